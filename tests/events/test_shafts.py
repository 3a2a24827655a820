"""Dry friction, ratchets, walls, latches and blows in random shafts against Moreau's time stepping (moreau.c)."""

import numpy as np
import pytest
from shafts import ROWS, SPAN, drawn
from sysdyn import api

NUMBER = 60
STRAY = 4
"""Rows beside impacts, where a step of the reference decides on which side they are."""


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.parametrize("number", range(NUMBER))
@pytest.mark.long
def test_shafts_turn_as_moreaus_do(number, formulation, tmp_path):
    case = drawn(number)
    (tmp_path / "shafts.sd").write_text(case.text)
    trace = api.simulate(tmp_path / "shafts.sd", formulation=formulation, output=tmp_path / "out.h5")
    angles, speeds = case.moved()
    rows = [int(np.argmin(np.abs(trace.time - SPAN * (k + 1) / ROWS))) for k in range(ROWS)]
    for k in range(len(case.inertia)):
        angle, speed = (trace[f"s{k}.{letter}"].values[rows] for letter in "qf")
        assert np.abs(angle - angles[:, k]).max() < 2e-3 * max(np.abs(angles[:, k]).max(), 1e-3)
        apart = np.sort(np.abs(speed - speeds[:, k]))
        assert apart[-STRAY] < 5e-3 * max(np.abs(speeds[:, k]).max(), 1e-3)
