"""A generated NumPy text as a module; what loads it takes its time to import, and only that backend asks."""

from __future__ import annotations

import importlib.abc
import importlib.util
from types import ModuleType


class _Text(importlib.abc.InspectLoader):
    """Loads the module that the compiler has generated."""

    def __init__(self, text: str) -> None:
        self._text = text

    def get_source(self, fullname: str) -> str:
        """The generated text."""
        return self._text


def module_of(text: str) -> ModuleType:
    """A generated NumPy text as a module."""
    loader = _Text(text)
    spec = importlib.util.spec_from_loader("sysdyn_residual", loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    loader.exec_module(module)
    return module
