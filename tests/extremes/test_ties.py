"""Constraints whose coefficients read no displacement are transformers: the complementary forms have them too."""

import numpy as np
import pytest
from running import ran

FORMULATIONS = ("lagrangian", "co_lagrangian", "co_hamiltonian")
PULLEY = """
model m {
  param r = 0.1 m
  node a, b: translation
  node w: rotation
  work 4 N on a.q
  A: kinetic(p = 1 kg*f) a; B: kinetic(p = 2 kg*f) b; J: kinetic(p = 0.02 kg.m^2*f) w
  psi pulley: a.f + b.f = 2*r*w.f + 0.3 m/s*cos(5 rad/s*t)
  init A.f = 0.5 m/s; init B.f = 0.2 m/s
}
scene s of m { time 0 s to 2 s; trace a.f, b.f, w.f, pulley.multiplier as mu, pulley.on(w.q) as M every 50 ms }
"""
CORE = """
component core {
  branch p: electrical; branch q: electrical; branch r: electrical
  psi mmf: 3*p.f - q.f - 2*r.f = 0.2 A*sin(30 rad/s*t)
}
model m {
  node a, b, c: electrical
  U: effort(e = 5 V) a -> ground
  L: kinetic(p = 0.1 H*f) a -> b
  K: kinetic(p = 0.02 H*f) c -> ground
  X: core() p = b -> ground, q = c -> ground, r = ground -> a
  init L.f = 0.4 A
}
scene s of m { time 0 s to 0.3 s; trace L.f, K.f, X.mmf.multiplier as mu, X.r.f as i every 5 ms }
"""
TRAIN = """
model m {
  param n = 4
  node x: translation
  node w[1..n]: rotation
  T: effort(e = 1 N.m) ground -> w[1]
  for i in 1..n { J[i]: kinetic(p = 0.1 kg.m^2*f) w[i] }
  for i in 1..n-1 { psi mesh[i]: w[i].f = 2*w[i + 1].f }
  phi rolls: x.q = 0.5 m*w[n].q + 0.1 m
  init w[n].q = 0.4
  init w[1].f = 1 rad/s
}
scene s of m { time 0 s to 2 s; trace x.q, w[1].f, w[n].q as th, mesh[1].multiplier as mu every 50 ms }
"""
LAWS = """
model m {
  node a, c: electrical
  node x, y: translation
  U: effort(e = 10 V) a -> ground
  R: dissipator(e = 5 ohm*f) a -> ground
  L: kinetic(p = 0.1 H*f) a -> c
  S: dissipator(e = 2 ohm*f) c -> ground
  psi tie: R.f = 2*L.f
  F: effort(e = 3 N) ground -> x
  M: kinetic(p = 1 kg*f) x; N: kinetic(p = 2 kg*f) y
  D: dissipator(e = 2 N.s/m*f) y -> ground
  psi link: D.f = 0.2*x.f
  init L.f = 0.5 A; init M.f = 0 m/s
}
scene s of m { time 0 s to 0.3 s; trace R.f, R.e, tie.multiplier as mu, x.f, D.e, link.multiplier as nu every 5 ms }
"""


def pulley(t):
    """M f' = F - A mu, A.f = b."""
    a, m, push = np.array([1.0, 1.0, -0.2]), np.array([1.0, 2.0, 0.02]), np.array([4.0, 0.0, 0.0])
    given, rate, grown = 0.3 * np.cos(5 * t), -1.5 * np.sin(5 * t), 0.3 * np.cos(5 * t) - 0.3
    whole, of_push = a @ (a / m), a @ (push / m)
    f = {
        k: start + push[k] / m[k] * t - a[k] / m[k] * (of_push * t - grown) / whole for k, start in ((0, 0.5), (1, 0.2))
    }
    mu = (of_push - rate) / whole
    return {"a.f": f[0], "b.f": f[1], "w.f": (f[0] + f[1] - given) / 0.2, "mu": mu, "M": 0.2 * mu}


def core(t):
    """The third winding is at 5 V: -5 V = -2 mu."""
    currents = 0.4 - 25 * t, -125 * t
    third = (3 * currents[0] + currents[1] - 0.2 * np.sin(30 * t)) / 2
    return {"L.f": currents[0], "K.f": currents[1], "mu": np.full_like(t, 2.5), "i": third}


def laws(t):
    """In series with R and L, and beside D, of which each keeps its law."""
    current = 30 / 22 + (0.5 - 30 / 22) * np.exp(-220 * t)
    speed, push = 3 / 0.08 * (1 - np.exp(-0.08 / 1.08 * t)), 3 / 1.08 * np.exp(-0.08 / 1.08 * t)
    drawn = {"R.f": 2 * current, "R.e": 10 * current, "mu": 10 - 10 * current}
    return drawn | {"x.f": speed, "D.e": 0.4 * speed, "nu": -0.4 * (push + speed)}


def train(t):
    inertia = 0.1 * (1 + 1 / 4 + 1 / 16 + 1 / 64)
    turned = 0.4 + (t + t**2 / 2 / inertia) / 8
    rest = np.full_like(t, 1 - 0.1 / inertia)
    return {"x.q": 0.5 * turned + 0.1, "w[1].f": 1 + t / inertia, "th": turned, "mu": rest}


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize(("text", "exact"), [(PULLEY, pulley), (TRAIN, train), (CORE, core), (LAWS, laws)])
@pytest.mark.long
def test_closed_form(tmp_path, formulation, text, exact):
    run = ran(tmp_path, text, formulation=formulation, accuracy=1e-6)
    assert run.met
    for name, value in exact(np.asarray(run.trace.time)).items():
        assert np.abs(np.asarray(run.trace[name]) - value).max() <= 1e-6 * np.abs(value).max(), name


def test_what_depends_on_a_displacement_is_told_still(tmp_path):
    text = PULLEY.replace("2*r*w.f", "2*r*cos(w.q)*w.f")
    assert ran(tmp_path, text, formulation="co_lagrangian").refused == "E602"
