"""What a large step makes where it is wanted is what it kept before: matrices, room for points, arrays at rest."""

import numpy as np
import pytest
import small_models as models
from scipy.sparse import csc_array, diags_array, random_array
from sysdyn.runtime.integrate import integrate
from sysdyn.runtime.integrate.request import Request
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.stretches import Ascents, Stretches
from sysdyn.runtime.start.start import ConsistentState, consistent_start


def matrices(kind, n, rng):
    """A, B on one pattern."""
    if kind == "line":
        there = csc_array(diags_array([1.0, 1.0, 1.0], offsets=[-1, 0, 1], shape=(n, n)))
    else:
        there = csc_array(random_array((n, n), density=4.0 / n, rng=rng) + diags_array(np.ones(n)))
    there.sort_indices()
    a, b = rng.normal(size=there.nnz), rng.normal(size=there.nnz)
    if kind == "faint":  # a pivot that is almost none: solutions are refined
        own = (there.indices == 3) & (np.repeat(np.arange(n), np.diff(there.indptr)) == 3)
        alone = (there.indices == 3) | (np.repeat(np.arange(n), np.diff(there.indptr)) == 3)
        a[alone], b[alone] = 0.0, 0.0
        a[own] = 1.0
        other = (there.indices != 3) & (np.repeat(np.arange(n), np.diff(there.indptr)) == 7)
        a[other] *= 1e-11
        b[other] *= 1e-11
    return there, a, b


@pytest.mark.parametrize("number", [float, complex])
@pytest.mark.parametrize("kind", ["line", "net", "faint"])
@pytest.mark.one_in(5)
def test_factors_of_a_sum_are_those_of_its_entries_bit_by_bit(kind, number):
    """In room of the caller that others wrote to, with the scale of the columns held by another one or by themselves,
    chosen pivots and those of the matrix before.
    """
    rng, n = np.random.default_rng(3), 400
    there, a, b = matrices(kind, n, rng)
    pattern = [there.indptr.astype(np.int32), there.indices.astype(np.int32), np.arange(n, dtype=np.int32)]
    z = "_z" if number is complex else ""
    call = {name: getattr(lib.core, f"sd_linear{z}_{name}") for name in ("new", "factor", "solve", "free")}
    call |= {name: getattr(lib.core, f"sd_linear{z}_{name}") for name in ("borrow", "scale_sum", "factor_sum")}
    plain, spare = (call["new"](n, *map(lib.pointer, pattern)) for _ in range(2))
    begin, turned = there.indptr, np.arange(n)[::-1]  # columns stand where `at` says
    at = np.zeros(n, dtype=np.int32)
    at[turned] = np.append(0, np.cumsum(np.diff(begin)[turned]))[:-1]
    place = np.concatenate([np.arange(begin[j], begin[j + 1]) for j in turned])
    work, held = np.full(n + 1, np.nan, dtype=number), np.zeros(n)
    assert call["borrow"](spare, lib.pointer(work), None, lib.pointer(held) if number is complex else None) == 0
    for k in range(3):
        c, scale = np.array([0.7 + k + (0.3j if number is complex else 0.0)]), 10.0 ** rng.uniform(-3, 3, n)
        held[:] = scale
        values = np.ascontiguousarray(a + c[0] * b, dtype=number)
        assert call["factor"](plain, lib.pointer(values), lib.pointer(scale)) == 0
        laid = (a[place], b[place], at) if k == 1 else (a, b, None)
        call["scale_sum"](spare, *map(lib.pointer, (*laid, c, scale)))
        assert call["factor_sum"](spare) == 0
        scale[:] = np.nan  # nobody reads it any more
        x = rng.normal(size=n).astype(number)
        mine, theirs = x.copy(), x.copy()
        work[:] = np.nan
        call["solve"](plain, lib.pointer(mine))
        call["solve"](spare, lib.pointer(theirs))
        assert mine.tobytes() == theirs.tobytes()
        full = csc_array((values, there.indices, there.indptr), shape=(n, n))
        assert np.abs(full @ mine - x).max() < 1e-6 * (1.0 + np.abs(full).max() * np.abs(mine).max())
        work[:] = np.nan
    for linear in (plain, spare):
        call["free"](linear)


@pytest.mark.parametrize("n", [0, 1, 3, 100])
@pytest.mark.one_in(2)
def test_an_array_is_what_it_was_bit_by_bit(n):
    """Of stretches, and where there are too many: zeros of both signs and what is no number included."""
    rest = np.repeat([0.0, -0.0, np.nan, 3.0, np.inf], n)
    for array in (rest, np.random.default_rng(0).normal(size=n)):
        assert Stretches(array).whole.tobytes() == array.tobytes()
    if n == 100:
        assert Stretches(rest)._values.size == 5


def test_places_are_what_they_were():
    for places in (np.r_[5:400, 7:300, [3, 1]], np.random.default_rng(0).permutation(50), np.arange(0)):
        for kind in (np.int32, np.int64):
            found = Ascents(places.astype(kind)).whole
            assert found.dtype == kind
            assert (found == places).all()


def test_a_start_that_is_put_away_is_the_same_start():
    y, yd = np.repeat([1.0, 2.0], 50), np.zeros(100)
    state = ConsistentState(0.0, y.copy(), yd.copy(), (), 0.0)
    state.put_away()
    assert not isinstance(state.held_y, np.ndarray)
    assert (state.y == y).all()
    assert (state.yd == yd).all()


@pytest.mark.parametrize("large", [True, False])
@pytest.mark.long
def test_points_settle_in_what_radau_does_not_read_between_its_steps(monkeypatch, large):
    """Rows at steps and within them write into right sides and stages: the run is the one that is not looked at.  Its
    constraints drift, so that nothing puts the stages right.
    """
    manifest, binding, module = models.pendulum(angle=2.0)
    steps = []
    for rows in (np.array([20.0]), np.linspace(0.1, 20.0, 200)):
        system = System(manifest, binding, load(module), "3")
        request = Request(20.0, rows, every_step=large, index=3, rtol=1e-5, method="radau")
        run = integrate.Integration(system, consistent_start(system, 0.0), request)
        run.run(lambda rows: None)
        steps.append((run.method.contents.steps, run.method.point()[0]))
    assert steps[0][0] == steps[1][0]
    assert (steps[0][1] == steps[1][1]).all()
