"""Rows between steps where laws are steep or stiff: a boost converter whose switching node holds 200 pF beside 4.7 uF,
a filter of three amplifiers.
"""

from pathlib import Path

import numpy as np
import pytest
from sysdyn.api import simulate
from sysdyn.cli.main import run

NETLIST = Path(__file__).parents[1] / "cli" / "netlists" / "boost.cir"


@pytest.mark.filterwarnings("ignore:.*not meet the equations")
@pytest.mark.parametrize(
    ("rtol", "volts", "amperes"),  # of 13 V and 1.4 A at most; the diode's current is steep in what its node holds
    [(1e-1, 0.05, np.inf), (1e-3, 0.01, 2.0), (1e-5, 1e-4, 0.1)],
)
@pytest.mark.long
def test_rows_of_radau_stay_with_the_motion(tmp_path, rtol, volts, amperes):
    model = tmp_path / "boost.sd"
    assert run(["import", str(NETLIST), "-o", str(model), "--quiet"]) == 0
    model.write_text(model.read_text().replace("as v_out", "as v_out, d1.f as i"))
    fine = simulate(model, accuracy=1e-6, output=tmp_path / "fine.h5")
    rows = simulate(model, rtol=rtol, method="radau", output=tmp_path / "t.h5")
    assert np.max(np.abs(np.asarray(rows["v_out"]) - np.asarray(fine["v_out"]))) < volts
    assert np.max(np.abs(np.asarray(rows["i"]) - np.asarray(fine["i"]))) < amperes


@pytest.mark.parametrize(("name", "part"), [("buck", 2e-3), ("osc", 0.05)])
def test_rosenbrock_goes_on_from_what_its_steps_leave_of_a_diode(tmp_path, name, part):
    """Linear steps do not meet an exponential: no length of the next one bore what they left."""
    model = tmp_path / "model.sd"
    assert run(["import", str(NETLIST.with_stem(name)), "-o", str(model), "--quiet"]) == 0
    fine = simulate(model, accuracy=1e-6, output=tmp_path / "fine.h5")
    rows = simulate(model, rtol=1e-2, method="rosenbrock", output=tmp_path / "t.h5")
    (shown,) = fine.names
    wanted = np.asarray(fine[shown])
    assert np.max(np.abs(np.asarray(rows[shown]) - wanted)) < part * np.max(np.abs(wanted))


@pytest.mark.long
def test_rows_of_radau_behind_a_kink_of_a_stiff_filter(tmp_path):
    """The high pass was 0.12 off at 3.07 ms, behind the source's kink."""
    model = tmp_path / "model.sd"
    assert run(["import", str(NETLIST.with_stem("biquad")), "-o", str(model), "--quiet"]) == 0
    fine = np.asarray(simulate(model, accuracy=1e-6, output=tmp_path / "fine.h5")["v_hp"])
    rows = np.asarray(simulate(model, rtol=1e-3, method="radau", output=tmp_path / "t.h5")["v_hp"])
    assert np.max(np.abs(rows - fine)) < 1e-3 * np.max(np.abs(fine))
