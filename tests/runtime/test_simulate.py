import json

import numpy as np
import pytest
import small_models as models
from sysdyn.runtime.accuracy.options import Options, choose_index
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.failures import SolverFailure, WrongOption
from sysdyn.runtime.simulate import simulate
from sysdyn.runtime.trace.trace import Trace, TraceParameter

# references.json: values at the last instant of each system
END = {
    "pendulum": (
        models.pendulum,
        4.0,
        {"q1": -0.12866541720223088, "f2": 0.043574977767020996, "kappa1": 2.4298740715415423},
    ),
    "mass_spring": (models.mass_spring, 10.0, {"q_x": 0.660513656270509, "f_x": -0.50486318891423}),
    "dc_motor": (
        models.dc_motor,
        0.6,
        {"f_c": 0.936225230071879, "f_a": 45.03517523655459, "q_a": 21.57951085649930},
    ),
    "lead_filter": (models.lead_filter, 1.0, {"q_2": -0.00001891163095, "f_3": 0.000756465238384}),
    "pendulum_spring": (models.pendulum_spring, 10.0, {"q_1": -0.65903118951028, "q_2": -5.10735094044785}),
    "fluid_tank": (models.fluid_tank, 10.0, {"q_2": 1.794195321783635, "f_3": 0.598065107261211}),
    "nonlinear_fluid": (models.nonlinear_fluid, 60.0, {"q_2": 4.971874535507478, "f_3": 0.728375598501610}),
    "slider_crank": (models.slider_crank, 4.0, {"q_1": -0.94799123004660, "q_3": 1.026518170347651}),
}


def outcome(made, path, t_end, **options):
    manifest, binding, module = made
    return simulate(manifest, binding, load(module), Options(path, 0.0, t_end, **options))


@pytest.mark.parametrize("name", END)
@pytest.mark.parametrize("accuracy", [1e-3, 1e-6])
@pytest.mark.long
def test_accuracy_is_met(name, accuracy, tmp_path):
    make, t_end, values = END[name]
    result = outcome(make(), tmp_path / "o.h5", t_end, accuracy=accuracy, every=t_end / 40)
    trace = Trace.open(tmp_path / "o.h5")
    assert result.final
    assert result.error_estimate <= accuracy
    assert not result.warnings
    for quantity, value in values.items():
        assert abs(trace[quantity][-1] - value) <= accuracy * trace[quantity].nominal, quantity
    assert trace.time[-1] == t_end
    assert trace.time.size == 41


@pytest.mark.parametrize("name", ["lead_filter", "fluid_tank"])
@pytest.mark.parametrize("accuracy", [1e-2, 1e-3, 1e-4])
@pytest.mark.long
def test_where_little_happens_the_estimate_holds(name, accuracy, tmp_path):
    make, t_end, _ = END[name]
    options = {"every": t_end / 200}
    result = outcome(make(), tmp_path / "o.h5", t_end, accuracy=accuracy, **options)
    assert result.met
    outcome(make(), tmp_path / "r.h5", t_end, rtol=1e-13, method="radau", **options)
    trace, exact = Trace.open(tmp_path / "o.h5"), Trace.open(tmp_path / "r.h5")
    sizes = {n: exact[n].nominal for n in trace.names if exact[n].nominal}
    errors = [np.abs(np.asarray(trace[n]) - np.asarray(exact[n])).max() / size for n, size in sizes.items()]
    assert max(errors) <= result.error_estimate <= accuracy


@pytest.mark.long
def test_the_run_behind_a_draft_begins_with_the_step_that_the_draft_found(tmp_path):
    make, t_end, values = END["pendulum"]
    options = {"every": t_end / 40, "method": "dopri"}
    made = outcome(make(), tmp_path / "o.h5", t_end, accuracy=1e-4, **options)
    trace = Trace.open(tmp_path / "o.h5")
    alone = outcome(make(), tmp_path / "a.h5", t_end, rtol=float(trace.attributes["rtol"]), **options)
    assert made.met
    assert made.steps < alone.steps == alone.statistics["steps"]
    for quantity, value in values.items():
        assert abs(trace[quantity][-1] - value) <= 1e-4 * trace[quantity].nominal, quantity


def test_trace_of_accepted_steps_holds_the_instants_asked_for(tmp_path):
    result = outcome(models.pendulum(), tmp_path / "o.h5", 4.0, at=(0.4, 1.0), accuracy=1e-4)
    trace = Trace.open(tmp_path / "o.h5")
    assert {0.0, 0.4, 1.0, 4.0} <= set(trace.time.tolist())
    assert (np.diff(trace.time) > 0).all()
    assert (result.method, result.index) == ("dopri", "0")
    assert trace.time.size > 20
    # derivatives are those of the quantity
    assert np.allclose(trace["q1"].derivative, trace["f1"].values, atol=1e-14)
    with pytest.raises(WrongOption, match="outside"):
        outcome(models.pendulum(), tmp_path / "p.h5", 4.0, at=(5.0,))


@pytest.mark.long
def test_expert_mode_is_one_run(tmp_path):
    result = outcome(models.mass_spring(), tmp_path / "o.h5", 10.0, rtol=1e-6, atol=1e-9)
    assert result.error_estimate is None
    assert result.statistics["steps"] < 600
    trace = Trace.open(tmp_path / "o.h5")
    assert trace.attributes["rtol"] == 1e-6
    assert trace.attributes["atol"] == 1e-9


@pytest.mark.long
def test_an_accuracy_that_cannot_be_reached_is_not_met(tmp_path):
    result = outcome(models.slider_crank(), tmp_path / "o.h5", 1.0, accuracy=1e-15, every=0.1)
    assert result.final
    assert not result.met
    (missed,) = result.judgement.not_met
    assert (missed.what, missed.limit) == ("accuracy", 1e-15)
    assert missed.value == result.error_estimate < 1e-9


@pytest.mark.long
def test_accuracy_on_one_quantity(tmp_path):
    given = {"accuracy": 1e-2, "every": 0.1, "method": "bdf"}
    loose = outcome(models.slider_crank(), tmp_path / "a.h5", 2.0, **given)
    one = outcome(models.slider_crank(), tmp_path / "b.h5", 2.0, accuracy_on=(("q_3", 1e-8),), **given)
    assert one.statistics["steps"] > 2 * loose.statistics["steps"]


def test_failing_run_leaves_a_readable_trace(tmp_path):
    with pytest.raises(SolverFailure) as caught:
        outcome(models.mass_spring(), tmp_path / "o.h5", 10.0, max_steps=12)
    trace = Trace.open(tmp_path / "o.h5")
    assert trace.attributes["final"] == 0
    assert not trace.final
    assert trace.time.size == 13
    assert trace.time[-1] == pytest.approx(caught.value.partial.reached)
    assert caught.value.partial.final is False
    assert trace["q_x"].nominal >= np.abs(trace["q_x"].values).max() * 0.999


def test_interruption_leaves_what_was_computed(tmp_path):
    seen = []

    def interrupt(fraction, left):
        seen.append(fraction)
        if fraction > 0.0:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        outcome(models.mass_spring(), tmp_path / "o.h5", 1e6, progress=interrupt)
    trace = Trace.open(tmp_path / "o.h5")
    assert trace.attributes["final"] == 0
    assert trace.time.size > 1
    assert trace.time[-1] == pytest.approx(seen[-1] * 1e6), "all that was said to be done"


@pytest.mark.long
def test_two_runs_without_timings_are_equal_byte_for_byte(tmp_path):
    for name in "ab":
        outcome(
            models.slider_crank(),
            tmp_path / f"{name}.h5",
            4.0,
            timings=False,
            parameters=(TraceParameter("m1", 1.0, "kg"),),
        )
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()
    assert not list(tmp_path.glob(".*"))


@pytest.mark.long
def test_statistics_and_timings(tmp_path):
    result = outcome(models.pendulum(), tmp_path / "o.h5", 4.0)
    attributes = Trace.open(tmp_path / "o.h5").attributes
    names = ["steps", "rejected_steps", "residual_evaluations", "jacobian_evaluations", "factorisations"]
    assert list(json.loads(attributes["statistics"])) == [*names, "newton_failures", "error_estimate"]
    timings = json.loads(attributes["timings"])
    assert set(timings) - {"forecast_s"} == {"cpu_integrate_s", "wall_integrate_s", "cpu_compile_s", "wall_total_s"}
    assert 0.0 < timings["cpu_integrate_s"] <= timings["wall_total_s"] * 1.5
    assert result.statistics["steps"] > 0


@pytest.mark.parametrize(
    ("wanted", "form"), [("auto", "2"), ("3", "3"), ("2", "2"), ("2v", "2v"), ("1", "1"), ("0", "0")]
)
@pytest.mark.long
def test_index_option(wanted, form, tmp_path):
    result = outcome(models.pendulum(), tmp_path / "o.h5", 1.0, index=wanted, rtol=1e-6)
    assert result.index == form
    assert bool(result.warnings) == (wanted == "3")


def test_options_that_do_not_exist(tmp_path):
    with pytest.raises(WrongOption, match="index 7"):
        outcome(models.pendulum(), tmp_path / "o.h5", 1.0, index="7")
    with pytest.raises(WrongOption, match="method rk4"):
        outcome(models.pendulum(), tmp_path / "o.h5", 1.0, method="rk4")
    assert choose_index is not None


@pytest.mark.long
def test_steps_without_a_row_cost_no_more_than_what_is_new_in_them(tmp_path):
    """A row moves its point onto the constraints, by residuals of their second derivatives; a step without one only
    where some quantity is larger than before, so that the nominals are those of all steps.
    """
    asked, nominal = [], []
    for every in (None, 4.0):
        manifest, binding, module = models.pendulum()
        rows, calls = module.phi_acceleration_rows, []

        def counted(*arguments, rows=rows, calls=calls):
            calls.append(1)
            return rows(*arguments)

        module.phi_acceleration_rows = counted
        path = tmp_path / "t.h5"
        trace = outcome((manifest, binding, module), path, 4.0, rtol=1e-6, method="bdf", every=every).traced
        asked.append(len(calls))
        nominal.append([trace[name].nominal for name in trace.names])
    assert asked[1] < 0.4 * asked[0]
    assert np.allclose(nominal[1], nominal[0], rtol=2e-3)
