"""Parameters beyond what products of doubles bear end with results or findings (ends.py runs all models)."""

from pathlib import Path

import pytest
from ends import ended
from sysdyn import models

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
def test_numbers_that_overflow_are_no_fault(model, settings, tmp_path):
    """The compiled module and the text multiply in other orders: one had a number where the other had none (exit 4)."""
    assert not ended(ROOT / f"{model}.sd", settings, tmp_path).startswith("FAULT")
