"""Radau IIA with 5 and 7 stages: the table of coefficients, and the orders 9 and 13 observed."""

from pathlib import Path

import mpmath as mp
import numpy as np
import pytest
import small_models as models
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.structures.steppers import RadauMethod
from sysdyn.runtime.numerics import radau_coefficients
from test_bdf import run
from test_radau import INSTANTS, KAPPA, Q1, oscillation

CORE = Path(__file__).parents[2] / "runtime" / "core"
TABLE = (RadauMethod * 3).in_dll(lib.core, "sd_radau_methods")


def complex_array(field):
    parts = np.array(field)
    return parts[..., 0] + 1j * parts[..., 1]


def test_the_table_is_what_its_generator_writes():
    assert (CORE / "steppers" / "radau" / "radau_coefficients.c").read_text() == radau_coefficients.text()


@pytest.mark.parametrize(("place", "s"), [(0, 3), (1, 5), (2, 7)])
def test_the_table_holds_the_method(place, s):
    """Nodes, simplifying assumptions and eigenvalues of the numbers that the core steps with, by their definitions."""
    method = TABLE[place]
    assert (method.stages, method.pairs) == (s, (s - 1) // 2)
    c, b = np.array(method.c)[:s], np.array(method.b)[:s]
    inverse = np.array(method.inverse)[:s, :s]
    with mp.workdps(40):
        for node in c:
            x = 2 * mp.mpf(float(node)) - 1
            slope = mp.diff(lambda v: mp.legendre(s, v) - mp.legendre(s - 1, v), x)
            assert abs((mp.legendre(s, x) - mp.legendre(s - 1, x)) / slope) < 1e-15
    assert c[-1] == 1.0
    q = np.arange(1, s + 1)[:, None]
    # C(s): A c^(q-1) = c^q / q, so A^-1 c^q / q = c^(q-1); entries of A^-1 are as large as 60
    assert np.abs((c**q / q) @ inverse.T - c ** (q - 1)).max() < 1e-15 * np.abs(inverse).sum(axis=1).max()
    a = np.linalg.inv(inverse)
    assert np.abs(a[-1] - b).max() < 3e-15
    assert np.abs(c ** (q - 1) @ a.T - c**q / q).max() < 3e-15
    d = np.arange(1, s)[:, None]
    assert np.abs((b * c ** (d - 1)) @ a - b * (1 - c**d) / d).max() < 1e-15  # D(s-1)
    degree = np.arange(1, 2 * s)[:, None]
    assert np.abs((b * c ** (degree - 1)).sum(axis=1) - 1 / degree[:, 0]).max() < 1e-15  # B(2s-1)
    # A^-1 = S diag S^-1
    pairs = method.pairs
    column, row = np.array(method.column)[:s], np.array(method.row)[:s]
    value, columns = complex_array(method.lambda_)[:pairs], complex_array(method.columns)[:pairs, :s]
    rows = complex_array(method.rows)[:pairs, :s]
    built = method.gamma * np.outer(column, row) + 2 * np.einsum("k,ki,kj->ij", value, columns, rows).real
    terms = 2 * np.einsum("k,ki,kj->ij", np.abs(value), np.abs(columns), np.abs(rows))
    assert np.abs(built - inverse).max() < 2e-15 * terms.max()
    assert np.abs(rows @ column).max() < 1e-14 * np.abs(rows).max()
    # the estimate: zero for polynomials up to degree s, of (1/gamma) h y'(0) and the stages
    estimate = np.array(method.estimate)[:s]
    degree = np.arange(1, s + 1)[:, None]
    found = estimate @ (c**degree).T + (degree[:, 0] == 1)
    assert np.abs(found).max() < 1e-14 * np.abs(estimate).max()
    assert abs(estimate @ c ** (s + 1)) > 1e-4
    lift = np.polynomial.Polynomial([0.0, *np.array(method.lift)[: s + 1]])
    assert abs(lift(1.0)) < 1e-12
    assert lift.deriv()(0.0) == 1.0
    assert np.abs(lift.deriv()(c)).max() < 1e-11


@pytest.mark.parametrize(("stages", "steps", "order"), [(5, (0.5, 0.25), 9), (7, (1.25, 0.625), 13)])
def test_order_on_a_smooth_ode(stages, steps, order):
    t = np.linspace(1.013, 9.97, 51)
    errors, within = [], []
    for h in steps:
        options = {"method": "radau", "fixed_step": h, "rtol": 1e-13, "stages": (stages, stages)}
        _, columns, _ = run(models.mass_spring(), 10.0, instants=t, **options)
        errors.append(abs(columns["q_x"][-1] - oscillation(10.0)))
        within.append(np.abs(columns["q_x"][:-1] - oscillation(t)).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.2)
    # values between the steps: the polynomial of the stages with the derivative at the start besides
    assert np.log2(within[0] / within[1]) == pytest.approx(stages + 2, abs=0.2)


@pytest.mark.parametrize("stages", [5, 7])
@pytest.mark.long
def test_order_on_the_pendulum(stages):
    """Of coordinates and multipliers 2 s - 1 with the constraint's rates, s where the constraint alone is asked."""
    steps = (0.4, 0.2)
    for form, index, order in (("2", 2, 2 * stages - 1), ("3", 3, stages)):
        errors = []
        for h in steps:
            options = {"method": "radau", "fixed_step": h, "rtol": 1e-12, "stages": (stages, stages)}
            found = run(models.pendulum(), 4.0, form, index, INSTANTS, **options)[1]
            errors.append(max(np.abs(found["q1"] - Q1).max(), np.abs(found["kappa1"] - KAPPA).max()))
        observed = np.log2(errors[0] / errors[1])
        assert observed > order - 0.2  # pre-asymptotic: errors fall faster


@pytest.mark.parametrize(("rtol", "allowed", "steps"), [(1e-6, 1e-5, 60), (1e-9, 1e-8, 80), (1e-12, 1e-11, 150)])
@pytest.mark.one_in(5)
def test_stages_that_pay_are_taken(rtol, allowed, steps):
    """By itself the oscillator takes a fraction of the steps of three stages, as accurate between them."""
    t = np.linspace(0, 10, 101)
    _, columns, finished = run(models.mass_spring(), 10.0, instants=t, method="radau", rtol=rtol)
    assert np.abs(columns["q_x"] - oscillation(t)).max() < allowed
    assert finished.statistics.steps < steps
    with_three = run(models.mass_spring(), 10.0, instants=t, method="radau", rtol=rtol, stages=(3, 3))[2]
    assert with_three.statistics.steps > 2 * finished.statistics.steps


@pytest.mark.long
def test_round_off_ends_no_run():
    """Newton's corrections of seven stages are coarser; below what they resolve the pendulum's run still ends."""
    _, columns, _ = run(models.pendulum(), 4.0, "2", 2, INSTANTS, method="radau", rtol=1e-16)
    assert np.abs(columns["q1"] - Q1).max() < 1e-11
