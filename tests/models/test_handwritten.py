"""Netlists written line by line are the arrays that they could have been written as, under the names of their lines."""

import re

import numpy as np
import pytest
from handwritten import chain, ladder, lattice, mesh, mixed, power_grid, stages, woven
from sysdyn.api import simulate
from sysdyn.cli.run.numpy_module import module_of
from sysdyn.cli.run.prepare import Prepared
from sysdyn.compiler.network import alike_elements as gathered_
from sysdyn.compiler.network.alike_elements import gather_families
from sysdyn.compiler.pipeline import compile_network
from sysdyn.dsl import load
from sysdyn.dsl.model.expression import fresh
from sysdyn.dsl.text.diagnostics import ModelError, Report
from sysdyn.dsl.text.source import SourceText
from sysdyn.runtime.condense.condenser import condense_model
from sysdyn.runtime.model import carrier
from sysdyn.runtime.model.system import System

NETLISTS = {
    "ladder": ladder(70),
    "begun": ladder(70, begun=True),
    "mesh": mesh(4, 12),
    "chain": chain(60),
    "stages": stages(18),
    "mixed": mixed(40).replace("to 1 ms", "to 200 us"),
    "power_grid": power_grid(40).replace("to 5 ms", "to 500 us"),
    "lattice": lattice(40),
    "woven": woven(60).replace("to 1 ms", "to 300 us"),
}


@pytest.fixture(autouse=True)
def gathered_from_few(monkeypatch):
    """Families of netlists that are small enough to be run twice."""
    monkeypatch.setattr(gathered_, "LEAST", 32)


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
@pytest.mark.one_in(12)
def test_a_netlist_runs_as_it_does_element_by_element(name, tmp_path, monkeypatch):
    text = NETLISTS[name]
    families = gather_families(network(text))
    assert families.authors
    text_of_c = {} if name != "mesh" else {"backend": "numpy"}  # its borders make the C compiler's the longest test
    one = run(tmp_path, text, "families", **text_of_c)
    monkeypatch.setattr(gathered_, "LEAST", 10**9)
    other = run(tmp_path, text, "written", backend="numpy")
    scale = np.abs(other).max(axis=1, keepdims=True)
    assert (scale > 0).all()
    assert (np.abs(one - other) <= 1e-8 * scale).all(), np.abs(one - other) / scale


@pytest.mark.parametrize("name", NETLISTS)
@pytest.mark.one_in(5)
def test_what_is_said_is_said_of_the_lines_of_the_text(name):
    """Notes of the compiler, unknowns and rows with their lines: the same set as element by element."""
    found = network(NETLISTS[name])
    families, written = (compile_network(found, gather=gather) for gather in (True, False))
    assert families.written is not None
    assert written.written is None
    assert sorted(said(n)[:2] for n in families.notes) == sorted(said(n)[:2] for n in written.notes)
    short = {said(n)[:2] for n in families.notes if "a displacement of it" in n.message}  # joined by tables
    assert all(code == "N501" for code, _ in short)
    assert not short or name not in ("ladder", "chain", "mesh", "stages")
    one, other = (sorted(s for s in map(said, c.notes) if s[:2] not in short) for c in (families, written))
    assert one == other
    one, other = (c.manifest(c.bind()) for c in (families, written))
    for part, key in (("unknowns", "name"), ("rows", "label")):
        assert {(r[key], r.get("line")) for r in one[part]} == {(r[key], r.get("line")) for r in other[part]}
    assert one["parameters"] == other["parameters"]


def said(note):
    """A note without the order of the terms of a row, which is that of the making."""
    return note.code, note.place.start, sorted(re.findall(r"[\w.]+", note.message))


def compiled(text):
    """A text through the compiler, gathered, with nothing left of what was compiled before."""
    with fresh():
        return compile_network(network(text), gather=True)


@pytest.mark.long
def test_one_text_of_c_for_any_number_of_lines(effort):
    """Families and equations do not grow with a chain; what a line costs does not either (counted, not timed)."""
    short, few = effort(lambda: compiled(ladder(100)))
    long, many = effort(lambda: compiled(ladder(200)))
    assert len(long.form.families) == len(short.form.families)
    assert len(long.program.routines) == len(short.program.routines)
    one, other = (re.sub(r"[\d.e]+", "0", made.text) for made in (short, long))
    assert one == other  # but for lines in comments, and the numbers of both ends
    assert (many - few) / 300 < 2500  # lines of Python a line of text, from its characters to C


def test_a_grid_without_order_keeps_its_names(tmp_path):
    """A grid of buses joined at random runs; each unknown keeps its name."""
    found = network(power_grid(24))
    model = compile_network(found, gather=True)
    names = {u["name"] for u in model.manifest(model.bind())["unknowns"]}
    assert {f"bus{k}.multiplier" for k in range(24)} & names
    assert not any("#" in name for name in names)
    text = power_grid(24)
    assert np.isfinite(run(tmp_path, text.replace("to 5 ms", "to 500 us"), "grid", backend="numpy")).all()


@pytest.mark.parametrize("of", [power_grid, mixed, lambda n: mesh(n // 8, 8)], ids=["power_grid", "mixed", "mesh"])
@pytest.mark.long
def test_what_is_joined_without_order_is_families_that_do_not_grow(of, effort):
    """Tables of indices tell what is joined to what: as many statements for any number of lines, each at equal cost."""
    short, few = effort(lambda: compiled(of(96)))
    long, many = effort(lambda: compiled(of(192)))
    assert len(long.family.branches) == len(short.family.branches)
    assert len(long.form.families) == len(short.form.families)
    assert len(long.text) < 1.05 * len(short.text)
    lines = len(of(192).splitlines()) - len(of(96).splitlines())
    assert (many - few) / lines < 4000  # lines of Python a line of text


@pytest.mark.long
def test_a_grid_without_a_ground_is_counted_from_one_of_its_nodes(tmp_path, monkeypatch):
    """Nothing tells by which node of a family: it is lowered as it is written."""
    text = power_grid(30).replace("-> ground", "-> earth").replace("to 5 ms", "to 100 us")
    text = text.replace("  node bus0:", "  node earth: electrical\n  node bus0:")
    found = network(text)
    assert gather_families(found).authors
    assert compile_network(found, gather=True).written is None
    one = run(tmp_path, text, "families", backend="numpy")
    monkeypatch.setattr(gathered_, "LEAST", 10**9)
    assert np.array_equal(one, run(tmp_path, text, "written", backend="numpy"))


@pytest.mark.long
def test_branches_of_an_array_beside_a_grid_without_order(tmp_path, monkeypatch):
    """What a `for` joins to it stays a loop; its nodes' indices do not show that they hang together."""
    more = "  node v[1..3]: electrical\n  for k in 1..3 { r[k]: resistor(R = k*1 ohm) v[k] -> bus4 }\n"
    more += "  for k in 1..3 { c[k]: capacitor(C = k*1 uF) v[k] -> ground }\n  w: resistor(R = 2 ohm) v[2] -> bus9\n"
    text = power_grid(30).replace("to 5 ms", "to 300 us").replace("\n}\n\nscene", f"\n{more}}}\n\nscene")
    text = text.replace("trace bus3.e", "trace v[2].e, w.f, r[3].f, bus3.e")
    assert compile_network(network(text), gather=True).written is not None
    one = run(tmp_path, text, "families", backend="numpy")
    monkeypatch.setattr(gathered_, "LEAST", 10**9)
    other = run(tmp_path, text, "written", backend="numpy")
    assert (np.abs(one - other) <= 1e-8 * np.abs(other).max(axis=1, keepdims=True)).all()


@pytest.mark.long
def test_a_chain_of_scalars_leaves_no_full_matrix():
    """Definitions through one another are not followed without end: terms grow with the unknowns, not their square."""

    def terms(n):
        model = compile_network(network(ladder(n)), backend="numpy")
        binding = model.bind()
        arrays = Prepared.arrays_of(binding)
        system = System(model.manifest(binding), arrays, carrier.load(module_of(model.text)))
        zero = np.zeros(system.unknowns)
        found = condense_model(system, 0.0, zero, zero)
        return found.stepped._share.size

    few, many = terms(50), terms(100)
    assert many < 2.5 * few


@pytest.mark.long
def test_what_nothing_traces_is_traced_under_its_own_name(tmp_path):
    text = re.sub(r"; trace .* }", " }", ladder(70))
    file = tmp_path / "n.sd"
    file.write_text(text)
    trace = simulate(file, output=tmp_path / "n.h5", unmet="warn", backend="numpy", until="1 us")
    assert {"C1", "C17", "R2", "C70"} <= set(trace.names)
    assert not any("#" in name for name in trace.names)


def test_a_wrong_number_is_told_of_its_element():
    text = stages(26)
    found = compile_network(network(text), gather=True)
    assert found.network.authors
    with pytest.raises(ModelError) as wrong:
        found.bind({"Ci9.C": 0.0})
    (said_,) = wrong.value.diagnostics
    assert (said_.code, said_.message) == ("E605", "the law of Ci9 cannot be inverted: Ci9.C is zero")


@pytest.mark.long
def test_initial_values_that_contradict_each_other_are_told_at_their_own_lines(tmp_path, monkeypatch):
    """Beside a family's statements one more: its element is named, not the family's first."""
    monkeypatch.setattr(gathered_, "LEAST", 16)
    text = ladder(16, begun=True).replace("\n}\n\nscene", "\n  init R12.f = 3 mA\n}\n\nscene")
    assert gather_families(network(text)).authors
    (tmp_path / "n.sd").write_text(text)
    with pytest.raises(ModelError) as refused:
        simulate(tmp_path / "n.sd", output=tmp_path / "n.h5", backend="numpy")
    found = next(d for d in refused.value.diagnostics if d.code == "E903")
    assert "'C12'" in found.message
    assert "#" not in f"{found.message} {found.help}"
    lines = text.splitlines()
    assert "init R12.f" in [lines[r.place.start[0] - 1].strip()[:10] for r in found.related]
