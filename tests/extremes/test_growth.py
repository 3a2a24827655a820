"""What is small early and grows: five problems from one part in 10^12, right at 1e-4 and 1e-6.

References by SciPy in variables in which nothing is small: logarithms, and the angle from the top.
"""

from pathlib import Path

import numpy as np
import pytest
from running import ran
from scipy.integrate import solve_ivp
from sysdyn.runtime.integrate import origin
from sysdyn.runtime.model import scales

FILE = Path(__file__).with_name("growth.sd")
BESIDE_PI = 1.2246467991473532e-16  # pi less its double


def solved(rate, start, t, method="DOP853", atol=1e-14):
    found = solve_ivp(rate, (0.0, t[-1]), start, method=method, t_eval=t, rtol=1e-12, atol=atol)
    assert found.success
    return found.y


def exponential(t):
    return np.exp(t)


def epidemic(t):
    return np.exp(solved(lambda t, x: [-0.5 * x[0] * np.exp(x[1]), 0.5 * x[0] - 0.1], [1 - 1e-12, np.log(1e-12)], t)[1])


def oscillator(t):
    return solved(lambda t, x: [x[1], 0.4 * (1 - x[0] ** 2) * x[1] - x[0]], [1e-9, 0.0], t, atol=1e-22)[0]


def pendulum(t):
    above = np.pi - (np.pi - 1e-9) + BESIDE_PI
    return np.pi - solved(lambda t, x: [x[1], 9.80665 * np.sin(x[0])], [above, 0.0], t, atol=1e-22)[0]


def ignition(t):
    return np.exp(solved(lambda t, x: np.exp(x) - np.exp(2 * x), [np.log(1e-5)], t, "Radau")[0])


@pytest.mark.parametrize("accuracy", [1e-4, 1e-6])
@pytest.mark.parametrize("reference", [exponential, epidemic, oscillator, pendulum, ignition], ids=lambda f: f.__name__)
@pytest.mark.long
def test_what_grows_is_right(tmp_path, reference, accuracy):
    run = ran(tmp_path, FILE, scene=f"{reference.__name__}_run", accuracy=accuracy)
    assert not run.refused
    assert run.met
    t = np.unique(np.asarray(run.trace.time))
    wanted = reference(t)
    assert np.abs(run.at("y", t) - wanted).max() <= accuracy * np.abs(wanted).max()


@pytest.mark.parametrize("method", ["bdf", "radau"])
@pytest.mark.long
def test_an_epidemic_breaks_out_with_either_method(tmp_path, method):
    run = ran(tmp_path, FILE, scene="epidemic_run", method=method, accuracy=1e-3)
    t = np.unique(np.asarray(run.trace.time))
    wanted = epidemic(t)
    assert np.abs(run.at("y", t) - wanted).max() <= 3e-3 * wanted.max()


ROD = """model rod {
  param m = 0.3 kg
  param w = 5 rad/s
  coord x: translation = 0.7 m
  coord y: translation ~ 0 m
  energy T* = 1/2*m*(x'^2 + y'^2)
  phi rod: x*sin(w*t) - y*cos(w*t) = 0
  init x' = 0 m/s
}
scene run of rod {
  time 0 s to 0.4 s
  trace x, y
}
"""


@pytest.mark.long
def test_zeros_at_the_start_count_as_a_part_of_their_like(tmp_path, monkeypatch):
    """Not as what they move in the shortest time about: beside that what moves at last is without bounds."""
    found = []

    def magnitudes(*arguments, **named):
        magnitude, time = scales.magnitudes(*arguments, **named)
        found.append(magnitude.copy())  # a run's own grow
        return magnitude, time

    monkeypatch.setattr(origin, "magnitudes", magnitudes)
    run = ran(tmp_path, ROD)
    assert run.met
    assert found
    for magnitude in found:
        assert magnitude[0] == pytest.approx(0.7, rel=1e-12)
        assert 0.7e-3 <= magnitude[1] <= 0.7
    # x'' = w^2 x along the rod
    along = np.hypot(np.asarray(run.trace["x"]), np.asarray(run.trace["y"]))
    assert np.abs(along - 0.7 * np.cosh(5.0 * np.asarray(run.trace.time))).max() <= 1e-4 * along.max()


@pytest.mark.parametrize("method", ["auto", "dopri", "radau", "bdf", "rosenbrock"])
@pytest.mark.one_in(3)
def test_a_run_that_ends_at_a_pole_is_not_met(tmp_path, method):
    """1/(1 - t) has no value at 1 s; just before it is met."""
    run = ran(tmp_path, FILE, method=method, scene="pole_run")
    assert not run.met
    before = ran(tmp_path, FILE, method=method, until="0.99", scene="pole_run")
    assert before.met
    assert before.at("y", 0.99) == pytest.approx(100.0, rel=1e-4)
