"""What follows from the given parameters: other parameters, initial values, constants of integrated rows, as formulas.

`binding` evaluates all of them once.  Who calls an exported model changes parameters at run time: for them the same
expressions are compiled (program/formulas.py), in the order in which they use each other.  Values that the text gives
as numbers are given; those it gives by other parameters follow.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from sysdyn.compiler.binding.binding import Binding, integers, places_of
from sysdyn.compiler.forms.descriptor import DescriptorForm
from sysdyn.compiler.model.interpret import over
from sysdyn.compiler.model.parameters import Extents, extents, positions
from sysdyn.compiler.model.terms import Nest
from sysdyn.compiler.program.formulas import Formula, program_of
from sysdyn.compiler.program.program import Program
from sysdyn.dsl.model.expression import Node, const, topological
from sysdyn.dsl.model.network import Loop, Network, Parameter
from sysdyn.values import dataclass

Places = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class FormulaGroup:
    """The formulas of one block, evaluated together.

    kind: parameter (values stand in p), initial (in families of unknowns), constant (added up in p); entries: number of
    values; source [k] values that are used, target [k]: place in p, or position in the family [k] (kind initial).
    """

    block: str
    kind: str
    entries: int
    source: Places
    target: Places
    family: Places


@dataclass(frozen=True, slots=True)
class Following:
    """Formulas as a program with its whole numbers ix, and groups in their order; follows: what a parameter uses.

    structural: parameters on whose values sizes and indices depend: other values ask for another compilation.
    """

    program: Program
    ix: NDArray[np.int32]
    groups: tuple[FormulaGroup, ...]
    follows: dict[str, tuple[str, ...]]
    structural: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _Piece:
    """One formula and where its values go."""

    formula: Formula
    kind: str
    number: int
    source: Places
    target: Places
    family: int = -1


def following(network: Network, form: DescriptorForm, program: Program, binding: Binding) -> Following:
    """All that follows from the given parameters of a bound model."""
    owners, where = places_of(network, form, program, binding)
    where |= {name: k for k, name in enumerate(program.scalars)}
    follows = {p.name: used for p in network.parameters if (used := _parameters_read(network, p))}
    pieces = [
        *_parameters(network, binding, where, follows),
        *_initial(form, binding),
        *_constants(form, binding, owners, where),
    ]
    made = program_of(form, program.scalars, [piece.formula for piece in pieces])
    ix = integers(made.slots, owners, binding.parameters, where, network)
    blocks = dict.fromkeys(piece.formula.block for piece in pieces)
    groups = tuple(_group(name, [p for p in pieces if p.formula.block == name]) for name in blocks)
    return Following(made, ix, groups, follows, _structural(network, follows))


def _names(roots: Sequence[Node]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(n.data for n in topological(roots) if n.op == "param"))


def _parameters_read(network: Network, parameter: Parameter) -> tuple[str, ...]:
    """The parameters that the text gives a parameter by; none for a number."""
    known = {p.name for p in network.parameters}
    roots = [*parameter.values, *(e.value for e in network.elements if e.name == parameter.name)]
    return tuple(name for name in _names(roots) if name in known)


def _structural(network: Network, follows: dict[str, tuple[str, ...]]) -> tuple[str, ...]:
    """Whole parameters, and those that they follow from."""
    found = dict.fromkeys(p.name for p in network.parameters if p.whole)
    stack = list(found)
    while stack:
        for name in follows.get(stack.pop(), ()):
            if name not in found:
                found[name] = None
                stack.append(name)
    return tuple(found)


def _group(name: str, pieces: list[_Piece]) -> FormulaGroup:
    first = np.cumsum([0, *(p.number for p in pieces)])
    return FormulaGroup(
        name,
        pieces[0].kind,
        int(first[-1]),
        np.concatenate([start + p.source for start, p in zip(first, pieces, strict=False)]),
        np.concatenate([p.target for p in pieces]),
        np.concatenate([np.full(p.target.size, p.family) for p in pieces]),
    )


def _parameters(
    network: Network, binding: Binding, where: dict[str, int], follows: dict[str, tuple[str, ...]]
) -> Iterator[_Piece]:
    """Those that follow, each in a group behind the groups of what it uses."""
    known = {p.name: p for p in network.parameters}
    level: dict[str, int] = {}
    found = []
    for name in binding.values:  # in the order of their dependencies
        if name in follows and (name in where or not known[name].shape):
            level[name] = 1 + max((level.get(used, 0) for used in follows[name]), default=0)
            found.append(name)
    for name in sorted(found, key=lambda name: level[name]):
        yield from _values(network, known[name], binding, where[name], f"parameters_{level[name]}")


def _values(network: Network, parameter: Parameter, binding: Binding, first: int, block: str) -> Iterator[_Piece]:
    """The formulas of one parameter: over its indices, or element by element; then its elements set apart."""
    box = binding.parameters.boxes.get(parameter.name, ())
    size = int(np.prod(extents(box)))
    # one formula over loop variables, or one for each index that they leave open
    if parameter.indices:
        pairs = zip(parameter.indices, box, strict=False)
        nest = tuple(Loop(name, const(a), const(b)) for name, (a, b) in pairs)
        number, rest = size // max(_rest(box, nest), 1), _rest(box, nest)
        for k, value in enumerate(parameter.values):
            every = np.arange(size) if len(parameter.values) == 1 else np.arange(k, size, rest)
            yield _Piece(Formula(block, nest, value), "parameter", number, every // max(rest, 1), first + every)
    # no loop variables: one formula for all elements, or one each
    else:
        for k, value in enumerate(parameter.values):
            every = np.arange(size) if len(parameter.values) == 1 else np.array([k])
            yield _Piece(Formula(block, (), value), "parameter", 1, np.zeros_like(every), first + every)
    # elements that a scene sets come last and win
    for setting in network.elements:
        if setting.name == parameter.name:
            at = [np.rint(binding.evaluate(node)).astype(np.int64).reshape(1) for node in setting.at]
            place = first + positions(box, at)
            yield _Piece(Formula(block, (), setting.value), "parameter", 1, np.zeros(1, dtype=np.int64), place)


def _rest(box: Extents, nest: Nest) -> int:
    """Values of the indices that a formula's own loops leave."""
    return int(np.prod(extents(box)[len(nest) :]))


def _initial(form: DescriptorForm, binding: Binding) -> Iterator[_Piece]:
    """Initial values of unknowns, what is fixed last."""
    pairs = zip(form.pins, binding.initial, strict=True)
    for pin, start in sorted(pairs, key=lambda pair: pair[0].fixed):
        every = np.arange(start.positions.size)
        formula = Formula("initial_values", pin.nest, pin.value)
        yield _Piece(formula, "initial", every.size, every, start.positions.astype(np.int64), pin.family)


def _constants(
    form: DescriptorForm, binding: Binding, owners: dict[str, Extents], where: dict[str, int]
) -> Iterator[_Piece]:
    """Constants of integrated constraints, by the initial displacements."""
    for offset in form.offsets:
        box = owners[offset.label]
        for term in offset.terms:
            columns = over(term.loops, offset.at, binding.parameters.lookup)
            number = columns[0].size if columns else over(term.loops, (const(0.0),), binding.parameters.lookup)[0].size
            at = [np.rint(a).astype(np.int64) for a in columns]
            place = positions(box, at) if box else np.zeros(number, dtype=np.int64)
            formula = Formula("constants", term.loops, term.expression)
            yield _Piece(formula, "constant", number, np.arange(number), where[offset.name] + place)
