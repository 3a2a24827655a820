"""A generated NumPy text as a module; what loads it takes its time to import, and only that backend asks."""

from __future__ import annotations

import importlib.abc
import importlib.util
from functools import lru_cache
from types import CodeType, ModuleType

KEPT = 8
"""Texts whose code is kept: scenes of one model are often one text."""


class _Text(importlib.abc.InspectLoader):
    """Loads the module that the compiler has generated."""

    def __init__(self, text: str) -> None:
        self._text = text

    def get_source(self, fullname: str) -> str:
        """The generated text."""
        return self._text

    def get_code(self, fullname: str) -> CodeType:
        """The text's code, compiled once."""
        return _code(self._text)


@lru_cache(maxsize=KEPT)
def _code(text: str) -> CodeType:
    return compile(text, "<sysdyn_residual>", "exec", dont_inherit=True)


def module_of(text: str) -> ModuleType:
    """A generated NumPy text as a module."""
    loader = _Text(text)
    spec = importlib.util.spec_from_loader("sysdyn_residual", loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    loader.exec_module(module)
    return module
