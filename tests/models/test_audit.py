"""What the audit lists: the energies of all stores, whatever form their laws take."""

import numpy as np
import pytest
from model_runs import FOUR, attempt, trace_of
from sysdyn import api

COIL = """
model coil {{
  node a, b, c: electrical
  V: effort(e = 1 V*sin(2 rad/s*t)) a -> ground
  L: kinetic({law}) a -> b
  C: potential({store}) b -> ground
  S: dissipator(e = 2 ohm*f) b -> ground
  X: effort(e = {read}) b -> c
  Y: dissipator(e = 2 ohm*f) c -> ground
  init C.e = 0.1 V
  init L.f = 0.1 A
}}
scene go of coil {{
  time 0 s to 1 s
  accuracy 1e-7
  trace L.f, L.p, C.e, C.q, audit.kinetic, audit.potential every 0.1 s
}}
"""
LINEAR, CHARGE = "p = 0.5 H*f", "q = 0.7 F*e"


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.parametrize("read", ["0.3*L.e", "0.1 V"])
@pytest.mark.long
def test_a_store_whose_effort_a_law_reads(tmp_path, read, formulation):
    trace = trace_of(tmp_path, COIL.format(law=LINEAR, store=CHARGE, read=read), formulation=formulation)
    assert trace["audit.kinetic"].values == pytest.approx(0.25 * trace["L.f"].values ** 2, abs=1e-9)
    assert trace["audit.potential"].values == pytest.approx(0.35 * trace["C.e"].values ** 2, abs=1e-9)
    assert abs(trace["audit.energy"].values).max() < 1e-6


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.one_in(2)
def test_stores_that_stay_implicit(tmp_path, formulation):
    law, store = "f = 2 A/Wb*p + 3 A/Wb^3*p^3", "q = 0.7 F*e + 0.2 C/V^3*e^3"
    trace = trace_of(tmp_path, COIL.format(law=law, store=store, read="0.1 V"), formulation=formulation)
    p, e = trace["L.p"].values, trace["C.e"].values
    assert trace["audit.kinetic"].values == pytest.approx(p**2 + 0.75 * p**4, abs=1e-8)
    assert trace["audit.potential"].values == pytest.approx(0.35 * e**2 + 0.15 * e**4, abs=1e-8)
    assert abs(trace["audit.energy"].values).max() < 1e-6


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.one_in(2)
def test_stores_whose_integral_is_a_logarithm_of_cosh_or_of_a_sum_of_squares(tmp_path, formulation):
    law, store = "f = 3 A/Wb*p + 0.2 A*atan(p/(0.01 Wb))", "e = 2 V/C*q + 0.3 V*tanh(q/(0.05 C))"
    trace = trace_of(tmp_path, COIL.format(law=law, store=store, read="0.1 V"), formulation=formulation)
    p, q = trace["L.p"].values, trace["C.q"].values
    bent = 0.2 * 0.01 * (p / 0.01 * np.arctan(p / 0.01) - 0.5 * np.log1p((p / 0.01) ** 2))
    assert trace["audit.kinetic"].values == pytest.approx(1.5 * p**2 + bent, abs=1e-9)
    assert trace["audit.potential"].values == pytest.approx(q**2 + 0.015 * np.log(np.cosh(q / 0.05)), abs=1e-9)


@pytest.mark.parametrize(
    "statement",
    ["work 0.1/(1 m)*audit.kinetic on x", "state s: J = 0 J; dynamic s' = audit.energy/(1 s)"],
)
def test_no_law_reads_the_audit(tmp_path, statement):
    text = f"""
    model one {{
      coord x: translation = 0.1 m
      energy T* = 1/2*1 kg*x'^2
      energy V = 1/2*3 N/m*x^2
      {statement}
      init x' = 0 m/s
    }}
    scene go of one {{
      time 0 s to 1 s
      trace x, audit.kinetic every 0.1 s
    }}
    """
    ran, report = attempt(tmp_path, text)
    assert ran is None
    assert [d.code for d in report if d.severity == "error"] == ["E102"]


@pytest.mark.long
def test_round_off_beside_what_is_stored_is_no_turnover(tmp_path):
    """Charged capacitors that do nothing: the balance is measured by what they hold."""
    text = """
    model still {
      node b: electrical
      V: effort(e = 1 V) b -> ground
      for i in 1..3 {
        C[i]: potential(e = 0.5 V/C*i*q) b -> ground
      }
    }
    scene go of still {
      time 0 s to 1 s
      trace b.e every 0.1 s
    }
    """
    assert 1e-12 < trace_of(tmp_path, text)["audit.energy"].nominal < 1e-6


BRANCHES = """
model branches {
  node a, b: electrical
  Vs: effort(e = 0.4 V) a
  R: dissipator(e = 150 ohm*f) a -> b
  D: dissipator(f = 2 mA/V*e + 3 mA/V^3*e^3) b
  M: dissipator(e = (1 ohm + 30 ohm/A^2*f^2)*f) a
  C: kinetic(p = 0.2 H*f) a -> b
  K: potential(q = 3 uF*e + 1 uF/V^2*e^3) b
}
scene go of branches {
  time 0 s to 10 ms
  accuracy 1e-7
  trace audit.dissipated, audit.supplied, R.energy, D.energy, M.energy, Vs.energy every 2 ms
}
"""


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.long
def test_what_dissipators_absorb_is_dissipated_whatever_form_their_laws_take(tmp_path, formulation):
    trace = trace_of(tmp_path, BRANCHES, formulation=formulation)
    lost = sum(trace[f"{name}.energy"].values for name in "RDM")
    assert lost[-1] > 1e-4
    assert trace["audit.dissipated"].values == pytest.approx(lost, abs=1e-6 * lost[-1])
    assert trace["audit.supplied"].values == pytest.approx(-trace["Vs.energy"].values, abs=1e-6 * lost[-1])


@pytest.mark.long
def test_what_is_supplied_is_accurate_against_what_goes_round(tmp_path):
    """A bead on a hoop that turns: its energy in the turning frame stays, and nothing is supplied; E920 before."""
    (tmp_path / "m.sd").write_text("""\
model m {
  param R = 0.5 m
  param W = 6 rad/s
  coord th: rotation = 10 deg
  let x = R*sin(th)*cos(W*t)
  let y = R*sin(th)*sin(W*t)
  let z = -R*cos(th)
  energy T* = 1/2*(1.3 kg)*(x'^2 + y'^2 + z'^2)
  energy V = (1.3 kg)*g0*z
  content D = 1/2*(0.01 N.m.s/rad)*th'^2
  init th' = 0 rad/s
}
scene s of m { time 0.3 s to 4 s; trace audit.supplied as S, th every 20 ms }
""")
    found = api.simulate(tmp_path / "m.sd", output=tmp_path / "m.h5")
    assert found.final == 1
    assert np.abs(found["S"].values).max() < 1e-12
    assert 5.0 < found["S"].nominal < 20.0
