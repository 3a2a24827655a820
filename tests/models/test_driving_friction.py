"""Dry friction whose bound is negative, or ends with the reaction that tells it: no run goes on by it."""

import numpy as np
import pytest
from sysdyn.api import check, simulate

PRIMAL = ("lagrangian", "hamiltonian")


def driven(friction, more=""):
    return (
        f"model fr {{ node x: translation; param c = -3 N\n M: kinetic(p = 2 kg*f) x\n {friction}\n"
        f" init M.f = 3 m/s {more}}}\nscene s of fr {{ time 0 s to 2 s; trace x.f }}\n"
    )


@pytest.mark.parametrize("friction", ["R: dissipator(e = c*setsign(f)) x", "content D = c*abs(x.f)"])
def test_negative_dry_friction_is_no_dissipator(friction):
    (found,) = [d for d in check(driven(friction)) if d.severity == "error"]
    assert (found.code, found.place.start[0]) == ("E313", 3)
    assert "c = -3 N" in found.message
    assert "abs(c)" in found.help


def test_negative_dry_friction_is_refused_of_other_numbers(tmp_path):
    file = tmp_path / "m.sd"
    file.write_text(driven("R: dissipator(e = c*setsign(f)) x").replace("-3 N", "3 N"))
    with pytest.raises(Exception, match="E313"):
        simulate(file, output=tmp_path / "m.h5", set={"c": -3})


@pytest.mark.parametrize(
    ("friction", "pushed", "formulation"),
    [
        ("R: dissipator(e = (4 N - 8 N/s*t)*setsign(f)) x", "", "lagrangian"),
        ("R: dissipator(e = (4 N - 8 N/s*t)*setsign(f)) x", "; W: effort(e = 30 N) ground -> x", "hamiltonian"),
        ("R: dissipator(e = (4 N - 8 N/s*t)*setsign(f)) x", "; W: effort(e = 30 N) ground -> x", "co_lagrangian"),
        ("content D = (4 N - 8 N/s*t)*abs(x.f)", "; W: effort(e = 30 N) ground -> x", "lagrangian"),
        ("content D = (4 N - 8 N/s*t)*abs(x.f)", "", "co_hamiltonian"),
    ],
)
@pytest.mark.one_in(3)
def test_dry_friction_ends_the_run_where_it_would_drive(tmp_path, friction, pushed, formulation):
    file = tmp_path / "m.sd"
    file.write_text(driven(friction, pushed))
    with pytest.raises(Exception, match=r"drives at t = 0\.5\d* s") as raised:
        simulate(file, output=tmp_path / "m.h5", formulation=formulation)
    assert raised.value.cause == "drives"


LIFTED = """
model fr {
  coord x, y: translation = 0 m
  energy T* = 1/2*(2 kg)*(x'^2 + y'^2)
  phi floor: y >= 0 m
  R: dissipator(e = 0.3*floor.multiplier*setsign(f)) on x
  work 30 N/s*t - (2 kg)*g0 on y
  init x' = 10 m/s
}
scene s of fr { time 0 s to 1 s; trace x', floor.multiplier as N }
"""


@pytest.mark.parametrize("formulation", PRIMAL)
def test_a_bound_ends_with_the_reaction_that_tells_it(tmp_path, formulation):
    """The floor lets go at t1 = m g0/(30 N/s); until then x'' = -0.3 N/m."""
    file, t1 = tmp_path / "m.sd", 2 * 9.80665 / 30
    file.write_text(LIFTED)
    trace = simulate(file, output=tmp_path / "m.h5", formulation=formulation, accuracy=1e-7)
    wanted = [10 - 0.15 * (30 * t1 * s - 15 * s**2) for s in np.minimum(trace.time, t1)]
    assert np.abs(np.array(trace["x'"]) - wanted).max() < 1e-6
    (warned,) = [d for d in check(LIFTED) if d.severity == "warning"]
    assert (warned.code, warned.place.start[0]) == ("W705", 6)


# -- refused ----------------------------------------------------------------------------------------------------
