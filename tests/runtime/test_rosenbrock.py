"""Rodas5P: order, dense output, what is slaved within steps, stiff laws, refusals, when auto takes and leaves it."""

import numpy as np
import pytest
import small_models as models
from sysdyn.runtime.accuracy.options import Options
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.failures import NoSuchForm, SolverFailure
from sysdyn.runtime.simulate import simulate
from sysdyn.runtime.trace.trace import Trace
from test_bdf import run
from test_dopri import observed
from test_radau import INSTANTS, KAPPA, Q1, oscillation


def rosenbrock(made, t_end, instants=(), form="3", index=1, **request):
    return run(made, t_end, form, index, instants, method="rosenbrock", **request)


def simulated(tmp_path, made, t_end, **options):
    manifest, binding, module = made
    path = tmp_path / "t.h5"
    asked = Options(path, 0.0, t_end, **{"every": t_end / 40, "timings": False, **options})
    outcome = simulate(manifest, binding, load(module), asked)
    return outcome, Trace.open(path)


def relaxing(rate, form="lagrangian"):
    """q' = f, f / rate + q = cos t (a damper at a spring that is moved): q pulled to the source with `rate` (1/s)."""
    start = {"q_x": (1, True)}
    return models.small("x", "0", "q_x**2/2", f"f_x**2/{2 * rate}", {"x": "cos(t)"}, initial=start, form=form)


def relaxed(rate, t):
    """Closed form of `relaxing` from 1."""
    a = rate**2 / (1 + rate**2)
    return a * (np.cos(t) + np.sin(t) / rate) + (1 - a) * np.exp(-rate * t)


def test_order_five_on_a_smooth_ode():
    errors = []
    for h in (0.25, 0.125, 0.0625):
        columns = rosenbrock(models.mass_spring(), 10.0, fixed_step=h, rtol=1e-12)[1]
        errors.append(abs(columns["q_x"][-1] - oscillation(10.0)))
    assert (observed(errors) > 4.8).all()


@pytest.mark.parametrize("family", ["lagrangian", "hamiltonian"])
@pytest.mark.long
def test_order_five_of_constraints_whose_matrix_moves(family):
    errors = []
    for h in (0.1, 0.05, 0.025):
        columns = rosenbrock(models.pendulum(family), 4.0, INSTANTS, "1", fixed_step=h, rtol=1e-12)[1]
        errors.append(max(np.abs(columns["q1"] - Q1).max(), np.abs(columns["kappa1"] - KAPPA).max()))
    assert (observed(errors) > 4.8).all()


@pytest.mark.long
def test_inertia_that_depends_on_the_position():
    # a bead on a wheel's spoke: E = dF/dyd moves; closed form r = r0 cosh(w t), w = 3 held by a constraint on the flow
    made = models.small(
        "r a",
        "f_r**2/2 + q_r**2*f_a**2/2",
        psi={"motor": "f_a - 3"},
        initial={"q_r": (0.1, True), "q_a": (0, True), "f_r": (0, True)},
        source_power="-3*mu_motor",
    )
    errors = []
    for h in (0.05, 0.025, 0.0125):
        columns = rosenbrock(made, 1.0, [1.0], "1", fixed_step=h, rtol=1e-12)[1]
        errors.append(abs(columns["q_r"][-1] - 0.1 * np.cosh(3.0)))
    assert (observed(errors) > 4.8).all()
    rows, _, _ = rosenbrock(models.slider_crank(), 4.0, np.linspace(0, 4, 41), "1", rtol=1e-8)
    assert np.abs(rows[:, 6]).max() < 1e-8  # of 3 J


def test_order_where_time_stands_in_the_equations():
    errors = []
    for h in (0.2, 0.1, 0.05):
        columns = rosenbrock(relaxing(2.0), 3.0, fixed_step=h, rtol=1e-12)[1]
        errors.append(abs(columns["q_x"][-1] - relaxed(2.0, 3.0)))
    assert (observed(errors) > 4.8).all()


def test_values_between_steps_have_order_five_too():
    t = np.linspace(1.013, 9.97, 197)
    errors = []
    for h in (0.2, 0.1, 0.05):
        columns = rosenbrock(models.mass_spring(), 10.0, t, fixed_step=h, rtol=1e-12)[1]
        errors.append(np.abs(columns["q_x"][:-1] - oscillation(t)).max())
    assert (observed(errors) > 4.8).all()


@pytest.mark.parametrize("rate", [1.0, 1e3, 1e5])
@pytest.mark.parametrize("rtol", [1e-2, 1e-4])
@pytest.mark.long
def test_error_within_steps_of_what_is_pulled_to_a_source(rate, rtol):
    # steps alone would not see it: whatever they are, their ends lie on the source
    t = np.linspace(0, 10, 501)
    _, columns, finished = rosenbrock(relaxing(rate), 10.0, t, rtol=rtol)
    assert np.abs(columns["q_x"] - relaxed(rate, t)).max() < 6 * rtol
    assert finished.statistics.steps < 500


@pytest.mark.long
def test_tolerance_against_error_and_work():
    t = np.linspace(0, 10, 101)
    for rtol, steps in ((1e-3, 25), (1e-6, 65), (1e-9, 250)):
        _, columns, finished = rosenbrock(models.mass_spring(), 10.0, t, rtol=rtol)
        assert np.abs(columns["q_x"] - oscillation(t)).max() < 3 * rtol
        assert finished.statistics.steps < steps


@pytest.mark.parametrize("part", [1.0, 1e-2])
@pytest.mark.long
def test_a_run_opens_with_the_step_that_the_one_before_found_fit(part):
    """With another tolerance too: as exact as one that looks for it, in fewer steps."""
    draft = rosenbrock(models.mass_spring(), 2.0, rtol=1e-4)[2]
    t, found = np.linspace(0, 2, 81), []
    for opening in (0.0, draft.opening):
        _, columns, finished = rosenbrock(models.mass_spring(), 2.0, t, rtol=1e-4 * part, opening=opening)
        found.append((np.abs(columns["q_x"] - oscillation(t)).max(), finished.statistics))
    (error, sought), (as_exact, known) = found
    assert as_exact < 1.2 * error
    assert known.steps < sought.steps
    assert known.rejected_steps == 0


@pytest.mark.long
def test_a_stiff_diode_as_the_others_have_it():
    t = np.linspace(0, 0.05, 101)
    exact = run(models.diode_circuit(), 0.05, "3", 1, t, rtol=1e-11, method="radau")[1]
    for rtol in (1e-3, 1e-5):
        columns = rosenbrock(models.diode_circuit(), 0.05, t, rtol=rtol)[1]
        for name in ("q_c", "f_d"):
            assert np.abs(columns[name] - exact[name]).max() < 20 * rtol * np.abs(exact[name]).max(), name


@pytest.mark.parametrize(("rtol", "steps"), [(1e-4, 40), (1e-7, 55), (1e-10, 110)])
@pytest.mark.long
def test_what_follows_from_a_state_may_jump_with_its_law(rtol, steps):
    """s' = -e, e = s above 0.5 and 2 s below: no step is so short that e changes little within it."""
    law = {"law": "e_g - (1.5 - 0.5*tanh(1e20*(s_s - 0.5)))*s_s"}
    start = {"s_s": (1, True), "q_x": (0, True), "f_x": (0, True)}
    made = models.small("x", "f_x**2/2", "q_x**2/2", states={"s": "-e_g"}, implicit=("g",), gamma=law, initial=start)
    _, columns, finished = rosenbrock(made, 2.0, rtol=rtol)
    assert abs(columns["s_s"][-1] - 2.0 * np.exp(-4.0)) < rtol
    assert finished.statistics.steps < steps


@pytest.mark.long
def test_constraints_hold_to_round_off_at_index_one():
    rows, columns, _ = rosenbrock(models.pendulum(), 4.0, INSTANTS, "1", rtol=1e-6)
    assert rows[:, 7].max() < 1e-14
    assert np.abs(columns["q1"][:3] - Q1).max() < 1e-6


@pytest.mark.long
def test_higher_index_is_refused_or_differentiated(tmp_path):
    with pytest.raises(NoSuchForm, match="index 1, and index 2 was asked for"):
        simulated(tmp_path, models.pendulum(), 1.0, method="rosenbrock", index="2")
    outcome, trace = simulated(tmp_path, models.pendulum(), 4.0, method="rosenbrock", accuracy=1e-5)
    assert (outcome.method, outcome.index, outcome.met) == ("rosenbrock", "1", True)
    assert abs(trace["q1"].values[-1] - Q1[-1]) < 1e-5 * 0.41


def test_failures_are_typed():
    with pytest.raises(SolverFailure) as caught:
        rosenbrock(models.mass_spring(), 10.0, max_steps=3)
    assert caught.value.cause == "max_steps"
    made = models.small("x y", "f_x**2/2", work={"y": "0*q_y"}, initial={"q_x": (1, True), "f_x": (0, True)})
    with pytest.raises(SolverFailure) as caught:
        rosenbrock(made, 1.0)
    assert caught.value.cause == "singular"


@pytest.mark.long
def test_the_same_run_twice():
    found = [rosenbrock(models.diode_circuit(), 0.05, rtol=1e-5)[2].statistics for _ in range(2)]
    assert found[0] == found[1]


def van_der_pol():
    """x'' = 500 (1 - x^2) x' - x: the phase of loose runs is off."""
    return models.small(
        "x", "f_x**2/2", "q_x**2/2", work={"x": "500*(1 - q_x**2)*f_x"}, initial={"q_x": (2, True), "f_x": (0, True)}
    )


@pytest.mark.long
def test_auto_takes_it_for_cheap_accuracy_and_more_stages_for_dear_one(tmp_path):
    for accuracy, method in ((1e-3, "rosenbrock"), (1e-7, "radau")):
        outcome, trace = simulated(tmp_path, relaxing(1e5), 10.0, accuracy=accuracy)
        assert (outcome.method, outcome.met) == (method, True)
        t = np.asarray(trace.time)
        assert np.abs(trace["q_x"].values - relaxed(1e5, t)).max() < accuracy


@pytest.mark.parametrize("rate", [1e7, 1e9])
@pytest.mark.long
def test_auto_leaves_it_where_equations_are_nearly_of_index_two(tmp_path, rate):
    outcome, trace = simulated(tmp_path, relaxing(rate), 10.0, accuracy=1e-3)
    assert outcome.met
    assert np.abs(trace["q_x"].values - relaxed(rate, np.asarray(trace.time))).max() < 1e-3


@pytest.mark.long
def test_auto_leaves_it_where_loose_runs_have_nothing_in_common(tmp_path):
    outcome, trace = simulated(tmp_path, van_der_pol(), 1500.0, accuracy=1e-3, sample_steps=True)
    assert outcome.met
    exact = simulated(tmp_path, van_der_pol(), 1500.0, accuracy=1e-8)[1]
    assert abs(trace["q_x"].values[-1] - exact["q_x"].values[-1]) < 1e-3 * 2.0
