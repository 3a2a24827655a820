"""Parameters beyond what products of doubles bear end with results or findings (ends.py runs all models)."""

from pathlib import Path

import pytest
from ends import ended
from sysdyn import api, models

ROOT = Path(models.__file__).parent / "seed"


@pytest.mark.parametrize(
    ("model", "settings"),
    [
        ("gear_pair", {"J1": 1e-300}),
        ("coulomb_slide", {"g": 1e300}),
        ("em_suspension", {"b0": 1e-300}),
        ("fluid_tank", {"Q10": 1e300}),
    ],
)
@pytest.mark.one_in(5)
def test_numbers_that_overflow_are_no_fault(model, settings, tmp_path):
    """The compiled module and the text multiply in other orders: one had a number where the other had none (exit 4)."""
    assert not ended(ROOT / f"{model}.sd", settings, tmp_path).startswith("FAULT")


@pytest.mark.parametrize("options", [{}, {"rtol": 1e-6}, {"method": "euler", "step": 0.1}])
@pytest.mark.one_in(2)
def test_a_trace_that_holds_no_numbers_is_not_met(options, tmp_path):
    """0 times infinity at all instants has no size, so that nothing was asked of it; and tolerances ask nothing."""
    ends = {"c": 1e300, "F": 1e-300}
    with pytest.raises(api.NotMet, match=r"T is no number from t = 0 s on"):
        api.simulate(ROOT / "relativistic_mass.sd", set=ends, output=tmp_path / "n.h5", **options)
