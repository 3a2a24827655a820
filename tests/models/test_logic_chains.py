"""Chains of TTL inverters (7404) begin by source stepping: their potentials beside those of ngspice."""

import re

import pytest
from start_strategies import started

GATE = """
  R1{k}: resistor(R = 4 kohm) vcc -> b{k}
  R2{k}: resistor(R = 1.6 kohm) vcc -> c{k}
  R3{k}: resistor(R = 1 kohm) e{k} -> ground
  R4{k}: resistor(R = 130 ohm) vcc -> h{k}
  Q1{k}: npn(vT = {vt} V) c = p{k}, b = b{k}, e = i{k}
  Q2{k}: npn(vT = {vt} V) c = c{k}, b = p{k}, e = e{k}
  Q3{k}: npn(vT = {vt} V) c = h{k}, b = c{k}, e = t{k}
  D{k}: diode(Is = 1e-14 A, vT = {vt} V) t{k} -> i{next}
  Q4{k}: npn(vT = {vt} V) c = i{next}, b = e{k}, e = ground"""
VT = 1.38064852e-23 * 300.15 / 1.6021766208e-19
LAST = "  RL: resistor(R = {load} ohm) i{n} -> ground"
HIGH, LOW = (3.695074272878, 3.695074345803), 2.209420369274e-2
ENDS = {1: [3.556208175886], 4: [3.694993259687, 1.811043822451e-2], 8: [3.694993259687, 1.811043822451e-2]}
"""V: of ngspice 42 (op, reltol 1e-10, gmin 1e-17) with IS = 9.9e-15, BF = 99, BR = 0.98019801980198."""


def chain(n):
    """The text of n inverters behind 0.2 V, loaded by 10 kohm beside 1 kohm."""
    nodes = [f"{name}{k}" for k in range(n) for name in "bcehpti"]
    gates = "".join(GATE.format(k=k, next=k + 1, vt=repr(VT)) for k in range(n))
    return f"""from std.electrical import voltage, resistor, npn, diode
model ttl {{
  node vcc, {", ".join(nodes)}, i{n}: electrical
  VCC: voltage(v = 5 V) vcc -> ground
  VIN: voltage(v = 0.2 V) i0 -> ground{gates}
{LAST.format(load=repr(1e4 * 1e3 / 1.1e4), n=n)}
}}
scene s of ttl {{ time 0 s to 1 us; trace i{n}.e every 1 us }}
"""


@pytest.mark.parametrize(
    ("n", "formulation"),
    [(1, "lagrangian"), (4, "co_lagrangian")]
    + [
        pytest.param(*case, marks=pytest.mark.long)
        for case in ((4, "lagrangian"), (8, "lagrangian"), (8, "co_lagrangian"))
    ],
)
def test_a_chain_of_ttl_gates_begins_as_spice_has_it(n, formulation):
    """Newton's method finds one gate; four left 0.63 of a source over, after 48 s."""
    state, system = (begun := started(chain(n), formulation)).state, begun.system
    values = {re.sub(r"('|\.multiplier)$", "", system.name(k)): state.y[k] for k in range(state.y.size)}
    expected = [HIGH[k > 0] if k % 2 == 0 else LOW for k in range(n)]
    expected[n - len(ENDS[n]) :] = ENDS[n]
    assert [values[f"i{k + 1}"] for k in range(n)] == pytest.approx(expected, rel=1e-9)
