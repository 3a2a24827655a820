"""Netlists written line by line are the arrays that they could have been written as, under the names of their lines."""

import re

import numpy as np
import pytest
from handwritten import chain, ladder, mesh, stages
from sysdyn.api import simulate
from sysdyn.compiler.network import gathered as gathered_
from sysdyn.compiler.network.gathered import gathered
from sysdyn.compiler.pipeline import compile_network
from sysdyn.dsl import load
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.dsl.text.source import SourceText

NETLISTS = {
    "ladder": ladder(70),
    "begun": ladder(70, begun=True),
    "mesh": mesh(11, 12),
    "chain": chain(60),
    "stages": stages(26),
}


def network(text):
    report = Report()
    document = load.document(SourceText("n.sd", text), report)
    (model,), (scene,) = document.models.values(), document.scenes.values()
    found = load.network(document, model, scene, report)
    assert not report.failed, list(report)[:3]
    return found


def traced(text):
    return re.search(r"trace (.*) }", text)[1].split(", ")


def run(folder, text, name, **options):
    file = folder / f"{name}.sd"
    file.write_text(text)
    end = float(re.search(r"to ([\d.]+) (?:us|s)", text)[1]) * (1.0 if " s;" in text else 1e-6)
    instants = [0.3 * end, 0.7 * end, end]
    trace = simulate(file, output=folder / f"{name}.h5", rtol=1e-10, atol=1e-16, unmet="warn", at=instants, **options)
    return np.array([[np.interp(t, trace.time, trace[q]) for t in instants] for q in traced(text)])


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("name", NETLISTS)
def test_a_netlist_runs_as_it_does_element_by_element(name, tmp_path, monkeypatch):
    text = NETLISTS[name]
    families = gathered(network(text))
    assert families.authors
    one = run(tmp_path, text, "families")
    monkeypatch.setattr(gathered_, "LEAST", 10**9)
    other = run(tmp_path, text, "written", backend="numpy")
    scale = np.abs(other).max(axis=1, keepdims=True)
    assert (scale > 0).all()
    assert (np.abs(one - other) <= 1e-8 * scale).all(), np.abs(one - other) / scale


@pytest.mark.parametrize("name", NETLISTS)
def test_what_is_said_is_said_of_the_lines_of_the_text(name):
    """Notes of the compiler, unknowns and rows with their lines: the same set as element by element."""
    found = network(NETLISTS[name])
    families, written = (compile_network(found, gather=gather) for gather in (True, False))
    assert families.written is not None
    assert written.written is None
    assert sorted(map(said, families.notes)) == sorted(map(said, written.notes))
    one, other = (c.manifest(c.bind()) for c in (families, written))
    for part, key in (("unknowns", "name"), ("rows", "label")):
        assert {(r[key], r.get("line")) for r in one[part]} == {(r[key], r.get("line")) for r in other[part]}
    assert one["parameters"] == other["parameters"]


def said(note):
    """A note without the order of the terms of a row, which is that of the making."""
    return note.code, note.place.start, sorted(re.findall(r"[\w.]+", note.message))
