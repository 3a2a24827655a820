"""Radau IIA: observed order, dense output, every index form, sparse factors, agreement with the BDF."""

import chain_model as chain
import numpy as np
import pytest
import small_models as models
from sysdyn.runtime.accuracy.options import Options
from sysdyn.runtime.integrate import methods
from sysdyn.runtime.integrate.integrate import Integration
from sysdyn.runtime.integrate.jumps import corners
from sysdyn.runtime.integrate.request import Request
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.core_library import ROW_HEAD
from sysdyn.runtime.model.failures import SolverFailure
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics import ordering
from sysdyn.runtime.simulate import simulate
from sysdyn.runtime.start.start import consistent_start
from sysdyn.runtime.trace.trace import Trace
from test_bdf import run

# references.json, pendulum, t = 0.4, 1, 4
INSTANTS = [0.4, 1.0, 4.0]
Q1 = np.array([0.2788161732553531, -0.18588523467690846, -0.12866541720223088])
KAPPA = np.array([2.3900013221216994, 2.4181679205005557, 2.4298740715415423])


def oscillation(t):
    return 0.5 * (np.cos(2 * t) + np.sin(2 * t))


def test_order_five_on_a_smooth_ode():
    errors = []
    for h in (0.25, 0.125, 0.0625):
        _, columns, _ = run(models.mass_spring(), 10.0, method="radau", fixed_step=h, rtol=1e-12)
        errors.append(abs(columns["q_x"][-1] - oscillation(10.0)))
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx(5.0, abs=0.15)


@pytest.mark.parametrize(("form", "index", "order"), [("2", 2, 5), ("2v", 2, 5), ("1", 1, 5), ("3", 3, 3)])
@pytest.mark.long
def test_order_on_the_pendulum_in_every_index_form(form, index, order):
    errors = []
    for h in (0.05, 0.025):
        found = run(models.pendulum(), 4.0, form, index, INSTANTS, method="radau", fixed_step=h, rtol=1e-12)[1]
        errors.append(max(np.abs(found["q1"] - Q1).max(), np.abs(found["kappa1"] - KAPPA).max()))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.2)


@pytest.mark.long
def test_values_between_steps_have_the_order_of_the_steps():
    t = np.linspace(1.013, 9.97, 197)
    errors = []
    for h in (0.1, 0.05, 0.025):
        _, columns, _ = run(models.mass_spring(), 10.0, instants=t, method="radau", fixed_step=h, rtol=1e-12)
        errors.append(np.abs(columns["q_x"][:-1] - oscillation(t)).max())
    assert (np.log2(np.divide(errors[:-1], errors[1:])) > 4.5).all()


@pytest.mark.long
def test_tolerance_against_error_and_work():
    t = np.linspace(0, 10, 101)
    for rtol, allowed, steps in ((1e-4, 1e-3, 70), (1e-8, 1e-6, 300), (1e-12, 1e-10, 1300)):
        _, columns, finished = run(models.mass_spring(), 10.0, instants=t, method="radau", rtol=rtol)
        assert np.abs(columns["q_x"] - oscillation(t)).max() < allowed
        assert finished.statistics.steps < steps


@pytest.mark.parametrize(("form", "index"), [("2", 2), ("2v", 2), ("1", 1), ("3", 3)])
@pytest.mark.long
def test_pendulum_with_step_control(form, index):
    rows, columns, finished = run(models.pendulum(), 4.0, form, index, INSTANTS, method="radau", rtol=1e-9)
    assert np.abs(columns["q1"] - Q1).max() < (1e-5 if form == "3" else 1e-7)
    assert rows[:, 7].max() < 1e-12
    assert finished.statistics.steps < 250


@pytest.mark.long
def test_index_two_circuit_valves_and_a_stiff_diode():
    # references.json: lead_filter at 1, nonlinear_fluid at 60
    columns = run(models.lead_filter(), 1.0, "3", 2, method="radau", rtol=1e-8)[1]
    assert columns["q_2"][-1] == pytest.approx(-0.00001891163095, rel=1e-6)
    columns = run(models.nonlinear_fluid(), 60.0, "3", 2, method="radau", rtol=1e-8)[1]
    assert columns["q_2"][-1] == pytest.approx(4.971874535507478, rel=1e-6)
    values = [
        run(models.diode_circuit(), 0.05, "3", 2, rtol=1e-9, method=method)[1]["q_c"][-1] for method in ("bdf", "radau")
    ]
    assert values[0] == pytest.approx(values[1], rel=1e-5)


@pytest.mark.long
def test_sparse_and_dense_factors_give_the_same(monkeypatch):
    system = System({"structure": chain.structure()}, chain.binding(6), load(chain.Chain), "2")
    state = consistent_start(system, 0.0)
    found = []
    for limit in (50, 0):
        monkeypatch.setattr(ordering, "DENSE", limit)
        request = Request(0.5, np.linspace(0, 0.5, 6), every_step=False, index=2, method="radau", rtol=1e-9)
        rows = []
        Integration(system, state, request).run(rows.append)
        found.append(np.concatenate(rows))
    assert np.abs(found[0] - found[1])[:, ROW_HEAD:].max() < 1e-7


@pytest.mark.long
def test_counters_are_deterministic_and_energy_balances():
    counters = [run(models.slider_crank(), 4.0, "2", 2, rtol=1e-6, method="radau")[2].statistics for _ in range(2)]
    assert counters[0] == counters[1]
    rows, _, _ = run(models.dc_motor(), 0.6, "3", 1, np.linspace(0, 0.6, 7), rtol=1e-9, method="radau")
    assert np.abs(rows[:, 6]).max() < 1e-6 * rows[:, 5].max()


def test_failures_are_typed():
    with pytest.raises(SolverFailure) as caught:
        run(models.mass_spring(), 10.0, max_steps=3, method="radau")
    assert caught.value.cause == "max_steps"
    made = models.small("x y", "f_x**2/2", work={"y": "0*q_y"}, initial={"q_x": (1, True), "f_x": (0, True)})
    with pytest.raises(SolverFailure) as caught:
        run(made, 1.0, method="radau")
    assert caught.value.cause == "singular"


@pytest.mark.parametrize("accuracy", [1e-6, 1e-9, 1e-11])
@pytest.mark.long
def test_accuracy_is_met(tmp_path, accuracy):
    manifest, binding, module = models.pendulum()
    path = tmp_path / "t.h5"
    outcome = simulate(
        manifest,
        binding,
        load(module),
        Options(path, 0.0, 4.0, at=tuple(INSTANTS), method="radau", accuracy=accuracy),
    )
    assert (outcome.method, outcome.warnings) == ("radau", ())
    trace = Trace.open(path)
    at = [int(np.argmin(np.abs(trace.time - t))) for t in INSTANTS]
    assert np.abs(np.asarray(trace["q1"])[at] - Q1).max() < max(accuracy, 1e-10)


def test_a_method_that_rests_between_pieces_steps_on_alike(monkeypatch):
    """What it lets go of at a jump of the text (of large systems) is what the next start makes anew: the same bits."""

    def rows():
        instants = np.linspace(0.0, 10.0, 41)
        return run(models.mass_spring(), 10.0, instants=instants, method="radau", rtol=1e-7, stops=np.array([2.5, 7.0]))

    kept, rested, rest = rows(), [], methods.lib.core.sd_radau_rest
    monkeypatch.setattr(methods, "LARGE", 0)
    monkeypatch.setattr(corners, "LARGE", 0)
    monkeypatch.setattr(methods.lib.core, "sd_radau_rest", lambda radau: (rested.append(radau), rest(radau)))
    found = rows()
    assert len(rested) >= 2
    assert found[0].tobytes() == kept[0].tobytes()
    assert found[2].statistics == kept[2].statistics
    instants = found[0][:, 0]
    assert np.abs(found[1]["q_x"] - oscillation(instants)).max() < 1e-5
