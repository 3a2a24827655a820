"""What the language does not offer of arrays and of components with several ports is refused with what to write."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from sysdyn import api
from sysdyn.cli.main import run

CHAINS = """\
from std.electrical import capacitor, resistor, voltage
component chain {
  param N = 2
  port a, b: electrical
  node v[0..N]: electrical
  inner: resistor(R = 1 ohm) a -> v[0]
  outer: resistor(R = 1 ohm) v[N] -> b
  for i in 1..N {
    R[i]: resistor(R = 1 kohm) v[i-1] -> v[i]
    C[i]: capacitor(C = 1 uF) v[i] -> ground
  }
}
model several {
  param n = 3
  node p: electrical
  V: voltage(v = 5 V*sin(2*pi*10 Hz*t)) p -> ground
  one: chain() a = p, b = ground
  for k in 1..n { S[k]: chain(N = SIZE) a = p, b = ground }
}
scene go of several {
  time 0 s to 0.1 s
  trace S[1].v[1].e as x, READ as y every 1 ms
}
"""
PUSHED = """\
model pushed {
  param n = 3
  input u[1..SIZE]: N = 0 N
  coord x[1..3]: translation = 0 m
  for i in 1..3 {
    energy T* = 1/2*(1 kg)*x[i]'^2
    work u[i] on x[i]
  }
}
scene go of pushed {
  time 0 s to 1 s
  set SETTING
  trace x[2] every 10 ms
}
"""


def chains(size="2", read="one.inner.power"):
    return api.check(CHAINS.replace("SIZE", size).replace("READ", read))


def pushed(size, setting):
    return api.check(PUSHED.replace("SIZE", size).replace("SETTING", setting))


def errors(found):
    return [d for d in found if d.severity == "error"]


@pytest.mark.parametrize("read", ["one.power", "one.energy", "one.energy_through"])
def test_a_component_with_ports_names_their_energies(read):
    error = errors(chains(read=read))[0]
    assert error.code == "E102"
    assert "energy_through(one.a) + energy_through(one.b)" in error.help
    assert not errors(chains(read="energy_through(one.a) + energy_through(one.b)"))


def test_the_energies_inside_an_array_of_components_can_be_read():
    assert not [d for d in chains(read="energy_through(S[2].a)") if d.code in ("N608", "E102")]
    (found,) = [d for d in chains(read="sum(i in 1..n: energy_through(S[i].a))") if d.code == "N608"]
    assert "sum(i in 1..n: S[i].R.energy)" in found.help
    assert not [d for d in chains(read="sum(i in 1..n: S[i].inner.energy)") if d.code in ("N608", "E102")]


@pytest.mark.parametrize("size", ["k", "k + 1", "if k == 1 then 1 else 3"])
def test_sizes_that_differ_in_an_array_are_named_where_they_are_given(size):
    (error,) = errors(chains(size))
    assert error.code == "E806"
    assert error.place.source.line(error.place.start[0]).strip() == "param N = 2"
    assert "S.N[k] is a size" in error.message
    assert "a label of its own for each" in error.help
    assert not errors(chains("n"))


@pytest.mark.long
def test_the_last_node_of_each_component_in_an_array_is_found_by_its_size(tmp_path):
    """`v[N]` of components of one size: three of 2*(1 ohm) + 3*(1 kohm) side by side, leaks of 1 Gohm in place of C."""
    path = tmp_path / "chains.sd"
    text = CHAINS.replace("  one: chain() a = p, b = ground\n", "").replace("SIZE", "n").replace("READ", "-V.f/(5 A)")
    text = text.replace("capacitor(C = 1 uF)", "resistor(R = 1 Gohm)").replace("5 V*sin(2*pi*10 Hz*t)", "5 V")
    path.write_text(text)
    conductance = api.simulate(str(path), output=str(tmp_path / "c.h5"), backend="numpy")["y"].values
    np.testing.assert_allclose(conductance, 3.0 / 3002.0, rtol=1e-5)  # three chains of three


def test_elements_of_an_input_that_vary_are_listed_where_its_size_is_a_number():
    assert not errors(pushed("3", "u = [1 N, t*1 N/s, 0 N]"))
    (error,) = errors(pushed("3", "u[2] = t*1 N/s"))
    assert (error.code, error.help) == ("E807", "the whole: set u = [a, b, ...]")
    (error,) = errors(pushed("n", "u = [1 N, t*1 N/s, 0 N]"))
    assert error.code == "E805"
    assert error.help.endswith("input u[1..3]")


CRANKS = """\
model cranks {
  coord th[1..3]: rotation ~ 0.01
  coord x, y: translation ~ 0.1 m
  coord turn: rotation ~ 0
  param px[1..3] = [0 m, 1 m, 0.4 m]
  param py[1..3] = [0 m, 0 m, 0.6 m]
  init th[1] = 0.01
  init th[1]' = 0 rad/s
  energy T* = sum(i in 1..3: 1/2*(0.1 kg.m^2)*th[i]'^2) + 1/2*(2 kg)*(x'^2 + y'^2) + 1/2*(0.05 kg.m^2)*turn'^2
  energy V = 2 kg*g0*y
  for i in 1..3 {
ROWS
  }
}
scene s of cranks {
  time 0 s to 0.5 s
  redundancy minimum_norm
  trace th[1] as th every 10 ms
}
"""
ALONG = "    phi along[i]: 0.3 m*cos(th[i]) = x + px[i]*(cos(turn) - 1) - py[i]*sin(turn)"
ACROSS = "    phi across[i]: 0.3 m*sin(th[i]) = y + px[i]*sin(turn) + py[i]*(cos(turn) - 1)"


def fallen(t, speed=0.0):
    """Angle, its rate and its acceleration [instants]: they fall as one pendulum, J th'' = -m g r cos th."""
    turning = -2.0 * 9.80665 * 0.3 / (3 * 0.1 + 2.0 * 0.09)
    found = solve_ivp(
        lambda t, u: (u[1], turning * np.cos(u[0])), (0.0, t[-1]), (0.01, speed), t_eval=t, rtol=1e-12, atol=1e-12
    )
    return *found.y, turning * np.cos(found.y[0])


def test_a_constraint_left_out_where_it_is_needed_is_named(tmp_path, capsys):
    """Three parallel cranks fall through the horizontal: across[3] says there what no other does.  By round-off a run
    may pass; then it is right.
    """
    ended = {}
    for name, rows in (("needed", (ALONG, ACROSS)), ("not", (ACROSS, ALONG))):
        text = CRANKS.replace("ROWS", "\n".join(rows)).replace("minimum_norm", "drop")
        (tmp_path / f"{name}.sd").write_text(text)
        for accuracy in (1e-2, 1e-3, 1e-6):
            given = ["--method", "rosenbrock", "--accuracy", str(accuracy), "-o", str(tmp_path / "t.h5")]
            ended[name, accuracy] = run(["simulate", str(tmp_path / f"{name}.sd"), *given])
            said = capsys.readouterr().err
            if ended[name, accuracy] == 0:
                found = api.Trace.open(tmp_path / "t.h5")
                th = fallen(found.time)[0]
                assert np.abs(found["th"].values - th).max() < accuracy * np.abs(th).max()
            elif name == "needed" and "E920" not in said:
                assert "--redundancy minimum_norm, which leaves out others" in said
                assert "another of its group is the last (left out as redundant, and needed there: across[3])" in said
    assert 3 in [ended["needed", accuracy] for accuracy in (1e-2, 1e-3, 1e-6)]
    assert 0 in [ended["not", accuracy] for accuracy in (1e-2, 1e-3, 1e-6)]


def test_of_constraints_that_take_turns_in_being_needed_others_are_left_out_as_they_turn(tmp_path):
    """The cranks go round: each choice of a constraint to leave out loses rank twice a turn.  The multipliers are the
    least at any instant: J^T kappa = Upsilon - M f'.
    """
    text = CRANKS.replace("ROWS", f"{ALONG}\n{ACROSS}").replace("= 0 rad/s", "= 6 rad/s").replace("0.5 s", "1.5 s")
    loads = ", ".join(f"{name}[{k}].multiplier" for name in ("along", "across") for k in (1, 2, 3))
    (tmp_path / "cranks.sd").write_text(text.replace("as th", f"as th, {loads}"))
    runs = ("dopri", "hamiltonian"), ("energy", "lagrangian"), ("radau", "hamiltonian"), ("bdf", "lagrangian")
    for method, form in runs:
        accuracy = 1e-4 if method == "bdf" else 1e-6
        given = {"method": method, "formulation": form, "accuracy": accuracy, "output": tmp_path / f"{method}.h5"}
        found = api.simulate(tmp_path / "cranks.sd", **given)
        th, rate, push = fallen(found.time, 6.0)
        assert th.max() > 2.0 * np.pi
        assert np.abs(found["th"].values - th).max() < accuracy * np.abs(th).max()
        for k in range(0, th.size, 10):
            sine, cosine = 0.3 * np.sin(th[k]), 0.3 * np.cos(th[k])
            reactions = np.zeros((6, 6))
            reactions[:3, :3], reactions[3:, :3] = -sine * np.eye(3), cosine * np.eye(3)
            reactions[:3, 3] = reactions[3:, 4] = -1.0
            reactions[:, 5] = 0.0, 0.0, 0.6, -0.0, -1.0, -0.4
            across = -sine * push[k] - cosine * rate[k] ** 2, cosine * push[k] - sine * rate[k] ** 2
            moved = -0.1 * push[k] * np.array([1.0, 1.0, 1.0])
            due = np.array([*moved, -2.0 * across[0], -2.0 * (across[1] + 9.80665), 0.0])
            least = np.linalg.lstsq(reactions.T, due, rcond=1e-9)[0]
            shown = np.array([found[name].values[k] for name in loads.split(", ")])
            assert np.abs(shown - least).max() < 100.0 * accuracy * np.abs(least).max()
