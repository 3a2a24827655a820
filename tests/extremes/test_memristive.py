"""A dissipator whose law reads its own displacement, (R + k q^2) q' = v, has the integral R q + k q^3/3 = int v dt; one
that reads its momentum knows it.
"""

import numpy as np
import pytest
from running import ran

FORMULATIONS = ("lagrangian", "hamiltonian", "kane", "co_lagrangian", "co_hamiltonian")
LAWS = ("e = (100 ohm + k*q^2)*f", "f = e/(100 ohm + k*q^2)")
MODEL = """
component memristor {
  param k: ohm/C^2
  branch: electrical
  law LAW
}

model ladder {
  param n = 2
  node s[1..n]: electrical
  for i in 1..n {
    V[i]: effort(e = i*1 V*sin(3 rad/s*t)) s[i] -> ground
    M[i]: memristor(k = 5e6 ohm/C^2) s[i] -> ground
  }
}

scene run of ladder {
  time 0 s to 4 s
  trace M[1..n].q as q, M[1..n].f as i every 20 ms
}
"""


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.long
def test_closed_form(tmp_path, law, formulation):
    run = ran(tmp_path, MODEL.replace("LAW", law), formulation=formulation, accuracy=1e-6)
    assert run.met
    time = np.asarray(run.trace.time)
    for k in (1, 2):
        linkage = k * (1.0 - np.cos(3.0 * time)) / 3.0
        charge = np.array([_charge(value) for value in linkage])
        current = k * np.sin(3.0 * time) / (100.0 + 5e6 * charge**2)
        for name, exact in ((f"q[{k}]", charge), (f"i[{k}]", current)):
            assert np.abs(np.asarray(run.trace[name]) - exact).max() <= 1e-6 * np.abs(exact).max()


def _charge(linkage):
    roots = np.roots([5e6 / 3.0, 0.0, 100.0, -linkage])
    return roots[np.abs(roots.imag) < 1e-12].real[0]


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize(("law", "begun"), [("f = (0.01 ohm^-1 + k*p^2)*e", 0.0), ("e = f/(0.01 ohm^-1 + k*p^2)", 0.5)])
@pytest.mark.one_in(5)
def test_by_its_momentum(tmp_path, law, begun, formulation):
    """Of V = i sin 3t the linkage is begun + i (1 - cos 3t)/3, whatever the law."""
    text = (
        MODEL.replace("LAW", law).replace("ohm/C^2", "ohm^-1/Wb^2").replace("5e6", "0.2").replace(".q as q", ".p as p")
    )
    text = text.replace("s[i] -> ground\n  }", f"s[i] -> ground\n    init M[i].p = {begun} Wb\n  }}")
    run = ran(
        tmp_path,
        text.replace("  for i", "  expect static: order == 2\n  for i"),
        formulation=formulation,
        accuracy=1e-6,
    )
    assert run.met
    time = np.asarray(run.trace.time)
    for k in (1, 2):
        linkage = begun + k * (1.0 - np.cos(3.0 * time)) / 3.0
        current = k * np.sin(3.0 * time) * (0.01 + 0.2 * linkage**2)
        for name, exact in ((f"p[{k}]", linkage), (f"i[{k}]", current)):
            assert np.abs(np.asarray(run.trace[name]) - exact).max() <= 1e-6 * np.abs(exact).max()


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.long
def test_a_damper_that_reads_where_it_is(tmp_path, formulation):
    """M v' = -c (1 + (x/d)^2) v has the integral M v + c (x + x^3/(3 d^2))."""
    text = """model m {
  node x: translation
  M: kinetic(p = 1 kg*f) x
  D: dissipator(e = 2 N.s/m*(1 + (x.q/(0.1 m))^2)*f) x
  init x.q = -0.1 m
  init M.f = 1 m/s
  expect static: order == 2
}
scene s of m { time 0 s to 2 s; trace x.q as x, x.f as v every 20 ms }
"""
    run = ran(tmp_path, text, formulation=formulation, accuracy=1e-6)
    assert run.met
    x, v = np.asarray(run.trace["x"]), np.asarray(run.trace["v"])
    assert np.abs(v + 2 * (x + x**3 / 0.03) - (1 - 2 * (0.1 + 0.001 / 0.03))).max() <= 3e-6
    assert np.ptp(x) > 0.2
