"""The standard library's reference, read from its own texts: the index, and the page of a component or a domain."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache
from typing import Any

from sysdyn.cli.page.columns import align
from sysdyn.dsl.elaborate.files import LIBRARY
from sysdyn.dsl.format.format import format_expression
from sysdyn.dsl.parser.parse import parse
from sysdyn.dsl.text.diagnostics import SourceText
from sysdyn.dsl.tree import syntax
from sysdyn.values import dataclass

PRELUDE = "prelude"
"""The module that is loaded before every file: nothing of it is imported."""


@dataclass(frozen=True, slots=True)
class LibraryEntry:
    """A component, domain, bundle or constant of the library; module `prelude` needs no import."""

    name: str
    module: str
    kind: str
    doc: str
    item: syntax.ComponentDefinition | syntax.DomainDefinition | syntax.BundleDefinition | syntax.ConstDefinition
    source: SourceText

    @property
    def line(self) -> str:
        """The first line of its comment."""
        return self.doc.splitlines()[0] if self.doc else ""

    @property
    def text(self) -> str:
        """As it stands in the library."""
        return self.source.text[self.item.span.start : self.item.span.end]


@cache
def entries() -> tuple[LibraryEntry, ...]:
    """Everything public, in the order of the modules' texts; the prelude comes last."""
    kinds = {
        syntax.ComponentDefinition: "component",
        syntax.DomainDefinition: "domain",
        syntax.BundleDefinition: "bundle",
        syntax.ConstDefinition: "const",
    }
    found = []
    paths = sorted(LIBRARY.glob("*.sd"), key=lambda p: (p.stem == PRELUDE, p.stem))
    for path in paths:
        source = SourceText.read(path, f"std/{path.name}")
        for item in parse(source)[0].items:
            if isinstance(
                item,
                (syntax.ComponentDefinition, syntax.DomainDefinition, syntax.BundleDefinition, syntax.ConstDefinition),
            ):
                doc = (item.doc or "").strip()
                found.append(LibraryEntry(item.name.name, path.stem, kinds[type(item)], doc, item, source))
    return tuple(found)


def modules() -> dict[str, str]:
    """The modules that can be imported, with the comment that stands above the first item of each text."""
    found = {}
    for entry in entries():
        if entry.module != PRELUDE and entry.module not in found:
            first = entry.source.text.splitlines()[0]
            stands_alone = first.startswith("##") and entry.source.text.splitlines()[1] == ""
            found[entry.module] = first.lstrip("# ") if stands_alone else ""
    return found


def index(module: str | None = None) -> str:
    """One line for each name, by module."""
    parts = []
    heads = modules() | {PRELUDE: "Known in every file without an import."}
    for name, said in heads.items():
        if module is None or name == module:
            head = "always there" if name == PRELUDE else f"std.{name}"
            rows = [(f"  {e.name}", e.line) for e in entries() if e.module == name]
            parts.append("\n".join([f"{head}{': ' if said else ''}{said}", align(rows)]))
    return "\n\n".join(parts)


def find(name: str) -> LibraryEntry | None:
    """The entry of `resistor`, `electrical.resistor` or `std.electrical.resistor`."""
    *around, last = name.removeprefix("std.").split(".")
    return next((e for e in entries() if e.name == last and around in ([], [e.module])), None)


def page(entry: LibraryEntry) -> str:
    """What a user of the library needs of one entry: ports, parameters, text, an example."""
    # a domain, a bundle, a constant: its text is all
    if not isinstance(entry.item, syntax.ComponentDefinition):
        return f"{entry.name}: {entry.line}\nIn every file, without an import.\n\n{_indent(entry.text)}"
    body = tuple(_statements(entry.item.body))
    parts = [f"{entry.name}: {entry.doc}\n\n    from std.{entry.module} import {entry.name}", picture(entry)]
    rows = [(f"  {p['name']}", p["unit"], p["default"] or "required", p["doc"]) for p in parameters(entry.item)]
    if rows:
        parts.append("Parameters and inputs\n" + align([("  name", "unit", "default", ""), *rows]))
    levels = [
        (f"  {s.name.name}{'*' if s.default else ''}", s.doc or "")
        for s in body
        if isinstance(s, syntax.LevelStatement)
    ]
    if levels:
        other = levels[-1][0].strip(" *")
        parts.append(f"Levels (* is taken where none is named, as in {entry.name}.{other}(...))\n{align(levels)}")
    shown = example(entry)
    parts += ["Its text", _indent(entry.text)]
    parts += ["Example", _indent(shown)] if shown else []
    return "\n\n".join(parts)


def account(entry: LibraryEntry) -> dict[str, Any]:
    """The JSON object of `sysdyn std NAME`."""
    found: dict[str, Any] = {"name": entry.name, "module": entry.module, "kind": entry.kind, "doc": entry.doc}
    found["text"] = entry.text
    if isinstance(entry.item, syntax.ComponentDefinition):
        found |= {"ports": ports(entry.item), "parameters": parameters(entry.item), "example": example(entry)}
        found["laws"] = [_statement_text(entry, s) for s in _statements(entry.item.body) if isinstance(s, _LAWS)]
        found["levels"] = [s.name.name for s in entry.item.body if isinstance(s, syntax.LevelStatement)]
    return found


_LAWS = (
    syntax.LawStatement,
    syntax.EnergyStatement,
    syntax.ContentStatement,
    syntax.WorkStatement,
    syntax.ConstraintStatement,
    syntax.DynamicStatement,
    syntax.InstanceStatement,
)


def _statements(body: Sequence[syntax.Statement]) -> Iterator[syntax.Statement]:
    """Statements, those of levels too."""
    for statement in body:
        yield statement
        if isinstance(statement, syntax.LevelStatement):
            yield from _statements(statement.body)


def _statement_text(entry: LibraryEntry, statement: syntax.Statement) -> str:
    return " ".join(entry.source.text[statement.span.start : statement.span.end].split())


def ports(component: syntax.ComponentDefinition) -> list[dict[str, str]]:
    """Ports and branches with their domains, outputs too."""
    found = []
    for s in _statements(component.body):
        if isinstance(s, syntax.PortStatement):
            found += [{"name": d.name, "kind": "port", "domain": s.domain.name} for d in s.decls]
        elif isinstance(s, syntax.BranchStatement):
            found += [{"name": d.name, "kind": "branch", "domain": s.domain.name} for d in s.decls]
            found += [] if s.decls else [{"name": "", "kind": "branch", "domain": s.domain.name}]
        elif isinstance(s, syntax.OutputStatement):
            found.append({"name": s.decl.name, "kind": "output", "domain": ""})
    return [dict(pairs) for pairs in dict.fromkeys(tuple(p.items()) for p in found)]


def parameters(component: syntax.ComponentDefinition) -> list[dict[str, str]]:
    """Parameters and inputs: name, unit, default ('' where one must be given), comment."""
    found: dict[str, dict[str, str]] = {}
    for s in _statements(component.body):
        if isinstance(s, (syntax.ParamStatement, syntax.InputStatement)):
            unit = "" if s.unit is None else s.unit.text
            default = "" if s.value is None else format_expression(s.value)
            doc = (s.doc or "").strip()
            kind = "input" if isinstance(s, syntax.InputStatement) else "param"
            found.setdefault(
                s.decl.name, {"name": s.decl.name, "kind": kind, "unit": unit, "default": default, "doc": doc}
            )
    for p in found.values():
        p["doc"] = ", ".join(filter(None, ("input" if p["kind"] == "input" else "", p["doc"])))
    return list(found.values())


def picture(entry: LibraryEntry) -> str:
    """The component as a box: ends on the left, ends and outputs on the right, domains in words."""
    assert isinstance(entry.item, syntax.ComponentDefinition)
    found = ports(entry.item)
    branches = [p for p in found if p["kind"] == "branch"]
    inputs = [p["name"] for p in parameters(entry.item) if p["kind"] == "input"]
    outputs = [p["name"] for p in found if p["kind"] == "output"]
    nodes = [f"{p['name']} ({p['domain']})" for p in found if p["kind"] == "port"]
    # nodes on both sides, branches from left to right
    half = (len(nodes) + 1) // 2
    left, right = [f"{n} o--" for n in nodes[:half]], [f"--o {n}" for n in nodes[half:]]
    for b in branches:
        name = f"{b['name']}." if b["name"] else ""
        left.append(f"{name}a ({b['domain']}) o--")
        right.append(f"--o {name}b")
    left += [f"{n} -->" for n in inputs]
    right += [f"--> {n}" for n in outputs]
    # both sides as high as the longer one
    height = max(len(left), len(right), 1)
    left += [""] * (height - len(left))
    right += [""] * (height - len(right))
    wide = max(map(len, left))
    title = f" {entry.name} "
    middle = [title if k == (height - 1) // 2 else " " * len(title) for k in range(height)]
    bar = " " * (wide + 4) + "+" + "-" * len(title) + "+"
    rows = [f"    {a.rjust(wide)}|{m}|{b}".rstrip() for a, m, b in zip(left, middle, right, strict=True)]
    how = _use(entry, branches, nodes, inputs)
    return "\n".join([bar, *rows, bar, "", f"    {how}"])


def _use(entry: LibraryEntry, branches: list[dict[str, str]], nodes: list[str], inputs: list[str]) -> str:
    """How it is written: `label: resistor(R = ...) a -> b`."""
    assert isinstance(entry.item, syntax.ComponentDefinition)
    given = [p["name"] for p in parameters(entry.item) if p["kind"] == "param" and not p["default"]]
    arguments = ", ".join(f"{name} = ..." for name in given)
    binds = [f"{n.split()[0]} = ..." for n in nodes]
    if len(branches) == 1 and not branches[0]["name"]:
        arguments = ", ".join(filter(None, [arguments, *(f"{name} = ..." for name in inputs)]))
        return f"label: {entry.name}({arguments}) a -> b"
    binds += [f"{b['name']} = ... -> ..." for b in branches] + [f"{name} = ..." for name in inputs]
    return f"label: {entry.name}({arguments}) {', '.join(binds)}".rstrip()


@cache
def _examples(module: str) -> tuple[SourceText, dict[str, syntax.ModelDefinition | syntax.SceneDefinition]]:
    source = SourceText.read(LIBRARY / "examples" / f"{module}.sd", f"std/examples/{module}.sd")
    items = parse(source)[0].items
    return source, {i.name.name: i for i in items if isinstance(i, (syntax.ModelDefinition, syntax.SceneDefinition))}


def example(entry: LibraryEntry) -> str | None:
    """A whole text that uses a component, with the imports that it needs."""
    if entry.kind != "component":
        return None
    source, items = _examples(entry.module)
    # `Wall_example`, a model, and `Wall_run`, its scene
    chosen = [items[name] for name in (f"{entry.name}_example", f"{entry.name}_run") if name in items]
    if not chosen:
        return None
    model = chosen[0]
    assert isinstance(model, syntax.ModelDefinition)
    # the imports that the example's instances need
    used = {s.component.names[0] for s in model.body if isinstance(s, syntax.InstanceStatement)}
    wanted: dict[str, list[str]] = {}
    for e in entries():
        if e.kind == "component" and e.name in used:
            wanted.setdefault(e.module, []).append(e.name)
    imports = [f"from std.{module} import {', '.join(names)}" for module, names in wanted.items()]
    texts = [source.text[i.span.start : i.span.end] for i in chosen]
    return "\n".join(imports) + "\n\n" + "\n\n".join(texts) + "\n"


def _indent(text: str) -> str:
    return "\n".join(f"    {line}".rstrip() for line in text.rstrip().splitlines())
