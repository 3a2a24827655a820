"""What a model offers to read: every name that a trace, an expectation or a law of the outside may hold, with its unit.

The scopes of the elaborated model are walked; each candidate (`R1.e`, `x'`, `rod.multiplier`) is read as a trace would
read it, and is listed where that succeeds.  Arrays are one entry: `v[0..n].e`, read at its first element.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from sysdyn.dsl.elaborate.elaborate import Elaborator
from sysdyn.dsl.elaborate.instances import bundles
from sysdyn.dsl.format.format import format_expression
from sysdyn.dsl.model import dimensions as dim
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.network import Shape
from sysdyn.dsl.model.paynter import MEMBERS
from sysdyn.dsl.model.values import Values
from sysdyn.dsl.names.failures import Failed
from sysdyn.dsl.names.members import AUDIT
from sysdyn.dsl.names.symbols import (
    BranchSymbol,
    BundleNode,
    ConstraintSymbol,
    Definition,
    DomainSymbol,
    InstanceSymbol,
    NodeSymbol,
    ParameterSymbol,
    PortSymbol,
    Scope,
    Symbol,
    TwoPortSymbol,
    Typed,
    UnknownSymbol,
)
from sysdyn.dsl.parser.parse import parse
from sysdyn.dsl.text.diagnostics import Report, SourceText
from sysdyn.dsl.tree import syntax
from sysdyn.values import dataclass

_BRANCH = (".e", ".f", ".q", ".p", ".power", ".energy", *(f".{m}" for m in MEMBERS))
_PORTS = tuple(f".{letter}{k}" for k in (1, 2) for letter in "efqp")


@dataclass(frozen=True, slots=True)
class Readable:
    """A name that can be read, in the text of the model; kind: what its object is; unit: in SI."""

    name: str
    object: str
    kind: str
    unit: str


@dataclass(frozen=True, slots=True)
class ListedInstance:
    """A component in the model: its path, component, levels and the one it has."""

    path: str
    component: str
    levels: tuple[str, ...]
    level: str | None


@dataclass(frozen=True, slots=True)
class _Candidate:
    """shown: the author's text; read: the same with the first index of every range; unit: where a domain names it."""

    shown: str
    read: str
    object: str
    kind: str
    unit: str | None = None


def readable(elaborator: Elaborator, known: Values) -> tuple[Readable, ...]:
    """Everything that can be read of an elaborated model, in the order of its declarations; `audit` comes last."""
    walk = _Walk(elaborator, known)
    found = [*walk.inside(elaborator.space.scope, "", "", 0)]
    pseudo = {b.domain.name for b in elaborator.parts.branches if b.domain.pseudo}
    found += [_Candidate(f"audit.{m}", f"audit.{m}", "audit", "audit") for m in (*AUDIT, *sorted(pseudo))]
    expressions = _expressions([c.read for c in found])
    listed = []
    with elaborator.context.entering(elaborator.space), elaborator.resolver.leniently():
        for candidate, (source, expression) in zip(found, expressions, strict=True):
            unit = _unit(elaborator, source, expression)
            if unit is not None:
                listed.append(Readable(candidate.shown, candidate.object, candidate.kind, candidate.unit or unit))
    return tuple(dict.fromkeys(listed))


def instances(elaborator: Elaborator) -> tuple[ListedInstance, ...]:
    """The components in the model, those inside others too; an array is one entry."""
    found: dict[str, ListedInstance] = {}
    for space, _ in elaborator.instances.bodies:
        if space.path:
            component = space.file_scope.find(space.component)
            body = getattr(component, "body", ())
            levels = tuple(s.name.name for s in body if isinstance(s, syntax.LevelStatement))
            found.setdefault(space.path, ListedInstance(space.path, space.component, levels, space.level))
    return tuple(found.values())


def _expressions(texts: list[str]) -> list[tuple[SourceText, syntax.Expr]]:
    """Each text as the expression of a trace."""
    found = []
    for text in texts:
        source = SourceText("<list>", f"scene list of model {{\n  trace {text}\n}}\n")
        file, _ = parse(source)
        (scene,) = (i for i in file.items if isinstance(i, syntax.SceneDefinition))
        (trace,) = (s for s in scene.body if isinstance(s, syntax.TraceStatement))
        found.append((source, trace.items[0].expr))
    return found


def _unit(elaborator: Elaborator, source: SourceText, expression: syntax.Expr) -> str | None:
    """The SI unit of an expression; None where it cannot be read, or is zero by its nature (the rate of a constant)."""
    resolver = elaborator.resolver
    report, resolver.report = resolver.report, Report()
    try:
        with resolver.entering_scope(elaborator.space.scope, source):
            value = resolver.resolve(expression)
    except Failed:
        return None
    finally:
        resolver.report = report
    if not isinstance(value, Typed) or (isinstance(expression, syntax.Prime) and ex.is_const(value.node)):
        return None
    return "1" if not value.dimension else dim.show(value.dimension)


class _Walk:
    """The candidates of a scope and of those inside it."""

    def __init__(self, elaborator: Elaborator, known: Values) -> None:
        self.discretes = elaborator.parts.discretes
        self.known = known
        self.loops: dict[int, tuple[syntax.ForStatement, ...]] = {}
        """The loops around the declaration of a let or an output, by its symbol's identity."""
        for space, body in elaborator.instances.bodies:
            for statement, loops in body:
                if isinstance(statement, (syntax.LetStatement, syntax.OutputStatement)) and loops:
                    symbol = space.scope.symbols.get(statement.decl.name)
                    self.loops[id(symbol)] = loops

    def inside(self, scope: Scope, shown: str, read: str, around: int) -> Iterator[_Candidate]:
        """shown, read: the path to the scope, with its dot; around: how many indices that path holds."""
        for name, symbol in scope.symbols.items():
            # the branch of the component itself: `R1.e`
            if isinstance(symbol, BranchSymbol) and not name:
                own = shown.removesuffix("."), read.removesuffix(".")
                yield from _candidates(own, "element", _BRANCH, symbol.domain)
            # all that is inside of an instance, of an array each part
            elif isinstance(symbol, InstanceSymbol):
                for space in symbol.spaces:
                    above, here = self._indices(space.around[around:])
                    inner = space.scope
                    yield from self.inside(inner, f"{shown}{name}{above}.", f"{read}{name}{here}.", len(space.around))
            # the nodes of a bundle, each under its member's name
            elif isinstance(symbol, BundleNode):
                for member, node in bundles.nodes(symbol):
                    yield from self._members(node, f"{shown}{name}", f"{read}{name}", member)
            else:
                yield from self._members(symbol, f"{shown}{name}", f"{read}{name}")

    def _members(self, symbol: Symbol, shown: str, read: str, member: str = "") -> Iterator[_Candidate]:
        """member: of a bundle, whose array is indexed at its own name."""
        kind, tails, shape = self._offers(symbol)
        above, here = self._indices(shape) if id(symbol) not in self.loops else _ranges(self.loops[id(symbol)])
        paths = f"{shown}{above}{member}", f"{read}{here}{member}"
        if isinstance(symbol, TwoPortSymbol):
            for k, branch in enumerate(symbol.branches):
                yield from _candidates(paths, kind, tails[4 * k : 4 * k + 4], branch.domain)
        else:
            yield from _candidates(paths, kind, tails, getattr(symbol, "domain", None))

    def _offers(self, symbol: Symbol) -> tuple[str, tuple[str, ...], Shape]:
        """What a symbol is, what follows its name where it is read, and its own indices."""
        match symbol:
            # a displacement with rates, effort and momentum; of a momentum coordinate flow and displacement
            case UnknownSymbol(kind="q"):
                rates = ("", "'", "''") if not symbol.complementary else ("", "'")
                kind = "momentum" if symbol.complementary else "coordinate"
                return kind, (*rates, *((".e", ".p") if kind == "coordinate" else (".f", ".q"))), symbol.shape
            case UnknownSymbol(kind="s"):
                return "state", ("", "'"), symbol.shape
            case UnknownSymbol():
                return "implicit", ("",), symbol.shape
            case NodeSymbol():
                return "node", _tails(symbol.domain), symbol.family.shape
            case PortSymbol():  # its node is the user's; what the component takes in there is its own
                return "port", (".f",) if symbol.end.domain.common == "effort" else (".e",), ()
            case BranchSymbol():
                return "element", _BRANCH, symbol.family.shape
            case TwoPortSymbol():
                return "two-port", _PORTS, symbol.branches[0].family.shape
            case ConstraintSymbol():
                return "constraint", (".multiplier", ".residual"), symbol.family.shape
            # a let or output; within loops only where the loop is known
            case Definition() if symbol.kind != "const" and (not symbol.at or id(symbol) in self.loops):
                if symbol.implied:
                    return "", (), ()
                return symbol.kind, ("", "'") if symbol.kind == "let" else ("",), ()
            case ParameterSymbol() if symbol.family.name in self.discretes:
                return "discrete", ("",), symbol.shape
        return "", (), ()

    def _indices(self, shape: Shape) -> tuple[str, str]:
        """The indices of a family as shown, and those of its first element."""
        if not shape:
            return "", ""
        bounds = [(self._whole(first), self._whole(last)) for first, last in shape]
        shown = ", ".join(f"{first}..{last}" for first, last in bounds)
        return f"[{shown}]", f"[{', '.join(first for first, _ in bounds)}]"

    def _whole(self, node: object) -> str:
        number = self.known.number(node)  # type: ignore[arg-type]
        return str(int(number)) if math.isfinite(number) else "1"


def _ranges(loops: tuple[syntax.ForStatement, ...]) -> tuple[str, str]:
    """The indices of a let in loops: as shown, and those of its first element."""
    bounds = [(format_expression(loop.lower), format_expression(loop.upper)) for loop in loops]
    shown = ", ".join(f"{first}..{last}" for first, last in bounds)
    return f"[{shown}]", f"[{', '.join(first for first, _ in bounds)}]"


def _candidates(
    paths: tuple[str, str], kind: str, tails: tuple[str, ...], domain: DomainSymbol | None
) -> Iterator[_Candidate]:
    """What follows an object's name, with the unit that its domain gives the letter."""
    units: dict[str, str] = {}
    if domain is not None:
        units = {"e": domain.effort.text, "f": domain.flow.text}
        units |= {"p": domain.momentum.text, "q": domain.displacement.text}
        own, rate = ("p", "e") if kind == "momentum" else ("q", "f")
        units |= {"": units[own], "'": units[rate]}
    for tail in tails:
        letter = tail.strip(".12")
        unit = units.get(letter if letter in "efqp" else "?") if tail.startswith(".") else units.get(tail)
        yield _Candidate(paths[0] + tail, paths[1] + tail, paths[0], kind, unit)


def _tails(domain: DomainSymbol) -> tuple[str, ...]:
    return (".e",) if domain.common == "effort" else (".q", ".f", ".p", ".e")
