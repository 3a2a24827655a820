"""Networks of the library's components, simulated and compared with closed forms."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.cli.run.running import run
from sysdyn.dsl.elaborate import files
from sysdyn.dsl.parser.parse import parse
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.dsl.text.source import SourceText
from sysdyn.dsl.tree import syntax
from sysdyn.runtime.trace.trace import Trace

ACCURACY = 1e-6
"""Asked for and met, of each quantity's largest magnitude."""
PRIMAL = ("lagrangian", "hamiltonian")
ALL = (*PRIMAL, "co_lagrangian", "co_hamiltonian")
INSTANTS = np.array([0.0, 0.013, 0.1, 0.27, 0.5, 0.71, 0.93, 1.0])
"""Of the span, where traces and closed forms are compared."""


@dataclass(frozen=True)
class Row:
    """A component (`gear`, or a level of it `gear.losses`) in a network of known response.

    start: initial values that the scene sets in place of the component's own.
    """

    component: str
    body: str
    end: float
    expected: dict[str, Callable]
    formulations: tuple[str, ...] = ALL
    start: str = ""

    @property
    def text(self):
        """The network as a model with one scene, whose traces are named y0, y1, ..."""
        traces = ", ".join(f"{e} as y{k}" for k, e in enumerate(self.expected))
        return network(self.body, self.end, traces, self.start)

    def check(self, folder, formulation):
        """Compare; the worst relative error."""
        at = self.end * INSTANTS
        found, report = traced(folder, self.text, at, formulation=formulation)
        assert found is not None, [f"{d.code} {d.message}" for d in report]
        span = np.linspace(0.0, self.end, 500)
        errors = {}
        for k, (expression, form) in enumerate(self.expected.items()):
            largest = np.max(np.abs(form(span) + 0.0 * span))
            errors[expression] = float(np.max(np.abs(found[f"y{k}"] - form(at))) / largest)
        assert max(errors.values()) <= ACCURACY, errors
        return max(errors.values())


def network(body, end, traces, start="", unit="s"):
    """A text of one model and one scene; what it uses of the library is imported."""
    used = [n for n in names(f"model network {{{body}}}") if n in library()]
    imports = "".join(f"from std.{library()[n].module} import {n}\n" for n in dict.fromkeys(used))
    scene = f"scene run of network {{\n  time 0 s to {end!r} {unit}\n  trace {traces}{start}\n}}\n"
    return f"{imports}model network {{{body}}}\n{scene}"


def names(text):
    """Components of the elements in a text's models, with their levels: gear, gear.losses."""
    models = [i for i in parsed(SourceText("network.sd", text)).items if isinstance(i, syntax.ModelDefinition)]
    found = [s for model in models for s in walk(model.body) if isinstance(s, syntax.InstanceStatement)]
    return [n for s in found for n in (s.component.names[0], ".".join(s.component.names))]


def walk(body):
    """Statements, those inside loops and levels too."""
    for statement in body:
        yield statement
        if isinstance(statement, (syntax.ForStatement, syntax.LevelStatement)):
            yield from walk(statement.body)


def parsed(source):
    """The file of a text without faults."""
    file, problems = parse(source)
    assert not problems, problems
    return file


@dataclass(frozen=True)
class Entry:
    """A component of the library and the module that holds it."""

    module: str
    component: syntax.ComponentDefinition

    @property
    def levels(self):
        return [s for s in self.component.body if isinstance(s, syntax.LevelStatement)]


@cache
def library():
    """Public components by name."""
    found = {}
    for path in sorted(files.LIBRARY.glob("*.sd")):
        for item in parsed(SourceText.read(path)).items:
            if isinstance(item, syntax.ComponentDefinition):
                assert item.name.name not in found
                found[item.name.name] = Entry(path.stem, item)
    return found


def traced(folder, text, at, *, accuracy=ACCURACY, formulation=None):
    """Values of each traced quantity at the instants (None where the text is refused) and the report."""
    path = Path(folder) / "network.sd"
    path.write_text(text, encoding="utf-8")
    report = Report()
    request = RunRequest(
        str(path),
        formulation=formulation,
        accuracy=accuracy,
        at=",".join(repr(float(t)) for t in at),
        output=str(path.with_suffix(".h5")),
        max_wall="20",
    )
    ran = run(request, report)
    if ran is None:
        return None, report
    assert ran.exit == 0, [ran.failure, *(f"{d.code} {d.message}" for d in report)]
    trace = Trace.open(path.with_suffix(".h5"))
    places = np.searchsorted(trace.time, np.asarray(at) * (1.0 - 1e-13))
    np.testing.assert_allclose(trace.time[places], at, rtol=1e-12, atol=0.0)
    return {name: trace[name].values[places] for name in trace.names}, report
