"""The bdf carries its error along where a model can but relax: one run is met by what it tells of itself."""

import numpy as np
import pytest
from sysdyn.api import simulate
from sysdyn.runtime.accuracy import controlled
from sysdyn.runtime.accuracy.runs import Runs

LINE = """from std.electrical import resistor, capacitor, inductor, voltage

model line {{
  param n = 40
  node v[0..n]: electrical
  source: voltage(v = {source}) v[0] -> ground
  for i in 1..n {{
    R[i]: resistor(R = 1 ohm / n) v[i - 1] -> v[i]
    {store}
  }}
  {more}
}}

scene s of line {{
  time 0 s to 1 s
  trace {traced}
}}
"""
STORES = {
    "capacitors": "C[i]: capacitor(C = 1 F / n) v[i] -> ground\n    init C[i].e = 0 V",
    "inductors": "L[i]: inductor(L = 1 H / n) v[i] -> ground\n    init L[i].f = 0 A",
}
SINE, PULSE = "1 V*sin(2*pi*2 Hz*t)", "1 V*exp(-(t - 0.5 s)^2/(0.04 s)^2)"


def written(folder, *, store="capacitors", source=SINE, more="", traced="v[n/2].e as y"):
    path = folder / "line.sd"
    path.write_text(LINE.format(store=STORES[store], source=source, more=more, traced=traced))
    return path


@pytest.fixture
def told(monkeypatch):
    """What was handed back by runs that carry their error, and the tolerance of every run."""
    found, tolerances = [], []
    asked, run = controlled.carried, Runs.run
    monkeypatch.setattr(controlled, "carried", lambda *of: found.append(asked(*of)) or found[-1])
    monkeypatch.setattr(Runs, "run", lambda runs, rtol, *how: tolerances.append(rtol) or run(runs, rtol, *how))
    return found, tolerances


def worst(path, formulation, trace, folder):
    """Largest error of the quantity y at any row, of its largest."""
    at = tuple(trace.time[1:-1])
    best = simulate(path, formulation=formulation, method="radau", rtol=1e-12, at=at, output=folder / "b.h5")
    exact = np.asarray(best["y"].values)[np.searchsorted(np.asarray(best.time), trace.time)]
    return np.abs(trace["y"].values - exact).max() / np.abs(exact).max()


@pytest.mark.one_in(2)
@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.parametrize("source", [SINE, PULSE, "1 V"])
@pytest.mark.parametrize("accuracy", [1e-1, 1e-2, 3e-3])
def test_one_run_is_told_no_better_than_it_is(accuracy, source, formulation, told, tmp_path):
    path = written(tmp_path, source=source)
    trace = simulate(path, formulation=formulation, accuracy=accuracy, output=tmp_path / "t.h5")
    found, tolerances = told
    assert len(found) == 1
    assert found[0] is not None
    assert found[0].met
    assert len(tolerances) == found[0].runs == 1
    error = worst(path, formulation, trace, tmp_path)
    assert error <= found[0].error_estimate <= accuracy


def test_what_is_faint_beside_the_source_is_met_by_another_method(told, tmp_path):
    more = "G: resistor(R = 0.01 ohm) v[n] -> ground"
    path = written(tmp_path, more=more, source=PULSE.replace("0.5 s", "0.75 s"), traced="v[n].e as y, v[1].e as near")
    path.write_text(path.read_text().replace("C = 1 F", "C = 30 F"))
    trace = simulate(path, formulation="hamiltonian", accuracy=3e-3, output=tmp_path / "t.h5")
    assert told[0] == [None]
    assert worst(path, "hamiltonian", trace, tmp_path) <= 3e-3


def test_what_can_ring_does_not(told, tmp_path):
    more = "coil: inductor(L = 1 H) v[n] -> ground\n  init coil.f = 0 A"
    simulate(written(tmp_path, more=more), accuracy=1e-2, output=tmp_path / "t.h5")
    assert told[0] == []
