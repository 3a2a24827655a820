"""Models, or parts, without a motion of their own: all follows a source at once, and no step has an error that its
test could see.  The accuracy asked holds all the same, and the ledgers, which are sums over the steps, balance.
"""

import numpy as np
import pytest
from model_runs import FOUR, trace_of
from scipy.special import lambertw

TEXT = """
model still {{
  node a: electrical
  node x: translation
  V: effort(e = 3 V*sin(2 rad/s*t)^5) a -> ground
  R: dissipator(e = 2 ohm*f) a -> ground
  F: effort(e = 0.2 N*sin(3 rad/s*t)^5) ground -> x
  K: potential(e = 1.9 N/m*q) x -> ground
  {more}
}}
scene run of still {{
  time 0 s to 2 s
  trace R.f, K.e, K.f every 0.1 s
  accuracy 1e-7
}}
"""
MORE = {"alone": "", "beside a capacitor": "C: potential(q = 0.1 F*e) a -> ground"}


@pytest.mark.parametrize("more", MORE)
@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.one_in(12)
def test_what_follows_its_source_at_once(tmp_path, formulation, more):
    """f = v/R; a spring under a force: its rate is that of the force over k."""
    trace = trace_of(tmp_path, TEXT.format(more=MORE[more]), scene="run", formulation=formulation)
    t = trace.time
    assert trace.attributes["met"] == 1
    for name, law in {
        "R.f": 1.5 * np.sin(2 * t) ** 5,
        "K.e": 0.2 * np.sin(3 * t) ** 5,
        "K.f": 3.0 / 1.9 * np.sin(3 * t) ** 4 * np.cos(3 * t),
    }.items():
        assert np.abs(trace[name].values - law).max() < 1e-7 * np.abs(law).max(), name


@pytest.mark.long
def test_energy_is_asked_of_the_ledger_alone(tmp_path):
    """A resistor behind a source: the accuracy is met by any step, its energy by short ones."""
    lines = TEXT.format(more="").splitlines()
    text = "\n".join(line for line in lines if not line.lstrip().startswith(("node x", "F:", "K:")))
    text = text.replace(", K.e, K.f", ", audit.dissipated, audit.energy")
    trace = trace_of(tmp_path, text, scene="run", formulation="lagrangian")
    # the integral of sin^10 over s: 63/256 s and sines of 2s to 10s
    s = 4.0
    sines = zip((-210, 120, -45, 10, -1), (2, 4, 6, 8, 10), strict=True)
    work = (126 * s + sum(c * np.sin(k * s) / k for c, k in sines)) / 512
    assert abs(trace["audit.dissipated"].values[-1] - 4.5 / 2 * work) < 1e-5
    assert np.abs(trace["audit.energy"].values).max() < 1e-6 * 4.5


DIODE = """
model clipper {
  param Is = 1 pA
  param vT = 25.85 mV
  node a, b: electrical
  V: effort(e = 5 V*sin(2*pi*50 Hz*t)) a -> ground
  R: dissipator(e = 100 ohm*f) a -> b
  D: dissipator(f = Is*(exp(e/vT) - 1)) b -> ground
}
scene run of clipper { time 0 s to 60 ms; trace R.f, D.e every 0.1 ms }
"""


@pytest.mark.parametrize("method", ["dopri", "radau", "bdf", "rosenbrock", "energy"])
@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.one_in(30)
def test_a_diode_that_follows_its_source_between_long_steps(tmp_path, formulation, method):
    """i R + vT ln(1 + i/Is) = V; of it there is a closed form in Lambert's W.  No step of dopri has an error here, and
    its polynomial may be anywhere between: rows of 6e23 A were said to hold, in magnitudes that such points had left.
    """
    trace = trace_of(tmp_path, DIODE, scene="run", formulation=formulation, method=method)
    volts = 5.0 * np.sin(100.0 * np.pi * trace.time)
    inner = 1e-12 * 100.0 / 25.85e-3 * np.exp((volts + 1e-10) / 25.85e-3)
    amperes = 25.85e-3 / 100.0 * lambertw(inner).real - 1e-12
    assert np.abs(trace["R.f"].values - amperes).max() < 1e-9 * np.abs(amperes).max()
    assert np.abs(trace["D.e"].values - (volts - 100.0 * amperes)).max() < 1e-8


@pytest.mark.parametrize("accuracy", [4.6e-4, 1e-5, 1e-7])
def test_a_root_of_a_law_that_follows_its_source(tmp_path, accuracy):
    """u/R = v/R + k v^3 beside a capacitor that stays empty: no error has a test, and Newton's iteration for all stages
    took its second correction for round-off wherever those of the state were (1e6 V, told as met).
    """
    text = """
    model cubic {
      param G = 0 S
      param G1 = 0 S
      param R5 = 1 ohm
      param k = 1 S/V^2
      param C = 1 F
      node u, v, w, x: electrical
      source: effort(e = 2 V*sin(1.906 rad/s*t)) u -> ground
      feed: dissipator(e = 2.553 ohm*f) v -> u
      load: dissipator(f = G1*e + k*e^3) v -> ground
      left: dissipator(e = 0.362 ohm*f) w -> u
      leak: dissipator(f = G*e) x -> w
      store: potential(q = C*e) x -> w
      right: dissipator(e = R5*f) ground -> w
    }
    scene run of cubic {
      time 0 s to 4 s
      solver radau
      trace v.e as v every 0.05 s
    }
    """
    trace = trace_of(tmp_path, text, scene="run", formulation="co_hamiltonian", accuracy=accuracy)
    source = 2.0 * np.sin(1.906 * trace.time)
    roots = [np.roots([2.553, 0.0, 1.0, -u]) for u in source]
    real = np.array([next(r.real for r in found if abs(r.imag) < 1e-9) for found in roots])
    assert np.abs(trace["v"] - real).max() < 1e-9


def test_a_ledger_is_balanced_however_light_the_method(tmp_path):
    """The ledger of a run in which little happens: E921 by 1.03 of the limit with 200 steps of the bdf."""
    text = """
    model light {
      param C0 = 0 F
      node a, b, c: electrical
      V: effort(e = 2 V*sin(1.085 rad/s*t)) a -> ground
      M: dissipator(e = 0.462 ohm*f + 1 ohm/A^2*f^3) b -> a
      one: potential(q = C0*e) c -> b
      two: potential(q = 0.915 F*e) ground -> c
      three: potential(q = C0*e) a -> b
      R: dissipator(e = 2.994 ohm*f) a -> ground
    }
    scene run of light {
      time 0 s to 4 s
      accuracy 1e-5
      trace R.f every 0.05 s
    }
    """
    trace = trace_of(tmp_path, text, scene="run", formulation="hamiltonian")
    assert trace.attributes["met"] == 1
    assert np.abs(trace["R.f"] - 2.0 / 2.994 * np.sin(1.085 * trace.time)).max() < 1e-9


@pytest.mark.long
def test_what_follows_at_once_is_no_round_off_where_nothing_flows(tmp_path):
    """Resistors and inductors of 0 H behind a source that feeds nothing: of flows of 1e-32 A no magnitude follows, and
    efforts of 2 V are no round-off (6.6e-2 V off within steps, told as met, with an error below round-off).
    """
    text = """
    model idle {
      param L = 1 H
      param L0 = 0 H
      node a, b, c, d: electrical
      V: effort(e = 2 V*sin(2.599 rad/s*t)) a -> ground
      M1: dissipator(e = 1 ohm*f + 1 ohm/A^2*f^3) b -> a
      K2: dissipator(f = 0.51 S*e + 0.51 S*e^3/(1 V^2)) c -> b
      L3: kinetic(p = L*f) d -> b
      L4: kinetic(p = L0*f) d -> b
      G5: dissipator(f = 1.09 S*e) c -> d
      M6: dissipator(e = 1.237 ohm*f + 1 ohm/A^2*f^3) d -> a
      L7: kinetic(p = L0*f) d -> c
    }
    scene run of idle {
      time 0 s to 4 s
      trace c.e as c every 0.05 s
    }
    """
    trace = trace_of(tmp_path, text, scene="run", formulation="hamiltonian")
    assert np.abs(trace["c"] - 2.0 * np.sin(2.599 * trace.time)).max() < 2e-4
