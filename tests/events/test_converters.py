"""Switches, diodes and thyristors in random circuits against backward Euler (converters.c)."""

import numpy as np
import pytest
from converters import ROWS, SPAN, drawn
from sysdyn import api

NUMBERS = [k for k in range(60) if k != 34]  # of which the reference finds no set of diodes at some steps
CASES = [(k, f) for f in ("lagrangian", "hamiltonian") for k in NUMBERS]
CASES += [(k, "co_lagrangian") for k in NUMBERS if all(v[0] != "mosfet" for v in drawn(k).valves)]


@pytest.mark.parametrize(("number", "formulation"), CASES)
@pytest.mark.one_in(90)
def test_converters_run_as_by_backward_euler(number, formulation, tmp_path):
    case = drawn(number)
    (tmp_path / "net.sd").write_text(case.text)
    trace = api.simulate(tmp_path / "net.sd", formulation=formulation, output=tmp_path / "out.h5")
    exact, off = case.moved()
    at = [np.flatnonzero(np.abs(trace.time - SPAN * k / ROWS) < 1e-9) for k in range(ROWS + 1)]
    for k, name in enumerate(case.traced):
        values = trace[name].values
        apart = max(np.abs(values[rows] - exact[j, k]).min() for j, rows in enumerate(at))  # before a jump, or behind
        of_kind = [j for j, other in enumerate(case.traced) if other[0] == name[0]]
        assert apart <= 2e-3 * np.abs(exact[:, of_kind]).max() + 5.0 * off[k]
