"""What differs between two structures of a formulation: equations, degrees of freedom, index, counts."""

from __future__ import annotations

from typing import Any


def describe_change(name: str, kept: Any, found: Any) -> str:
    """What changed in one fact: the numbers, or the first lines that are not in the other."""
    if not (isinstance(kept, list) and isinstance(found, list)):
        return f"{name} is {found}, recorded {kept}"

    def text(item: Any) -> str:
        return " ".join(map(str, item)) if isinstance(item, list) else str(item)

    gone = [text(item) for item in kept if item not in found]
    new = [text(item) for item in found if item not in kept]
    if not gone and not new:
        return f"{name} are in another order"
    parts = [f"'{new[0]}' is new" if new else "", f"'{gone[0]}' is gone" if gone else ""]
    more = max(len(new) - 1, 0) + max(len(gone) - 1, 0)
    return f"{name}: {', '.join(p for p in parts if p)}" + (f" and {more} more" if more else "")
