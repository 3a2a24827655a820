"""Random circuits with bends and jumps of their source against Radau IIA (random_circuits.py)."""

import numpy as np
import pytest
from random_circuits import AMBIENT, drawn
from sysdyn import api

UNKNOWN = (11, 14, 20, 23, 29, 38)  # the reference finds no current behind a jump
NUMBERS = [k for k in range(44) if k not in UNKNOWN]


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian"])
@pytest.mark.parametrize("number", NUMBERS)
@pytest.mark.long
def test_circuits_run_as_by_radau(number, formulation, tmp_path):
    case = drawn(number)
    (tmp_path / "net.sd").write_text(case.text)
    trace = api.simulate(tmp_path / "net.sd", formulation=formulation, output=tmp_path / "out.h5")
    exact, off = case.moved()
    for name, value in case.traced.items():
        rise = AMBIENT if name.endswith("hot.e") else 0.0
        wanted = value(exact) - rise
        largest = np.abs(wanted).max()
        apart = np.abs(trace[name].values - rise - wanted)[1:].max()
        assert apart < 2e-5 * largest + 2.0 * np.abs(value(exact + off) - value(exact)).max() + 1e-9, name
