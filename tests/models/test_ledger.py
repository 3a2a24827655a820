"""The ledger of a pseudo domain: what its stores have gained is what its sources and losses have brought."""

from dataclasses import replace

import h5py
import numpy as np
import pytest
from model_runs import FOUR, attempt, trace_of
from reduced import ROOT
from sysdyn.api import NotMet, simulate
from sysdyn.compiler import pipeline
from sysdyn.dsl.model.expression import const, substitute, variables

BODIES = """
model two {
  param C = 100 J/K
  node a, b: heat
  Ca: potential(q = C*e) a -> ground
  Cb: potential(q = 2*C*e) ground -> b
  G: dissipator(f = (5 W/K)*e) a -> b
  loss: dissipator(f = (1 W/K)*(e - 290 K)) b -> ground
  heater: flow(f = 50 W*sin(1 rad/s*t)) ground -> a
  init a.e = 350 K
  init b.e = 290 K
  expect always: abs(audit.heat) <= 1e-3 J
}
scene go of two {
  time 0 s to 100 s
  accuracy 1e-6
  trace a.e, audit.heat every 1 s
}
"""
EXCHANGER = ROOT / "models" / "gallery" / "heat_exchanger.sd"


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.long
def test_a_ledger_is_zero(tmp_path, formulation):
    trace = trace_of(tmp_path, BODIES, formulation=formulation)
    assert np.ptp(trace["a.e"].values) > 40
    assert np.abs(trace["/audit/heat"].values).max() < 1e-6
    assert trace["audit.heat"].units == "J"
    with h5py.File(tmp_path / "trace.h5") as file:
        assert file["/audit/heat"] == file["audit.heat"]


@pytest.mark.parametrize("formulation", FOUR[:2])
def test_the_ledger_of_an_array(tmp_path, formulation):
    text = EXCHANGER.read_text().replace("param n = 400", "param n = 20")
    text = text.replace("  trace h[n].e,", "  trace audit.heat as ledger, h[n].e,")
    trace = trace_of(tmp_path, text, formulation=formulation)
    assert np.abs(trace["held"].values).max() > 20
    assert np.abs(trace["ledger"].values).max() < 1e-4


@pytest.mark.long
def test_a_ledger_tells_of_a_lost_flow(tmp_path, monkeypatch):
    """The balance of a node without the flow of the heater: its temperature is wrong, and the ledger says so."""

    def losing(network, then=pipeline.primal, **options):
        found, *rest = then(network, **options)
        law = next(c for c in found.constraints if c.name == "heater.law")
        lost = {n: const(0.0) for n in variables(law.expression) if n.op == "var"}
        assert len(lost) == 1
        cut = (
            c if c.name == "heater.law" else replace(c, expression=substitute(c.expression, lost))
            for c in found.constraints
        )
        return replace(found, constraints=tuple(cut)), *rest

    monkeypatch.setattr(pipeline, "primal", losing)
    ran, _ = attempt(tmp_path, BODIES)
    assert ran is not None
    assert [c.ok for c in ran.claims] == [False]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (BODIES.replace("audit.heat", "audit.electrical"), "'audit' has no member 'electrical'"),
        (BODIES.replace("f = 50 W*", "f = audit.heat/(1 s)*"), "no law can read it"),
    ],
)
def test_no_ledger(tmp_path, text, said):
    ran, report = attempt(tmp_path, text)
    assert ran is None
    assert any(d.code == "E102" and said in d.message for d in report)


@pytest.mark.long
def test_a_staircase_of_energy_is_not_met_where_the_run_ends_on_a_step(tmp_path):
    """8 of 12.5 J came from nowhere, told as met: at 9 m round-off leaves open on which step it stands."""
    path = tmp_path / "m.sd"
    path.write_text(
        "model m {\n coord x: translation = 0 m\n energy T* = 1/2*(1 kg)*x'^2\n energy V = (1 J)*floor(x/(1 m))\n"
        " init x' = 3 m/s\n}\nscene s of m { time 0 s to 3 s; trace x }\n"
    )
    with pytest.raises(NotMet, match="ledger is off"):
        simulate(path, output=tmp_path / "t.h5")
