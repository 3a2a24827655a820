"""Public benchmark problems at accuracy 1e-6: published end values, exact solutions, or SciPy on an expert's equations.

The stiff families that take longer stand in tests/extremes/test_stiff.py.
"""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from sysdyn.api import simulate

BENCHMARK = Path(__file__).parents[2] / "models" / "benchmark"
ASKED = 1e-6
# Test Set for IVP Solvers (Mazzia, Magherini, Iavernaro); pendulum and four-bar: IFToMM A01, A02 by elliptic functions
ENDS = {
    "pendulum": {0: -0.2750874625761158, 1: -0.9614192050991254, 2: 4.175598100951731, 3: -1.1947490545604709},
    "crank": {
        0: 15.0, 1: -0.3311734988256260, 2: 0.1697373328427860, 3: 0.1893192899613509e-3, 4: 0.2375751249879174e-4,
        5: -0.5323896770569702e-5, 6: -0.8363313279112129e-5,
    },
    "transistor": {
        0: -0.5562145012262709e-2, 1: 3.006522471903042, 2: 2.849958788608128, 3: 2.926422536206241,
        4: 2.704617865010554, 5: 2.761837778393145, 6: 4.770927631616772, 7: 1.236995868091548,
    },
    "fourbar": {
        0: 0.3284581115408155, 1: 0.9445185381786009, 4: 2.3284581115408156, 5: 0.9445185381786009,
        6: 1.4230514702069443, 7: -0.49486884548704324,
    },
    "akzo": {
        0: 0.1150794920661702, 1: 0.1203831471567715e-2, 2: 0.1611562887407974, 3: 0.3656156421249283e-3,
        4: 0.1708010885264404e-1, 5: 0.4873531310307455e-2,
    },
    "caraxis": {
        0: 0.0493455784275402809122, 1: 0.496989460230171153861, 2: 1.04174252488542151681,
        3: 0.373911027265361256927, 4: -0.0770583684040972357970, 5: 0.744686658723778553466e-2,
        6: 0.0175568157537232222276, 7: 0.770341043779251976443,
    },
    "hires": {0: 0.7371312573325668e-3, 3: 0.1175651343283149e-2, 5: 0.6238968252742796e-2, 7: 0.2850001604814231e-2},
}  # fmt: skip


@pytest.mark.parametrize("family", ENDS)
@pytest.mark.long
def test_published_ends(family, tmp_path):
    run = simulate(BENCHMARK / f"{family}.sd", scene="reference", accuracy=ASKED, output=tmp_path / "t.h5")
    for number, wanted in ENDS[family].items():
        values = np.asarray(run[f"y{number}"])
        assert abs(values[-1] - wanted) < ASKED * np.abs(values).max(), number


def ladder(name, tmp_path, n):
    """Largest errors against `exact` are taken over the whole span: time (s), the middle and the last node (V)."""
    file = BENCHMARK / f"{name}.sd"
    run = simulate(file, scene="reference", accuracy=ASKED, set={"n": n}, output=tmp_path / "t.h5")
    return run.time, np.asarray(run["y_mid"]), np.asarray(run["y_end"])


def modal(t, n, node, f=2.0):
    """Exact voltage of a node of the RC ladder: its modes sin(i th_k), th_k = (2k - 1) pi/(2n + 1), under the sine."""
    th = (2.0 * np.arange(1, n + 1) - 1.0) * math.pi / (2 * n + 1)
    rate, w = -4.0 * n * n * np.sin(th / 2.0) ** 2, 2.0 * math.pi * f
    share = n * n * np.sin(th) / ((2 * n + 1) / 4.0) * np.sin(node * th)
    t = np.asarray(t)[:, None]
    return (share * (w * (np.exp(rate * t) - np.cos(w * t)) - rate * np.sin(w * t)) / (rate**2 + w * w)).sum(axis=1)


@pytest.mark.parametrize("n", [10, 100])
@pytest.mark.long
def test_rc_ladder_against_its_modes(n, tmp_path):
    time, *found = ladder("rc_ladder", tmp_path, n)
    for values, node in zip(found, (n // 2, n), strict=True):
        assert np.abs(values - modal(time, n, node)).max() < 3.0 * ASKED * np.abs(values).max()


def line(t, y):
    """i_1, v_1, ... of the LC line, as an expert writes it."""
    n = y.size // 2
    i, v = y[0::2], y[1::2]
    before = np.concatenate([[1.0 - math.exp(-((t / 0.05) ** 2))], v[:-1]])
    return np.column_stack([n * (before - v) - 0.1 * i, n * (i - np.append(i[1:], v[-1]))]).ravel()


def diodes(t, v):
    """Node voltages of the nonlinear transmission line, as an expert writes it."""
    drop = np.concatenate([v[:1], v[:-1] - v[1:]])
    through = drop + np.expm1(40.0 * drop)
    into = np.concatenate([[math.exp(-t) - through[0]], through[1:]])
    return into - np.append(through[1:], 0.0)


@pytest.mark.parametrize(("name", "slopes", "per"), [("lc_line", line, 2), ("nltl", diodes, 1)])
@pytest.mark.long
def test_lines_against_scipy(name, slopes, per, tmp_path):
    n = 40
    time, middle, end = ladder(name, tmp_path, n)
    found = solve_ivp(slopes, (0.0, time[-1]), np.zeros(per * n), "LSODA", time, rtol=1e-11, atol=1e-14)
    for values, node in ((middle, n // 2), (end, n)):
        wanted = found.y[per * node - 1]
        assert np.abs(values - wanted).max() < 3.0 * ASKED * np.abs(wanted).max()


@pytest.mark.parametrize("accuracy", [1e-5, 1e-7])
@pytest.mark.one_in(2)
def test_what_flows_known_by_differences_have_in_common_is_no_state(accuracy, tmp_path):
    """Tested as states, the potentials of floating capacitors held the bdf at order 1: 281 000 steps at 1e-7, an error
    of 10 times that, and an estimate of a hundredth of the error.
    """
    found, exact = (
        simulate(
            BENCHMARK / "transistor.sd", scene="reference", formulation=formulation, method="bdf", accuracy=asked,
            output=tmp_path / formulation,
        )
        for formulation, asked in (("co_lagrangian", accuracy), ("lagrangian", 1e-9))
    )  # fmt: skip
    error = max(abs(found[y][-1] - exact[y][-1]) / np.abs(exact[y]).max() for y in exact.names)
    assert error < accuracy
    assert found.statistics["error_estimate"] > error / 3.0
    assert found.statistics["steps"] < 15_000
