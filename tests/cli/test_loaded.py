"""`api.load`: a model compiled once and run often gives what `simulate` gives; `api.check`; traces in memory."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from sysdyn.api import ModelError, NotMet, SolverFailure, Trace, UsageError, check, compile_model, load, simulate
from texts import LADDER

MODELS = Path(__file__).parents[2] / "models"

ARRAY = """
model masses {
  param n = 3
  for i in 1..n {
    param m[i] = i*(1 kg)
  }
  param k = 4 N/m
  input push: N = 0 N
  coord x[1..n]: translation = 1 m
  energy T* = sum(i in 1..n: 1/2*m[i]*x[i]'^2)
  energy V = sum(i in 1..n: 1/2*k*x[i]^2)
  work push on x[1]
  for i in 1..n {
    init x[i]' = 0 m/s
  }
}
scene s of masses {
  time 0 s to 2 s
  trace x[1] as a, x[2] as b every 10 ms
  accuracy 1e-6
}
"""


@pytest.fixture
def masses(tmp_path):
    path = tmp_path / "masses.sd"
    path.write_text(ARRAY)
    return path


SAME = ("pendulum", "dc_motor", "bouncing_ball", "diode_circuit", "co_circuit", "two_tank")
"""One or none of each: constraints, inputs, events, steep laws; unknowns that leave the runs."""


@pytest.mark.parametrize("name", [f"seed/{name}" for name in SAME])
@pytest.mark.long
def test_runs_equal_those_of_the_command_to_the_last_bit(name, tmp_path):
    """Runs on their own: with an option that the others do not have (tests/cli/test_in_core.py looks at those)."""
    file = MODELS / f"{name}.sd"
    model = load(file, scene="reference")
    own = {"max_steps": 10**6}
    model.run({next(iter(model.parameters)): 1.1 * float(next(iter(model.parameters.values())))}, **own)
    for changed in ({}, {k: 1.05 * float(v) for k, v in model.parameters.items() if np.ndim(v) == 0}):
        mine = model.run(changed, **own)
        other = simulate(file, scene="reference", set=changed, output=tmp_path / "t.h5")
        assert set(mine.names) == set(other.names)
        assert all(np.array_equal(mine[n], other[n], equal_nan=True) for n in (*mine.names, "audit.energy"))
        assert np.array_equal(mine.time, other.time)
        assert [(e.time, e.name, e.after) for e in mine.events] == [(e.time, e.name, e.after) for e in other.events]
        assert mine.statistics == other.statistics
        assert all(mine[n].nominal == other[n].nominal and mine[n].units == other[n].units for n in mine.names)


CASES = (("seed/slider_crank", "reference"), ("gallery/lead_filter", "charges"), ("seed/two_tank", "reference"))


@pytest.mark.parametrize(("name", "scene"), CASES)
@pytest.mark.long
def test_a_run_depends_on_nothing_that_ran_before(name, scene):
    """Structures of other runs, of other forms and of one that stopped, leave no trace in it."""
    used, fresh = (load(MODELS / f"{name}.sd", scene=scene) for _ in range(2))
    numbers = {k: float(v) for k, v in used.parameters.items() if np.ndim(v) == 0}
    for factor, options in ((1.02, {}), (0.98, {"index": "2"}), (1.04, {"method": "bdf"}), (1.01, {"rtol": 1e-9})):
        used.run({k: factor * v for k, v in numbers.items()}, **options)
    with pytest.raises(SolverFailure):
        used.run({}, max_steps=2)
    one, other = (model.run({k: 1.03 * v for k, v in numbers.items()}) for model in (used, fresh))
    assert all(np.array_equal(one[n], other[n], equal_nan=True) for n in (*one.names, "audit.energy"))
    assert (one.statistics, one.attributes["judged"]) == (other.statistics, other.attributes["judged"])


def test_settings_of_every_kind(masses):
    """Parameters by number or text, one element, an array, an input, a size: each against its closed form."""
    model = load(masses)
    rate = 2.0  # sqrt(k/m[1])
    for settings, a, b in (
        ({}, np.cos(rate * 2), np.cos(rate / np.sqrt(2) * 2)),
        ({"k": "9 N/m"}, np.cos(3.0 * 2), np.cos(3.0 / np.sqrt(2) * 2)),
        ({"m[2]": 4.0}, np.cos(rate * 2), np.cos(1.0 * 2)),
        ({"m": [4.0, 1.0, 1.0]}, np.cos(1.0 * 2), np.cos(2.0 * 2)),
        ({"push": "4 N"}, 1.0, np.cos(rate / np.sqrt(2) * 2)),
        ({"push": "4 N", "k": 1.0}, 4.0 - 3.0 * np.cos(2.0), np.cos(2.0 / np.sqrt(2))),
        ({"n": 2}, np.cos(rate * 2), np.cos(rate / np.sqrt(2) * 2)),
    ):
        run = model.run(settings)
        assert abs(run["a"].values[-1] - a) < 4e-6, settings
        assert abs(run["b"].values[-1] - b) < 4e-6, settings
    assert model.run({}, until=1.0, at=[0.123]).time[-1] == 1.0
    assert 0.123 in model.run({}, until="1 s", at=[0.123]).time


def test_what_cannot_be_run_says_why(masses):
    model = load(masses)
    for settings, said in (
        ({"zz": 1.0}, "not a parameter"),
        ({"zz": [1.0, 2.0]}, "no parameter 'zz'"),
        ({"#branch 0": [1.0, 2.0]}, "no parameter '#branch 0'"),  # the compiler's own tables
        ({"k": "3 kg"}, "kg"),
        ({"m": [1.0, 2.0]}, "shape"),
    ):
        with pytest.raises(ModelError, match=said):
            model.run(settings)
    with pytest.raises(UsageError, match="formulation"):
        model.run({}, formulation="kane")
    with pytest.raises(SolverFailure):
        model.run({}, max_steps=3)
    assert model.run({})["a"].values[-1] == pytest.approx(np.cos(4.0), abs=4e-6)  # still usable
    assert "masses" in repr(model)


def test_a_run_that_is_not_met_raises_with_its_trace(masses):
    model = load(masses, method="bdf")
    with pytest.raises(NotMet) as found:
        model.run({}, accuracy=1e-13, until=200.0)
    assert found.value.trace.met is False
    with pytest.warns(UserWarning, match="accuracy"):
        assert model.run({}, accuracy=1e-13, until=200.0, unmet="warn").met is False


def test_a_trace_in_memory_is_saved_as_the_command_writes_it(masses, tmp_path):
    model = load(masses)
    held = model.run({"k": 2.0})
    held.save(tmp_path / "saved.h5")
    again = Trace.open(tmp_path / "saved.h5")
    assert set(again.names) == set(held.names)
    assert all(np.array_equal(again[n], held[n]) and again[n].nominal == held[n].nominal for n in held.names)
    assert (again.met, again.statistics, again.parameters) == (held.met, held.statistics, held.parameters)
    assert again.timings["cpu_integrate_s"] > 0.0


def test_a_trace_as_xarray_and_pandas(masses):
    pytest.importorskip("xarray")
    held = load(masses).run({"k": 2.0})
    data, frame = held.to_xarray(), held.to_pandas()
    assert data["a"].dims == ("time",)
    assert data["a"].attrs["units"] == "m"
    assert float(data["a"].sel(time=1.0, method="nearest")) == held["a"].values[np.abs(held.time - 1.0).argmin()]
    assert data.attrs["met"] == 1
    assert np.array_equal(frame["b"].to_numpy(), held["b"])
    assert frame.index.name == "time"
    assert frame.attrs["units"]["audit.energy"] == "J"


def test_check_of_a_text():
    assert check(ARRAY) == []
    found = check("model m {\n  coord x: translation\n  energy T* = 1/2*y*x'^2\n}\n", "mine.sd")
    assert [d.code for d in found] == ["E101"]
    assert found[0].place.file == "mine.sd"


ZERO = """
model zero {
  param m = 0.5 kg
  coord x: translation = 1 m
  coord y: translation = 0.2 m
  energy T* = 1/2*(1 kg)*x'^2 + 1/2*m*y'^2
  energy V = 1/2*(4 N/m)*x^2 + 1/2*(9 N/m)*(y - x)^2
  content D = 1/2*(1 N.s/m)*y'^2
  init x' = 0 m/s
}
scene s of zero { time 0 s to 2 s; trace x, y every 0.5 s }
"""


def test_a_mass_may_become_zero_in_hamiltons_form_which_divides_by_it(tmp_path):
    path = tmp_path / "zero.sd"
    path.write_text(ZERO)
    ends = {}
    for formulation in ("lagrangian", "hamiltonian"):
        model = load(path, formulation=formulation)
        ends[formulation] = [model.run(set={"m": m})["y"][-1] for m in (0.5, 0.0, 0.5)]
        assert ends[formulation][0] == ends[formulation][2]
    assert np.allclose(ends["lagrangian"], ends["hamiltonian"], rtol=0.0, atol=1e-4)
    assert abs(ends["lagrangian"][0] - ends["lagrangian"][1]) > 1e-3


NEURONS = """
model neurons {
  param n = 3
  param w[1..n, 1..n] = 0.5
  state s[1..n]: 1 = 0.1
  state r: 1 = 1
  for i in 1..n { dynamic s[i]' = (tanh(sum(j in 1..n: w[i, j]*s[j]*j) + 0.1*i) - s[i])/(1 s) }
  dynamic r' = (max(i in 1..n: s[i]) - r*exp(-sum(i in 1..n: s[i])) - prod(i in 1..n: 1 + s[i]))/(1 s)
}
scene fire of neurons {
  time 0 s to 3 s
  trace s[n] as last, r
  accuracy 1e-7
}
"""


@pytest.mark.parametrize("formulation", ["lagrangian", "co_hamiltonian"])
def test_functions_of_sums_over_a_size_follow_the_size(tmp_path, formulation):
    """Written out for each size that is asked for: the same model runs with 3, with 5 and with 3 again."""
    path = tmp_path / "neurons.sd"
    path.write_text(NEURONS)
    model = load(path, scene="fire", formulation=formulation)

    def rates(t, z):
        s, r = z[:-1], z[-1]
        i = np.arange(1.0, s.size + 1)
        grown = s.max() - r * np.exp(-s.sum()) - np.prod(1.0 + s)
        return np.append(np.tanh(0.5 * (s * i).sum() + 0.1 * i) - s, grown)

    for n in (3, 5, 3):
        found = model.run({"n": n} if n != 3 else {})
        wanted = solve_ivp(rates, (0.0, 3.0), np.append(np.full(n, 0.1), 1.0), rtol=1e-11, atol=1e-12).y[-2:, -1]
        assert [found["last"][-1], found["r"][-1]] == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 8])
@pytest.mark.long
def test_a_ladder_of_another_length_is_that_ladder(tmp_path, n):
    """Of three sections the middle one is both the second and the last but one: no other length has its rows."""
    (tmp_path / "m.sd").write_text(LADDER)
    found = load(tmp_path / "m.sd").run(set={"n": n})["out"].values[-1]
    a = np.diag([-2.0] * (n - 1) + [-1.0]) + np.diag(np.ones(n - 1), 1) + np.diag(np.ones(n - 1), -1)
    source = np.zeros(n)
    source[0] = 1.0
    settled = np.linalg.solve(-a, source)
    assert found == pytest.approx((settled - expm(a) @ settled)[-1], rel=1e-3, abs=1e-7)


def test_the_residual_of_a_network_is_that_of_one_size(tmp_path):
    (tmp_path / "m.sd").write_text(LADDER)
    module = compile_model(tmp_path / "m.sd")
    zeros = np.zeros(module.y0.size)
    assert np.isfinite(module.residual(0.0, zeros, zeros, {"Rr": 500.0})).all()
    with pytest.raises(ModelError, match="the size 'n' is part of the text"):
        module.residual(0.0, zeros, zeros, {"n": 5.0})


@pytest.mark.parametrize(
    ("settings", "code"),
    [
        ({"Rr": -5.0}, "E322"),
        ({"Rr": 20e3}, "E322"),
        ({"R[2].R": -1.0}, "E322"),
        ({"n": 2.5}, "E805"),
    ],
)
@pytest.mark.one_in(2)
def test_numbers_that_a_text_refuses_are_refused_of_a_run(tmp_path, settings, code):
    (tmp_path / "m.sd").write_text(LADDER)
    model = load(tmp_path / "m.sd")
    assert model.run(set={"Rr": 9e3})["out"].values[-1] > 0.0
    with pytest.raises(ModelError) as error:
        model.run(set=settings)
    assert code in {d.code for d in error.value.diagnostics}


@pytest.mark.parametrize("settings", [{"k": -2.0}, {"m[2]": -1.0}, {"m": [1.0, 2.0, -3.0]}])
@pytest.mark.one_in(5)
def test_a_negative_stiffness_or_inertia_is_refused_of_a_run(tmp_path, settings):
    (tmp_path / "m.sd").write_text("""model m {
  param k = 4 N/m
  param m[1..3] = [1 kg, 2 kg, 3 kg]
  node x[1..3]: translation
  for i in 1..3 {
    K[i]: potential(e = 2*k*q) x[i]
    M[i]: kinetic(p = m[i]*f) x[i]
    init x[i].q = 1 m
  }
}
scene s of m { time 0 s to 1 s; trace x[1].q as x }
""")
    model = load(tmp_path / "m.sd")
    assert model.run(set={"k": 2.0, "m": [1.0, 2.0, 3.0]})["x"].values[-1] == pytest.approx(np.cos(2.0), rel=1e-3)
    with pytest.raises(ModelError) as error:
        model.run(set=settings)
    assert {d.code for d in error.value.diagnostics} == {"E325" if "k" in settings else "E321"}


@pytest.mark.parametrize("settings", [{"a": -1.0}, {"c": -1.0}])
def test_a_dissipator_that_would_give_power_is_refused_of_a_run(tmp_path, settings):
    (tmp_path / "m.sd").write_text("""model m {
  param a = 1 ohm
  param c = 1 V/A^3
  node x: electrical
  R: dissipator(e = a*f + c*f^3) x
  C: potential(e = q/(1 F)) x
  init C.e = 1 V
}
scene s of m { time 0 s to 1 s; trace C.e as v }
""")
    model = load(tmp_path / "m.sd")
    assert model.run(set={"a": 2.0, "c": 0.0})["v"].values[-1] == pytest.approx(np.exp(-0.5), rel=1e-3)
    with pytest.raises(ModelError, match="E313"):
        model.run(set=settings)
