"""The letters of unknowns and parameters: q, f, p, e of the family, kappa and mu numbered as in the book.  Of dry
friction sigma is the sense of a slip (1, -1, 0 while it sticks), n the direction of one in the plane, numbered too.

A coordinate q1 has the flow f1 and the momentum p1; any other, x, has f_x and p_x; what the compiler chose as a
coordinate (the branch `coil`) is q_coil.
"""

from __future__ import annotations

import re
from collections.abc import Container, Iterable, Iterator, Sequence
from itertools import count

from sysdyn.compiler.forms.descriptor import DescriptorForm
from sysdyn.compiler.model.mirror import family_name, letter
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Switch
from sysdyn.values import dataclass

GREEK = (
    "alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "iota", "kappa", "lambda", "mu", "nu", "xi",
    "omicron", "pi", "rho", "sigma", "tau", "upsilon", "phi", "chi", "psi", "omega",
)  # fmt: skip
SHORT = {"th": "theta", "om": "omega"}
_NAME = re.compile(rf"({'|'.join(sorted([*GREEK, *SHORT], key=len, reverse=True))}|[^\W\d_])(?:_(\w+)|(\d+))?")
_NUMBERED = re.compile(r"[qp](\d+)")


@dataclass(frozen=True, slots=True)
class Letter:
    """A symbol: its base, what stands below it, dots above."""

    base: str
    below: tuple[str, ...]
    dots: int


class Letters:
    """Of one formulation of a model; declared: coordinates of the text; parameters: all names of them; switches:
    those of the model, whose senses and directions are parameters.
    """

    def __init__(
        self, form: DescriptorForm, declared: Sequence[str], parameters: Sequence[str], switches: Sequence[Switch]
    ) -> None:
        self._formulation = form.formulation
        self._named = frozenset(declared)
        self._speeds = frozenset(f.owner for f in form.families if form.is_speed(f))
        self._numbers: dict[tuple[str, str], int] = {}
        for kind in ("kappa", "mu"):
            owners = [f.owner for f in form.families if f.kind == kind]
            self._numbers |= {(owner, kind): k for k, owner in enumerate(owners, 1)}
        self._slips: dict[str, Letter] = {}
        self._slipping: list[tuple[Letter, str, int]] = []
        self._friction(switches, {letter_of_name(p) for p in parameters})

    def _friction(self, switches: Sequence[Switch], taken: Container[Letter]) -> None:
        """Letters of the senses and directions of slips, with the labels and lines whose they are; taken: none of
        these letters.
        """
        free = {base: _free(base, taken) for base in ("sigma", "n")}
        for base, kind, switch, names in slips(switches):
            number = next(free[base])
            for k, name in enumerate(names, 1):
                self._slips[name] = Letter(base, (number, str(k)) if kind == "direction" else (number,), 0)
            self._slipping.append((Letter(base, (number,), 0), f"{kind} of {switch.label}", switch.place.start[0]))

    def letter_of(self, node: Node) -> Letter:
        """The symbol of an unknown without its indices."""
        owner, kind, order = node.data
        if (owner, kind) in self._numbers:
            return Letter(kind, (str(self._numbers[owner, kind]),), order)
        if kind in ("q", "f", "p"):
            return self._of_coordinate(owner, kind, order)
        return self.name(family_name(self._formulation, owner, kind), order)

    def _of_coordinate(self, owner: str, kind: str, order: int) -> Letter:
        own = letter(self._formulation, kind)
        if kind == "f" and owner in self._speeds:
            path, _, own = owner.rpartition(".")
            return Letter(path, (own,), order) if path == "u" else self.name(owner, order)
        if kind == "q" and owner in self._named:
            return self.name(owner, order)
        numbered = _NUMBERED.fullmatch(owner)
        return Letter(own, (numbered[1],) if numbered else tuple(owner.split("#")), order)

    def name(self, text: str, order: int = 0) -> Letter:
        """A parameter, a dynamic variable, an implicit effort: a letter with an index where the name is one."""
        return self._slips.get(text) or letter_of_name(text, order)

    def slipping(self) -> Sequence[tuple[Letter, str, int]]:
        """Letter, what it is of, line: of the senses and directions of slips."""
        return tuple(self._slipping)

    def legend(self, form: DescriptorForm) -> list[tuple[str, int, str, int]]:
        """(kind, number, constraint, line) of each multiplier."""
        found = []
        for family in form.families:
            if (family.owner, family.kind) in self._numbers:
                line = family.place.start[0] if family.place else 0
                found.append((family.kind, self._numbers[family.owner, family.kind], family.owner, line))
        return found


def letter_of_name(text: str, order: int = 0) -> Letter:
    """A name as a letter with an index where it is one."""
    if text.startswith("#offset "):  # the constant of an integrated constraint
        return Letter("c", (text.removeprefix("#offset "),), order)
    *path, own = text.lstrip("#").split(".")
    found = _NAME.fullmatch(own)
    if found is None:
        return Letter(own, tuple(path), order)
    below = found[2] or found[3]
    return Letter(found[1], (*((below,) if below else ()), *(part for part in path if part)), order)


def slips(switches: Iterable[Switch]) -> Iterator[tuple[str, str, Switch, tuple[str, ...]]]:
    """Letter, meaning, switch, parameters: of each sense and each direction of a slip; once for those of an array."""
    seen = set()
    for switch in switches:
        sense = () if switch.sense is None else (switch.sense,)
        for base, kind, nodes in (("sigma", "sense", sense), ("n", "direction", switch.direction)):
            names = tuple(node.data for node in nodes)
            if names and names not in seen:
                seen.add(names)
                yield base, kind, switch, names


def _free(base: str, taken: Container[Letter]) -> Iterator[str]:
    """Numbers below a letter that is no parameter's."""
    return (str(k) for k in count(1) if Letter(base, (str(k),), 0) not in taken)


def is_letter(text: str) -> bool:
    """Whether a name is a letter, with an index or without."""
    return _NAME.fullmatch(text) is not None
