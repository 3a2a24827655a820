"""From a text to the checked networks of its models and scenes: the front end's list of calls."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from sysdyn.dsl.elaborate.authors import point_at_author
from sysdyn.dsl.elaborate.elaborate import Elaborator
from sysdyn.dsl.elaborate.files import FileScope
from sysdyn.dsl.elaborate.scenes import stopping
from sysdyn.dsl.elaborate.scenes.scenes import SceneReader
from sysdyn.dsl.elaborate.statements import switches
from sysdyn.dsl.model import budget
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.calculus import NoDerivativeError
from sysdyn.dsl.model.collecting import at_rest
from sysdyn.dsl.model.depth import deep
from sysdyn.dsl.model.network import Network, Parameter, Scene
from sysdyn.dsl.model.rewriting import nodes_read, with_common_sizes, with_literal_ranges
from sysdyn.dsl.model.unit_habits import common
from sysdyn.dsl.model.units import Dimension
from sysdyn.dsl.model.values import Values
from sysdyn.dsl.names.failures import Failed
from sysdyn.dsl.names.resolve import Resolver
from sysdyn.dsl.names.symbols import Space, nearest
from sysdyn.dsl.parser.parse import parse
from sysdyn.dsl.rules import bound_values, checks, graph_checks, law_rules
from sysdyn.dsl.rules.claims import exact_claims
from sysdyn.dsl.rules.floating import floating
from sysdyn.dsl.rules.text_conditions import TextConditions
from sysdyn.dsl.text.diagnostics import Diagnostic, Place, Report, SourceText
from sysdyn.dsl.tree import syntax
from sysdyn.values import dataclass

if TYPE_CHECKING:
    from sysdyn.dsl.elaborate.scenes.listing import ListedInstance, Readable


@dataclass(frozen=True, slots=True)
class ParsedFile:
    """A parsed file with its models and scenes by name."""

    file: syntax.File
    models: dict[str, syntax.ModelDefinition]
    scenes: dict[str, syntax.SceneDefinition]


@dataclass(frozen=True, slots=True)
class Listing:
    """What a model offers to those who run it: parameters (inputs that hold constants too) and names to read."""

    parameters: dict[str, Parameter]
    inputs: tuple[str, ...]
    known: Values
    readable: tuple[Readable, ...]
    instances: tuple[ListedInstance, ...]


def read(path: str | Path, report: Report, name: str | None = None) -> ParsedFile:
    """Parse a file; OSError where it cannot be read."""
    return document(SourceText.read(path, name), report)


def document(source: SourceText, report: Report) -> ParsedFile:
    """Parse a text; what is wrong with its syntax goes to the report."""
    file, problems = parse(source)
    report.extend(problems)
    models = {i.name.name: i for i in reversed(file.items) if isinstance(i, syntax.ModelDefinition)}
    scenes: dict[str, syntax.SceneDefinition] = {}
    for item in file.items:
        if isinstance(item, syntax.SceneDefinition):
            if item.name.name in scenes:
                place = Place(source, item.name.span)
                report.error("E106", f"scene '{item.name.name}' is declared twice", place)
            else:
                scenes[item.name.name] = item
    return ParsedFile(file, dict(reversed(models.items())), scenes)


def model_of(document: ParsedFile, scene: syntax.SceneDefinition, report: Report) -> syntax.ModelDefinition | None:
    """The model that a scene is of; None after E902."""
    name = ".".join(scene.model.names)
    if name in document.models:
        return document.models[name]
    broken = any(isinstance(i, syntax.BrokenStatement) and name in i.names for i in document.file.items)
    if not broken:
        near = nearest(name, document.models)
        help_ = f"nearest: '{near}'" if near else f"models here: {', '.join(document.models) or 'none'}"
        place = Place(document.file.source, scene.model.span)
        report.error(
            "E902", f"scene '{scene.name.name}' is of '{name}', which is no model of this file", place, help=help_
        )
    return None


def network(
    document: ParsedFile,
    model: syntax.ModelDefinition,
    scene: syntax.SceneDefinition | None,
    report: Report,
    settings: Sequence[tuple[str, str]] = (),
    *,
    levels: Sequence[tuple[str, str]] = (),
    required: bool = True,
    outputs: Sequence[str] | None = None,
    moved: Collection[str] = (),
) -> Network | None:
    """The network of a model under a scene; settings are (name, value), levels (path, name) of the command line;
    outputs: names of traced quantities or expressions, observed in the place of what the scene traces; moved: names
    or paths of inputs to whose formulas a parameter of that name, zero, is added.

    None where the report has errors, or N608: a network that lacks a part of the text is none, and where a statement
    could not be read only names and units are judged.  required: parameters and inputs must have values.
    """
    try:
        with deep(), at_rest(), budget.drawn(document.file.source.text):
            elaborator, reader = _elaborate(document, model, scene, report, settings, levels, moved)
            try:
                return _build_network(elaborator, reader, scene, report, required=required, outputs=outputs)
            finally:
                report.retold(lambda found: point_at_author(elaborator, found))
    # a text that unfolds into more than memory holds, or what has no derivative: one finding at the model
    except (budget.SpentError, NoDerivativeError) as spent:
        report.add(spent.diagnostic(Place(document.file.source, model.name.span)))
        return None


def _build_network(
    elaborator: Elaborator,
    reader: SceneReader,
    scene: syntax.SceneDefinition | None,
    report: Report,
    *,
    required: bool,
    outputs: Sequence[str] | None,
) -> Network | None:
    """The network of an elaborated model, after every check."""
    read_scene: Scene | None = None
    # what the scene observes, then what the command line asks for in its place
    if scene is not None:
        read_scene = reader.read(scene, Place(elaborator.source, scene.name.span))
    if outputs is not None:
        for source, trace in reader.only(outputs, lambda text: _trace(text, report)):
            reader.command(source, trace, SceneReader.trace)
    if _unread(elaborator, scene):
        return None  # what is missing would be found missing again, in other words
    # states that the text does not name: ranges of tables, integrals that are read, rates along expressions
    stopping.watch_tables(elaborator, reader.observations)
    elaborator.quadratures()
    elaborator.add_derivatives()
    # rules that need no numbers
    checks.run(elaborator, report, required=required)
    checks.set_valued_results(elaborator, reader.observations, report)
    exact_claims(elaborator, report)
    _begin(elaborator, read_scene)
    # from here with the numbers of parameters: events of arrays one by one, sizes, the graph
    known = Values(elaborator.parts.parameters, reader.elements)
    if not report.failed and not _incomplete(report):
        switches.expand_events(elaborator.context, known)
    bound_values.run(elaborator, known, report, reader.observations)
    if not report.failed and not _incomplete(report):
        graph_checks.run(elaborator, known, nodes_read(elaborator.parts), report)
        floating(elaborator, reader.observations, report)
    # laws are judged on the finished network, in which alike sizes have one name
    found = with_literal_ranges(with_common_sizes(_result(elaborator, reader, read_scene)), known.number)
    law_rules.run(found, known, report)
    return None if report.failed or _incomplete(report) else found


def _elaborate(
    document: ParsedFile,
    model: syntax.ModelDefinition,
    scene: syntax.SceneDefinition | None,
    report: Report,
    settings: Sequence[tuple[str, str]],
    levels: Sequence[tuple[str, str]],
    moved: Collection[str] = (),
) -> tuple[Elaborator, SceneReader]:
    """The model with the levels and settings asked for: its names, elements and statements."""
    files = FileScope(document.file, report)
    elaborator = Elaborator(files, model, report)
    elaborator.inputs.moved = frozenset(moved)
    # names of the model first: scene and command line refer to them
    elaborator.names()
    reader = SceneReader(elaborator)
    given = [s for name, value in settings for s in _set(name, value, report)]
    # the levels that the scene chooses, before instances are made
    if scene is not None:
        reader.levels(scene)
    for source, statement in given:
        reader.command(source, statement, SceneReader.set_input)
    # the command line wins over the scene
    for path, name in levels:
        text = SourceText("--level", f"{path}={name}")
        elaborator.instances.levels[path] = (name, text.place(0, len(text.text)))
    # components, with their nodes and branches
    elaborator.elements()
    _unused_levels(elaborator, report)
    # values of parameters: the scene's, then the command line's
    if scene is not None:
        reader.settings(scene)
    for source, statement in given:
        reader.command(source, statement, SceneReader.set_parameter)
    # laws and definitions, which read the values
    elaborator.settle()
    elaborator.statements()
    return elaborator, reader


def at_authors(network: Network, found: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
    """What binding or the start find wrong in a library, at the author's place; the rest as it is."""
    found, source = tuple(found), network.place.source
    if not any(d.severity == "error" and d.place is not None and d.place.source != source for d in found):
        return found
    again = document(source, Report())
    levels = [(choice.path, choice.chosen) for choice in network.levels]
    with deep(), budget.drawn(source.text), ex.fresh():
        elaborator, _ = _elaborate(again, again.models[network.model], None, Report(), (), levels)
        return tuple(point_at_author(elaborator, found))


def conditions_on_numbers(
    document: ParsedFile,
    model: syntax.ModelDefinition,
    scene: syntax.SceneDefinition | None,
    settings: Sequence[tuple[str, str]] = (),
    levels: Sequence[tuple[str, str]] = (),
) -> TextConditions:
    """What a text without errors asks of its numbers."""
    with deep(), budget.drawn(document.file.source.text):
        elaborator, reader = _elaborate(document, model, scene, Report(), settings, levels)
        return TextConditions(elaborator, reader.elements)


def listing(
    document: ParsedFile,
    model: syntax.ModelDefinition,
    scene: syntax.SceneDefinition | None,
    report: Report,
    levels: Sequence[tuple[str, str]] = (),
) -> Listing | None:
    """What a model offers: parameters with values, names that can be read, components; None where it has errors."""
    from sysdyn.dsl.elaborate.scenes.listing import instances, readable  # no run asks for it

    try:
        with deep(), budget.drawn(document.file.source.text):
            elaborator, reader = _elaborate(document, model, scene, report, (), levels)
            if report.failed:
                return None
            parameters = elaborator.parts.parameters
            known = Values(parameters, reader.elements)
            kept = {n: p for n, p in parameters.items() if n not in elaborator.parts.discretes}
            inputs = dict.fromkeys(elaborator.parts.inputs)
            return Listing(kept, tuple(inputs), known, readable(elaborator, known), instances(elaborator))
    except (budget.SpentError, NoDerivativeError) as spent:
        report.add(spent.diagnostic(Place(document.file.source, model.name.span)))
        return None


def _unread(elaborator: Elaborator, scene: syntax.SceneDefinition | None) -> bool:
    """Whether a statement of the model, of a component in it, of the scene, or one that it needs could not be read."""
    once = {id(body): body for _, body in elaborator.instances.bodies}.values()
    bodies = [statement for body in once for statement, _ in body]
    said = [*bodies, *(scene.body if scene else ())]
    within = (
        action for s in said if isinstance(s, (syntax.WhenStatement, syntax.EveryStatement)) for action in s.actions
    )
    return elaborator.files.scope.missed or any(isinstance(s, syntax.BrokenStatement) for s in (*said, *within))


def _unused_levels(elaborator: Elaborator, report: Report) -> None:
    """A level for a path that is no component is a mistake, not a wish."""
    known = {space.path for space, _ in elaborator.instances.bodies} if elaborator.instances.levels else set[str]()
    for path, (name, place) in elaborator.instances.levels.items():
        unread = elaborator.space.scope.is_broken(re.split(r"[.[]", path)[0]) or elaborator.files.scope.missed
        if path not in known and not report.failed and not unread:
            near, whole = nearest(path, known), re.sub(r"\[[^]]*\]", "", path)
            help_ = f"nearest: '{near}'" if near else None
            if whole in known:
                help_ = f"a level is that of all elements of a statement: level {whole} = {name}"
            report.error("E802", f"level {path} = {name}: there is no component '{path}'", place, help=help_)


def _result(elaborator: Elaborator, reader: SceneReader, scene: Scene | None) -> Network:
    """The network as frozen tuples, from what the elaborator and the scene's reader have gathered."""
    whole = elaborator.resolver.whole
    parts = elaborator.parts
    return Network(
        model=elaborator.model.name.name,
        place=Place(elaborator.source, elaborator.model.name.span),
        parameters=tuple(replace(p, whole=True) if p.name in whole else p for p in parts.parameters.values()),
        quasis=tuple(elaborator.parts.quasis),
        speeds=tuple(elaborator.parts.speeds),
        tables=tuple(elaborator.files.tables.values()),
        coordinates=tuple(parts.coordinates),
        unknowns=tuple(parts.unknowns),
        states=tuple(parts.states),
        energies=tuple(parts.energies),
        works=tuple(parts.works),
        constraints=tuple(parts.constraints),
        dynamics=tuple(parts.dynamics),
        initials=tuple(parts.initials),
        observations=(*reader.observations, *parts.watched),
        expectations=tuple(e for e in parts.expectations if e.moment != "static"),
        statics=tuple(e for e in parts.expectations if e.moment == "static"),
        goldens=tuple(parts.goldens),
        scene=scene,
        elements=tuple(reader.elements),
        nodes=tuple(parts.nodes),
        branches=tuple(parts.branches),
        couplings=tuple(parts.couplings),
        derived=tuple(parts.derived),
        discretes=frozenset(parts.discretes),
        events=tuple(parts.events),
        switches=tuple(parts.switches),
        levels=tuple(elaborator.instances.choices.values()),
        read=nodes_read(parts),
        literal=elaborator.resolver.sizes_read,
    )


def _begin(elaborator: Elaborator, scene: Scene | None) -> None:
    """Discrete variables that begin with a value of time begin with that of the scene's start."""
    parameters = elaborator.parts.parameters
    start = {ex.time(): ex.const(0.0) if scene is None or scene.start is None else scene.start}
    for name in elaborator.parts.discretes:
        p = parameters[name]
        parameters[name] = replace(p, values=tuple(ex.substitute(v, start) for v in p.values))


def _incomplete(report: Report) -> bool:
    """Whether a part of the text was left out."""
    return any(d.code == "N608" for d in report)


def constant(document: ParsedFile, text: str, dimension: Dimension, name: str, report: Report) -> float | None:
    """A constant expression of the command line in SI; a bare number is in SI units; None after reporting."""
    source = SourceText(name, f"const value = {text}\n")
    # `--at ""`
    if not text.strip():
        report.error("E207", f"{name}: a value is missing", source.place(0, 0))
        return None
    inner = Report()
    file, problems = parse(source)
    inner.extend(problems)
    items = [i for i in file.items if isinstance(i, syntax.ConstDefinition)]
    # a text that is no single expression, as `1; const b = 2`
    if inner.failed or "\n" in text or len(items) != 1 or len(file.items) != 1:
        unit = common(dimension) if dimension else ""
        report.extend(replace(d, help=f"one expression: 3 {unit}") if d.code == "E113" else d for d in inner)
        if not inner.failed:
            report.error("E207", f"{name} {text[:40]}: one expression is wanted", source.place(0, 0))
        return None
    value = items[0].value
    resolver = Resolver(report)
    with deep(), ex.fresh(), resolver.space(_space(document, source)):
        try:
            # a bare number is in SI units: `--at 3`
            if isinstance(value.operand if isinstance(value, syntax.Negative) else value, syntax.Number):
                return resolver.scalar(value).node.data  # type: ignore[no-any-return]
            node = resolver.scalar_of(value, dimension, "E208", f"{name} is in {{}}, wants {common(dimension)}")
        except Failed:
            return None
        found = Values({}).number(node)
    if not math.isfinite(found):
        report.error("E207", f"{name} {text[:40]} is no finite constant", source.place(0, len(source.text)))
        return None
    return found


def _set(name: str, value: str, report: Report) -> list[tuple[SourceText, syntax.SetStatement]]:
    """One `--set NAME=VALUE` of the command line, read as the statement of a scene."""
    text = f"scene command_line of model {{\n  set {name} = {value}\n}}\n"
    source = SourceText("--set", text)
    inner = Report()
    parsed = document(source, inner)
    statements = [s for scene in parsed.scenes.values() for s in scene.body]
    if len(inner) or "\n" in name + value or len(statements) != 1 or not isinstance(statements[0], syntax.SetStatement):
        report.extend(inner)
        if not inner.failed:
            report.error("E910", f"--set {name}={value} is not NAME=VALUE", source.place(0, 0))
        return []
    return [(source, statements[0])]


def _trace(expression: str, report: Report) -> tuple[SourceText, syntax.TraceStatement] | None:
    """One `--outputs` of the command line, read as the statement of a scene; None after reporting."""
    source = SourceText("--outputs", f"scene command_line of model {{\n  trace {expression}\n}}\n")
    inner = Report()
    statements = [s for scene in document(source, inner).scenes.values() for s in scene.body]
    if len(inner) or "\n" in expression or len(statements) != 1 or not isinstance(statements[0], syntax.TraceStatement):
        report.extend(inner)
        if not inner.failed:
            report.error("E905", f"--outputs {expression[:40]}: one expression is wanted", source.place(0, 0))
        return None
    return source, statements[0]


def _space(document: ParsedFile, source: SourceText) -> Space:
    scope = FileScope(document.file, Report()).scope
    return Space("", scope, scope, source)
