"""At which instants runs are compared, and what is said of what they miss, on rows made by hand."""

from dataclasses import replace

import numpy as np
import pytest
from sysdyn.runtime.accuracy import fronts
from sysdyn.runtime.accuracy.common_instants import MANY, MOST, Thinned, common, join_instants, known_instants, late_by
from sysdyn.runtime.accuracy.options import Options, WrongOption, instants
from sysdyn.runtime.accuracy.pairs import RunSample, difference, distance_of_runs
from sysdyn.runtime.integrate.request import COMPARED, TRACE
from sysdyn.runtime.integrate.rows.ledgers import LedgerBalance
from sysdyn.runtime.integrate.weights.round_off import LeftOpen
from sysdyn.runtime.integrate.weights.unknown_roles import Roles, without_rate
from sysdyn.runtime.judgement import Estimate, allowed_share, cancelling_quantities, judge
from sysdyn.runtime.model.failures import RowLabel


def rows(times):
    return np.stack([np.asarray(times, dtype=float), np.arange(len(times), dtype=float)], axis=1)


def test_few_rows_are_all_kept():
    thinned = Thinned()
    assert thinned.time.size == 0
    thinned.take(rows(range(5)))
    thinned.take(rows([]).reshape(0, 2))
    assert thinned.time.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 4.0]  # the last one stands behind all


@pytest.mark.parametrize("chunk", [1, 7, 1000])
@pytest.mark.long
def test_a_long_stream_is_thinned_evenly_whatever_its_chunks(chunk):
    thinned, every = Thinned(), np.arange(3000.0)
    for k in range(0, every.size, chunk):
        thinned.take(rows(every[k : k + chunk]))
    kept = thinned.time[:-1]
    assert np.unique(np.diff(kept)).size == 1
    assert MOST < kept.size <= 2 * min(max(MOST, every.size // 16), MANY)
    assert thinned.time[-1] == 2999.0
    assert thinned.rows(kept[3:5])[:, 0].tolist() == kept[3:5].tolist()
    assert len(thinned.rows(np.array([0.5]))) == 0


def test_instants_are_known_where_the_trace_has_an_interval():
    assert known_instants(np.arange(10.0), Options(None, 0.0, 9.0), 1) is None
    asked, options = np.linspace(0.0, 1.0, 1201), Options(None, 0.0, 1.0, every=1 / 1200)
    assert np.array_equal(known_instants(asked, options, 1), asked)
    many = known_instants(asked, options, 4000)
    assert many.size == 401  # every third, the last among them
    few = known_instants(np.array([2.0, 3.1, 4.0]), Options(None, 2.0, 4.0, every=2.0, at=(3.1,)), 1)
    assert few.size == MOST + 2
    assert 3.1 in few  # what is asked for is compared
    assert few[-1] == 4.0
    assert ((few > 2.0) & (few <= 4.0)).all()


def test_beside_a_jump_of_the_text_nothing_is_compared():
    options = Options(None, 0.0, 10.0, stops=np.array([5.0, np.inf]))
    assert common(np.array([0.0, 5.0 - 1e-9, 5.0, 5.1, 5.1]), options).tolist() == [0.0, 5.1]
    assert common(np.array([5.0, 1.0]), Options(None, 0.0, 10.0)).tolist() == [1.0, 5.0]


def test_between_one_event_of_two_runs_a_jump_is_no_difference():
    """The first events are 0.02 apart and 4 from the next: one event.  The second are as far apart as the third is, and
    the third are at the same instant, where both values are those before it.
    """
    one, two = np.array([1.00, 5.0, 6.0]), np.array([1.02, 5.6, 6.0])
    instants = np.array([0.99, 1.01, 1.03, 5.3, 6.0, 7.0])
    assert (late_by(instants, one, two, 1.0) > 0.0).tolist() == [False, True, False, False, False, False]
    assert not late_by(instants, one, np.zeros(0), 1.0).any()


def test_a_condition_that_turns_again_at_once_is_one_event():
    """One run has three instants where the other has two: the second of both is theirs all the same."""
    instants = np.array([0.2, 0.4, 0.60005, 0.7])
    one, two = np.array([0.3, 0.3 + 1e-9, 0.6]), np.array([0.3, 0.6001])
    for first, second in ((one, two), (two, one)):
        assert (late_by(instants, first, second, 1.0) > 0.0).tolist() == [False, False, True, False]


def test_events_that_one_run_lacks_leave_the_others_in_their_places():
    instants = np.array([0.10005, 0.3, 0.50005, 0.70005])
    one, two = np.array([0.1, 0.3, 0.5, 0.7]), np.array([0.1001, 0.5001, 0.7001])
    assert (late_by(instants, one, two, 1.0) > 0.0).tolist() == [True, False, True, True]
    assert (late_by(instants, two, one, 1.0) > 0.0).tolist() == [True, False, True, True]


def test_of_two_rows_at_one_instant_the_former_is_kept():
    thinned = Thinned()
    thinned.take(np.array([[0.0, 1.0], [1.0, 2.0]]))
    thinned.take(np.array([[1.0, 3.0], [2.0, 4.0], [2.0, 5.0]]))
    instants = np.array([0.0, 1.0, 2.0])
    assert thinned.rows(instants)[:, 1].tolist() == [1.0, 2.0, 4.0]


def test_instants_of_both_kinds_are_one():
    every, kinds = join_instants(np.array([0.0, 1.0]), np.array([TRACE, TRACE]), np.array([0.5, 1.0]))
    assert every.tolist() == [0.0, 0.5, 1.0]
    assert kinds.tolist() == [TRACE, COMPARED, TRACE | COMPARED]


def test_round_off_of_a_balance_grows_with_what_passes():
    """0.5 J stored; 2 W dissipated, 3 W supplied over 10 s."""
    assert LeftOpen(np.zeros(0), np.array([[0.5, 2.0, 3.0, 9.0]])).balances(10.0).tolist() == [50.5]


def test_flows_that_are_solved_for_carry_nothing():
    yes, none = np.array([True, True]), np.zeros(2, np.int32)
    found = without_rate(Roles(none, none, yes, yes, yes, ~yes, common=none), np.array([False, True]))
    assert found.test.tolist() == [0, -1]
    for mask in (found.state, found.differential, found.smooth):
        assert mask.tolist() == [True, False]
    assert found.idle.tolist() == [False, True]
    assert found.common.tolist() == [-1, -1]


SPRING = RowLabel("spring.q", "observe", "m.sd", 3)


def balance(value, turnover=2.0, kind="energy", passed=1.0, risen=()):
    return LedgerBalance(kind, "energy", "J", passed, turnover, value, SPRING, risen)


def test_what_a_balance_may_be_follows_from_the_accuracy():
    assert allowed_share(Options(None, 0.0, 1.0, accuracy=1e-4)) == pytest.approx(1e-3)
    assert allowed_share(Options(None, 0.0, 1.0, accuracy=1e-4, accuracy_on=(("x", 1e-2),))) == pytest.approx(0.1)
    assert allowed_share(Options(None, 0.0, 1.0, accuracy=None)) == 1e-12
    assert allowed_share(Options(None, 0.0, 1.0, rtol=1e-6)) == pytest.approx(1e-2)
    assert allowed_share(Options(None, 0.0, 1.0, rtol=1.0)) == 0.1


def test_a_run_misses_a_balance_at_its_first_instant_beyond():
    options = Options(None, 0.0, 1.0, accuracy=1e-4)
    found = judge(options, "bdf", [balance(0.01, risen=((0.1, 1e-3), (0.4, 5e-3), (0.7, 0.01)))], True, [])
    (missed,) = found.not_met
    assert (missed.what, missed.value, missed.element, missed.time) == ("energy", 0.01, "spring.q", 0.4)
    assert missed.limit == pytest.approx(2e-3)
    assert found.judged == ("accuracy", "energy")
    assert found.attributes() == {"met": 0, "judged": "accuracy energy"}
    assert judge(options, "bdf", [balance(1e-3)], True, []).met


def test_round_off_may_be_all_that_a_balance_is():
    found = judge(Options(None, 0.0, 1.0), "bdf", [balance(1e-20, turnover=0.0)], True, [], lambda: np.array([1e-19]))
    assert found.met
    assert not judge(Options(None, 0.0, 1.0), "bdf", [balance(np.nan)], True, []).met


def test_implicit_euler_is_not_judged_and_what_should_stay_is_told():
    kept = balance(0.5, passed=0.0)
    found = judge(Options(None, 0.0, 1.0), "euler", [kept, balance(0.5)], True, [Estimate("x", 1.0, 1e-4, None)])
    assert (found.judged, found.not_met) == ((), ())
    assert found.conserved_quantities() == [{"what": "energy", "drift": 0.5, "of": 2.0, "unit": "J"}]


def test_a_quantity_that_misses_its_accuracy_is_named():
    (missed,) = judge(Options(None, 0.0, 1.0), "bdf", [], True, [Estimate("x", None, 1e-4, 0.3)]).not_met
    assert missed.to_json() == {
        "what": "accuracy", "value": None, "limit": 1e-4, "element": "x", "time": 0.3, "unit": "1",
    }  # fmt: skip
    assert judge(Options(None, 0.0, 1.0), "bdf", [], False, [Estimate("x", 1.0, 1e-4, 0.3)]).met


def test_a_difference_of_large_terms_is_told_where_their_error_is_too_much_of_it():
    """Terms of 1000 known to 1e-6 are known to 1e-3, too little for 0.1 to 1e-4, enough for it to 2e-2."""
    (found,) = cancelling_quantities({"d": 1000.0}, {"d": 0.1}, 1e-4, 1e-6, {})
    assert (found.quantity, found.terms) == ("d", 1000.0)
    assert found.known == pytest.approx(1e-3)
    assert not list(cancelling_quantities({"d": 1000.0}, {"d": 0.1}, 2e-2, 1e-6, {}))
    assert not list(
        cancelling_quantities({"d": 1000.0}, {"d": 10.0}, 1e-9, 1e-6, {})
    )  # one hundredth has not cancelled
    assert not list(cancelling_quantities({"d": 1000.0}, {"d": 1e-13}, 1e-4, 1e-6, {}))  # a zero by symmetry


def test_what_an_event_is_late_by_counts_where_values_move():
    """Behind an event that one run has 1e-3 s later x falls by 2 in a second, and y jumps."""
    late = late_by(np.array([0.2, 0.4, 0.9]), np.array([0.3995]), np.array([0.4005]), 1.0)[:, None]
    assert late[:, 0] == pytest.approx([0.0, 1e-3, 0.0])
    moved = np.where(late > 0.0, late * np.array([[2.0, 0.0]]), np.inf)
    coarse = RunSample(1e-4, np.array([[0.0, 0.0], [1.0, 0.0], [3.0, 1.0]]), np.ones(2), 10)
    fine = RunSample(1e-6, np.array([[0.0, 0.0], [1.0009, 1.0], [3.0, 1.0]]), np.ones(2), 20, between=moved)
    assert distance_of_runs(coarse, fine)[1] == pytest.approx([9e-4, 0.0])
    assert difference(coarse, fine, np.full(2, 1e-3)) == pytest.approx((9e-4, 0.9))
    turned = replace(fine, values=fine.values + np.array([[0.0], [0.05], [0.0]]), jump=np.array([0.0, 1.0]))
    assert distance_of_runs(coarse, turned)[1] == pytest.approx(
        [0.0509, 0.05]
    )  # of what does not jump all counts, else the rest


def test_a_front_within_one_step_of_the_coarser_run_is_seen():
    """x = t^3, and behind 0.4 s in the finer run a bump of 0.3 that takes it twelve steps."""

    def run(times, bump):
        return np.stack([times, times**3 + bump(times), 3.0 * times**2], axis=1)

    def bump(times):
        return 0.3 * np.exp(-(((times - 0.45) / 0.01) ** 2))

    def off(fine, shape):
        return fronts.passed_over(run(np.linspace(0.0, 1.0, 6), np.zeros_like), run(fine, shape), *np.array([[1], [2]]))

    even, crowded = np.linspace(0.0, 1.0, 21), np.linspace(0.42, 0.48, 13)
    assert off(np.union1d(even, crowded), bump) == pytest.approx(0.3)
    assert off(np.union1d(even, crowded), np.zeros_like) < 1e-15
    assert off(even, bump) == 0.0  # a step like the others: rows in common see it


def test_an_instant_that_rounds_beyond_the_end_is_the_end():
    end = 4e-7
    assert end < 400 * 1e-9
    times, _ = instants(Options(None, 0.0, end, at=(400 * 1e-9,)))
    assert times.tolist() == [0.0, end]
    with pytest.raises(WrongOption, match="lies outside"):
        instants(Options(None, 0.0, end, at=(1.0001 * end,)))
