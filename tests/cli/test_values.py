"""Values made by sysdyn.values are those of the standard decorator."""

import copy
import dataclasses
import inspect
import pickle

import pytest
from sysdyn import values
from sysdyn.initials import INITIALS


@values.dataclass(frozen=True, slots=True)
class Ours:
    """A value."""

    a: int
    b: str = "x"
    c: tuple[int, ...] = ()

    @property
    def twice(self) -> int:
        return 2 * self.a


@dataclasses.dataclass(frozen=True, slots=True)
class Theirs:
    """A value."""

    a: int
    b: str = "x"
    c: tuple[int, ...] = ()


@values.dataclass(frozen=True, slots=True, eq=False)
class Alone:
    array: list[int]


@values.dataclass(slots=True)
class Grows:
    items: list[int] = dataclasses.field(default_factory=list)


def test_values_are_made_written_compared_and_kept_as_the_standard_ones():
    ours, theirs = Ours(1, c=(2,)), Theirs(1, c=(2,))
    assert repr(ours) == repr(theirs).replace("Theirs", "Ours")
    assert ours == Ours(1, "x", (2,))
    assert ours != Ours(2, c=(2,))
    assert ours != theirs
    assert len({ours, Ours(1, c=(2,)), Ours(1)}) == 2
    assert dataclasses.asdict(ours) == dataclasses.asdict(theirs)
    assert [(f.name, f.type, f.default) for f in dataclasses.fields(ours)] == [
        (f.name, f.type, f.default) for f in dataclasses.fields(theirs)
    ]
    assert dataclasses.replace(ours, a=5).twice == 10
    assert pickle.loads(pickle.dumps(ours)) == copy.deepcopy(ours) == ours
    mine, standard = (inspect.signature(cls.__init__).parameters.values() for cls in (Ours, Theirs))
    assert [(p.name, p.kind, p.default) for p in mine] == [(p.name, p.kind, p.default) for p in standard]
    assert (Ours.__doc__, Ours.__qualname__, Ours.__module__) == ("A value.", "Ours", __name__)


def test_values_are_frozen_and_have_slots():
    ours = Ours(1)
    for change in (lambda: setattr(ours, "a", 2), lambda: setattr(ours, "d", 2), lambda: delattr(ours, "a")):
        with pytest.raises(dataclasses.FrozenInstanceError):
            change()
    assert not hasattr(ours, "__dict__")
    match ours:
        case Ours(1, b):
            assert b == "x"


def test_wrong_calls_name_what_is_wrong():
    with pytest.raises(TypeError, match=r"Ours.__init__\(\) missing 1 required positional argument: 'a'"):
        Ours()
    with pytest.raises(TypeError, match="unexpected keyword argument 'd'"):
        Ours(1, d=2)
    with pytest.raises(TypeError, match="without a default"):

        @values.dataclass(frozen=True, slots=True)
        class _Wrong:
            a: int = 1
            b: int


def test_values_that_may_change_are_made_as_the_standard_ones_too():
    @dataclasses.dataclass(slots=True)
    class Changes:
        items: list[int] = dataclasses.field(default_factory=list)

    grows, theirs = Grows(), Changes()
    assert Grows().items is not grows.items
    grows.items.append(1)
    theirs.items = [1]
    assert repr(grows) == repr(theirs).rpartition(".")[2].replace("Changes", "Grows")
    assert grows == Grows([1]) != Grows()
    assert pickle.loads(pickle.dumps(grows)) == copy.deepcopy(grows) == grows
    assert dataclasses.asdict(grows) == dataclasses.asdict(theirs)
    with pytest.raises(TypeError, match="unhashable"):
        hash(grows)
    with pytest.raises(AttributeError):
        grows.other = 1
    with pytest.raises(TypeError, match="cannot inherit frozen"):  # as of any value that may change

        @dataclasses.dataclass(frozen=True)
        class _Frozen(Grows):
            pass


def test_a_value_may_be_shown_by_its_own_text():
    @values.dataclass(frozen=True, slots=True, repr=False)
    class Named:
        name: str

        def __repr__(self) -> str:
            return f"<{self.name}>"

    assert repr(Named("x")) == "<x>"
    assert Named("x") == Named("x")


def test_other_kinds_are_the_standard_decorators_own():
    assert Alone([1]) != Alone([1])

    @values.dataclass(frozen=True, slots=True, order=True)
    class Ordered:
        key: int

    assert Ordered(1) < Ordered(2)

    @values.dataclass(frozen=True, slots=True)
    class Positive:
        a: int

        def __post_init__(self) -> None:
            if self.a < 0:
                raise ValueError("a")

    assert Positive(1).a == 1
    with pytest.raises(ValueError, match="a"):
        Positive(-1)


@pytest.mark.parametrize("count", range(1, len(INITIALS) + 2))
@pytest.mark.one_in(15)
def test_each_argument_is_the_field_of_its_place_and_of_its_name(count):
    """As far as `__init__` stands written, and one field beyond, where the standard decorator takes over."""
    names = [f"field{k}" for k in range(count)]
    made = values.dataclass(type("Many", (), {"__annotations__": dict.fromkeys(names, int)}), frozen=True, slots=True)
    by_place, by_name = made(*range(count)), made(**{name: k for k, name in reversed([*enumerate(names)])})
    assert [getattr(by_place, name) for name in names] == list(range(count))
    assert by_place == by_name
    assert made.__init__.__name__ == "__init__"
