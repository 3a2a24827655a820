"""The tube against brute force, and the cubics it is made of."""

import numpy as np
import pytest
from sysdyn.runtime.comparison.arrays import Arrays
from sysdyn.runtime.comparison.compare import compare
from sysdyn.runtime.comparison.curve import (
    Curve,
    bernstein,
    cells_at,
    largest,
    largest_magnitude,
    turning_points,
    value_at,
    whole_cells,
    with_extrema,
)
from sysdyn.runtime.comparison.thinning import estimated_rates, round_to_step, thin_rows
from sysdyn.runtime.comparison.tube import band
from sysdyn.runtime.comparison.verdict import Tolerance

SIZE = 400_001


def random_curve(random, jumps):
    time = np.sort(np.append(random.uniform(0.0, 1.0, random.integers(0, 12)), [0.0, 1.0]))
    if jumps and time.size > 3:
        k = random.integers(1, time.size - 1)
        time = np.insert(time, k, time[k])
    values = random.standard_normal(time.size)
    rates = random.standard_normal(time.size) * 5.0
    rates[random.uniform(size=time.size) < 0.3] = np.nan
    return Curve(time, values, rates)


def sampled(curve, instants):
    cell = cells_at(curve.time, instants)
    return bernstein(curve, cell, instants, instants)[0]


def brute(r, s, tau, instants):
    """Largest distance of s from the band around r, and the same the other way, on a grid."""
    step = instants[1] - instants[0]
    reach = round(tau / step)
    a, b = sampled(r, instants), sampled(s, instants)
    worst = 0.0
    for one, two in ((a, b), (b, a)):
        padded = np.pad(one, reach, constant_values=np.nan)
        windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1)
        worst = max(worst, np.nanmax(two - np.nanmax(windows, axis=1)), np.nanmax(np.nanmin(windows, axis=1) - two))
    return worst


@pytest.mark.parametrize("seed", range(30))
@pytest.mark.one_in(15)
def test_the_tube_is_what_brute_force_finds(seed):
    random = np.random.default_rng(seed)
    r, s = random_curve(random, seed % 2), random_curve(random, seed % 3 == 0)
    instants = np.linspace(0.0, 1.0, 4001)
    for tau in (0.001, 0.05, 0.4):
        expected = brute(r, s, tau, instants)
        ref = Arrays(r.time, {"x": r.values}, {"x": r.rates})
        test = Arrays(s.time, {"x": s.values}, {"x": s.rates})
        for atol in (0.05, max(expected * 0.97, 1e-3)):
            worst = compare(ref, test, Tolerance(0.0, atol, tau)).quantities[0].worst
            if expected > 1.01 * atol:
                # the grid sees no more than the tube, and the tube no more than it should
                assert worst.ratio * atol == pytest.approx(expected, rel=0.06, abs=0.02)
        assert compare(ref, test, Tolerance(0.0, expected * 1.02 + 0.03, tau)).equal


def test_a_band_of_a_jump_holds_both_sides():
    jump = Curve(np.array([0.0, 1.0, 1.0, 2.0]), np.array([0.0, 0.0, 1.0, 1.0]))
    assert band(jump, 0.9, 0.05) == (0.0, 0.0)
    assert band(jump, 0.96, 0.05) == (0.0, 1.0)
    assert band(jump, 1.04, 0.05) == (0.0, 1.0)
    assert band(jump, 5.0, 0.05) == (np.inf, -np.inf)


@pytest.mark.long
def test_extrema_in_closed_form():
    random = np.random.default_rng(0)
    b = random.standard_normal((4, 2000))
    b[:, :50] = b[0, :50]  # constants
    b[1, 50:100] = b[0, 50:100]  # slopes that vanish at an end
    x = np.linspace(0.0, 1.0, 2001)[:, None]
    grid = np.stack([value_at(b, np.full(2000, p)) for p in x[:, 0]])
    assert np.allclose(largest(b), grid.max(axis=0), atol=1e-5)
    size, at = largest_magnitude(b)
    assert np.allclose(size, np.abs(grid).max(axis=0), atol=1e-5)
    assert np.allclose(np.abs(value_at(b, at)), size, rtol=1e-12)


def cubic(*coefficients):
    """Coefficients [4, 1] of a + b x + c x^2 + d x^3 on 0..1."""
    a, b, c, d = coefficients
    return np.array([[a], [a + b / 3.0], [a + 2.0 * b / 3.0 + c / 3.0], [a + b + c + d]])


@pytest.mark.parametrize(
    ("coefficients", "found"),
    [
        ((0.0, 1.0, -1.0, 0.0), [0.5]),  # a parabola
        ((1.0, -1.0, 0.0, 4.0 / 3.0), [0.5]),  # 4 x^2 = 1
        ((2.0, 2.0, -5.5, 11.0 / 3.0), [(1.0 - np.sqrt(3.0 / 11.0)) / 2.0, (1.0 + np.sqrt(3.0 / 11.0)) / 2.0]),
        ((0.0, 3.0, 0.0, 0.0), []),  # a line
        ((7.0, 0.0, 0.0, 0.0), []),
        ((0.0, 0.0, 1.0, 0.0), []),  # at the end, not inside
        ((0.0, 1.0, 1.0, 1.0), []),
    ],
)
@pytest.mark.one_in(5)
def test_where_a_cubic_turns(coefficients, found):
    x = turning_points(cubic(*coefficients))
    assert np.sort(x[np.isfinite(x)]) == pytest.approx(found, rel=1e-13)


def test_a_curve_with_its_extrema_is_the_same_curve_and_monotone_in_every_cell():
    """t^3 - 3 t from -2 to 2 in one cell turns at -1 and 1; behind it a jump, and a line that turns nowhere."""
    curve = Curve(
        np.array([-2.0, 2.0, 2.0, 5.0]), np.array([-2.0, 2.0, 9.0, 3.0]), np.array([9.0, 9.0, np.nan, np.nan])
    )
    found = with_extrema(curve)
    assert found.time == pytest.approx([-2.0, -1.0, 1.0, 2.0, 2.0, 5.0], abs=1e-14)
    assert found.values == pytest.approx([-2.0, 2.0, -2.0, 2.0, 9.0, 3.0], abs=1e-14)
    assert found.rates[:4] == pytest.approx([9.0, 0.0, 0.0, 9.0])
    assert np.isnan(found.rates[4:]).all()
    cells = whole_cells(found, np.array([0, 1, 2]))
    for x in (0.25, 0.5, 0.8):
        t = found.time[:3] + x * np.diff(found.time)[:3]
        assert value_at(cells, np.full(3, x)) == pytest.approx(t**3 - 3.0 * t, abs=1e-13)
    bare = with_extrema(Curve(curve.time, curve.values))
    assert bare.time.tolist() == curve.time.tolist()


def test_parts_of_a_cell_are_the_same_cubic():
    curve = Curve(np.array([0.0, 2.0]), np.array([1.0, -1.0]), np.array([3.0, 0.5]))
    cell = np.zeros(2, dtype=int)
    parts = bernstein(curve, cell, np.array([0.0, 0.7]), np.array([0.7, 2.0]))
    whole = whole_cells(curve, cell[:1])
    for k, (a, b) in enumerate(((0.0, 0.7), (0.7, 2.0))):
        for x in (0.0, 0.3, 1.0):
            expected = value_at(whole, np.array([(a + x * (b - a)) / 2.0]))
            assert value_at(parts[:, k : k + 1], np.array([x])) == pytest.approx(expected, rel=1e-14)


def test_thinning_keeps_within_its_limit():
    t = np.linspace(0.0, 10.0, 3001)
    curves = [Curve(t, np.sin(3.0 * t), 3.0 * np.cos(3.0 * t)), Curve(t, np.abs(np.sin(t)))]
    limits = np.array([1e-4, 1e-3])
    kept = thin_rows(curves, limits)
    assert 20 < kept.size < 400
    assert kept[0] == 0
    assert kept[-1] == t.size - 1
    for curve, limit in zip(curves, limits, strict=True):
        rates = None if curve.rates is None else curve.rates[kept]
        thin = Arrays(t[kept], {"x": curve.values[kept]}, {} if rates is None else {"x": rates})
        full = Arrays(t, {"x": curve.values}, {} if curve.rates is None else {"x": curve.rates})
        assert compare(full, thin, Tolerance(0.0, limit)).equal


def test_estimated_rates_leave_kinks_alone():
    t = np.linspace(0.0, 2.0, 201)
    rates = estimated_rates(t, np.abs(t - 1.0), 1e-6)
    assert np.isnan(rates[100])
    smooth = np.delete(rates, [99, 100, 101])
    assert np.allclose(np.abs(smooth), 1.0)


def test_rounded_is_within_half_a_step():
    values = np.random.default_rng(1).standard_normal(1000)
    assert np.max(np.abs(round_to_step(values, 1e-3) - values)) <= 0.5e-3
    assert np.array_equal(round_to_step(values, 0.0), values)


def test_what_is_no_number_stands_beside_the_number_of_the_other():
    time = np.linspace(0.0, 1.0, 5)
    values = np.array([0.0, 1.0, 2.0, np.nan, 4.0])
    lost, whole = Arrays(time, {"x": values}, {}), Arrays(time, {"x": 4.0 * time}, {})
    worst = compare(whole, lost, Tolerance()).quantities[0].worst
    assert worst.reference == 3.0
    assert np.isnan(worst.test)
    worst = compare(lost, whole, Tolerance()).quantities[0].worst
    assert worst.test == 3.0
    assert np.isnan(worst.reference)


@pytest.mark.parametrize(("late", "equal"), [(0.0, True), (1e-10, True), (0.2, False)])
@pytest.mark.one_in(2)
def test_a_row_of_an_event_a_little_later_leaves_cells_lines_where_one_has_no_rates(late, equal):
    """t^2 with rates and by its rows: in a cell of both the rows say all, in others the line is 1/16 off."""
    time = np.array([0.0, 0.5, 0.5, 1.0])
    other = time + np.array([0.0, late, late, 0.0])
    known = Arrays(time, {"x": time**2}, {"x": 2.0 * time})
    rows = Arrays(other, {"x": other**2}, {})
    tolerance = Tolerance(rtol=1e-6, atol=0.0)
    assert compare(known, rows, tolerance).equal == equal
    assert compare(rows, known, tolerance).equal == equal
