"""Starts of the gallery's models from other guesses and positions than their own."""

import pytest
from model_runs import FOUR, trace_of
from reduced import ROOT

GALLERY = ROOT / "models" / "gallery"


@pytest.mark.parametrize("guess", [0.9, 1.2, 2.0])
@pytest.mark.parametrize("formulation", FOUR[2:])
def test_a_junction_guessed_far_above_its_voltage(tmp_path, formulation, guess):
    """From 1.1 V down Newton's steps are thermal voltages: the current shrinks, but not beside its terms."""
    text = (GALLERY / "ebers_moll_amp.sd").read_text().replace("init Ce.e ~ 1.3 V", f"init Ce.e ~ {guess} V")
    trace = trace_of(tmp_path, text, scene="bias", formulation=formulation)
    assert trace["e.e"].values[0] == pytest.approx(1.21317, abs=1e-5)


@pytest.mark.parametrize("scene", ["shared", "dropped"])
@pytest.mark.parametrize("start", [-2.5, -2.0, -0.8])
def test_parallel_cranks_that_start_elsewhere(tmp_path, scene, start):
    """Near points may not be taken on the other side of a dead centre, nor the start moved by the row left out."""
    trace = trace_of(tmp_path, GALLERY / "sixbar_redundant.sd", scene=scene, settings=(("start", f"{start} rad"),))
    assert trace["th"].values[0] == pytest.approx(start * 57.29578, abs=1e-4)
