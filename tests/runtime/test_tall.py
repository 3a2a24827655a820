"""Rows that determine their unknowns, and more rows than unknowns, against solutions that are known."""

import numpy as np
import pytest
from sysdyn.runtime.model.patterns import Places, compress
from sysdyn.runtime.numerics import least_change, tall
from sysdyn.runtime.numerics.least_change import least_norm
from sysdyn.runtime.numerics.ordering import neighbours, paired_order, symmetric_order, tall_order
from sysdyn.runtime.numerics.tall import determine, free_unknowns, left_open

N = 400


def _chain(n=N):
    """Second differences of n unknowns with both ends held, and each third row once more: [rows, n] by its entries."""
    rows, columns, values = [], [], []
    for k in (*range(n), *range(0, n, 3)):
        row = (max(rows) + 1) if rows else 0
        for j, v in ((k - 1, -1.0), (k, 2.0), (k + 1, -1.0)):
            if 0 <= j < n:
                rows.append(row), columns.append(j), values.append(v)
    return (max(rows) + 1, n), (np.array(rows), np.array(columns), np.array(values))


def _times(shape, entries, x):
    found = np.zeros(shape[0])
    np.add.at(found, entries[0], entries[2] * x[entries[1]])
    return found


def test_rows_in_excess_change_nothing():
    """A parabola is what constant second differences make."""
    shape, entries = _chain()
    k = np.arange(1, N + 1)
    exact = 0.5 * k * (N + 1 - k)
    assert _times(shape, entries, exact) == pytest.approx(np.ones(shape[0]), abs=1e-9)
    found = determine(shape, entries, np.ones(shape[0]))
    assert found == pytest.approx(exact, rel=1e-11)


def test_what_is_open_is_not_determined():
    """A column without a row of its own; columns that stand in rows together alone; more columns than rows."""
    shape, (i, j, v) = _chain()
    aim = np.ones(shape[0])
    assert determine((shape[0], N + 1), (i, j, v), aim)[N] == 0.0  # stands in no row: the least is zero
    pair = np.append(i, [0, 1]), np.append(j, [N, N]), np.append(v, [0.0, 0.0])
    assert determine((shape[0], N + 1), pair, aim)[N] == 0.0
    square = i < N  # no more rows than unknowns, and a column of zeros beside them
    zeros = np.append(i[square], 0), np.append(j[square], N), np.append(v[square], 0.0)
    assert determine((N, N + 1), zeros, np.ones(N))[N] == 0.0
    twice = np.concatenate([i, i]), np.concatenate([j, j + N]), np.concatenate([v, v])
    assert determine((shape[0], 2 * N), twice, aim) is None
    both = np.concatenate([i, i + shape[0], i]), np.concatenate([j, j, j + N]), np.concatenate([v, v, v])
    assert determine((2 * shape[0], 2 * N), both, np.concatenate([aim, aim])) is not None


def test_rows_that_determine_everything_leave_nothing_open():
    shape, entries = _chain()
    assert np.abs(left_open(shape, entries)).max() == 0.0
    assert left_open((shape[0], N + 1), entries)[N] == 1.0  # it stands in no row


def test_what_is_open_moves_together():
    """Two rings of differences and a chain beside them: each ring moves as one, by an amount of its own."""
    n = 100
    k = np.arange(n)
    ring = np.concatenate([k, k]), np.concatenate([k, (k + 1) % n]), np.concatenate([np.ones(n), -np.ones(n)])
    shape, chain = _chain(n)
    parts = [(ring, 0, 0), (ring, n, n), (chain, 2 * n, 2 * n)]
    entries = tuple(
        np.concatenate(item) for item in zip(*(((e[0] + i), (e[1] + j), e[2]) for e, i, j in parts), strict=True)
    )
    found = left_open((2 * n + shape[0], 3 * n), entries)
    first, second, third = found[:n], found[n : 2 * n], found[2 * n :]
    assert max(np.ptp(first), np.ptp(second), np.abs(third).max()) < 1e-12
    assert min(abs(first[0]), abs(second[0])) > 0.1
    assert max(abs(first[0]), abs(second[0])) == pytest.approx(1.0)


def test_a_difference_alone_leaves_the_mean_open():
    """x_k - x_(k+1) around a ring: rows enough, of one rank less."""
    n = 300
    k = np.arange(n)
    entries = np.concatenate([k, k]), np.concatenate([k, (k + 1) % n]), np.concatenate([np.ones(n), -np.ones(n)])
    aim = np.cos(2.0 * np.pi * k / n)
    assert determine((n, n), entries, aim) is None
    found = least_norm((n, n), entries, aim)
    assert found.sum() == pytest.approx(0.0, abs=1e-6 * np.abs(found).max())
    assert _times((n, n), entries, found) == pytest.approx(aim, abs=1e-9)


def test_the_saddle_point_is_not_asked_where_rows_determine_all(monkeypatch):
    """One factorisation of the rows themselves."""
    monkeypatch.setattr(least_change, "_SPARSE", ())
    shape, entries = _chain()
    found = least_norm(shape, entries, np.ones(shape[0]))
    assert found[0] == pytest.approx(0.5 * N, rel=1e-11)


def test_the_order_of_a_square_grid_fills_little():
    """Neighbours of a matrix, and what its elimination fills by their order: a third of what any pivots would."""
    m = 30
    k = np.arange(m * m).reshape(m, m)
    down, across = (k[:-1].ravel(), k[1:].ravel()), (k[:, :-1].ravel(), k[:, 1:].ravel())
    pairs = np.concatenate([np.stack(down), np.stack(across)], axis=1)
    row = np.concatenate([k.ravel(), pairs[0], pairs[1]])
    column = np.concatenate([k.ravel(), pairs[1], pairs[0]])
    pattern, _ = compress(m * m, m * m, [Places(row, column)])
    edges = neighbours(pattern)
    assert edges.rows == pairs.shape[1]
    assert (np.bincount(edges.row) == 2).all()
    order = paired_order(pattern)
    assert sorted(order.tolist()) == list(range(m * m))
    assert _filled(m * m, pairs, order) < 15 * m * m


@pytest.mark.parametrize("reach", [1, 2, 3])
def test_a_line_is_eliminated_from_both_ends(reach):
    """As short as from one end, and no chain of unknowns that wait for each other is longer than half the line."""
    n = 301
    near = np.concatenate([np.stack([np.arange(n - d), np.arange(d, n)]) for d in range(1, reach + 1)], axis=1)
    row = np.concatenate([np.arange(n), near[0], near[1]])
    pattern, _ = compress(n, n, [Places(row, np.concatenate([np.arange(n), near[1], near[0]]))])
    order = paired_order(pattern)
    assert sorted(order.tolist()) == list(range(n))
    assert _filled(n, near, order) <= _filled(n, near, np.arange(n))
    place, waits = np.argsort(order), np.zeros(n, dtype=int)
    beside = [[] for _ in range(n)]
    for a, b in near.T.tolist():
        beside[a].append(b), beside[b].append(a)
    for k in order.tolist():
        waits[k] = 1 + max((waits[j] for j in beside[k] if place[j] < place[k]), default=0)
    assert waits.max() <= n // 2 + 2 * reach


def _filled(n, pairs, order):
    """Entries of the factor of a symmetric matrix by its graph, unknowns eliminated in this order."""
    beside = [set() for _ in range(n)]
    for a, b in pairs.T.tolist():
        beside[a].add(b), beside[b].add(a)
    count = 0
    for k in order.tolist():
        others = beside[k]
        count += len(others)
        for a in others:
            beside[a] |= others
            beside[a] -= {a, k}
    return count


def test_what_is_free_does_not_depend_on_units():
    """Differences of three in rows and columns of sizes 1e12 apart, the last unknown fixed by a row of its own."""
    rows, columns, values = np.array([0, 0, 1, 1, 2]), np.array([0, 1, 1, 2, 3]), np.array([1.0, -1.0, 1.0, -1.0, 1.0])
    of_row, of_column = np.array([1e12, 1.0, 1e-12]), np.array([1.0, 1e9, 1e-9, 1.0])
    entries = rows, columns, values * of_row[rows] * of_column[columns]
    assert free_unknowns((4, 4), entries).tolist() == [True, True, True, False]


def _sums(n=N):
    """Row k: x_k less a third of x_(k-1) and of x_(k-7); each fifth row once more; rows in an order of their own."""
    rows, columns, values = [], [], []
    for at, k in enumerate((*np.random.default_rng(3).permutation(n).tolist(), *range(0, n, 5))):
        for j, v in ((k, 1.0 + 1e-3 * k), (k - 1, -1.0 / 3.0), (k - 7, -1.0 / 3.0)):
            if j >= 0:
                rows.append(at), columns.append(j), values.append(v)
    return (max(rows) + 1, n), (np.array(rows), np.array(columns), np.array(values))


def test_what_follows_row_by_row_needs_no_factors(monkeypatch):
    shape, entries = _sums()
    exact = np.cos(np.arange(N))
    aim = _times(shape, entries, exact)
    monkeypatch.setattr(tall, "_factor", lambda *_: pytest.fail("rows follow one after the other"))
    assert tall.determine(shape, entries, aim) == pytest.approx(exact, rel=1e-12, abs=1e-13)
    i, j, v = entries
    by_columns = np.lexsort((i, j))  # as a pattern has them: taken as they stand
    in_order = i[by_columns], j[by_columns], v[by_columns]
    assert tall.by_columns(shape, in_order, fewer=False).values is in_order[2]
    assert (tall.determine(shape, in_order, aim) == tall.determine(shape, entries, aim)).all()


def test_a_matrix_by_its_columns_is_that_by_its_entries():
    """A column that nothing uses stays out of it, and of what its rows miss."""
    shape, (i, j, v) = _sums()
    of = tall.by_columns((shape[0], N + 1), (i, j + 1, v), fewer=False)
    full, again = np.zeros((2, shape[0], N + 1))
    for matrix, (rows, columns, values) in ((full, (i, j + 1, v)), (again, of.entries())):
        np.add.at(matrix, (rows, columns), values)
    assert (full == again).all()
    x, aim = np.cos(np.arange(N + 1.0)), np.sin(np.arange(float(shape[0])))
    np.testing.assert_allclose(of.residual(x, aim), aim - full @ x, rtol=0.0, atol=1e-12)


def test_rows_in_excess_that_substitution_misses_are_left_to_factors():
    """x_(k+1) = 4 x_k - x_(k-1) from both first values: round-off grows by 3.7 each, and the last row says so."""
    n = 200
    k = np.arange(1, n - 1)
    i = np.concatenate([[0, 1], k + 1, k + 1, k + 1, [n]])
    j = np.concatenate([[0, 1], k - 1, k, k + 1, [n - 1]])
    v = np.concatenate([[1.0, 1.0], np.full(k.size, -1.0), np.full(k.size, 4.0), np.full(k.size, -1.0), [1.0]])
    exact = (2.0 - np.sqrt(3.0)) ** np.arange(n)
    aim = _times((n + 1, n), (i, j, v), exact)
    alone = tall.determine((n + 1, n), (i, j, v), aim)
    assert np.abs(alone - exact).max() > 1e3  # as long as nobody looks at the last row
    found = least_norm((n + 1, n), (i, j, v), aim)
    assert _times((n + 1, n), (i, j, v), found) == pytest.approx(aim, abs=1e-9)
    assert found == pytest.approx(exact, abs=1e-8)


def test_an_unknown_does_not_follow_by_an_entry_that_is_next_to_none():
    shape, (i, j, v) = _sums()
    faint = np.where((j == 9) & (np.isin(i, i[(j == 9) & (v > 0.5)])), 1e-12, v)
    columns = tall.by_columns(shape, (i, j, faint), fewer=False)
    assert tall._substitute(columns, np.ones(shape[0]), np.zeros(N)) == 1


@pytest.mark.parametrize("n", [150, 500])
def test_what_stands_in_every_row_is_eliminated_last(n):
    """Each of the others fills nothing; taken first it would fill everything."""
    hub, here = n // 3, np.arange(n)
    rows, columns = np.concatenate([here, here]), np.concatenate([here, np.full(n, hub)])
    tall, _ = compress(n + 5, n, [Places(rows, columns)])
    assert sorted(tall_order(tall).tolist()) == here.tolist()
    assert hub in tall_order(tall)[-2:]
    square, _ = compress(n, n, [Places(np.append(rows, columns), np.append(columns, rows))])
    order = symmetric_order(square)
    assert order.paired
    assert hub in order.columns[-2:]
    assert order.filled <= 4 * n


def _pairs(n=60):
    """A chain of N unknowns x, and n pairs behind it: u_k = x_k, u_k = 2 (a_k - b_k), and that difference once more."""
    shape, (i, j, v) = _chain()
    k = np.arange(n)
    u, a, b = N + k, N + n + k, N + 2 * n + k
    tie, apart, again = shape[0] + k, shape[0] + n + k, shape[0] + 2 * n + k
    rows = np.concatenate([i, tie, tie, apart, apart, apart, again, again])
    columns = np.concatenate([j, u, k, u, a, b, a, b])
    one = np.ones(n)
    values = np.concatenate([v, one, -one, one, -2.0 * one, 2.0 * one, one, -one])
    aim = np.concatenate([np.ones(shape[0]), np.zeros(2 * n), 0.25 * (N - k) * (k + 1)])
    return (shape[0] + 3 * n, N + 3 * n), (rows, columns, values), aim, np.arange(N + 3 * n) >= N + n


def test_what_may_stay_open_is_left_where_others_are_determined():
    """Of pairs the difference alone is told: it holds, and all else is what it is without them."""
    n = 60
    shape, entries, aim, idle = _pairs(n)
    assert determine(shape, entries, aim) is None
    found = determine(shape, entries, aim, idle=idle)
    k = np.arange(1, N + 1)
    assert found[:N] == pytest.approx(0.5 * k * (N + 1 - k), rel=1e-11)
    assert found[N : N + n] == pytest.approx(found[:n], rel=1e-13)
    a, b = found[N + n : N + 2 * n], found[N + 2 * n :]
    assert a - b == pytest.approx(0.5 * found[:n], rel=1e-12)
    assert (np.minimum(np.abs(a), np.abs(b)) == 0.0).all()
    assert np.flatnonzero(free_unknowns(shape, entries)).tolist() == np.flatnonzero(idle).tolist()


def test_what_others_open_ones_move_is_not_determined():
    """The pairs' first ones may stay open, their second ones, which move with them, may not."""
    shape, entries, aim, idle = _pairs()
    idle[-60:] = False
    assert determine(shape, entries, aim, idle=idle) is None


def test_rows_may_be_fewer_by_what_may_stay_open():
    """x_k determined, of each a_k - b_k the difference: half as many rows as unknowns of pairs."""
    n = 200
    k = np.arange(n)
    rows, columns = np.concatenate([k, n + k, n + k]), np.concatenate([k, n + k, 2 * n + k])
    entries = rows, columns, np.concatenate([2.0 * np.ones(n), np.ones(n), -np.ones(n)])
    idle = np.arange(3 * n) >= n
    found = determine((2 * n, 3 * n), entries, np.cos(np.arange(2.0 * n)), idle=idle)
    assert found[:n] == pytest.approx(0.5 * np.cos(k), rel=1e-14)
    assert found[n : 2 * n] - found[2 * n :] == pytest.approx(np.cos(n + k), rel=1e-13)


def test_the_saddle_point_is_not_asked_where_rates_alone_stay_open(monkeypatch):
    monkeypatch.setattr(least_change, "_SPARSE", ())
    shape, entries, aim, idle = _pairs()
    found = least_norm(shape, entries, aim, idle=idle)
    assert _times(shape, entries, found) == pytest.approx(aim, rel=1e-10, abs=1e-7)  # of 20 000


def test_rows_in_excess_of_open_ones_are_met_or_refused():
    """The difference of a pair, said twice and not alike: no u meets both."""
    shape, entries, aim, idle = _pairs()
    aim[-1] += 1.0
    missed = lambda found: np.abs(_times(shape, entries, found) - aim).max() < 1e-6  # noqa: E731
    assert determine(shape, entries, aim, missed, idle) is None
