"""Linearisations of texts, and what they are compared with."""

import numpy as np
from texts import ROOT, run_json

CLOSE = 1e-10

SEED = ROOT / "models" / "seed"

PRIMAL = ("lagrangian", "hamiltonian")

ALL = (*PRIMAL, "co_lagrangian", "co_hamiltonian")


def linear(capsys, path, *options):
    code, found = run_json(capsys, "linearize", str(path), "--backend", "numpy", *options)
    assert code == 0, found["diagnostics"]
    return found["result"]


def values(pairs):
    return np.array([complex(*p) for p in pairs])


def alike(found, expected, close=CLOSE):
    """Every value of one set stands near one of the other, both ways, relative to the largest."""
    found, expected = list(np.atleast_1d(found)), list(np.atleast_1d(expected))
    assert len(found) == len(expected), (found, expected)
    size = max(map(abs, expected), default=1.0)
    for value in expected:
        near = min(range(len(found)), key=lambda k: abs(found[k] - value))
        assert abs(found.pop(near) - value) <= close * size, (found, expected)


RLC = """
model rlc {
  param R = 3 ohm
  param L = 0.5 H
  param C = 0.02 F
  input u: V = 0 V
  node s, a, b: electrical
  supply: effort(e = u) s -> ground
  r: dissipator(e = R*f) s -> a
  l: kinetic(p = L*f) a -> b
  c: potential(q = C*e) b -> ground
}
scene at_rest of rlc { time 0 s to 1 s; trace c.e as v, l.f as i, r.e as v_r, l.e as v_l }
"""
