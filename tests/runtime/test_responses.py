"""Transfer functions over frequency and time, modes and their witness, against closed forms."""

import mpmath
import numpy as np
import pytest
from sysdyn.runtime.linear import precise, responses, witness
from sysdyn.runtime.linear.modes import Transfer, modes, store_shares, transfer, wide_transfer
from sysdyn.runtime.linear.tangent import Reduced

NONE = np.zeros(0, complex)


def lag(gain, *poles, zeros=()):
    return Transfer(0, 0, np.array(poles, complex), np.array(zeros, complex), gain, None, (0.0, 0.0))


def reduced(a, b, c, d=0.0):
    a, b, c = np.array(a, float), np.array(b, float)[:, None], np.array(c, float)[None, :]
    none = np.zeros((1, 1))
    return Reduced(a, b, c, np.array([[d]]), none, none, np.arange(len(a)), tuple(f"x{k}" for k in range(len(a))))


def test_a_lag_falls_by_three_decibels_at_its_corner():
    found = responses.frequencies(lag(2.0, -2.0), 0.1, 100.0)
    corner = np.flatnonzero(found.w == 2.0)[0]
    assert found.magnitude[corner] == pytest.approx(-10.0 * np.log10(2.0))
    assert found.phase[corner] == pytest.approx(-45.0)
    assert found.value == pytest.approx(2.0 / (1j * found.w + 2.0))


def test_an_improper_part_grows_with_the_frequency():
    one = Transfer(0, 0, NONE, NONE, 3.0, 3.0, (0.5, 0.25))
    assert responses.at_frequencies(one, np.array([2j])) == pytest.approx([3.0 + 1j - 1.0])


def test_a_response_spans_a_decade_around_its_corners():
    assert responses.span([lag(1.0, -2.0, 0.0), lag(1.0, -50.0, zeros=(-7.0,))]) == (0.2, 500.0)
    assert responses.span([lag(1.0, 0.0)]) == (0.1, 10.0)


def test_no_point_lies_on_a_pole_without_damping():
    found = responses.frequencies(lag(1.0, 3j, -3j), 0.1, 100.0)
    assert 3.0 not in found.w
    assert np.isfinite(found.value).all()


def test_three_lags_are_unstable_beyond_a_gain_of_eight():
    """1/(s + 1)^3 turns by 180 degrees at sqrt(3), where it is 1/8; its gain is below one everywhere."""
    found = responses.margins(lag(1.0, -1.0, -1.0, -1.0), 0.01, 100.0)
    assert found.gain == pytest.approx(8.0)
    assert found.w_phase == pytest.approx(np.sqrt(3.0))
    assert found.phase is None


def test_the_phase_margin_of_two_integrators_and_a_lead():
    """10 (s + 1)/s^2 crosses one where 100 (1 + w^2) = w^4; its phase there is -180 + atan(w)."""
    found = responses.margins(lag(10.0, 0.0, 0.0, zeros=(-1.0,)), 0.01, 1000.0)
    w = np.sqrt(50.0 + np.sqrt(2600.0))
    assert found.w_gain == pytest.approx(w)
    assert found.phase == pytest.approx(np.degrees(np.arctan(w)))


def test_a_step_response_ends_where_its_slowest_mode_is_at_rest():
    assert responses.horizon([lag(1.0, -2.0, -100.0)]) == pytest.approx(3.0)
    assert responses.horizon([lag(1.0, 5j, -5j)]) == pytest.approx(8.0 * 2.0 * np.pi / 5.0)
    assert responses.horizon([lag(1.0, 0.0)]) == 1.0


def test_the_step_of_a_lag_is_an_exponential():
    small = reduced([[-2.0]], [4.0], [1.0], 0.5)
    time, values = responses.step(small, lag(4.0, -2.0), 3.0, 31)
    assert time[-1] == 3.0
    assert values == pytest.approx(0.5 + 2.0 * (1.0 - np.exp(-2.0 * time)), abs=1e-12)


def test_curves_of_eigenvalues_cross_without_changing_places():
    sets = [np.array([-1.0 + k, 1.0 - k], complex) for k in np.linspace(0.0, 2.0, 6)]
    shuffled = [values[:: 1 if k % 2 else -1] for k, values in enumerate(sets)]
    found = responses.branches(shuffled)
    assert np.abs(np.diff(found, 2, axis=0)).max() < 1e-12  # straight lines
    missing = responses.branches([np.array([1.0, 5.0], complex), np.array([5.1], complex)])
    assert np.isnan(missing[1, 0])
    assert missing[1, 1] == 5.1


OSCILLATOR = np.array([[0.0, 1.0], [-25.0, -2.0]])
"""x'' + 2 x' + 25 x = 0: -1 +- 4.899 i, damping ratio 0.2."""


def test_modes_of_an_oscillator_have_its_frequency_and_damping():
    low, high = modes(OSCILLATOR)
    assert low.eigenvalue == pytest.approx(-1.0 - 1j * np.sqrt(24.0))
    assert high.frequency == pytest.approx(5.0)
    assert high.damping == pytest.approx(0.2)
    assert high.participation.sum() == pytest.approx(1.0)
    assert modes(np.zeros((0, 0))) == ()


def test_energy_of_an_oscillation_is_half_in_each_store():
    found = modes(np.array([[0.0, 1.0], [-25.0, 0.0]]))
    # q, e = 25 q of the spring; p, f of the unit mass
    content, conjugate = np.array([[1.0, 0.0], [0.0, 1.0]]), np.array([[25.0, 0.0], [0.0, 1.0]])
    assert store_shares(found, content, conjugate) == pytest.approx(np.full((2, 2), 0.5))


def test_a_transfer_function_has_the_zeros_and_the_gain_of_its_quotient():
    """(3 s + 12)/(s^2 + 2 s + 25)."""
    found = transfer(OSCILLATOR, np.array([0.0, 1.0]), np.array([12.0, 3.0]), 0.0, (0, 0), (0.0, 0.0))
    assert found.zeros == pytest.approx([-4.0])
    assert found.gain == pytest.approx(3.0)
    assert found.static == pytest.approx(12.0 / 25.0)


def test_what_the_input_does_not_reach_is_no_pole():
    a = np.diag([-1.0, -7.0])
    found = transfer(a, np.array([1.0, 0.0]), np.array([1.0, 1.0]), 0.0, (0, 0), (0.0, 0.0))
    assert found.poles == pytest.approx([-1.0])


E, A = np.diag([1.0, 1.0, 0.0]), np.array([[-2.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, -1.0]])
"""x1' = -2 x1 + x2, x2' = x3, 0 = x2 - x3: eigenvalues -2 and 1."""


def test_a_witness_counts_eigenvalues_without_finding_them():
    found = witness.witness(E, A)
    assert (found.states, found.zeros) == (2, 0)
    assert found.size == pytest.approx(np.log(2.0))
    assert found.certain
    assert not found.contradicts(np.array([-2.0, 1.0], complex))
    assert found.contradicts(np.array([-2.0, 1.1], complex))
    assert found.contradicts(np.array([-2.0], complex))
    assert witness.agrees(E, A, np.array([-2.0, 1.0], complex))
    assert not witness.agrees(E, A, np.array([-2.0, 3.0], complex))


def test_a_singular_pencil_has_no_witness():
    assert witness.witness(np.zeros((2, 2)), np.ones((2, 2))) is None
    assert witness.spread(np.diag([1.0, 1e-3]), np.diag([2.0, 5.0])) == pytest.approx(1e3)


def test_wide_elimination_solves_what_doubles_lose():
    """Hilbert's matrix of order 12 has a condition of 1e16."""
    n = 12
    with precise.digits():
        hilbert = np.array([[mpmath.mpf(1) / (i + j + 1) for j in range(n)] for i in range(n)], dtype=object)
        aim = hilbert @ precise.wide(np.ones((n, 1)))
        assert precise.narrow(precise.solve(hilbert, aim)) == pytest.approx(np.ones((n, 1)), rel=1e-15)
        assert precise.solve(precise.wide(np.ones((2, 2))), precise.wide(np.ones((2, 1)))) is None


def test_wide_eigenvalues_keep_a_slow_one_beside_a_fast_one():
    found = precise.decompose(precise.wide(np.array([[-1e20, 1e20], [0.0, -1e-12]])))
    assert sorted(found.values.real) == pytest.approx([-1e20, -1e-12], rel=1e-15, abs=0.0)


def test_a_quotient_loses_what_cancels():
    """(s + 1)/((s + 1)(s + 3)) in two states."""
    a, b, c = np.array([[0.0, 1.0], [-3.0, -4.0]]), np.array([0.0, 1.0]), np.array([1.0, 1.0])
    with precise.digits():
        zeros, poles, gain = precise.rational(*map(precise.wide, (a, b, c)), mpmath.mpf(0))
    assert zeros.size == 0
    assert poles == pytest.approx([-3.0])
    assert gain == 1.0


def test_partners_of_eigenvalues_are_the_nearest():
    one, other = np.array([1.0, -10.0], complex), np.array([-10.1, 1.0], complex)
    assert precise.relative_distances(one, other) == pytest.approx([0.0, 0.1 / 10.1])
    assert not precise.steady(one, other)
    assert precise.steady(one, one[::-1])


def test_a_threefold_zero_that_round_off_moved_is_at_zero():
    values = np.array([1e-5, -1e-5j, 1e-5j, -1.0], complex)
    found = precise.settle_modes(
        precise.Decomposed(values, np.eye(4), np.eye(4)), values * [2.0, 2.0, 2.0, 1.0], ValueError
    )
    assert found.values.tolist() == [0.0, 0.0, 0.0, -1.0]
    with pytest.raises(ValueError):
        precise.settle_modes(
            precise.Decomposed(values, np.eye(4), np.eye(4)), values * [1.0, 1.0, 1.0, 2.0], ValueError
        )


def test_independent_rows_are_those_of_the_first_group():
    columns = precise.wide(np.array([[1.0, 0.0], [2.0, 0.0], [0.0, 1.0]]))
    groups = np.array([0, 1]), np.array([2])
    with precise.digits():
        found = precise.independent(columns, groups).tolist()
    assert found[1:] == [2]
    assert found[0] in (0, 1)


@pytest.mark.parametrize(("groups", "free"), [(([0], [1], [2]), {2}), (([2], [1], [0]), {0}), (([0, 1],), {0, 1})])
def test_columns_that_a_null_space_leaves_free_are_the_last_groups_first(groups, free):
    """x + y = 0, 2 y + z = 0: one of three is free, of those in no group (z in the last case) none if it can be."""
    matrix = np.array([[1.0, 1.0, 0.0], [0.0, 2.0, 1.0]])
    with precise.digits():
        (found,), rows = precise.free(matrix, matrix, np.ones(3), tuple(np.array(g) for g in groups))
    assert found in free
    assert rows.tolist() == [0, 1]


def test_what_the_change_of_round_off_moves_in_its_first_digits_is_no_pivot():
    """Two rows that differ by 1e-15 in one entry are one row; that they differ by 1e-9 counts."""
    for difference, free in ((1e-15, 1), (1e-9, 0)):
        matrix = np.array([[0.3, 0.7], [0.3, 0.7 + difference]])
        with precise.digits():
            found, _ = precise.free(matrix, precise.shaken(matrix), np.ones(2), (np.array([0, 1]),))
        assert found.size == free


def test_round_off_shakes_like_numbers_alike_and_nothing_that_is_counted():
    matrix = np.array([[0.3, -0.3], [2.0, 1e9]])
    found = precise.shaken(matrix)
    assert found[0, 0] == -found[0, 1] != 0.3
    assert found[1, 0] == 2.0
    assert found[1, 1] != 1e9
    assert found == pytest.approx(matrix, rel=2e-15)


def test_an_eigenvalue_that_round_off_moves_and_that_is_none_is_refused():
    """Of -1 and -1e-9 in 1/s; what is round-off of the largest, or stands near it, is not asked."""
    said = pytest.raises(ValueError, match="1e-09")

    def refuse(value):
        return ValueError(f"{abs(value):g}")

    values = np.array([-1.0, -1e-9], complex)
    with said:
        precise.refuse_lost(values, values * [1.0, 1.01], refuse)
    precise.refuse_lost(values, values * [1.0, 1.0 + 1e-8], refuse)  # steady enough
    precise.refuse_lost(np.array([-1.0, -1e-11], complex), np.array([-1.0, -3e-11], complex), refuse)
    precise.refuse_lost(np.array([-1.0, -1e-3], complex), np.array([-1.0, -2e-3], complex), refuse)


def widely(a, b, c, d=0.0):
    return *(precise.wide(np.array(part)) for part in (a, b, c)), mpmath.mpf(d)


def test_a_transfer_function_in_many_digits_keeps_a_slow_pole_and_loses_what_cancels():
    """(s + 2)/((s + 1)(s + 2)(s + 1e-18)) in three states."""
    slow = 1e-18
    a = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-2.0 * slow, -(2.0 + 3.0 * slow), -(3.0 + slow)]]
    with precise.digits():
        m = mpmath.mpf
        exact = precise.wide(np.array(a))
        exact[2] = [-2 * m(slow), -(2 + 3 * m(slow)), -(3 + m(slow))]
        one = exact, *widely(a, [0.0, 0.0, 1.0], [2.0, 1.0, 0.0])[1:]
        found = wide_transfer(one, one, (3, 4), (0.5, 0.0))
    assert (found.output, found.input, found.improper) == (3, 4, (0.5, 0.0))
    assert found.zeros.size == 0
    assert found.poles == pytest.approx([-1.0, -slow], rel=1e-14, abs=0.0)
    assert found.gain == 1.0
    assert found.static == pytest.approx(1.0 / slow, rel=1e-14)


def test_zeros_that_move_with_round_off_are_at_zero_or_at_infinity():
    """c = (tiny, 1): (s + tiny)/(s + 1)(s + 3); c = (1, tiny): (1 + tiny s)/..., of which round-off makes the zero."""
    a, b = [[0.0, 1.0], [-3.0, -4.0]], [0.0, 1.0]
    with precise.digits():
        small = wide_transfer(widely(a, b, [1e-17, 1.0]), widely(a, b, [-2e-17, 1.0]), (0, 0), (0.0, 0.0))
        far = wide_transfer(widely(a, b, [1.0, 1e-17]), widely(a, b, [1.0, -2e-17]), (0, 0), (0.0, 0.0))
    assert (small.zeros.tolist(), small.static) == ([0.0], 0.0)
    assert far.zeros.size == 0
    assert (far.gain, far.static) == pytest.approx((1.0, 1.0 / 3.0), rel=1e-14)
