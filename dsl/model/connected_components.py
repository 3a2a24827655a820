"""Connected parts of what is joined two by two."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Generic, TypeVar

Item = TypeVar("Item", bound=Hashable)


class Joined(Generic[Item]):
    """A forest of items by their parts, whose paths shorten as they are followed (Tarjan 1975)."""

    def __init__(self) -> None:
        self._head: dict[Item, Item] = {}

    def first(self, item: Item) -> Item:
        """The item that stands for a part."""
        path = []
        while item in self._head:
            path.append(item)
            item = self._head[item]
        for below in path:
            self._head[below] = item
        return item

    def join(self, a: Item, b: Item) -> bool:
        """Both parts are one, for which stands what stood for a's; whether they were two."""
        a, b = self.first(a), self.first(b)
        if a != b:
            self._head[b] = a
        return a != b
