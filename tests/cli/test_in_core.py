"""Runs of `api.load` made in the core: what a run on its own hands back, within the accuracy that both promise, bit for
bit the same whatever ran before, and refused there where a run on its own has to look.
"""

import threading
from pathlib import Path

import numpy as np
import pytest
from sysdyn.api import ModelError, NotMet, Trace, load, simulate
from sysdyn.dsl.text.diagnostics import Report

MODELS = Path(__file__).parents[2] / "models"
SEEDS = (
    ("pendulum", "lagrangian"), ("pendulum", "hamiltonian"), ("dc_motor", "kane"), ("co_circuit", "lagrangian"),
    ("lc_ladder", "auto"), ("slider_crank", "hamiltonian"), ("two_link_arm", "lagrangian"), ("knife_edge", "kane"),
    ("diode_circuit", "co_lagrangian"), ("two_tank", "auto"), ("mass_spring", "co_kane"), ("thermal_two_node", "auto"),
)  # fmt: skip
"""Every method and formulation, with and without constraints, linear and not, with unknowns that leave other runs."""
OWN = ("rtol", "statistics", "timings", "conserved")
"""Attributes that say how a run came about, or what is left of a zero."""


def numbers(model):
    known = model._loaded.parameters
    return {k: float(v) for k, v in model.parameters.items() if np.ndim(v) == 0 and v and not known[k].whole}


def core(model):
    """The text's structures in the core, None where it has none, and why."""
    cores = model._loaded.first.cores
    return (cores._free[0] if cores._free else None), cores.refused


@pytest.mark.parametrize(("name", "formulation"), SEEDS)
@pytest.mark.long
def test_a_run_in_the_core_is_the_run_of_the_command(name, formulation, tmp_path):
    file = MODELS / "seed" / f"{name}.sd"
    model = load(file, scene="reference", formulation=formulation)
    some = numbers(model)
    cases = [{}, {k: 1.04 * v for k, v in list(some.items())[:3]}, {k: 1.02 * v for k, v in some.items()}]
    traces = [model.run(case) for case in cases]
    found, refused = core(model)
    assert refused is None
    for case, mine in zip(cases, traces, strict=True):
        assert found.batch.core.spent > 0.0
        other = simulate(file, scene="reference", formulation=formulation, set=case, output=tmp_path / "t.h5")
        assert set(mine.names) == set(other.names)
        assert np.array_equal(mine.time, other.time)
        assert mine.parameters == dict(other.parameters)
        assert mine.attributes.keys() == other.attributes.keys()
        for attribute in other.attributes.keys() - set(OWN):
            assert mine.attributes[attribute] == other.attributes[attribute], attribute
        assert mine.statistics.keys() == other.statistics.keys()
        assert mine.timings.keys() <= {*other.timings, "forecast_s"}
        for quantity in (*mine.names, "audit.energy", "audit.constraints"):
            one, two = mine[quantity], other[quantity]
            size = two.nominal or 1.0
            assert one.units == two.units
            assert np.abs(one.values - two.values).max() <= 1e-4 * size, quantity
            assert (one.derivative is None) == (two.derivative is None), quantity
            # the largest of the ends of steps, too, which stand elsewhere
            assert one.nominal == two.nominal or abs(one.nominal - two.nominal) <= 1e-3 * size, quantity


@pytest.mark.parametrize("name", ["pendulum", "two_tank", "slider_crank"])
@pytest.mark.long
def test_a_run_depends_on_its_own_numbers_alone(name):
    """The first call and the second, after others, of another object and in threads: the same bits."""
    file = MODELS / "seed" / f"{name}.sd"
    used, fresh = load(file, scene="reference"), load(file, scene="reference")
    some = numbers(used)
    case = {k: 1.03 * v for k, v in some.items()}
    one = used.run(case)
    for factor in (0.98, 1.1):
        used.run({k: factor * v for k, v in some.items()})
    used.run(case, until=0.1)
    beside: list[Trace] = []
    threads = [threading.Thread(target=lambda: beside.append(used.run(case))) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(beside) == 3
    for other in (used.run(case), fresh.run(case), *beside):
        assert np.array_equal(one.time, other.time)
        assert all(np.array_equal(one[n], other[n], equal_nan=True) for n in (*one.names, "audit.energy"))
        assert all(one[n].nominal == other[n].nominal for n in one.names)
        assert (one.statistics, one.attributes["judged"]) == (other.statistics, other.attributes["judged"])


def test_the_trace_is_its_own(tmp_path):
    """What one run handed back stays as it was when the next one has taken the structures; it is saved as any other."""
    model = load(MODELS / "seed" / "pendulum.sd", scene="reference")
    one = model.run({"l": 2.0})
    before = one["q1"].values.copy()
    model.run({"l": 3.0})
    assert np.array_equal(one["q1"], before)
    one.save(tmp_path / "saved.h5")
    again = Trace.open(tmp_path / "saved.h5")
    assert (again.met, again.statistics, again.parameters) == (one.met, one.statistics, one.parameters)
    assert again.parameters["l"][0] == 2.0


BRANCHES = """
model branches {
  param y_0 = 0.1 m
  param l = 1 m
  coord x, y: translation
  energy T* = 1/2*(1 kg)*(x'^2 + y'^2)
  energy V = (1 kg)*(9.81 m/s^2)*y
  phi rod: x^2 + y^2 = l^2
  init x = 0.5 m
  init y ~ y_0
  init x' = 0 m/s
}
scene s of branches { time 0 s to 0.5 s; trace x, y every 10 ms }
"""


def test_a_guess_leads_to_its_own_root(tmp_path):
    """x = 0.5 m of a rod of 1 m: y = +-sqrt(0.75) m by the sign of its guess, which moves; rods of other lengths."""
    path = tmp_path / "b.sd"
    path.write_text(BRANCHES)
    model = load(path)
    for guess, length in ((0.1, 1.0), (-0.1, 1.0), (0.3, 1.0), (-0.9, 1.0), (0.1, 0.51), (0.1, 30.0), (-0.8, 1.02)):
        y = model.run({"y_0": guess, "l": length})["y"]
        assert y[0] == pytest.approx(np.copysign(np.sqrt(length**2 - 0.25), guess), abs=1e-10)
    assert core(model)[1] is None


def alone(model, case):
    """What a run on its own says."""
    report = Report()
    ran = model._loaded.run(case, report)
    return ran, report


def test_what_the_core_does_not_answer_is_answered_as_ever(tmp_path):
    """No mass, a negative one, a rest without direction, a claim that fails."""
    text = (MODELS / "seed" / "pendulum.sd").read_text()
    text = text.replace("every 10 ms", "every 10 ms\n  expect always: q1 <= 0.5 m")
    (tmp_path / "p.sd").write_text(text)
    model = load(tmp_path / "p.sd", scene="reference")
    assert model.run({"th_0": 0.2}).met
    for case, code in (({"m": 0.0}, "E516"), ({"m": -1.0}, "E321"), ({"th_0": 0.3}, "E909")):
        with pytest.raises(ModelError) as found:
            model.run(case)
        ran, report = alone(model, case)
        assert ran is None or ran.exit == 1
        assert [d.code for d in found.value.diagnostics] == [d.code for d in report]
        assert code in {d.code for d in report}
    rest, own = model.run({"th_0": 0.0}), alone(model, {"th_0": 0.0})[0].outcome.traced
    assert all(np.array_equal(rest[n], own[n]) for n in rest.names), "nothing moves: the run on its own"


def test_an_accuracy_that_is_missed_is_said_by_a_run_of_its_own(tmp_path):
    """200 periods at 2e-13, where double precision ends."""
    path = tmp_path / "o.sd"
    path.write_text(
        "model o {\n  param k = 1 N/m\n  coord x: translation = 1 m\n  energy T* = 1/2*(1 kg)*x'^2\n"
        "  energy V = 1/2*k*x^2\n  init x' = 0 m/s\n}\nscene s of o { time 0 s to 1 s; trace x every 0.1 s }\n"
    )
    model = load(path, accuracy=2e-13)
    assert model.run({}).met
    assert core(model)[1] is None
    with pytest.raises(NotMet) as found:
        model.run({"k": 1.6e6})
    assert found.value.trace.final
    assert np.array_equal(found.value.trace["x"], alone(model, {"k": 1.6e6})[0].outcome.traced["x"])


FALLING = (
    ("bouncing_ball", {}, "events"), ("stick_slip_belt", {}, "events"), ("redundant_pendulum", {}, "minimum_norm"),
    ("pendulum", {"rtol": 1e-8}, "tolerances"), ("pendulum", {"accuracy_check": True}, "second opinion"),
    ("pendulum", {"max_steps": 10**5}, "limited"), ("pendulum", {"backend": "numpy", "until": 0.1}, "not compiled"),
)  # fmt: skip


@pytest.mark.parametrize(("name", "options", "why"), FALLING)
@pytest.mark.long
def test_what_has_no_place_in_the_core_is_run_on_its_own(name, options, why):
    model = load(MODELS / "seed" / f"{name}.sd", scene="reference", **options)
    case = {k: 1.01 * v for k, v in list(numbers(model).items())[:1]}
    mine = model.run(case)
    assert why in core(model)[1]
    own = alone(model, case)[0].outcome.traced
    assert all(np.array_equal(mine[n], own[n], equal_nan=True) for n in mine.names)
    assert mine.statistics == own.statistics


def test_instants_that_follow_from_what_changes_are_laid_out_anew(tmp_path):
    text = (MODELS / "seed" / "pendulum.sd").read_text().replace("time 0 s to 4 s", "time 0 s to m*(1 s/kg)")
    (tmp_path / "p.sd").write_text(text)
    model = load(tmp_path / "p.sd", scene="reference")
    assert [model.run(case).time[-1] for case in ({"l": 2.0}, {"m": 2.0}, {"l": 1.0})] == [1.13, 2.0, 1.13]
    assert core(model)[1] is None


def test_a_long_run_is_made_on_its_own(tmp_path):
    """One that nobody could interrupt, and one whose rows are many."""
    for ending, until in (("", 2000.0), (" every 10 ms", 200.0)):
        text = (MODELS / "seed" / "pendulum.sd").read_text().replace(" every 10 ms", ending)
        (tmp_path / "p.sd").write_text(text)
        model = load(tmp_path / "p.sd", scene="reference", until=until, accuracy=1e-2)
        assert model._loaded._in_core({}, *model._loaded.bound({})) is None
        assert any(why in core(model)[1] for why in ("do not run", "no result"))


@pytest.mark.parametrize(("name", "parameter"), [("pendulum", "l"), ("dc_motor", "L1"), ("mass_spring", "M")])
@pytest.mark.long
def test_a_call_is_few_lines_of_python(name, parameter, effort):
    """1 ms beside 1.5 times the integrations was asked for (tests/bench/api.py)."""
    model = load(MODELS / "seed" / f"{name}.sd", scene="reference")
    value = float(model.parameters[parameter])
    for factor in (1.0, 1.01):
        model.run({parameter: factor * value})
    lines = [effort(lambda: model.run({parameter: 1.02 * value}))[1] for _ in range(2)]
    assert lines[1] <= 1600
