"""Starts that linear rows exclude, beside laws that bend: refused by these rows, without a search."""

import pytest
from sysdyn import api
from sysdyn.runtime.start import strategies

LOOP = """
model m {
  node a, b, c: electrical
  C1: potential(q = 1 uF*e) a -> ground
  C2: potential(q = 2 uF*e) a -> b
  C3: potential(q = 3 uF*e) b -> c
  C4: potential(q = 3 uF*e) c -> ground
  D: dissipator(f = 1 nA*(exp(e/(25 mV)) - 1)) b -> c
  R: dissipator(e = 1 kohm*f) a -> c
  init C1.e = 9 V
  init C2.e = 2 V
  init C3.e = 3 V
  init C4.e = 4 V
}
scene s of m { time 0 s to 5 us; trace a.e }
"""


@pytest.mark.parametrize("formulation", ["lagrangian", "co_lagrangian"])
@pytest.mark.long
def test_voltages_around_a_loop(tmp_path, monkeypatch, formulation):
    """And a junction at 3 V, whose current of 1e43 A is nothing to search by."""
    searched = []
    followed = strategies._at_the_end
    monkeypatch.setattr(strategies, "_at_the_end", lambda *a: searched.append(a) or followed(*a))
    path = tmp_path / "m.sd"
    path.write_text(LOOP.replace("C1.e = 9 V", "C1.e = 1 V"))
    with pytest.raises(api.ModelError, match=r"E903: fixed initial values of .*'C1.e'.* contradict"):
        api.simulate(path, formulation=formulation, output=tmp_path / "t.h5")
    assert not searched


@pytest.mark.long
def test_a_node_that_its_circuit_holds_elsewhere():
    """1 V behind 3 ohm on 2 ohm, the coil without current: 0.4 V; what has nothing to do with it is not named."""
    text = """
model m {
  node p, s: electrical
  node p_: electrical = 0 V
  S: effort(e = 1 V) s
  R1: dissipator(e = 3 ohm*f) s -> p_
  R2: dissipator(e = 2 ohm*f) p_
  L: kinetic(p = 1 H*f) p_ -> ground
  C: potential(q = 1 F*e) p
  R: dissipator(e = 1 ohm*(f + f^3/(1 A^2))) p
  state w: rad/s = 0 rpm
  dynamic w' = 1 rad/s^2 - w^2/(1 rad)
  init L.f = 0 A
  init C.e = 1 V
}
scene s of m { time 0 s to 1 s; trace p_.e }
"""
    (found,) = [d for d in api.check(text) if d.severity == "error"]
    assert found.message.startswith("fixed initial values of 'p_.e' contradict ")


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.one_in(2)
def test_what_moves_a_little_with_the_value_in_the_way_is_not_named(tmp_path, formulation):
    """The least change spread over the current of a coil, 1.5e-6 of its size: it was named beside the capacitor."""
    text = """
from std.electrical import voltage, resistor, capacitor, inductor
model m {
  node a, b: electrical
  V: voltage(v = 24 V) a -> ground
  C: capacitor(C = 1 uF) a -> ground
  R: resistor(R = 10 ohm) a -> b
  L: inductor(L = 1 mH) b -> ground
  init C.e = 0 V
  init L.f = 0 A
}
scene s of m { time 0 s to 1 ms; trace L.f }
"""
    path = tmp_path / "m.sd"
    path.write_text(text)
    with pytest.raises(api.ModelError, match=r"E903: fixed initial values of 'C.e' contradict"):
        api.simulate(path, formulation=formulation, output=tmp_path / "t.h5")
