"""Runs in the core with other initial values, against closed forms; what is refused, with its reason."""

import numpy as np
import pytest
import small_models as models
from sysdyn.runtime.accuracy.options import Options
from sysdyn.runtime.many.asked import DONE, END, EXTREMA, ROWS, TRACES, WHY, NotApplicableError, obstacle, way_of
from sysdyn.runtime.many.batch import Batch
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.start import consistent_start
from sysdyn.runtime.structure.structure import structure


def batch(made, method, options, **more):
    system = System(made[0], made[1], load(made[2]))
    start = consistent_start(system, 0.0)
    way, start = way_of(system, start, structure(system, start), options, method)
    return Batch(way, start, options, **more)


def options(**more):
    return Options(None, 0.0, 3.0, accuracy=1e-6, **more)


def oscillator(q, v, t):
    """q'' = -4 q."""
    return q * np.cos(2.0 * t) + v / 2.0 * np.sin(2.0 * t)


BEGUN = np.array([[0.5, 1.0], [-2.0, 0.0], [1e-3, 5.0]])


@pytest.mark.parametrize("method", ["dopri", "radau", "bdf"])
@pytest.mark.long
def test_ends_of_oscillators_from_elsewhere(method):
    made = batch(models.mass_spring(), method, options(every=0.1), keep=END)
    found = made.run(np.zeros((3, 0)), BEGUN)
    assert found.state.tolist() == [DONE] * 3
    place = made.columns.index("q_x")
    for (q, v), end, estimate in zip(BEGUN, found.end[:, place], found.estimate, strict=True):
        size = np.hypot(q, v / 2.0)
        assert estimate <= 1e-6
        assert end == pytest.approx(oscillator(q, v, 3.0), abs=3e-6 * size)


@pytest.mark.long
def test_extremes_of_oscillators_from_elsewhere():
    made = batch(models.mass_spring(), "dopri", options(every=0.01), keep=EXTREMA)
    found = made.run(np.zeros((3, 0)), BEGUN)
    place = made.columns.index("q_x")
    t = 0.01 * np.arange(301)
    for (q, v), least, most in zip(BEGUN, found.least[:, place], found.most[:, place], strict=True):
        rows = oscillator(q, v, t)
        assert (least, most) == pytest.approx((rows.min(), rows.max()), abs=3e-6 * np.hypot(q, v / 2.0))


@pytest.mark.long
def test_rows_that_are_kept_are_those_that_were_asked_for():
    thin = np.array([0, 7, 30])
    made = batch(models.mass_spring(), "dopri", options(every=0.1), keep=TRACES, thin=thin)
    found = made.run(np.zeros((3, 0)), BEGUN)
    place = made.columns.index("q_x")
    for (q, v), rows in zip(BEGUN, found.traces[:, place], strict=True):
        assert rows == pytest.approx(oscillator(q, v, 0.1 * thin), abs=3e-6 * np.hypot(q, v / 2.0))


@pytest.mark.long
def test_one_run_is_handed_back_as_a_trace():
    made = batch(models.mass_spring(), "dopri", options(every=0.1), keep=ROWS)
    trace = made.trace(np.zeros(0), np.array([-1.0, 2.0]), ())
    assert trace["q_x"].values == pytest.approx(oscillator(-1.0, 2.0, trace.time), abs=3e-6)
    assert trace.time == pytest.approx(0.1 * np.arange(31), abs=1e-12)


def test_a_constraint_is_met_from_every_anchor():
    """A rod of 2.34 m: only the fixed values are taken, what follows from the constraint is found for each run."""
    made = batch(models.pendulum(), "radau", options(every=0.1), keep=END)
    y = made.start.y[: made.system.form.written]
    begun = np.tile(y, (2, 1))
    begun[1, 0] = 2.34 * np.sin(0.25)
    found = made.run(np.zeros((2, 0)), begun)
    assert found.state.tolist() == [DONE, DONE]
    x, z = (found.end[:, made.columns.index(name)] for name in ("q1", "q2"))
    assert np.hypot(x, z) == pytest.approx([2.34, 2.34], rel=1e-12)
    v, w = (found.end[:, made.columns.index(name)] for name in ("f1", "f2"))
    energy = 0.5 * (v**2 + w**2) + 9.81 * z
    assert energy == pytest.approx(-9.81 * 2.34 * np.cos([np.pi / 18, 0.25]), rel=1e-5)


def test_a_run_that_needs_too_many_steps_has_no_result():
    made = batch(models.mass_spring(), "dopri", options(every=0.1, max_steps=5), keep=END)
    found = made.run(np.zeros((1, 0)), BEGUN[:1])
    assert WHY[found.state[0]] == "stopped"
    assert found.steps.tolist() == [5]


@pytest.mark.parametrize(
    ("more", "why"),
    [
        ({"rtol": 1e-6}, "the solver's own tolerances are given: there is no accuracy to be controlled"),
        ({"stops": np.array([1.0])}, "the text jumps or has kinks in time"),
        ({"accuracy_check": True}, "a second opinion is asked for"),
        ({"max_wall": 1.0}, "the wall time of a run is limited"),
    ],
)
@pytest.mark.one_in(2)
def test_what_the_core_does_not_do_is_refused_with_its_reason(more, why):
    assert obstacle(options(**more)) == why


def test_what_can_be_asked_in_the_core_is_not_in_its_way():
    assert obstacle(options(every=0.1)) is None
    with pytest.raises(NotApplicableError, match="the wall time of a run is limited"):
        batch(models.mass_spring(), "dopri", options(max_wall=1.0))
