"""The names that a file declares: domains, bundles, units, constants, functions, tables, components, models."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import cache
from itertools import count
from pathlib import Path

from sysdyn.dsl.elaborate.instances.bundles import Bundles
from sysdyn.dsl.elaborate.tables import read_table
from sysdyn.dsl.model import dimensions as dim
from sysdyn.dsl.model.dependence import in_order
from sysdyn.dsl.model.network import Table
from sysdyn.dsl.model.units import NONE, Unit, find_unit, multiply, si
from sysdyn.dsl.names.calls import walk
from sysdyn.dsl.names.failures import Failed
from sysdyn.dsl.names.resolve import Resolver
from sysdyn.dsl.names.symbols import (
    ComponentSymbol,
    Definition,
    DomainSymbol,
    FunctionSymbol,
    Scope,
    Space,
    Symbol,
    TableSymbol,
    nearest,
)
from sysdyn.dsl.names.unit_reading import read_unit
from sysdyn.dsl.parser.parse import parse
from sysdyn.dsl.text.diagnostics import Diagnostic, Place, Related, Report, SourceText
from sysdyn.dsl.tree import syntax

LIBRARY = Path(__file__).parents[1] / "std"
MODULES = 8
"""Names of modules that a message lists."""


_Declared = syntax.UnitAlias | syntax.UnitBase


def _written_in(unit: _Declared) -> list[str]:
    """The names of the units in which an alias is written."""
    quantities = walk(unit.value) if isinstance(unit, syntax.UnitAlias) else ()
    return [f.name for q in quantities if isinstance(q, syntax.QuantityLiteral) for f in q.unit.factors]


@cache
def library_components() -> dict[str, str]:
    """The components of the standard library, with the module that each is in."""
    found = {}
    for path in sorted(LIBRARY.glob("*.sd")):
        for name in re.findall(r"^component (\w+)", path.read_text(encoding="utf-8"), re.M):
            found[name] = path.stem
    return found


@cache
def prelude() -> syntax.File:
    """The file that is loaded before every other one."""
    file, problems = parse(SourceText.read(LIBRARY / "prelude.sd", "std/prelude.sd"))
    assert not problems, problems
    return file


@cache
def _of_library(path: Path) -> tuple[syntax.File, tuple[Diagnostic, ...]]:
    """A file of the library and what is wrong with it, parsed once a process."""
    return parse(SourceText.read(path, f"std/{path.name}"))


def _hides_function(symbol: Symbol) -> bool:
    """Whether a call of the symbol's name was one of the language's own functions before."""
    return isinstance(symbol, (FunctionSymbol, TableSymbol)) and symbol.name in dim.FUNCTIONS


def _grid_tables(table: Table, held: tuple[str, ...]) -> dict[str, Table]:
    """The tables that stand for one: of two arguments that hold, each is taken down to its point of the grid, where
    the bilinear table has the value itself.
    """
    axes = {n: replace(table, name=n, points=(x,), values=x) for n, x in zip(held, table.points, strict=False)}
    return axes | {table.name: replace(table, method="linear") if held else table}


class FileScope:
    """A file's own names on top of the prelude's, the values of its tables, and the modules that it imports."""

    def __init__(self, file: syntax.File, report: Report) -> None:
        self.file = file
        self.report = report
        self.tables: dict[str, Table] = {}
        self._modules: dict[Path, Scope | None] = {}
        self._imported: dict[int, Place] = {}  # symbols of other files: where the import that gave them names them
        self.outer = Scope()
        self._declare(prelude(), self.outer)
        self.scope = Scope(self.outer)
        self._declare(file, self.scope)

    def _declare(self, file: syntax.File, scope: Scope) -> None:
        """Units first, then every other name of a file."""
        # statements that could not be read: the names in them are declared, if wrongly, so that their uses are no
        # errors of their own
        for item in file.items:
            if isinstance(item, syntax.BrokenStatement):
                scope.broken |= item.names
                if "std" in item.names:  # an import that could not be read: what hangs on it is not reported again
                    scope.broken |= {name for name, module in library_components().items() if module in item.names}
        # `unit kN = 1000 N`: coefficients and parameters of the file may be written in it
        units = [item for item in file.items if isinstance(item, (syntax.UnitAlias, syntax.UnitBase))]
        for unit in self._dependency_order(
            units, scope, file.source
        ):  # units first: everything else is written in them
            self._unit(unit, scope, file.source)
        # domains, components, constants, functions, tables and imports, in the order of the text
        for item in file.items:
            for symbol in self._symbols(item, scope, file.source):
                self._enter(symbol, scope)
        Bundles(file, scope, self.report).declare(self._enter)

    def _enter(self, symbol: Symbol, scope: Scope) -> None:
        """Enter a symbol in a file's scope; E106 where another one has its name, N102 where it hides one of the
        language.
        """
        before = scope.symbols.get(symbol.name)
        if before is symbol:  # imported twice
            return
        # two declarations of one name, or one beside an import
        if before is not None:
            place, first = (self._imported.get(id(s), s.place) for s in (symbol, before))
            related = (Related("first declared here", first),)
            self.report.error("E106", f"'{symbol.name}' is declared twice", place, related=related)
            return
        scope.symbols[symbol.name] = symbol
        # a name of the prelude may be declared anew, which N102 notes
        if scope.outer is not None and (symbol.name in scope.outer.symbols or _hides_function(symbol)):
            self._hides(symbol.name, self._imported.get(id(symbol), symbol.place))

    def _hides(self, name: str, place: Place | None) -> None:
        """N102: from here on the name means what this file says."""
        self.report.note("N102", f"'{name}' of this file hides the '{name}' that the language has", place)

    def _dependency_order(self, units: Sequence[_Declared], scope: Scope, source: SourceText) -> Iterator[_Declared]:
        """The units of a text, each behind those that it is written in; E105 of one that needs itself."""
        first: dict[str, _Declared] = {}
        for unit in units:
            first.setdefault(unit.name.name, unit)
        order, circles = in_order(first, lambda name: [n for n in _written_in(first[name]) if n in first])
        for circle in circles:
            text = f"circular definition: {' -> '.join(circle)}"
            self.report.error("E105", text, Place(source, first[circle[-2]].span))
            scope.broken |= set(circle)
        around = {name for circle in circles for name in circle}
        yield from (first[name] for name in order if name not in around)
        yield from (unit for unit in units if unit is not first[unit.name.name])

    def _unit(self, item: syntax.UnitAlias | syntax.UnitBase, scope: Scope, source: SourceText) -> None:
        """A unit of the text: a new base, or an alias of others."""
        name = item.name.name
        if name in scope.units:
            self.report.error("E106", f"unit '{name}' is declared twice", Place(source, item.name.span))
            return
        # `unit N = ...` hides the SI's N in this file
        if find_unit(name) is not None:
            self._hides(name, Place(source, item.name.span))
        # `unit EUR base`: a dimension that nothing else has
        if isinstance(item, syntax.UnitBase):
            scope.units[name] = Unit(((name, 1),), Fraction(1), name)
        # `unit kp = 9.81 N`: a positive constant multiple of known units
        else:
            resolver = Resolver(self.report)
            try:
                with resolver.entering_scope(scope, source):
                    value = resolver.scalar(item.value)
            except Failed:
                scope.broken.add(name)
                return
            # `unit u = 0 m`, `unit u = -1 m` or one that reads a parameter measures nothing
            if value.node.op != "const" or not 0.0 < value.node.data < float("inf"):
                message = f"unit '{name}' is not a positive constant"
                self.report.error("E201", message, Place(source, item.value.span))
                scope.broken.add(name)
                return
            scope.units[name] = Unit(value.dimension or NONE, Fraction(value.node.data), name)

    def _symbols(self, item: syntax.TopLevel, scope: Scope, source: SourceText) -> Iterator[Symbol]:
        """The names that a top-level item declares."""
        match item:
            # effort, flow and what a node has in common
            case syntax.DomainDefinition():
                yield from self._domain(item, scope, source)
            # a model may be used as a component of another one
            case syntax.ComponentDefinition() | syntax.ModelDefinition():
                yield ComponentSymbol(item.name.name, item.body, scope, source, Place(source, item.name.span))
            # resolved where it is read first, in the scope of its own file
            case syntax.ConstDefinition():
                span = item.name.span
                place = Place(source, span)
                space = Space("", scope, scope, source)
                yield Definition(item.name.name, "const", item.value, (), None, space, place, span)
            case syntax.FunctionDefinition():
                yield FunctionSymbol(item, source, scope, Place(source, item.name.span))
            case syntax.TableDefinition():
                yield from self._table(item, scope, source)
            # the symbols of another file, entered as if they were declared here
            case syntax.Import():
                yield from self._import(item, source)

    def _import(self, item: syntax.Import, source: SourceText) -> Iterator[Symbol]:
        """Names of another file or of the library; what is not there is reported once."""
        module = self._module(item, source)
        if module is None:
            # each name is a unit, another symbol, or not there
            for word in item.names:  # reported; what hangs on them is not reported again
                self.scope.broken.add(word.name)
            return
        for word in item.names:
            symbol = module.symbols.get(word.name)
            unit = module.units.get(word.name)
            # `from units import kp`
            if unit is not None:
                self.scope.units[word.name] = unit
            # the place of the import is kept: two imports of one name are reported there
            elif symbol is not None:
                self._imported[id(symbol)] = Place(source, word.span)
                self._warn_of_extrapolation(symbol, word, source)
                yield symbol
            # `from std.electrical import mass`: the module that has it, or the nearest name of this one
            else:
                other = library_components().get(word.name)
                near = None if other else nearest(word.name, module.symbols)
                text = ".".join(item.module.names)
                help_ = f"nearest exported name: '{near}'" if near else f"it exports {', '.join(module.symbols)}"
                help_ = f"from std.{other} import {word.name}" if other else help_
                self.report.error("E103", f"'{word.name}' is not in {text}", Place(source, word.span), help=help_)
                self.scope.broken |= {word.name} | ({near} - self.scope.symbols.keys() if near else set())

    def _warn_of_extrapolation(self, symbol: Symbol, word: syntax.Word, source: SourceText) -> None:
        """W302: a table that is read here, and that the text which holds its data continues beyond them."""
        table = self.tables.get(symbol.key) if isinstance(symbol, TableSymbol) else None
        if table is not None and table.outside == "extend" and source is self.file.source:
            message = f"table '{word.name}' is extrapolated ('extend') beyond its data"
            related = (Related(f"{Path(table.place.source.name).name} says so", table.place),)
            self.report.warning("W302", message, Place(source, word.span), help="clamp or stop there", related=related)

    def _module(self, item: syntax.Import, source: SourceText) -> Scope | None:
        """The names of a module: std.x from the library, others from the folder of the importing file."""
        names = item.module.names
        place = Place(source, item.module.span)
        inside = names[0] == "std"
        folder = LIBRARY if inside else Path(source.name).parent
        path = folder.joinpath(*names[inside:]).with_suffix(".sd")
        # read before; None: it is being read now, so that the two import each other
        if path in self._modules:
            found = self._modules[path]
            if found is None:
                here = Path(source.name).stem
                other = f"modules '{here}' and '{names[-1]}' import each other"
                self.report.error("E801", f"module '{here}' imports itself" if here == names[-1] else other, place)
            return found
        # `from std.electric import resistor`, or `from electrical import ...` without the `std.`
        if not path.is_file():
            modules = sorted(p.stem for p in folder.glob("*.sd") if p.stem != "prelude")
            near = nearest(names[-1], modules)
            head, listed = "std." if inside else "", ", ".join(modules[:MODULES]) + ", ..." * (len(modules) > MODULES)
            if not inside and (LIBRARY / f"{names[-1]}.sd").is_file():
                head, near = "std.", names[-1]
            help_ = f"nearest module: '{head}{near}'" if near else f"there are {listed or 'none'}"
            self.report.error("E103", f"there is no module '{'.'.join(names)}'", place, help=help_)
            return None
        # marks the module as being read until its names are there
        self._modules[path] = None
        file, problems = _of_library(path) if inside else parse(SourceText.read(path))
        self.report.extend(problems)
        scope = Scope(self.outer)
        before, self.scope = self.scope, scope
        try:
            self._declare(file, scope)
        finally:
            self.scope = before
        self._modules[path] = scope
        return scope

    def _domain(self, item: syntax.DomainDefinition, scope: Scope, source: SourceText) -> Iterator[Symbol]:
        """A domain from its roles: units of effort, flow, momentum, displacement, and what is common at a node."""
        units: dict[str, Unit] = {}
        common, pseudo, before = "effort", None, len(self.report)
        # roles with their units, what is common at a node, and whether effort times flow is no power
        for part in item.body:
            match part:
                case syntax.DomainRole():
                    unit = read_unit(part.unit, scope, source, self.report)
                    if unit is not None:
                        units[part.kind] = unit
                case syntax.DomainNode():
                    common = part.common
                case syntax.DomainPseudo():
                    pseudo = read_unit(part.unit, scope, source, self.report)
        place = Place(source, item.name.span)
        missing = [k for k in ("effort", "flow", "displacement") if k not in units]
        unread = len(self.report) > before or any(isinstance(part, syntax.BrokenStatement) for part in item.body)
        # effort, flow and displacement have no default; a role that was misread is reported already
        if missing and not unread:
            self.report.error("E210", f"domain {item.name.name}: its {missing[0]} is not given", place)
        if missing or unread:
            scope.broken.add(item.name.name)
            return
        # without a momentum there are no kinetic stores (thermal); its unit is that of effort times time
        kinetic = "momentum" in units
        units.setdefault("momentum", si(multiply(units["effort"].dimension, dim.TIME)))
        self._check_domain(item.name.name, units, pseudo, place)
        e, f, p, q = (units[k] for k in ("effort", "flow", "momentum", "displacement"))
        yield DomainSymbol(item.name.name, e, f, p, q, common, pseudo is not None, place, kinetic)

    def _check_domain(self, name: str, units: dict[str, Unit], pseudo: Unit | None, place: Place) -> None:
        """E210 to E212: effort times flow is power (or what `pseudo` says), integrals have their units."""
        power = multiply(units["effort"].dimension, units["flow"].dimension)
        want = dim.POWER if pseudo is None else pseudo.dimension
        if power != want:
            message = f"domain {name}: effort*flow is {dim.show(power)}, not {dim.show(want)}"
            help_ = f"fix a unit, or declare 'pseudo: {dim.show(power)}'"
            self.report.error("E210", message, place, help=help_)
        for code, integral, rate in (("E211", "displacement", "flow"), ("E212", "momentum", "effort")):
            wanted = multiply(units[rate].dimension, dim.TIME)
            if units[integral].dimension != wanted:
                letter = "q = int f dt" if integral == "displacement" else "p = int e dt"
                edge = "bottom" if integral == "displacement" else "top"
                message = f"domain {name}: {integral} is not the time integral of {rate} ({edge} edge: {letter})"
                self.report.error(code, message, place, help=f"its unit should be {dim.show(wanted)}")

    def _table(self, item: syntax.TableDefinition, scope: Scope, source: SourceText) -> Iterator[Symbol]:
        """A table with its data, checked when it is read."""
        sized = next((p for p in item.params if p.size is not None), None)
        if sized is not None:
            message = f"argument '{sized.name}' of table {item.name.name} is one number, not an array"
            self.report.error("E206", message, Place(source, sized.span), help=f"{sized.name}: {sized.unit.text}")
            return
        heads = [(p.name, read_unit(p.unit, scope, source, self.report)) for p in item.params]
        result = read_unit(item.result, scope, source, self.report)
        units = [u for _, u in heads if u is not None]
        if result is None or len(units) != len(heads):
            return
        place = Place(source, item.name.span)
        arguments = tuple((name, unit.dimension) for (name, _), unit in zip(heads, units, strict=True))
        key = self._key(item.name.name, source)
        several = len(arguments) > 1 and item.interpolation == "hold"
        held = tuple(f"{key} along {name}" for name, _ in arguments) if several else ()
        yield TableSymbol(item.name.name, key, arguments, result.dimension, place, held)
        table = read_table(item, units, result, source, self.report)
        if table is not None:
            self.tables |= _grid_tables(replace(table, name=key), held)

    def _key(self, name: str, source: SourceText) -> str:
        """What a table is called among those of all files: by its own name in the model's, else with its module's."""
        if source is self.file.source:
            return name
        qualified = f"{Path(source.name).stem}.{name}"
        return next(k for n in count(1) if (k := qualified if n == 1 else f"{qualified}#{n}") not in self.tables)
