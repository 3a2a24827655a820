"""What a text asks of its numbers, for runs with other numbers: which of its conditions those break.

Conditions: what `require` says (E322), linear laws of elements that do not fall (E321, E325), laws of dissipators
that give no power, dry friction included (E313), whole sizes (E805).  They say whether numbers are refused; what is
said of them the rules themselves say of the text under these numbers.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

from sysdyn.dsl.elaborate.elaborate import Elaborator
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Branch, ElementSetting, Loop, Parameter
from sysdyn.dsl.model.values import Values
from sysdyn.dsl.rules.bound_values import friction_bounds
from sysdyn.dsl.rules.graph_checks import modulus, negative
from sysdyn.dsl.rules.passivity import active
from sysdyn.values import dataclass

REFUSED = frozenset({"E313", "E321", "E322", "E325"})
"""Codes by which a text refuses numbers that are not sizes."""
Key = str | tuple[str | int, ...]
"""A parameter, or (name, index, ...) of an element of one."""
_COMPARED: dict[str, Callable[[float, float], bool]] = {
    ">": operator.gt, ">=": operator.ge, "<": operator.lt, "<=": operator.le, "!=": operator.ne,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Bound:
    """A condition that compares one parameter with a number: value `compared` limit."""

    name: str
    compared: Callable[[float, float], bool]
    limit: float


@dataclass(frozen=True, slots=True)
class ParameterConditions:
    """Those on some parameters: that compare one of them with a number, others under loops, laws of dissipators."""

    bounds: tuple[Bound, ...]
    others: tuple[tuple[Node, tuple[Loop, ...]], ...]
    laws: tuple[Branch, ...]

    @property
    def plain(self) -> bool:
        """Whether bounds are all there is."""
        return not self.others and not self.laws


class TextConditions:
    """The conditions of one text; within the space of expressions in which it was made."""

    def __init__(self, model: Elaborator, elements: Sequence[ElementSetting]) -> None:
        self._parameters: Mapping[str, Parameter] = model.parts.parameters
        self._elements = tuple(elements)
        conditions = [(r.condition, r.loops) for r in model.parts.requirements]
        # a linear law has a modulus that is not negative
        for branch in model.parts.branches:
            slope = modulus(branch)
            if slope is not None:
                conditions.append((ex.compare(">=", slope, ex.const(0.0)), branch.loops))
        # nor is a bound of friction
        for bound, draft in friction_bounds(model):
            conditions.append((ex.compare(">=", bound, ex.const(0.0)), draft.loops))
        # sizes are whole numbers
        for name in sorted(model.resolver.whole):
            parameter = model.parts.parameters.get(name)
            if parameter is not None and parameter.values and not parameter.shape:
                size = ex.param(name)
                conditions.append((ex.compare("==", size, ex.call("floor", size)), ()))
        self._conditions = [(c, loops, self._read(c, loops)) for c, loops in conditions]
        # nonlinear dissipators are judged by samples
        bent = (b for b in model.parts.branches if b.kind == "dissipator" and not b.domain.pseudo)
        self._laws = [(b, self._read(b.law, b.loops)) for b in bent if b.law is not None and modulus(b) is None]
        self._of: dict[frozenset[str], ParameterConditions] = {}

    def _read(self, condition: Node, loops: Iterable[Loop]) -> frozenset[str]:
        """Parameters that a condition reads, and those that they follow from."""
        waiting = [condition, *(end for loop in loops for end in (loop.first, loop.last))]
        found = set[str]()
        while waiting:
            new = {n.data for n in ex.topological(waiting) if n.op == "param"} - found
            found |= new
            waiting = [v for name in new if (p := self._parameters.get(name)) is not None for v in p.values]
        return frozenset(found)

    def conditions_of(self, names: frozenset[str]) -> ParameterConditions:
        """The conditions on these parameters."""
        if names not in self._of:
            mine = [(c, loops) for c, loops, read in self._conditions if read & names]
            bounds = {c: b for c, _ in mine if (b := self._bound(c, names)) is not None}
            others = tuple(one for one in mine if one[0] not in bounds)
            laws = tuple(b for b, read in self._laws if read & names)
            self._of[names] = ParameterConditions(tuple(bounds.values()), others, laws)
        return self._of[names]

    def _bound(self, condition: Node, names: frozenset[str]) -> Bound | None:
        if condition.op != "cmp" or condition.data not in _COMPARED:
            return None
        left, right = condition.args
        plain = left.op == "param" and not left.args and left.data in names and right.op == "const"
        return Bound(left.data, _COMPARED[condition.data], right.data) if plain else None

    def holds(self, numbers: Mapping[Key, float]) -> bool:
        """Whether every condition holds with these numbers."""
        mine = self.conditions_of(frozenset(key if isinstance(key, str) else str(key[0]) for key in numbers))
        scalar = all(isinstance(key, str) for key in numbers)
        if scalar and not all(b.compared(numbers[b.name], b.limit) for b in mine.bounds):
            return False
        if scalar and mine.plain:
            return True
        parameters, elements = dict(self._parameters), list(self._elements)
        for key, value in numbers.items():
            if isinstance(key, str):
                parameters[key] = replace(parameters[key], values=(ex.const(value),))
                elements = [e for e in elements if e.name != key]
            else:
                at = tuple(ex.const(float(k)) for k in key[1:])
                place = parameters[str(key[0])].place
                elements.append(ElementSetting(str(key[0]), at, ex.const(value), place))
        known = Values(parameters, elements)
        asked = mine.others if scalar else [(c, loops) for c, loops, _ in self._conditions]
        held = all(known.truth(c, at) for c, loops in asked for at in known.cases(c, loops))
        return held and not any(active(branch, known) or negative(branch, known) for branch in mine.laws)
