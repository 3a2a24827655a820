import numpy as np
import pytest
import small_models as models
from sysdyn.runtime.integrate.integrate import Integration, Request, integrate
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.core_library import ROW_HEAD
from sysdyn.runtime.model.failures import SolverFailure
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.start import consistent_start


def run(made, t_end, form="3", index=0, instants=(), **request):
    manifest, binding, module = made
    system = System(manifest, binding, load(module), form)
    state = consistent_start(system, 0.0)
    blocks = []
    wanted = np.unique(np.append(np.asarray(instants, float), t_end))
    finished = integrate(system, state, Request(t_end, wanted, every_step=False, index=index, **request), blocks.append)
    names = [row.name for row in system.description.rows if row.block == "observe"]
    rows = np.concatenate(blocks)
    columns = {name: rows[:, ROW_HEAD + k] for k, name in enumerate(names)}
    return rows, columns, finished


@pytest.mark.parametrize(
    ("order", "tolerances"),
    [(1, (1e-4, 1e-6)), (2, (1e-5, 1e-8)), (3, (1e-6, 1e-9)), (4, (1e-7, 1e-10)), (5, (1e-10, 1e-11))],
)
@pytest.mark.long
def test_observed_order(order, tolerances):
    # error ~ steps^-order where no higher order is allowed
    t = np.linspace(0, 10, 21)
    errors, steps = [], []
    for rtol in tolerances:
        _, columns, finished = run(models.mass_spring(), 10.0, instants=t, rtol=rtol, max_order=order)
        errors.append(np.abs(columns["q_x"] - 0.5 * (np.cos(2 * t) + np.sin(2 * t))).max())
        steps.append(finished.statistics.steps)
    observed = np.log(errors[0] / errors[1]) / np.log(steps[1] / steps[0])
    assert observed == pytest.approx(order, abs=0.2)


def test_implicit_euler_is_first_order():
    errors = []
    for h in (0.01, 0.005):
        _, columns, finished = run(models.mass_spring(), 1.0, fixed_step=h, max_order=1, instants=[1.0])
        errors.append(abs(columns["q_x"][-1] - 0.5 * (np.cos(2.0) + np.sin(2.0))))
        assert finished.statistics.steps == round(1.0 / h)
    assert np.log2(errors[0] / errors[1]) == pytest.approx(1.0, abs=0.1)


@pytest.mark.long
def test_tolerance_against_error_of_the_oscillator():
    t = np.linspace(0, 10, 21)
    exact = 0.5 * (np.cos(2 * t) + np.sin(2 * t))
    before = np.inf
    for rtol, allowed in ((1e-4, 1e-2), (1e-6, 1e-4), (1e-8, 2e-6), (1e-10, 2e-8)):
        _, columns, _ = run(models.mass_spring(), 10.0, instants=t, rtol=rtol)
        error = np.abs(columns["q_x"] - exact).max()
        assert error < allowed
        assert error < before
        before = error


@pytest.mark.long
def test_stabilised_pendulum_keeps_its_constraints_and_energy():
    # reference values of references.json, pendulum, t = 0.4, 1, 4
    q1 = [0.2788161732553531, -0.18588523467690846, -0.12866541720223088]
    kappa = [2.3900013221216994, 2.4181679205005557, 2.4298740715415423]
    rows, columns, finished = run(models.pendulum(), 4.0, "2", 2, [0.4, 1.0, 4.0], rtol=1e-8)
    assert np.abs(columns["q1"] - q1).max() < 1e-7
    assert np.abs(columns["kappa1"] - kappa).max() < 1e-7
    assert np.abs(columns["q1"] ** 2 + columns["q2"] ** 2 - 2.34**2).max() < 1e-12
    assert rows[:, 7].max() < 1e-13
    assert np.abs(rows[:, 6]).max() < 1e-6
    # accelerations at the instants fulfil the row they come from
    a = 1.13 * columns["a1"] + 2 * columns["kappa1"] * columns["q1"]
    assert np.abs(a).max() < 1e-12
    assert finished.unsettled == 0


@pytest.mark.parametrize(("form", "index"), [("2", 2), ("2v", 2), ("1", 1), ("3", 3)])
@pytest.mark.long
def test_every_index_form_of_the_pendulum(form, index):
    _, columns, _ = run(models.pendulum(), 4.0, form, index, [4.0], rtol=1e-7)
    assert abs(columns["q1"][-1] + 0.12866541720223088) < (1e-4 if form == "3" else 1e-5)


@pytest.mark.long
def test_hamiltonian_agrees_with_lagrangian():
    for make in (models.pendulum, models.dc_motor, models.mass_spring):
        form, index = ("2", 2) if make is models.pendulum else ("3", 1)
        name = "q1" if make is models.pendulum else ("f_a" if make is models.dc_motor else "q_x")
        values = [run(make(kind), 0.6, form, index, rtol=1e-9)[1][name][-1] for kind in ("lagrangian", "hamiltonian")]
        assert values[0] == pytest.approx(values[1], rel=1e-6)


@pytest.mark.long
def test_index_two_circuit_of_massless_coordinates():
    # references.json, lead_filter at t = 1
    _, columns, _ = run(models.lead_filter(), 1.0, "3", 2, rtol=1e-8)
    assert columns["q_2"][-1] == pytest.approx(-0.00001891163095, rel=1e-6)
    assert columns["f_3"][-1] == pytest.approx(0.000756465238384, rel=1e-6)


@pytest.mark.long
def test_valves_through_zero_slope_and_stiff_diode():
    # references.json, nonlinear_fluid at t = 60
    _, columns, _ = run(models.nonlinear_fluid(), 60.0, "3", 2, rtol=1e-8)
    assert columns["q_2"][-1] == pytest.approx(4.971874535507478, rel=1e-6)
    assert columns["f_3"][-1] == pytest.approx(0.728375598501610, rel=1e-6)
    # the rectifier charges to the source's peak less the diode's drop; two tolerances agree
    values = [run(models.diode_circuit(), 0.05, "3", 2, rtol=rtol)[1]["q_c"][-1] for rtol in (1e-6, 1e-9)]
    assert values[0] == pytest.approx(values[1], rel=1e-3)
    assert 2e-5 < values[1] < 5e-5


@pytest.mark.long
def test_energy_balance_counts_dissipation_and_supply():
    rows, _, _ = run(models.dc_motor(), 0.6, "3", 1, np.linspace(0, 0.6, 7), rtol=1e-9)
    # the two implicit efforts exchange power: 12 f_c + (e_2 f_a - e_1 f_c) is the supply, less what the resistors take
    assert np.abs(rows[:, 6]).max() < 1e-6 * rows[:, 5].max()


@pytest.mark.long
def test_work_counters_are_deterministic():
    counters = [run(models.slider_crank(), 4.0, "2", 2, rtol=1e-6)[2].statistics for _ in range(2)]
    assert counters[0] == counters[1]
    assert 300 < counters[0].steps < 800
    assert counters[0].residual_evaluations < 3 * counters[0].steps
    assert counters[0].jacobian_evaluations < counters[0].steps // 4


@pytest.mark.long
def test_dense_output_between_steps_is_as_good_as_at_steps():
    t = np.linspace(0, 10, 501)
    _, columns, _ = run(models.mass_spring(), 10.0, instants=t, rtol=1e-8)
    assert np.abs(columns["q_x"] - 0.5 * (np.cos(2 * t) + np.sin(2 * t))).max() < 2e-6


def decay(function):
    """s' = function(t, s), one dynamic variable."""
    manifest, binding, module = models.small("", "0", states={"a": "-s_a"}, initial={"s_a": (1, True)})

    def rows(p, ix, at, to, t, y, yd, r):
        k = next(k for k, row in enumerate(manifest["structure"]["rows"]) if row["block"] == "lambda")
        r[to[k]] += yd[0] - function(t, y[0])

    module.lambda_rows = rows
    return manifest, binding, module


def test_exception_of_a_callback_surfaces():
    def broken(t, s):
        if t > 0.5:
            raise ZeroDivisionError("in the model")
        return -s

    with pytest.raises(ZeroDivisionError, match="in the model"):
        run(decay(broken), 1.0)


def test_a_residual_that_is_not_finite_cuts_the_step_and_then_fails_with_its_row():
    with pytest.raises(SolverFailure) as caught:
        run(decay(lambda t, s: -s if t < 0.5 else np.nan), 1.0)
    assert caught.value.cause == "nonfinite"
    assert caught.value.row.label == "a"
    assert caught.value.time == pytest.approx(0.5, abs=1e-6)


@pytest.mark.long
def test_escape_to_infinity_is_a_typed_failure():
    with pytest.raises(SolverFailure) as caught:
        run(decay(lambda t, s: s * s), 2.0)
    assert caught.value.time == pytest.approx(1.0, rel=1e-2)
    assert caught.value.cause in ("step_too_small", "newton", "nonfinite", "error_test", "max_steps")


def test_limits_on_steps():
    with pytest.raises(SolverFailure) as caught:
        run(models.mass_spring(), 10.0, max_steps=10)
    assert caught.value.cause == "max_steps"
    assert 0.0 < caught.value.time < 10.0


def test_singular_model_names_unknown_and_row():
    made = models.small("x y", "f_x**2/2", work={"y": "0*q_y"}, initial={"q_x": (1, True), "f_x": (0, True)})
    with pytest.raises(SolverFailure) as caught:
        run(made, 1.0)
    assert caught.value.cause == "singular"
    assert "y" in f"{caught.value.unknown} {caught.value.row}"


@pytest.mark.long
def test_scaled_models_behave_alike():
    # the same oscillator in nano and mega units: the same steps
    counters = []
    for scale in (1.0, 1e-9, 1e6):
        made = models.small(
            "x",
            "f_x**2",
            "4*q_x**2",
            initial={"q_x": (0.5 * scale, True), "f_x": (scale, True)},
            observe={"x": "q_x"},
        )
        _, columns, finished = run(made, 10.0, rtol=1e-6)
        counters.append(finished.statistics.steps)
        assert columns["x"][-1] / scale == pytest.approx(0.660513656270509, rel=5e-4)
    assert counters[0] == counters[1] == counters[2]


@pytest.mark.long
def test_memory_is_released():
    manifest, binding, module = models.mass_spring()
    system = System(manifest, binding, load(module))
    state = consistent_start(system, 0.0)
    for _ in range(20):
        Integration(system, state, Request(0.1, np.array([0.1]))).run(lambda rows: None)
