"""What is said of runs, by hand: expectations on samples, runs that disagree, energies, files of sweeps."""

from dataclasses import replace
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from sysdyn.cli.report import balance
from sysdyn.cli.run.start.starting import holds
from sysdyn.cli.run.verdict.expectations import judge, watch
from sysdyn.cli.sweep.results import write
from sysdyn.cli.sweep.run_records import Done, Kept, KeptRuns
from sysdyn.cli.verify.verify_results import Verified, VerifiedRun, disagreements, worst
from sysdyn.dsl import load
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.text.diagnostics import Report, SourceText
from sysdyn.runtime.judgement import Judgement, Shortfall
from sysdyn.runtime.trace.trace import Quantity, Trace

NAN, INF = float("nan"), float("inf")


# --- expectations -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("operator", "left", "right", "within", "found"),
    [
        ("==", 1.0, 1.25, 0.25, True),
        ("==", 1.0, 1.5, 0.25, False),
        ("==", 1.0, 1.0, 0.0, True),
        ("!=", 1.0, 1.25, 0.25, False),
        ("!=", 1.0, 1.5, 0.25, True),
        ("<", 1.0, 1.0, 0.0, False),
        ("<", 1.0, 1.0, 0.25, True),  # a tolerance is the author's
        ("<=", 1.0, 1.0, 0.0, True),
        ("<=", 1.5, 1.25, 0.25, True),
        ("<", 1.75, 1.25, 0.25, False),
        (">", 1.0, 1.0, 0.0, False),
        (">", 1.0, 1.25, 0.25, True),
        (">=", 1.0, 1.5, 0.25, False),
        *(
            (operator, NAN, 1.0, 5.0, False) for operator in ("==", "!=", "<", "<=", ">", ">=")
        ),  # no number is no answer
    ],
)
@pytest.mark.one_in(12)
def test_what_holds_within_a_tolerance(operator, left, right, within, found):
    assert holds(operator, left, right, within) is found


def expecting(said, samples, *, finished=True, estimate=None):
    """Claims and findings of expectations on made samples of x: (time, value)."""
    text = f"model m {{ state x: 1 = 0; dynamic x' = 1/(1 s) }}\nscene s of m {{ time 0 s to 4 s; trace x\n{said}\n}}\n"
    report = Report()
    document = load.document(SourceText("m.sd", text), report)
    with ex.fresh():
        network = load.network(document, document.models["m"], document.scenes["s"], report)
        sides = [(e.left, e.right, e.within or ex.const(0.0)) for e in network.expectations]
        names = [f"expect {k} {side}" for k in range(len(sides)) for side in ("left", "right", "within")]
        time = np.array([t for t, _ in samples])
        values = np.array(
            [[evaluate([n], lambda v, x=x: x)[0] for one in sides for n in one] for _, x in samples]
        ).reshape(time.size, len(names))
        known = SimpleNamespace(names=tuple(names), time=time, values=values, largest=np.abs(values).max(axis=0))
        binding = SimpleNamespace(evaluate=lambda node: evaluate([node], lambda _: NAN)[0])
        prepared = SimpleNamespace(network=network, binding=binding)
        outcome = SimpleNamespace(samples=known, error_estimate=estimate)
        claims = judge(prepared, outcome, report, finished=finished)
        kept = watch(prepared)(known.names)(time, values)
    return [(c.ok, c.value, c.time) for c in claims], [d for d in report if d.code == "E909"], kept.tolist()


RAMP = [(0.0, 0.0), (1.0, 1.0), (2.0, 2.0), (4.0, 4.0)]


def test_always_is_judged_by_the_first_sample_that_breaks_it():
    claims, (told,), kept = expecting("expect always: x < 1.5", RAMP)
    assert claims == [(False, 2.0, 2.0)]
    assert told.message == "expect failed: 2 at 2 s, expected < 1.5"
    assert kept == [False, False, True, False]
    assert expecting("expect always: x < 5", RAMP)[:2] == ([(True, 4.0, 4.0)], [])


def test_an_inequality_holds_up_to_what_no_run_resolves():
    near = [(0.0, 0.0), (1.0, 1.0), (2.0, 2.0 + 1e-12), (3.0, 2.0 + 3e-12)]
    claims, (_,), kept = expecting("expect always: x <= 2", near)
    assert (claims[0][0], claims[0][2]) == (False, 3.0)
    assert kept == [False, False, True, True]
    assert expecting("expect always: x <= 2", near[:3])[0][0][0] is True
    assert expecting("expect always: x < 2", near[:3])[0] == [(False, 2.0 + 1e-12, 2.0)]


def test_finally_is_the_last_sample_of_a_run_that_ended():
    said = "expect finally: x == 4 within 0.1"
    assert expecting(said, RAMP)[0] == [(True, 4.0, 4.0)]
    assert expecting(said, RAMP[:3], finished=False)[0] == [(None, None, None)]
    claims, (told,), _ = expecting(said, RAMP[:3])
    assert claims == [(False, 2.0, 2.0)]
    assert told.message == "expect failed: 2 at 2 s, expected 4 within 0.1 (off by 20 times)"


def test_at_an_instant():
    said = "expect at 1 s: x == 1 within 1e-3"
    claims, told, kept = expecting(said, RAMP)
    assert (claims, told, kept) == ([(True, 1.0, 1.0)], [], [False, True, False, False])
    assert expecting(said, RAMP[:1], finished=False)[0] == [(None, None, None)]
    claims, (told,), _ = expecting(said, RAMP[:1])
    assert (claims, told.message) == ([(False, None, 1.0)], "expect failed: the run does not reach 1 s")


def test_what_misses_by_less_than_the_runs_own_error_says_which_accuracy_would_decide():
    said = "expect finally: x <= 3.999"
    (told,) = expecting(said, RAMP, estimate=1e-2)[1]
    assert told.help == "this is less than the estimated error of the run (0.01): --accuracy 2e-05 would decide it"
    (told,) = expecting(said, RAMP, estimate=1e-5)[1]
    assert "estimated error" not in told.help
    (told,) = expecting("expect finally: x == 3.5 within 0.49", RAMP, estimate=1e-2)[1]  # 0.01 beyond what is granted
    assert told.help.endswith("--accuracy 3e-04 would decide it")


def test_an_exact_claim_is_told_what_would_hold():
    (told,) = expecting("expect finally: x == 4.001", RAMP, estimate=1e-2)[1]
    assert told.help == "'==' without 'within' asks for the last bit: within 0.001 would hold"


# --- runs that disagree -----------------------------------------------------------------------------------------------


def run(name, values, *, inaccurate=False):
    time = np.linspace(0.0, 1.0, len(values))
    kept = {n: Quantity(n, np.asarray(v, float), "m", 1.0, None) for n, v in (
        ("x", values), ("audit.energy", [0.0, -3.0, 2.0]), ("audit.constraints", [0.0, 1e-9, 0.0]))}  # fmt: skip
    trace = Trace("", time, {}, {}, kept, ())
    missed = (Shortfall("accuracy", "x", 1.0, 1e-3, None, None, ""),) if inaccurate else ()
    judgement = replace(Judgement(True, ()), not_met=missed)
    return VerifiedRun("lagrangian", name, 1e-3, SimpleNamespace(judgement=judgement), (), trace, None)


BOUNDS = {"x": 1e-2}


def pairs(*runs):
    return [(d.one.method, d.other.method) for d in disagreements(runs, BOUNDS, 1.0)]


def test_runs_are_compared_with_the_first_and_those_that_agree_with_each_other():
    bdf, radau, dopri = run("bdf", [1, 1, 1]), run("radau", [1, 1.009, 1]), run("dopri", [1, 0.991, 1])
    assert pairs(bdf, radau, dopri) == [("radau", "dopri")]  # 0.018 apart, each within 0.01 of the first
    wrong = run("wrong", [1, 2, 1])
    assert pairs(bdf, radau, wrong) == [("bdf", "wrong")]
    assert pairs(bdf, bdf) == []
    assert pairs(bdf) == []


def test_a_first_run_that_missed_its_accuracy_judges_no_other():
    """It differs from both, which agree: nothing is held against them, and they are held against each other."""
    doubted = run("bdf", [1, 2, 1], inaccurate=True)
    two, three = run("radau", [1, 1, 1]), run("dopri", [1, 1.5, 1])
    assert pairs(doubted, two, three) == [("bdf", "radau"), ("bdf", "dopri"), ("radau", "dopri")]
    (first, *_) = disagreements((doubted, two), BOUNDS, 1.0)
    assert [r.method for r in first.doubted] == ["bdf"]
    assert (doubted.energy, doubted.constraints) == (3.0, 1e-9)


def test_what_differs_beyond_the_horizon_is_not_compared():
    one, other = run("bdf", [1, 1, 1]), run("radau", [1, 1, 2])
    assert disagreements((one, other), BOUNDS, 0.5) == ()
    assert worst(one, other, BOUNDS, 0.5).ratio == 0.0
    assert worst(one, other, BOUNDS, 1.0).ratio == pytest.approx(100.0)
    assert worst(one, one, BOUNDS, 1.0) is None
    assert worst(one, other, {}, 1.0) is None


def test_runs_that_the_solver_left_are_failures():
    stopped = replace(run("radau", [1, 1, 1]), failure="the solver stopped")
    made = Verified(**{**dict.fromkeys(Verified.__dataclass_fields__), "runs": (run("bdf", [1, 1, 1]), stopped),
                       "finer": stopped})  # fmt: skip
    assert made.failures == (stopped,) * 2


def test_a_run_that_stopped_early_neither_differs_nor_agrees():
    stopped = replace(run("radau", [1, 2, 1]), failure="the limit of wall time is reached")
    whole = run("bdf", [1, 1, 1])
    assert disagreements((whole, stopped), BOUNDS, 1.0) == disagreements((stopped, whole), BOUNDS, 1.0) == ()
    assert worst(whole, stopped, BOUNDS, 1.0) is worst(stopped, whole, BOUNDS, 1.0) is None
    other = run("dopri", [1, 3, 1])
    ((found),) = disagreements((stopped, whole, other), BOUNDS, 1.0)  # the two that ended are compared
    assert (found.one, found.other) == (whole, other)


# --- energies of statements -------------------------------------------------------------------------------------------


def powers(body):
    """Role and expression of each part of a model, by its label's first word."""
    report = Report()
    document = load.document(SourceText("m.sd", f"model m {{\n{body}\n}}\n"), report)
    network = load.network(document, document.models["m"], None, report)
    assert network is not None, [d.message for d in report]
    return balance.add_observations(network)


def worth(part, **values):
    """Its value; the displacement of x is `x`, its flow `x_`."""
    return evaluate([part.expression], lambda v: values[v.data[0] + ("_" if v.data[1] == "f" else "")])[0]


def test_energy_of_a_kinetic_coenergy_is_that_of_the_momentum():
    """T* = m c^2 (1 - sqrt(1 - v^2/c^2)): held is m c^2 (gamma - 1), at 0.6 c a quarter of m c^2."""
    _, parts = powers("coord x: translation = 0 m\nenergy T* = 4 N.m*(1 - sqrt(1 - (x'/(5 m/s))^2))")
    (part,) = parts
    assert (part.role, part.power, part.domain) == ("held", False, "translation")
    assert worth(part, x_=3.0) == pytest.approx(4.0 * 0.25, rel=1e-14)


def test_powers_of_contents_and_works():
    """D = 1/3 c |v|^3 dissipates c |v|^3; work F on x^2 supplies F 2 x v, counted as what comes in."""
    body = "coord x: translation = 1 m\nenergy T* = 1/2*(1 kg)*x'^2\n"
    _, parts = powers(f"{body}content D = 1/3*(2 N.s^2/m^2)*abs(x')^3\nwork 3 N/m on x^2\nenergy V = 5 N/m*x^2")
    by = {p.label.partition(" ")[0]: p for p in parts}
    assert {k: (p.role, p.power) for k, p in by.items()} == {
        "T*": ("held", False), "D": ("out", True), "work": ("in", True), "V": ("held", False),
    }  # fmt: skip
    assert {p.branch for p in parts} == {""}
    at = {"x": 0.5, "x_": -2.0}
    assert worth(by["D"], **at) == pytest.approx(2.0 * 8.0)
    assert worth(by["work"], **at) == pytest.approx(-(3.0 * 2.0 * 0.5 * -2.0))
    assert worth(by["V"], **at) == pytest.approx(5.0 * 0.25)


def test_sums_over_arrays_keep_their_loops():
    body = "param n = 2\ncoord x[1..n]: translation\nenergy T* = sum(i in 1..n: 1/2*(i*1 kg)*x[i]'^2)"
    _, (part,) = powers(body)
    i = ex.index("of#0")
    speed = ex.var("x", "f", i)
    each = ex.scale(0.5, ex.mul(i, speed, speed))
    assert part.expression is ex.reduction("sum", "of#0", ex.const(1.0), ex.param("n"), each)


def test_branches_are_measured_and_shares_counted_by_their_roles():
    network, parts = powers(
        "node a: electrical\nV: effort(e = 2 V) a -> ground\nR: dissipator(e = 3 ohm*f) a -> ground"
    )
    assert [(p.label, p.branch, p.role, p.power) for p in parts] == [("V", "V", "in", True), ("R", "R", "out", True)]
    assert len(network.states) == len(network.dynamics) == 2
    values = {"power of V": [1.0, -3.0], "power of R": [0.5, 4.5]}
    kept = {name: Quantity(name, np.array(v), "J", None, None) for name, v in values.items()}
    made = Trace("", np.array([0.0, 1.0]), {}, {}, kept, ())
    assert [(s.label, s.energy) for s in balance.shares(made, parts)] == [("V", 4.0), ("R", 4.0)]
    assert balance.shares(replace(made, time=np.zeros(0)), parts) == ()


def test_what_constraints_that_move_supply_is_a_row_of_its_own():
    def share(label, role, energy):
        return balance.Share(label, role, energy, None)

    parts = [share("M", "held", 5.0), share("R", "out", 2.0), share("V", "in", 4.0)]
    page = balance.section(parts, [p.label for p in parts], 0.0)
    assert "constraints and statements that move in time" in page
    assert page.count("<b>7</b>") == 1  # supplied: 4 J and the 3 J that are missing
    closed = [*parts[:2], share("V", "in", 7.0)]
    assert "move in time" not in balance.section(closed, [p.label for p in closed], 0.0)
    assert "were not measured" in balance.section([], [], 0.0)
    assert (balance.joules(-0.5), balance.joules(NAN), balance.joules(12345.6)) == ("−0.5", "–", "1.235e+04")


# --- the file of a sweep ----------------------------------------------------------------------------------------------


def test_runs_of_a_sweep_stand_in_their_own_places_however_they_were_made(tmp_path):
    """Run 0 was not made, 1 stopped halfway, 2 and 3 came from the core."""
    done = Done()
    ended = {"end": {"x": 1.5}, "least": {"x": 0.0}, "most": {"x": 2.0}}
    done.take(Kept(1, 3, False, "the solver stopped", "radau", None, 7, 0.25, **ended, time=[0.0, 1.0],
                  traces={"x": [0.0, 1.5]}))  # fmt: skip
    done.take(KeptRuns(
        np.array([3, 2]), ("x",), "dopri", np.array([1e-5, 1e-6]), np.array([40, 30]), np.array([0.5, 0.125]),
        np.array([[33.0], [22.0]]), np.zeros((2, 0)), np.zeros((2, 0)), np.array([0.0, 1.0, 2.0]),
        np.array([[[3.0, 3.1, 3.2]], [[2.0, 2.1, 2.2]]]),
    ))  # fmt: skip
    cases = [{"k": 10.0 * k, "mode": f"m{k}"} for k in range(4)]
    path = tmp_path / "s.h5"
    write(path, cases, done, {"x": "m", "k": "N/m"}, {"title": "t"}, timings=False)
    with h5py.File(path) as file:
        assert file.attrs["final"] == 0
        assert file["set.k"][:].tolist() == [0.0, 10.0, 20.0, 30.0]
        assert [v.decode() for v in file["set.mode"][:]] == ["m0", "m1", "m2", "m3"]
        assert file["exit"][:].tolist() == [-1, 3, 0, 0]
        assert file["met"][:].tolist() == [0, 0, 1, 1]
        assert [v.decode() for v in file["reason"][:]] == ["not run yet", "the solver stopped", "", ""]
        assert file["steps"][:].tolist() == [0, 7, 30, 40]
        np.testing.assert_equal(file["error_estimate"][:], [NAN, NAN, 1e-6, 1e-5])
        np.testing.assert_equal(file["end.x"][:], [NAN, 1.5, 22.0, 33.0])
        np.testing.assert_equal(file["min.x"][:], [NAN, 0.0, NAN, NAN])
        rows = [[NAN] * 3, [0.0, 1.5, NAN], [2.0, 2.1, 2.2], [3.0, 3.1, 3.2]]
        np.testing.assert_equal(file["trace.x"][:], rows)
        assert file["time"][:].tolist() == [0.0, 1.0, 2.0]
        assert (file["end.x"].attrs["units"], file["set.k"].attrs["units"]) == ("m", "N/m")
        assert "cpu_s" not in file
    assert list(tmp_path.iterdir()) == [path]
    done.take(Kept(0, 0, True, end={"x": 9.0}))
    write(path, cases, done, {}, {}, timings=True)
    with h5py.File(path) as file:
        assert file.attrs["final"] == 1
        assert file["cpu_s"][:].tolist() == [0.0, 0.25, 0.125, 0.5]
