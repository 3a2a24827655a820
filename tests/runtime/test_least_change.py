"""The least change under rows against closed forms: singular values, the saddle point, weights, work."""

import time
from dataclasses import replace

import numpy as np
import pytest
from sysdyn.runtime.numerics import least_change as module
from sysdyn.runtime.numerics.gauss_newton import Problem, least_residual, solve, stepped
from sysdyn.runtime.numerics.least_change import in_order, least_measured, least_norm
from sysdyn.runtime.numerics.work import EACH, EVALUATION, FACTORS, GRANTED, ITERATIONS, Budget, OutOfTimeError, Work


def entries(matrix):
    i, j = np.nonzero(matrix)
    return i, j, matrix[i, j]


def problem(residual, jacobian, guess, **more):
    """All rows in all unknowns, of size and weight one."""
    guess = np.asarray(guess, float)
    rows, n = residual(guess).size, guess.size
    i, j = np.indices((rows, n)).reshape(2, -1)
    given = {
        "use": np.ones(rows, bool),
        "free": np.ones(n, bool),
        "guess": guess,
        "scale": np.ones(n),
        "weight": np.ones(n),
        **more,
    }
    return Problem(residual, lambda x: np.asarray(jacobian(x)).ravel(), i, j, rows, **given)


@pytest.mark.parametrize("limit", [1000, 0], ids=["singular values", "saddle point"])
@pytest.mark.parametrize("seed", range(6))
def test_the_least_norm_is_that_of_the_pseudoinverse(monkeypatch, limit, seed):
    """u = A^T (A A^T)^-1 b, with a row that repeats another, rows in units from 1e-6 to 1e6."""
    monkeypatch.setattr(module, "SINGULAR_VALUES", limit)
    random = np.random.default_rng(seed)
    a = random.standard_normal((4, 7))
    b = random.standard_normal(4)
    found = a.T @ np.linalg.solve(a @ a.T, b)
    units = 10.0 ** random.uniform(-6, 6, 5)
    with_copy = units[:, None] * np.vstack([a, a[1] - 2.0 * a[3]])
    aim = units * np.append(b, b[1] - 2.0 * b[3])
    assert least_norm((5, 7), entries(with_copy), aim) == pytest.approx(found, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("limit", [1000, 0], ids=["singular values", "saddle point"])
@pytest.mark.parametrize("tail", [1e-3, 1e-5, 1e-7])
def test_rows_that_leave_little_hold_as_those_that_leave_much(monkeypatch, limit, tail):
    """x1 = 1, x1 + tail x2 = 1 + tail: x2 = 1, though it hardly stands in its row."""
    monkeypatch.setattr(module, "SINGULAR_VALUES", limit)
    a = np.array([[1.0, 0.0, 0.0], [1.0, tail, 0.0], [0.0, 0.0, 1.0]])
    found = least_norm((3, 3), entries(a), np.array([1.0, 1.0 + tail, 0.0]))
    assert np.abs(a @ found - [1.0, 1.0 + tail, 0.0]).max() < 1e-10
    assert found[1] == pytest.approx(1.0, abs=1e-10 / tail)


def test_what_the_metric_takes_for_nothing_is_found_in_columns_of_one_size():
    """1e-13 x = 1e-13 beside y = 1: below RANK, but the only way to meet its row; the rest stays of least norm."""
    a = np.array([[1.0, 1e-13, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 3.0, 4.0]])
    found = least_norm((3, 4), entries(a), np.array([2.0, 1.0, 5.0]))
    assert found == pytest.approx([1.0, 1e13, 0.6, 0.8], rel=1e-9)


def test_the_nearest_point_of_a_circle():
    """From (3, 4) to x^2 + y^2 = 1: (0.6, 0.8); with y as good as fixed: (0, 1)-wards along x."""
    made = problem(lambda x: np.array([x @ x - 1.0]), lambda x: [2.0 * x], [3.0, 4.0])
    found = solve(made, made.guess)
    assert found.x == pytest.approx([0.6, 0.8], rel=1e-7)
    assert found.residual < 1e-14
    held = replace(made, guess=np.array([3.0, 0.8]), free=np.array([True, False]))
    assert solve(held, held.guess).x == pytest.approx([0.6, 0.8], rel=1e-12)


def test_weights_and_scales_say_who_moves():
    """x + y = 1 from zero: parts in the ratio (scale/weight)^2."""
    made = problem(
        lambda x: np.array([x.sum() - 1.0]),
        lambda x: [[1.0, 1.0]],
        [0.0, 0.0],
        scale=np.array([2.0, 1.0]),
        weight=np.array([1.0, 3.0]),
    )
    assert solve(made, made.guess).x == pytest.approx(np.array([4.0, 1.0 / 9.0]) / (4.0 + 1.0 / 9.0), rel=1e-12)


def test_light_unknowns_cost_nothing():
    """x + z = 1, y - z = 2: with z light, x and y share what x + y = 3 asks."""
    a = np.array([[1.0, 0.0, 1.0], [0.0, 1.0, -1.0]])
    found = in_order(a.shape, entries(a), np.array([1.0, 2.0]), (np.array([True, True, False]),))
    assert found == pytest.approx([1.5, 1.5, -0.5], rel=1e-12)


def test_levels_move_in_their_order():
    """x + y + z + w = 3, w = 2 + v: v and w alone meet both; where w is fixed by w = 1, z moves and x, y do not."""
    a = np.array([[1.0, 1.0, 1.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0, -1.0], [0.0, 0.0, 0.0, 1.0, 0.0]])
    levels = np.array([[1, 1, 0, 0, 0], [0, 0, 1, 0, 0]], bool)
    free = in_order((2, 5), entries(a[:2]), np.array([3.0, 2.0]), levels)
    assert free == pytest.approx([0.0, 0.0, 0.0, 3.0, 1.0], abs=1e-12)
    bound = in_order((3, 5), entries(a), np.array([3.0, 2.0, 1.0]), levels)
    assert bound == pytest.approx([0.0, 0.0, 2.0, 1.0, -1.0], abs=1e-12)


def test_curved_rows_move_the_last_level_first():
    """x^2 + y^2 = 25 from (3, 1): y goes to 4 while x stays; of one level both move along the radius."""

    def made(*levels):
        rows = problem(lambda x: np.array([x @ x - 25.0]), lambda x: [2.0 * x], [3.0, 1.0])
        return replace(rows, levels=tuple(np.array(level) for level in levels))

    assert solve(made([True, False]), np.array([3.0, 1.0])).x == pytest.approx([3.0, 4.0], rel=1e-12)
    one = made([True, True])
    both = solve(one, one.guess).x
    assert both == pytest.approx(5.0 * np.array([3.0, 1.0]) / np.sqrt(10.0), rel=1e-7)
    assert stepped(replace(one, guess=both), both) == pytest.approx(both, rel=1e-12)


def test_rows_that_contradict_leave_the_least_residual():
    """x = 0 and x = 1: x = 1/2 leaves 1/2 in each."""
    made = problem(lambda x: np.array([x[0], x[0] - 1.0]), lambda x: [[1.0], [1.0]], [7.0])
    assert least_residual(made, made.guess) == pytest.approx([0.5], abs=1e-6)


def test_work_is_counted_by_size_and_ends_by_the_clock():
    work = Work(share=0.5)
    while not work.done:
        work.iteration((2000, 2000), 10000)
    one = FACTORS + 2e3 * 14000 + EVALUATION + EACH * 1e4
    assert work.spent == pytest.approx(one * np.ceil(0.5 * max(GRANTED, ITERATIONS * one) / one), rel=1e-2)
    late = Work(budget=Budget(time.monotonic() - 1.0))
    with pytest.raises(OutOfTimeError):
        late.evaluation(1)
    Work(budget=Budget(time.monotonic() + 1e3)).evaluation(1)


def test_values_and_aim_stay_the_callers_unless_they_are_spent():
    """A wide matrix of rows of unlike sizes, and one of more rows than unknowns that factors take."""
    for shape, scale in (((3, 5), 1e6), ((260, 200), 1e-3)):
        random = np.random.default_rng(5)
        matrix = random.standard_normal(shape) * np.where(np.arange(shape[0]) % 2, scale, 1.0)[:, None]
        i, j, v = entries(matrix)
        aim = matrix @ random.standard_normal(shape[1])
        kept = v.copy(), aim.copy()
        found = least_norm(shape, (i, j, v), aim)
        assert (v == kept[0]).all()
        assert (aim == kept[1]).all()
        assert (least_norm(shape, (i, j, v), aim, spent=True) == found).all()
        assert matrix @ found == pytest.approx(kept[1], rel=1e-9, abs=1e-9 * np.abs(kept[1]).max())


def test_round_off_beside_a_level_is_no_row_of_the_rest():
    """u1 and u2 are the level; of what is left 1e-18 u3 in their rows says nothing of u3 = 2."""
    random = np.random.default_rng(3)
    for _ in range(20):
        a = np.zeros((3, 3))
        a[:2, :2], a[:2, 2], a[2, 2] = random.normal(size=(2, 2)), 1e-18 * random.normal(size=2), 1.0
        aim = np.append(a[:2, :2] @ [0.3, 0.7], 2.0)
        i, j = np.nonzero(a)
        level = np.array([True, True, False])
        np.testing.assert_allclose(in_order((3, 3), (i, j, a[i, j]), aim, [level]), [0.3, 0.7, 2.0], rtol=1e-9)


def test_the_least_measured_is_that_of_the_pseudoinverse_to_round_off():
    """Of rows that depend on each other, in columns of sizes 1e-6 to 1e6, asked again with another aim."""
    random = np.random.default_rng(5)
    matrix, scale = random.standard_normal((6, 9)), 10.0 ** np.linspace(-6.0, 6.0, 9)
    matrix[5] = matrix[0] + matrix[1]
    entries = *np.indices(matrix.shape).reshape(2, -1), (matrix / scale).ravel()
    for seed in (1, 2):
        aim = matrix @ np.random.default_rng(seed).standard_normal(9)
        found = least_measured(entries, aim, scale) / scale
        assert np.abs(found - np.linalg.pinv(matrix, 1e-10) @ aim).max() < 1e-14 * np.abs(aim).max()
