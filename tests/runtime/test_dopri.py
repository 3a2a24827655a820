"""DOP853 on the underlying equation: observed order, dense output, projection, stops, stiffness, refusals."""

import chain_model as chain
import numpy as np
import pytest
import small_models as models
from sysdyn.runtime.accuracy.options import Options
from sysdyn.runtime.integrate.integrate import Integration
from sysdyn.runtime.integrate.request import Request
from sysdyn.runtime.integrate.rows import settlers
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.core_library import ROW_HEAD
from sysdyn.runtime.model.failures import NoSuchForm, SolverFailure
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics import ordering
from sysdyn.runtime.simulate import simulate
from sysdyn.runtime.start.start import consistent_start
from sysdyn.runtime.trace.trace import Trace
from test_bdf import run
from test_radau import INSTANTS, KAPPA, Q1, oscillation


def dopri(made, t_end, instants=(), **request):
    return run(made, t_end, "0", 1, instants, method="dopri", **request)


def observed(errors):
    return np.log2(np.divide(errors[:-1], errors[1:]))


@pytest.mark.long
def test_order_eight_on_a_smooth_ode():
    errors = []
    for h in (0.4, 0.2, 0.1):
        columns = dopri(models.pendulum(), 4.0, INSTANTS, fixed_step=h, h_max=1.0)[1]
        errors.append(np.abs(columns["q1"] - Q1).max())
    assert (observed(errors) > 7.5).all()
    errors = []
    for h in (0.25, 0.125):
        errors.append(abs(dopri(models.mass_spring(), 10.0, fixed_step=h, h_max=1.0)[1]["q_x"][-1] - oscillation(10.0)))
    assert observed(errors)[0] > 7.2


def test_values_between_steps_have_order_seven():
    t = np.linspace(1.013, 9.97, 197)
    errors = []
    for h in (0.5, 0.25, 0.125):
        columns = dopri(models.mass_spring(), 10.0, t, fixed_step=h, h_max=1.0)[1]
        errors.append(np.abs(columns["q_x"][:-1] - oscillation(t)).max())
    assert (observed(errors) > 6.8).all()


@pytest.mark.long
def test_multipliers_between_steps():
    t = np.append(np.linspace(0.01, 0.39, 20), INSTANTS)
    for rtol, allowed in ((1e-6, 1e-8), (1e-12, 1e-12)):
        rows, columns, _ = dopri(models.pendulum(), 4.0, t, rtol=rtol)
        assert np.abs(columns["kappa1"][-3:] - KAPPA).max() < allowed
        assert rows[:, 7].max() < 1e-14


@pytest.mark.parametrize("form", ["lagrangian", "hamiltonian"])
@pytest.mark.long
def test_error_falls_with_the_tolerance(form):
    errors, steps = [], []
    for rtol in (1e-9, 1e-12):
        _, columns, finished = dopri(models.pendulum(form), 4.0, INSTANTS, rtol=rtol)
        errors.append(np.abs(columns["q1"] - Q1).max())
        steps.append(finished.statistics.steps)
    assert errors[0] < 1e-8
    assert errors[1] < 1e-11
    assert steps[1] < 90
    assert np.log(errors[0] / errors[1]) / np.log(steps[1] / steps[0]) > 5.0


@pytest.mark.parametrize("form", ["lagrangian", "hamiltonian"])
@pytest.mark.long
def test_energy_is_integrated_with_the_order_of_the_method(form):
    rows = dopri(models.dc_motor(form), 0.6, np.linspace(0, 0.6, 7), rtol=1e-9)[0]
    assert np.abs(rows[:, 6]).max() < 1e-9 * rows[:, 5].max()


@pytest.mark.parametrize("form", ["lagrangian", "hamiltonian"])
@pytest.mark.long
def test_the_balance_of_energy_between_steps_is_as_good_as_at_them(form):
    """Ten rows a step share the powers at eight of its points; each by itself they were a thousand times as far off."""
    rows = dopri(models.pendulum(form), 4.0, np.linspace(0.0, 4.0, 401), rtol=1e-6)[0]
    assert np.abs(rows[:, 6]).max() < 1e-8 * rows[:, 2].max()
    rows = dopri(models.dc_motor(form), 0.6, np.linspace(0.0, 0.6, 601), rtol=1e-9)[0]
    assert np.abs(rows[:, 6]).max() < 1e-9 * rows[:, 5].max()


def drift(made, t_end, form, method, rtol):
    """Largest residual of a constraint at the last accepted point itself (rows of the trace are settled)."""
    manifest, binding, module = made
    system = System(manifest, binding, load(module), form)
    request = Request(t_end, np.array([t_end]), every_step=False, index=1, rtol=rtol, method=method)
    integration = Integration(system, consistent_start(system, 0.0), request)
    finished = integration.run(lambda rows: None)
    assert finished.reached == t_end
    y, yd = integration.method.point()
    return np.abs(system.another("constraints").residual(t_end, y, yd)).max()


@pytest.mark.parametrize("family", ["lagrangian", "hamiltonian"])
@pytest.mark.long
def test_no_drift_over_a_long_span(family):
    # without projection 0.3 and 0.6 (seed README, section 6, 12)
    assert drift(models.pendulum(family), 400.0, "0", "dopri", 1e-4) < 1e-14
    assert drift(models.slider_crank(form=family), 100.0, "0", "dopri", 1e-4) < 1e-14


@pytest.mark.parametrize("method", ["bdf", "radau"])
@pytest.mark.parametrize("form", ["1", "0"])
@pytest.mark.long
def test_differentiated_rows_are_projected_after_each_step(monkeypatch, method, form):
    assert drift(models.pendulum(angle=2.0), 40.0, form, method, 1e-4) < 1e-12
    monkeypatch.setattr(settlers, "PROJECTED", ())
    assert drift(models.pendulum(angle=2.0), 40.0, form, method, 1e-4) > 1e-3


@pytest.mark.long
def test_counters_are_deterministic():
    found = [dopri(models.slider_crank(), 4.0, rtol=1e-8)[2].statistics for _ in range(2)]
    assert found[0] == found[1]
    assert found[0].newton_failures == 0


def stiff(rate=1e6):
    return models.small(
        "x",
        "f_x**2/2",
        potential="q_x**2/2",
        states={"a": f"{rate}*(cos(q_x) - s_a)"},
        initial={"q_x": (1, True), "f_x": (0, True), "s_a": (1, True)},
        observe={"a": "s_a"},
    )


def simulated(tmp_path, made, t_end=4.0, **options):
    manifest, binding, module = made
    return simulate(manifest, binding, load(module), Options(tmp_path / "t.h5", 0.0, t_end, **options))


def test_stiffness_is_seen(tmp_path):
    with pytest.raises(SolverFailure) as caught:
        simulated(tmp_path, stiff(), method="dopri")
    assert caught.value.cause == "stiff"
    outcome = simulated(tmp_path, stiff(), index="0")
    assert (outcome.method, outcome.index) == ("radau", "0")
    # worth while none the less
    assert simulated(tmp_path, stiff(100.0), method="dopri").method == "dopri"


@pytest.mark.long
def test_a_system_much_faster_than_its_motion_is_left_to_radau(tmp_path):
    """What follows at 100/s a motion of 1/s holds an explicit method to short steps, though none is at the boundary."""
    left = simulated(tmp_path, stiff(100.0), index="0", accuracy=1e-6)
    other = Trace.open(tmp_path / "t.h5")["a"][-1]
    held = simulated(tmp_path, stiff(100.0), method="dopri", accuracy=1e-6)
    assert (left.method, held.method) == ("radau", "dopri")
    assert left.statistics["steps"] < 0.5 * held.statistics["steps"]
    assert abs(Trace.open(tmp_path / "t.h5")["a"][-1] - other) < 2e-6


@pytest.mark.long
def test_index_zero_takes_dopri_and_dopri_index_zero(tmp_path):
    for options in ({"index": "0"}, {"method": "dopri"}, {"index": "0", "method": "dopri"}):
        outcome = simulated(tmp_path, models.pendulum(), accuracy=1e-9, at=tuple(INSTANTS), **options)
        assert (outcome.method, outcome.index, outcome.warnings) == ("dopri", "0", ())
        trace = Trace.open(tmp_path / "t.h5")
        at = [int(np.argmin(np.abs(trace.time - t))) for t in INSTANTS]
        assert np.abs(np.asarray(trace["q1"])[at] - Q1).max() < 1e-9
    for method in ("bdf", "radau"):
        outcome = simulated(tmp_path, models.pendulum(), index="0", method=method)
        assert (outcome.method, outcome.index) == (method, "0")


def test_what_has_no_underlying_equation_is_refused(tmp_path):
    with pytest.raises(NoSuchForm, match="coordinates without inertia"):
        simulated(tmp_path, models.springs(), index="0")
    with pytest.raises(NoSuchForm, match="index 2 was asked for"):
        simulated(tmp_path, models.pendulum(), method="dopri", index="2")
    # without inertia of its own, but determined by the constraint
    assert simulated(tmp_path, models.slider_crank(m1=0.0), 0.5, index="0").method == "dopri"


@pytest.mark.long
def test_a_step_ends_where_the_text_jumps():
    made = models.small(
        "x",
        "f_x**2/2",
        work={"x": "Piecewise((0, t < 1.2345), (1, True))"},
        initial={"q_x": (0, True), "f_x": (0, True)},
        observe={"x": "q_x"},
    )
    columns = dopri(made, 3.0, rtol=1e-9, stops=np.array([1.2345]))[1]
    assert columns["x"][-1] == pytest.approx(0.5 * (3.0 - 1.2345) ** 2, rel=1e-12)


@pytest.mark.long
def test_a_rail_that_jumps_between_stages_is_passed_in_small_steps():
    """No stage sees it: the projection would carry the mass across, 2 m in no time, and no error test would know."""
    made = models.small(
        "x y",
        "(f_x**2 + f_y**2)/2",
        "q_x**2/2",
        phi={"rail": "q_y - tanh(1e6*(t - 1.003))"},
        initial={"q_x": (1, True), "f_x": (0, True), "q_y": (-1, False)},
        observe={"x": "q_x", "v": "f_y"},
    )
    t = 1.003 + 1e-7 * np.linspace(-9, 9, 37)
    columns = dopri(made, 3.0, t, rtol=1e-6)[1]
    assert columns["v"][:-1] == pytest.approx(1e6 / np.cosh(1e6 * (t - 1.003)) ** 2, abs=10.0)
    assert columns["x"][-1] == pytest.approx(np.cos(3.0), abs=1e-5)


@pytest.mark.long
def test_sparse_and_dense_factors_give_the_same(monkeypatch):
    system = System({"structure": chain.structure()}, chain.binding(6), load(chain.Chain), "0")
    state = consistent_start(system, 0.0)
    found = []
    for limit in (50, 0):
        monkeypatch.setattr(ordering, "DENSE", limit)
        request = Request(0.5, np.linspace(0, 0.5, 6), every_step=False, index=1, method="dopri", rtol=1e-9)
        rows = []
        Integration(system, state, request).run(rows.append)
        found.append(np.concatenate(rows))
    assert np.abs(found[0] - found[1])[:, ROW_HEAD:].max() < 1e-9


@pytest.mark.parametrize("policy", ["drop", "minimum_norm"])
@pytest.mark.long
def test_redundant_constraints(tmp_path, policy):
    one = {"one": "q_x**2 + q_y**2 - 1"}
    both = {**one, "two": "q_x**2/2 + q_y**2/2 - 1/2"}
    ends = []
    for phi in (one, both):
        made = models.small(
            "x y",
            "(f_x**2 + f_y**2)/2",
            potential="9.81*q_y",
            phi=phi,
            initial={"q_x": (0.6, True), "q_y": (-0.8, False), "f_x": (0, True)},
            observe={"x": "q_x", **{name: f"kappa_{name}" for name in phi}},
        )
        outcome = simulated(tmp_path, made, index="0", accuracy=1e-9, redundancy=policy)
        assert (outcome.method, outcome.warnings) == ("dopri", ())
        trace = Trace.open(tmp_path / "t.h5")
        ends.append({name: trace[name].values[-1] for name in trace.names})
    assert ends[1]["x"] == pytest.approx(ends[0]["x"], abs=1e-8)
    # kappa_one + kappa_two / 2 makes the reaction; the least of them is (4, 2) / 5 of it
    share = {"drop": (1.0, 0.0), "minimum_norm": (0.8, 0.4)}[policy]
    for name, part in zip(("one", "two"), share, strict=True):
        assert ends[1][name] == pytest.approx(part * ends[0]["one"], abs=1e-7)
