"""Ports of components that are bound to coordinates of the author: what stands inside, and what goes through them."""

import numpy as np
import pytest
from sysdyn.api import check, simulate

MODEL = """from std.mechanical import mass
component plates {
  port x: translation
  branch c: electrical
  energy V = c.q^2*(1 m - x.q)/(2*(1 F.m))
  K: potential(e = 2 N/m*q) x -> ground
  Z: dissipator(e = 0.1 N.s/m*f) x -> ground
  output speed = x.f
}
model m {
  node a: electrical
  R: dissipator(e = 1 ohm*f) a -> ground
  KIND x: translation = 0.1 m
  MASS
  P: plates() x = x, c = a -> ground
  init P.c.q = 1 C
  init x.f = 0 m/s
}
scene s of m {
  time 0 s to 1 s
  trace x.q as x, P.speed as v, P.x.e as e, energy_through(P.x) as taken, P.c.e as u
}
"""
MASS = {"coord": "energy T* = 1/2*(1 kg)*x'^2", "node": "M: mass(m = 1 kg) x"}


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.one_in(2)
def test_a_coordinate_is_a_node_to_the_inside_of_a_component(formulation, tmp_path):
    """A fault in sysdyn before; of elements alone inside, P.x.e was zero."""
    path, found = tmp_path / "m.sd", {}
    for kind, mass in MASS.items():
        path.write_text(MODEL.replace("KIND", kind).replace("MASS", mass))
        found[kind] = simulate(path, output=tmp_path / f"{kind}.h5", formulation=formulation, accuracy=1e-6)
    for name in ("x", "v", "e", "taken", "u"):
        other = found["node"][name].values
        assert np.abs(found["coord"][name].values - other).max() <= 1e-12 * np.abs(other).max()
    x, v, e = (found["coord"][name].values for name in ("x", "v", "e"))
    pull = (found["coord"]["u"].values / (1.0 - x)) ** 2 / 2.0  # of c.q = u/(1 - x)
    assert np.abs(e - (2.0 * x + 0.1 * v - pull)).max() < 1e-12
    moves = 0.5 * (v**2)
    assert np.abs(found["coord"]["taken"].values + moves).max() < 1e-6 * moves.max()


def test_energy_that_goes_through_a_port_is_written_as_it_is_read():
    text = MODEL.replace("KIND", "coord").replace("MASS", MASS["coord"])
    (told,) = check(text.replace("energy_through(P.x)", "P.energy_through(x)"))
    assert (told.code, told.help) == ("E102", "energy_through(P.x)")


BEADS = """component bead {
  param m = 1 kg
  port x[1..2]: translation
  energy T* = 1/2*m*(x[1].f^2 + x[2].f^2)
  energy V = m*g0*x[2].q + 1/2*(3 N/m)*x[1].q^2
  K: potential(e = 5 N/m*q) x[1] -> x[2]
}
model m {
  KIND x[1..2], y[1..2]: translation
  B: bead() x = x
  C: bead(m = 2 kg) x = y
  phi tie: x[1]READ = y[1]READ
  for i in 1..2 {
    init x[i]READ = 0.1 m*i
    init x[i].f = 0 m/s
  }
  init y[2]READ = 0 m
  init y[2].f = 0 m/s
}
scene s of m { time 0 s to 0.3 s; trace x[2].q as x, y[2].q as y, B.K.e as e }
"""


def test_an_array_of_ports_takes_an_array_of_coordinates(tmp_path):
    """Refused before (E805), though coordinates of mechanics are nodes."""
    path, found = tmp_path / "m.sd", {}
    for kind, read in (("coord", ""), ("node", ".q")):
        path.write_text(BEADS.replace("KIND", kind).replace("READ", read))
        found[kind] = simulate(path, output=tmp_path / f"{kind}.h5", accuracy=1e-6)
    for name in ("x", "y", "e"):
        other = found["node"][name].values
        assert np.abs(found["coord"][name].values - other).max() <= 1e-12 * np.abs(other).max()
