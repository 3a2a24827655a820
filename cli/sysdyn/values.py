"""Values with slots: `dataclass(slots=True)` of the standard library, frozen or not, without compiling each class at
import.

The standard decorator writes the methods of every class as text and compiles it whenever it is imported: of 300 classes
that took 40 % of the start of a command.  Here `__init__` stands written for each number of fields (`initials.py`), and
the names of a class are put in; what else a value needs is shared.  Classes that ask for more are left to the
standard decorator.
"""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Callable
from dataclasses import MISSING
from operator import attrgetter
from types import FunctionType
from typing import TYPE_CHECKING, Any

from sysdyn.initials import INITIALS

SPECIAL = ("ClassVar", "InitVar", "KW_ONLY")
"""Kinds of fields that are left to the standard decorator."""


@dataclasses.dataclass(frozen=True, slots=True)
class _Standard:
    """A value as the standard decorator leaves it: its kind of field and its options, for `fields` and `replace`."""

    name: str = ""


_CHANGING = copy.copy(_Standard.__dataclass_params__)  # type: ignore[attr-defined]
_CHANGING.frozen = False
"""Options of a value whose fields may be set again."""
_NEW = object()
"""Stands where a field's value is made anew for each value."""


def _setter(store: Callable[..., None], factory: Callable[[], Any]) -> Callable[..., None]:
    """Sets a field that has a default factory."""

    def set_or_make(self: object, value: object) -> None:
        store(self, factory() if value is _NEW else value)

    return set_or_make


def _refuse_set(self: object, name: str, _value: object) -> None:
    raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")


def _refuse_delete(self: object, name: str) -> None:
    raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")


def _state(self: Any) -> list[Any]:
    return [getattr(self, name) for name in self.__match_args__]


def _restore(self: Any, state: list[Any]) -> None:
    for name, value in zip(self.__match_args__, state, strict=True):
        object.__setattr__(self, name, value)


def _make_repr(names: tuple[str, ...]) -> Callable[[object], str]:
    """Values as the names of their fields and what they hold."""

    def text(self: object) -> str:
        inside = ", ".join(f"{name}={getattr(self, name)!r}" for name in names)
        return f"{type(self).__qualname__}({inside})"

    return text


SHARED = {"__replace__": dataclasses.replace}
FROZEN = {
    "__setattr__": _refuse_set, "__delattr__": _refuse_delete, "__getstate__": _state, "__setstate__": _restore,
}  # fmt: skip


def _make_comparison(names: tuple[str, ...], *, frozen: bool) -> dict[str, Callable[..., Any] | None]:
    """Values of one class are equal where their fields are; what may change has no hash."""
    held = attrgetter(*names)

    def equal(self: object, other: object) -> Any:
        return held(self) == held(other) if other.__class__ is self.__class__ else NotImplemented

    def hash_value(self: object) -> int:
        return hash(held(self))

    return {"__eq__": equal, "__hash__": hash_value if frozen else None}


def _plain(cls: type, options: dict[str, bool]) -> bool:
    """With slots, of no other class, all its fields by position."""
    return (
        options.keys() <= {"frozen", "slots", "eq", "repr"}
        and options.get("slots", False)
        and cls.__bases__ == (object,)
        and 0 < len(cls.__annotations__) <= len(INITIALS)
        and not hasattr(cls, "__post_init__")
        and all(_usual(value) for value in vars(cls).values() if isinstance(value, dataclasses.Field))
        and not any(kind in str(written) for written in cls.__annotations__.values() for kind in SPECIAL)
    )


def _usual(said: dataclasses.Field[Any]) -> bool:
    """Whether `field(...)` says a default or its factory, what is compared and what is shown, and nothing else."""
    if said.default is MISSING and said.default_factory is MISSING:
        return False
    return said.init and said.hash is None and said.kw_only is not True and not said.metadata


def _field(name: str, kind: Any, default: Any) -> Any:
    """A field as the standard decorator leaves it; default: of its own, or what `field` has made."""
    made: Any = default if isinstance(default, dataclasses.Field) else dataclasses.field(default=default)
    made.name, made.type = name, kind
    made._field_type = _Standard.__dataclass_fields__["name"]._field_type  # type: ignore[attr-defined]
    return made


class _Fields:
    """`__dataclass_fields__` of a class, made when `fields` or `replace` first ask."""

    def __init__(self, kinds: dict[str, Any], defaults: dict[str, Any]) -> None:
        self._kinds, self._defaults = kinds, defaults

    def __get__(self, _value: object, cls: type) -> dict[str, Any]:
        found = {name: _field(name, kind, self._defaults.get(name, MISSING)) for name, kind in self._kinds.items()}
        cls.__dataclass_fields__ = found  # type: ignore[attr-defined]
        return found


def _make_class(cls: type, *, slots: bool, frozen: bool = False, eq: bool = True, repr: bool = True) -> Any:
    """The class anew, with slots and methods; what it writes itself stays."""
    own = {name: value for name, value in vars(cls).items() if name not in ("__dict__", "__weakref__")}
    kinds = cls.__annotations__
    names = tuple(kinds)
    defaults = {name: own.pop(name) for name in names if name in own}
    if list(defaults) != list(names[len(names) - len(defaults) :]):
        raise TypeError(f"{cls.__qualname__}: a field without a default follows one with it")
    said = {name: value for name, value in defaults.items() if isinstance(value, dataclasses.Field)}
    compared, shown = (
        tuple(n for n in names if n not in said or getattr(said[n], what)) for what in ("compare", "repr")
    )
    equality = _make_comparison(compared, frozen=frozen) if eq else {}
    own = SHARED | (FROZEN if frozen else {}) | ({"__repr__": _make_repr(shown)} if repr else {}) | equality | own
    own |= {"__slots__": names, "__match_args__": names}
    own["__dataclass_params__"] = _Standard.__dataclass_params__ if frozen else _CHANGING  # type: ignore[attr-defined]
    own["__dataclass_fields__"] = _Fields(kinds, defaults)
    made = type(cls.__name__, (), own)
    made.__init__ = _initial(made, names, defaults)  # type: ignore[misc]
    return made


def _initial(made: Any, names: tuple[str, ...], defaults: dict[str, Any]) -> FunctionType:
    """`__init__` of a class with slots."""
    first = [_first(default) for default in defaults.values()]
    head = len(names) - len(first)
    code = INITIALS[len(names) - 1].__code__
    code = code.replace(co_varnames=("self", *names), co_name="__init__", co_qualname=f"{made.__qualname__}.__init__")
    known = {f"s{k}": vars(made)[name].__set__ for k, name in enumerate(names)}
    for k, value in enumerate(first, head):
        if value is _NEW:
            known[f"s{k}"] = _setter(known[f"s{k}"], defaults[names[k]].default_factory)
    init = FunctionType(code, known, "__init__", tuple(first))
    init.__annotations__ = made.__annotations__ | {"return": None}
    return init


def _first(default: Any) -> Any:
    """What a field holds where nothing is given, as `__init__` has it."""
    if not isinstance(default, dataclasses.Field):
        return default
    return _NEW if default.default is MISSING else default.default


if TYPE_CHECKING:
    from dataclasses import dataclass
else:

    def dataclass(cls: type | None = None, /, **options: bool) -> Any:
        """The standard decorator, or the same sooner."""

        def wrap(cls: type) -> Any:
            if _plain(cls, options):
                return _make_class(cls, **options)
            return dataclasses.dataclass(**options)(cls)

        return wrap if cls is None else wrap(cls)


__all__ = ["dataclass"]
