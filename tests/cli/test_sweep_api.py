"""`Model.sweep`: the study of the command in Python; Monte Carlo against closed forms."""

import os
from pathlib import Path

import numpy as np
import pytest
from sysdyn.api import Sweep, UsageError, load

LONG = bool(os.environ.get("SYSDYN_LONG"))

TEXT = """
model filter {
  param R = 1000 ohm
  param C = 1e-6 F
  coord q: electrical
  energy V = q^2/(2*C)
  content D = 1/2*R*q'^2
  work 1 V on q
  init q = 0 C
}

scene step of filter {
  time 0 s to 1 ms
  trace q/C as u
  accuracy 1e-5
}
"""


@pytest.fixture
def filter_(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("filter.sd").write_text(TEXT)
    return load("filter.sd")


def test_a_product_of_lists(filter_):
    found = filter_.sweep({"R": [500.0, 1000.0], "C": "0.5e-6 F..2e-6 F:3"})
    assert found["set.R"].tolist() == [500.0] * 3 + [1000.0] * 3
    expected = 1.0 - np.exp(-1e-3 / (found["set.R"] * found["set.C"]))
    assert np.abs(found["end.u"] - expected).max() < 1e-5
    assert found.failed == ()
    assert found.units["end.u"] in ("V", "kg m2 s-3 A-1", "kg*m^2/(s^3*A)")
    assert "6 runs over C, R" in repr(found)


def test_as_xarray_and_pandas(filter_):
    pytest.importorskip("xarray")
    pytest.importorskip("pandas")
    found = filter_.sweep({"R": [500, "2 kohm"]}, output="runs.h5", until=2e-3)
    data, table = found.to_xarray(), found.to_pandas()
    assert data["end.u"].dims == ("run",)
    assert table.loc[1, "set.R"] == 2000.0
    assert table.loc[1, "end.u"] == pytest.approx(1.0 - np.exp(-1.0), abs=2e-5)
    again = Sweep.open("runs.h5")
    assert all(np.array_equal(again[name], found[name]) for name in found)


def test_what_fails_is_named_and_wrong_usage_raised(filter_):
    found = filter_.sweep({"C": [1e-6, 0.0]})
    assert [k for k, _, _ in found.failed] == [1]
    assert found["met"].tolist() == [1, 0]
    with pytest.raises(UsageError, match="runs"):
        filter_.sweep({"R": "~normal(1000, 10)"})
    with pytest.raises(UsageError, match="a list"):
        filter_.sweep({"R": {}})


def test_monte_carlo_has_the_quantiles_of_the_closed_form(filter_):
    """u(T) = 1 - exp(-T/RC) of lognormal R and C: ln RC is normal, so every quantile is known; those of a sample lie
    within four standard errors sqrt(p (1 - p)/n)/density.  SYSDYN_LONG=1: 10000 runs, else 2000.
    """
    n = 10_000 if LONG else 2_000
    over = {"R": "~lognormal(1000 ohm, 1.05)", "C": "~lognormal(1e-6 F, 1.10)"}
    found = filter_.sweep(over, runs=n, seed=5, keep="end")
    u = found["end.u"]
    assert found.failed == ()
    assert np.abs(u - (1.0 - np.exp(-1e-3 / (found["set.R"] * found["set.C"])))).max() < 1e-5
    sigma = np.hypot(np.log(1.05), np.log(1.10))
    from scipy.special import ndtri

    for p in (0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99):
        z = ndtri(1.0 - p)  # u falls as RC grows
        tau = 1e-3 * np.exp(sigma * z)
        expected = 1.0 - np.exp(-1e-3 / tau)
        slope = np.exp(-1e-3 / tau) * 1e-3 / tau * sigma  # |du/dz|
        density = np.exp(-0.5 * z * z) / np.sqrt(2.0 * np.pi) / slope
        error = np.sqrt(p * (1.0 - p) / n) / density
        assert abs(np.quantile(u, p) - expected) < 4.0 * error, p


def test_an_element_that_varies_has_the_unit_of_its_array(tmp_path):
    text = (
        TEXT.replace("R = 1000 ohm", "R[1..2] = [1 kohm, 1 kohm]")
        .replace("R*q'", "R[2]*q'")
        .replace("trace q/C", "trace q")
    )
    (path := tmp_path / "filter.sd").write_text(text)
    found = load(path).sweep({"R[2]": [500.0, 1000.0]}, keep="end")
    assert found.units == {"set.R[2]": "ohm", "end.u": "C"}
    assert found["end.u"] == pytest.approx(-1e-6 * np.expm1([-2.0, -1.0]), rel=1e-4)
