"""A slice of the random rectifiers; the whole is `python tests/events/ideal_rectifiers.py`."""

import numpy as np
import pytest
from ideal_rectifiers import APART, Circuit, apart, voltage
from sysdyn.api import simulate


@pytest.mark.parametrize("seed", [0, 1, 2, 3, 4, 6, 8, 14, 38, 42, 48])
@pytest.mark.one_in(4)
@pytest.mark.filterwarnings("ignore")
def test_a_run_and_one_by_the_bdf_agree(seed, tmp_path):
    assert apart(tmp_path, seed)[0] < 0.1 * APART


@pytest.mark.filterwarnings("ignore")
def test_a_charge_that_is_round_off_does_not_stop_a_run(tmp_path):
    """That of a diode which blocks from the start, beside 0.07 C, asked steps of 1e-19 s (E930)."""
    file = tmp_path / "m.sd"
    file.write_text(Circuit(10).text)
    first, second = (
        voltage(simulate(file, output=tmp_path / "a.h5", method=method, rtol=1e-8)) for method in ("radau", "bdf")
    )
    assert np.abs(first - second).max() < 1e-5 * np.abs(second).max()


@pytest.mark.parametrize("seed", [4, 11, 26, 39])
@pytest.mark.filterwarnings("ignore")
def test_six_digits(seed, tmp_path):
    """Behind an event inductors that megaohms tie move within 1e-9 s: values between the ends of the next steps
    followed the slopes of that motion (the ledger was off by 2e-2 J), sizes of currents were those of their first
    slopes, and a current that follows a resistor was off within steps that the error at their ends had passed.
    """
    file = tmp_path / "m.sd"
    file.write_text(Circuit(seed).text.replace("1e-4", "1e-6"))
    found = simulate(file, output=tmp_path / "a.h5")
    assert found.met
    other = voltage(simulate(file, output=tmp_path / "b.h5", method="bdf", rtol=1e-7, unmet="warn"))
    assert np.abs(voltage(found) - other).max() < 1e-5 * np.abs(other).max()


def test_the_same_for_ever():
    assert Circuit(5).text == Circuit(5).text
    assert len({Circuit(seed).text for seed in range(60)}) == 60
