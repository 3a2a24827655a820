"""Transistors side by side, whose body diodes are sources that a current may not leave backwards, in closed form."""

import numpy as np
import pytest
from sysdyn import api

TEXT = """
from std.electrical import resistor, voltage, mosfet

model pair {{
  node a, b: electrical
  V: voltage(v = 10 V*sin(2*pi*1 Hz*t)) a -> ground
  R: resistor(R = 4 ohm) a -> b
  Q1: mosfet(Ron = 1 ohm, vf = 0.7 V, gate = if t < 1 s then 1 else 0) d = b, s = ground
  Q2: mosfet(Ron = 2 ohm, vf = {vf} V, gate = if t < 0.4 s then 1 else 0) d = b, s = ground
}}

scene s of pair {{
  time 0 s to 2.1 s
  trace b.e
}}
"""


@pytest.mark.parametrize("vf", [0.7, 0.5])
@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "co_lagrangian"])
@pytest.mark.long
def test_two_body_diodes_side_by_side(tmp_path, vf, formulation):
    """Channels of 1 and 2 ohm divide 10 V sin beside 4 ohm; below, the diode with the least forward voltage holds."""
    (tmp_path / "pair.sd").write_text(TEXT.format(vf=vf))
    trace = api.simulate(tmp_path / "pair.sd", formulation=formulation, output=tmp_path / "out.h5")
    t = np.asarray(trace.time)
    conductance = np.where(t < 0.4, 1.5, np.where(t < 1.0, 1.0, 0.0))
    wanted = np.maximum(10.0 * np.sin(2.0 * np.pi * t) * 0.25 / (0.25 + conductance), -vf)
    beside = (np.abs(t - 0.4) > 1e-8) & (np.abs(t - 1.0) > 1e-8)
    assert np.abs(trace["b.e"].values - wanted)[beside].max() < 1e-9
    assert (wanted[beside] == -vf).sum() > 5
