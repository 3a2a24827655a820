"""A clutch closes while a crank stands at its dead centre, where it moves nothing: slopes there are round-off."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from sysdyn import api

CLUTCH = """model clutch {
  coord a, b: rotation
  coord s: translation ~ 0.34 m
  init b = 180 deg
  init a = 0 rad
  energy T* = 1/2*(12 kg.m^2)*a'^2 + 1/2*(1.5 kg.m^2)*b'^2 + 1/2*(180 kg)*s'^2
  energy V = -(180 kg)*g0*s
  phi rod: (s - 60 mm*cos(b))^2 + (60 mm*sin(b))^2 = (400 mm)^2
  let M = if t > 0.5 s then 1980 N.m else 0 N.m
  content D = M*abs(a' - b')
  init a' = 150 rpm
  init b' = 0 rpm
}
scene s of clutch { time 0 s to 0.6 s; trace a', b' }
"""


def exact():
    """Instant of sticking (s) and the common speed at 0.6 s, in b alone: s = r cos b + sqrt(l^2 - r^2 sin^2 b)."""
    r, rod, g = 0.06, 0.4, 9.80665

    def slider(b):
        w = np.sqrt(rod**2 - (r * np.sin(b)) ** 2)
        first = -r * np.sin(b) - r**2 * np.sin(b) * np.cos(b) / w
        second = -r * np.cos(b) - r**2 * np.cos(2 * b) / w - (r**2 * np.sin(b) * np.cos(b)) ** 2 / w**3
        return first, second

    def rate(own, torque):
        def f(_, y):
            first, second = slider(y[0])
            force = torque + 180.0 * g * first - 180.0 * first * second * y[1] ** 2
            return [y[1], force / (own + 180.0 * first**2)]

        return f

    speed = 150.0 * 2.0 * np.pi / 60.0
    slips = lambda t, y: speed - 1980.0 / 12.0 * (t - 0.5) - y[1]  # noqa: E731
    slips.terminal = True
    options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}
    one = solve_ivp(rate(1.5, 1980.0), (0.5, 0.6), [np.pi, 0.0], events=slips, **options)
    two = solve_ivp(rate(13.5, 0.0), (one.t[-1], 0.6), one.y[:, -1], **options)
    return one.t[-1], two.y[1, -1]


@pytest.mark.parametrize("method", ["radau", "bdf"])
@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
def test_it_sticks_as_the_motion_leaves_the_place(tmp_path, formulation, method):
    (tmp_path / "m.sd").write_text(CLUTCH)
    trace = api.simulate(tmp_path / "m.sd", formulation=formulation, method=method, output=tmp_path / "out.h5")
    instant, speed = exact()
    assert [e.time for e in trace.events] == pytest.approx([instant], abs=1e-6)
    assert trace["a'"].values[-1] == pytest.approx(speed, rel=1e-4)
    assert trace["b'"].values[-1] == pytest.approx(speed, rel=1e-4)
