"""What rides on an offset: accuracy relative to the range, which temperatures in degC have anyhow; N922 for others."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from sysdyn import api
from sysdyn.cli.run import running
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.dsl.text.diagnostics import Report

RISE = """model rise {
  state T: K = %(base)g K
  state w: 1 = 0.3
  dynamic T' = (1.5 K*w^3 - (T - %(base)g K))/(1 s)
  dynamic w' = (w - w^3)/(2 s)
}
scene go of rise {
  time 0 s to 20 s
  trace T%(unit)s every 0.5 s
  %(accuracy)s
}
"""


def exact(base, time):
    def rate(_, y):
        return [1.5 * y[1] ** 3 - y[0], 0.5 * (y[1] - y[1] ** 3)]

    return base + solve_ivp(rate, (0.0, 20.0), [0.0, 0.3], method="DOP853", rtol=1e-13, atol=1e-13, t_eval=time).y[0]


def write(tmp_path, accuracy, base=290.0, unit=""):
    (tmp_path / "m.sd").write_text(RISE % {"base": base, "unit": unit, "accuracy": accuracy})
    return tmp_path / "m.sd"


@pytest.mark.parametrize("method", ["bdf", "radau", "rosenbrock", "dopri"])
@pytest.mark.parametrize(("asked", "base"), [(1e-3, 290.0), (1e-5, 290.0), (1e-5, 1e5)])
def test_errors_are_a_part_of_the_range(tmp_path, asked, base, method):
    text = write(tmp_path, f"accuracy {asked} on T relative to range", base)
    trace = api.simulate(text, output=tmp_path / "out.h5", method=method)
    right = exact(base, trace.time)
    rise = np.ptp(right)
    assert np.abs(trace["T"].values - right).max() < asked * rise
    assert trace["T"].nominal == pytest.approx(rise, rel=2 * asked)
    assert trace.statistics["error_estimate"] <= asked


def test_a_temperature_in_degrees_is_judged_by_its_rise(tmp_path):
    trace = api.simulate(write(tmp_path, "accuracy 1e-6", unit=" in degC"), output=tmp_path / "out.h5")
    right = exact(290.0, trace.time)
    assert trace["T"].nominal == pytest.approx(np.ptp(right), rel=1e-5)
    assert np.abs(trace["T"].values + 273.15 - right).max() < 1e-6 * np.ptp(right)


RANGED = " relative to range"


@pytest.mark.parametrize(("base", "ranged", "noted"), [(1e4, "", True), (1e4, RANGED, False), (290.0, "", False)])
def test_what_moves_by_a_small_part_of_its_size_is_noted(tmp_path, base, ranged, noted):
    report = Report()
    text = write(tmp_path, f"accuracy 1e-4 on T{ranged}", base)
    assert running.run(RunRequest(str(text), output=str(tmp_path / "out.h5")), report).exit == 0
    notes = [d for d in report if d.code == "N922"]
    assert bool(notes) == noted
    assert all("T moves by 1.5 K" in d.message and "on T relative to range" in d.help for d in notes)


def test_the_words_are_kept_by_the_layout(tmp_path):
    from sysdyn.dsl.format.format import format_text

    text = write(tmp_path, "accuracy 1e-6 on T relative to range").read_text()
    assert "accuracy 1e-6 on T relative to range" in format_text(text)
