"""The texts of models/book: each descriptor model of the catalogue with its unknowns, index and solution.

n coordinates, m1 displacement, m2 flow, m3 effort and m4 dynamic constraints, momenta, differential index, and the
residual on the independent solution of descriptor_values.json; models/book/README.md is the table of them.
"""

import re

import pytest
from book_entries import BOOK, ENTRIES, begin, residual
from reduced import ROOT
from sysdyn.api import Trace
from sysdyn.cli.main import run
from sysdyn.compiler.equations.offsets import offsets
from sysdyn.dsl.model import expression as ex
from sysdyn.runtime.structure.structure import structure


def test_the_catalogue_has_ninety_models_and_each_its_text():
    assert len(ENTRIES) == 90
    assert {e.file for e in ENTRIES} == {p.stem for p in BOOK.glob("*.sd")}


@pytest.mark.parametrize("entry", ENTRIES, ids=lambda e: e.name)
@pytest.mark.one_in(200)
def test_unknowns_index_and_residual(entry):
    with ex.fresh():
        prepared, found = begin(entry)
        kinds = found.system.kinds
        counts = tuple(int((kinds == kind).sum()) for kind in ("f", "kappa", "mu", "e", "s", "p"))
        facts = structure(found.system, found.state)
        assert (counts, facts.index) == (entry.counts, entry.index)
        assert residual(entry, prepared) < 1e-9
        if entry.index is not None:  # which rows are differentiated how often says the same
            by_rows = offsets(prepared.compiled.form)
            assert by_rows is not None
            assert by_rows.index == entry.index


TABLE = re.compile(r"\| `(\w+)` \| `(\w+)` \|((?: \d+ \|){5}) (\d+|none) \| (\S+) \|")


def test_the_table_is_of_these():
    """Each line of models/book/README.md against the catalogue; residuals are what was measured once."""
    lines = [m.groups() for line in (BOOK / "README.md").read_text().splitlines() if (m := TABLE.fullmatch(line))]
    expected = []
    for e in ENTRIES:
        numbers = "".join(f" {n} |" for n in e.counts[:5])
        expected.append((e.file, e.formulation, numbers, "none" if e.index is None else str(e.index)))
    assert [line[:4] for line in lines] == expected
    assert all(float(line[4]) < 1e-9 for line in lines)


def test_texts_are_clean_and_canonical(capsys):
    files = sorted(map(str, BOOK.glob("*.sd")))
    assert run(["fmt", "--check", *files]) == 0, capsys.readouterr().err
    assert run(["check", "--strict", "--quiet", *files]) == 0, capsys.readouterr().out


def test_a_flow_constraint_stays_where_the_scene_says_so(tmp_path, capsys):
    """Without keep_flow the ram's row touches the sprung displacement and is integrated; a parameter may not say it."""
    text = (BOOK / "ram_cylinder.sd").read_text()
    path = tmp_path / "ram.sd"
    for change, label in (("false", "phi"), ("true", "psi")):
        path.write_text(text.replace("keep_flow = true", f"keep_flow = {change}"))
        assert run(["compile", str(path), "--scene", "reference", "--dump", "descriptor", "--quiet"]) == 0
        assert f"{label} of psi_1" in capsys.readouterr().out
    path.write_text(text.replace("keep_flow = true", "keep_flow = A > 1 m^2"))
    assert run(["check", str(path), "--quiet"]) == 1
    assert "E405" in capsys.readouterr().err


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian"])
@pytest.mark.one_in(2)
def test_efforts_of_gyrators_are_unknowns_where_the_scene_keeps_them(formulation, tmp_path, capsys):
    """A motor with and without keep_implicit: (2.94)'s two gammas with their implicit efforts, and the same motion."""
    text = (ROOT / "models" / "seed" / "dc_motor.sd").read_text()
    path, found = tmp_path / "motor.sd", []
    for change in ("false", "true"):
        said = text.replace("time 0 s to 0.6 s", f"time 0 s to 0.1 s\n  solver bdf(keep_implicit = {change})")
        path.write_text(said)
        options = ["--scene", "reference", "--formulation", formulation, "--quiet", "--backend", "numpy"]
        assert run(["compile", str(path), *options[:4], "--dump", "descriptor", "--quiet"]) == 0
        rows = capsys.readouterr().out
        found.append(("emf.e1" in rows, "emf.e2" in rows, "gamma of emf.e1.law" in rows, "gamma of emf.e2.law" in rows))
        assert run(["simulate", str(path), *options, "--accuracy", "1e-7", "-o", str(tmp_path / f"{change}.h5")]) == 0
    assert found == [(False,) * 4, (True,) * 4]
    one, other = (Trace.open(tmp_path / f"{change}.h5") for change in ("false", "true"))
    for name in ("i", "om", "e", "torque"):
        assert one[name][-1] == pytest.approx(other[name][-1], rel=1e-6), name
