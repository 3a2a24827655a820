"""What rooms of the runtime and of `analysis` find of small models, by themselves, against closed forms."""

import numpy as np
import pytest
from start_strategies import prepared_start
from sysdyn.cli.analysis.linearisation import linearise
from sysdyn.cli.analysis.states import state_of
from sysdyn.cli.export.starts import start_tables
from sysdyn.cli.export.tables import assembly_tables
from sysdyn.cli.run.events import plan
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.cli.run.verdict.culprit import undefined_at_start
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.runtime.integrate.rows.bare import by_sums, shows
from sysdyn.runtime.linear.contact_rest import ContactRest
from sysdyn.runtime.linear.rest import rests
from sysdyn.runtime.model.failures import NoSuchForm
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.gauss_newton import Solution
from sysdyn.runtime.one_underlying import refuse_undetermined
from sysdyn.runtime.start.corrections import by_corrections
from sysdyn.runtime.start.exact import anew, sharp
from sysdyn.runtime.start.flat import at_rest, flat_at, without_flow
from sysdyn.runtime.start.integrated import integrated
from sysdyn.runtime.start.starter import Starter

HANGING = """model hanging {
  param m = 1.3 kg
  param k = 52 N/m
  coord x: translation = 0.01 m
  energy T* = 1/2*m*x'^2
  energy V = 1/2*k*x^2 + m*g0*x
  output length = 2*x + 1 m
}
scene s of hanging { time 0 s to 1 s; trace x, length }
"""
DIVIDER = """model divider {
  node a, b: electrical
  S: effort(e = 10 V) a -> ground
  R1: dissipator(e = 3 Mohm*f) a -> b
  R2: dissipator(e = 2 Mohm*f) b -> ground
  C: potential(q = 1 F*e) a -> ground
}
scene s of divider { time 0 s to 1 s; trace R2.e, R1.f }
"""
VALVE = """model vessels {
  node a, b: hydraulic
  A: potential(e = 2e5 Pa/m^3*q) a -> ground
  B: potential(e = 2e5 Pa/m^3*q) b -> ground
  V: dissipator(e = 3e9 Pa.s^2/m^6*f*abs(f)) a -> b
  init A.q = 0.1 m^3
  init B.q = 0.1 m^3
}
scene s of vessels { time 0 s to 1 s; trace V.f }
"""


def start_of(text, formulation="lagrangian"):
    """(what is prepared, the system, its start, the starter, the unknowns of the start)."""
    report = Report()
    prepared, begun = prepared_start(text, formulation, report=report)
    assert begun is not None, list(report)
    starter = Starter(begun.system)
    state = begun.state
    return prepared, begun.system, state, starter, starter.unknowns(state.t, state.y, state.yd)


def at(system, y, name):
    """The value of an unknown by its name."""
    return y[[system.name(k) for k in range(y.size)].index(name)]


def test_a_mass_hangs_where_its_spring_bears_it(tmp_path):
    (tmp_path / "m.sd").write_text(HANGING)
    found, why = state_of(RunRequest(str(tmp_path / "m.sd"), backend="numpy"), None, (), Report(), rest=True)
    assert why is None
    assert at(found.system, found.state.y, "x") == pytest.approx(-1.3 * 9.80665 / 52.0, rel=1e-12)
    linear = linearise(found, ())
    assert sorted(mode.eigenvalue.imag for mode in linear.modes)[-1] == pytest.approx(np.sqrt(52.0 / 1.3), rel=1e-12)
    assert max(abs(mode.eigenvalue.real) for mode in linear.modes) < 1e-12


def test_a_ball_rests_on_its_floor_with_its_weight():
    text = """model ball {
  coord h: translation = 0.2 m
  energy T* = 1/2*(0.7 kg)*h'^2
  energy V = 0.7 kg*g0*h
  phi floor: h >= 0.05 m restitution 0.5
}
scene s of ball { time 0 s to 1 s; trace h }
"""
    prepared, system, state, _, _ = start_of(text)
    tangible = {c.name for c in prepared.compiled.energies.coordinates if c.tangible}
    (rest,) = rests(ContactRest(system, tangible, 0.0, state.y, plan(prepared, system)), 5)
    assert at(system, rest.state.y, "h") == pytest.approx(0.05, abs=1e-12)
    force = [rest.state.y[k] for k in range(system.form.written) if "floor" in system.name(k)]
    assert np.abs(force) == pytest.approx([0.7 * 9.80665], rel=1e-12)


def test_what_follows_by_constant_sums_is_known_without_settling():
    _, system, _, starter, _ = start_of(HANGING)
    state = np.array([system.name(k) in ("x", "x'") for k in range(system.form.written)])
    assert shows(system, np.ones_like(state))
    assert not shows(system, np.zeros_like(state))
    known, sums = by_sums(starter.settled, np.ones(starter.settled.unknowns, dtype=bool))
    assert known.all()
    assert sums.size == starter.settled.rows


def test_a_divider_of_megohms_is_found_from_anywhere_by_corrections():
    """2 of 5 megohms under 10 V; beside what else holds, the solution is met to its last digits, and is sharp."""
    _, system, _, starter, x = start_of(DIVIDER, "co_lagrangian")
    follows = starter.free & starter.following(0.0, x)
    away = np.where(follows, 0.3 * x, x)
    found = by_corrections(starter, 0.0, away, starter.every, follows)
    assert found.holds
    assert (found.known == follows).all()
    assert at(system, found.x[: system.form.written], "b'") == pytest.approx(4.0, rel=1e-14)
    best = Solution(x, 0.0)
    assert sharp(starter, 0.0, best, starter.free).x == pytest.approx(x, rel=1e-14, abs=1e-20)
    assert anew(starter, 0.0, best, x, x, starter.free) == (best, False), "no state has moved: it is left as it is"


@pytest.mark.long
def test_a_turbulent_valve_at_rest_has_no_slope_there_and_one_under_pressure():
    """e = k f|f|: de/df = 2 k |f| is zero at rest alone."""
    for said, flat in (("0.1", 1), ("0.3", 0)):
        _, _, _, starter, x = start_of(VALVE.replace("init A.q = 0.1", f"init A.q = {said}"))
        follows = starter.free & starter.following(0.0, x)
        found = flat_at(starter, 0.0, x, follows)
        assert bool(found.any()) == bool(flat)
        assert not without_flow(starter, 0.0, x, follows).any(), "its rate is asked for"
        assert bool(at_rest(starter, 0.0, x, follows).any()) == bool(flat), "it passes nothing, and is left alone"


def test_a_root_of_what_is_negative_at_the_start_is_named_with_its_argument():
    text = """model m {
  param a = 1 m
  coord x: translation ~ 3 m
  coord y: translation ~ 1 m
  energy T* = 1/2*(1 kg)*(x'^2 + y'^2)
  phi bar: sqrt((a - x)/(1 m)) = y/(1 m)
}
scene s of m { time 0 s to 1 s; trace x }
"""
    report = Report()
    prepared, _ = prepared_start(text, "lagrangian", report=report)
    system = System(prepared.structure, prepared.arrays, prepared.carrier)
    said, _ = undefined_at_start(prepared, system, 0.0)
    assert "sqrt" in said
    assert "-2" in said


def test_a_coordinate_without_inertia_has_no_underlying_equation():
    text = HANGING.replace("energy T* = 1/2*m*x'^2", "coord w: translation = 0 m\n  energy T* = 1/2*m*w'^2")
    text = text.replace("x: translation = 0.01 m", "x: translation ~ 0.01 m")
    _, system, state, _, _ = start_of(text)
    with pytest.raises(NoSuchForm, match=r"there is no underlying equation: .*x'"):
        refuse_undetermined(system, system.another("0"), state)


def test_tables_of_an_export_are_the_pattern_and_the_start_of_the_system():
    """Rows of a mass on a spring: its balance alone, as written, over x, x' and x''."""
    _, system, state, _, _ = start_of(HANGING)
    tables = assembly_tables(system)
    assert (tables.unknowns, tables.entries) == (system.unknowns, system.pattern.row.size)
    start = start_tables(system, state)
    assert start.known == pytest.approx([0.01, 0.0, -52.0 * 0.01 / 1.3 - 9.80665], rel=1e-14)


def test_of_a_mass_the_displacement_of_its_flow_is_integrated():
    _, _, _, starter, _ = start_of(HANGING)
    found = integrated(starter.settled)
    names = [starter.settled.name(k) for k in range(starter.settled.unknowns)]
    moved = {names[k]: names[q] for k, q in enumerate(found.moved) if q >= 0}
    assert moved == {"x'": "x"}
    assert not found.force.any()
