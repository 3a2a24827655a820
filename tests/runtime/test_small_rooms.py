"""Small rooms of the runtime by themselves, against closed forms."""

from types import SimpleNamespace

import numpy as np
import pytest
from sysdyn.runtime.events import observer
from sysdyn.runtime.events.bounces import SEEN, flights, is_thrown
from sysdyn.runtime.events.watching import FALLEN, Watching
from sysdyn.runtime.integrate.jumps.first_step import PARTS, WIDER, FirstStep
from sysdyn.runtime.integrate.jumps.modes import EARLY
from sysdyn.runtime.model.facts import Facts
from sysdyn.runtime.model.patterns import Places, compress
from sysdyn.runtime.numerics.ordering import SMALL
from sysdyn.runtime.numerics.saddle import saddle_order
from sysdyn.runtime.start.residue import Residue

G = 9.80665


class Flying:
    """Of y = (h, v), yd = (v, -g): block observe and a restart of free flight, exactly."""

    def __call__(self, t, y, yd):
        return np.array([y[0]])

    def zero(self, row):
        return 1e-9

    def struck(self, t, y, yd):
        return y, np.array([y[1], -G])


@pytest.mark.parametrize("speed", [0.01, 3.0])
def test_a_thrown_ball_is_back_after_twice_its_speed_over_g(speed):
    flying = Flying()
    point = np.array([0.0, speed]), np.array([speed, -G])
    ((bounce, least),) = flights(flying, flying, 0.0, point, speed / G, [(0, 1)])
    assert bounce.flight == pytest.approx(2.0 * speed / G, rel=1e-9)
    assert bounce.height == pytest.approx(0.5 * speed**2 / G, rel=1e-9)
    assert least == pytest.approx(2.0 * np.sqrt(2.0 * SEEN * 1e-9 / G), rel=1e-9)
    falling = np.array([0.0, -speed]), np.array([-speed, -G])
    assert flights(flying, flying, 0.0, falling, speed / G, [(0, 1)]) == []


class Watch(Watching):
    """A gap whose row is 3, samples of 10 ms and 25 ms, values that count as zero below 1e-6; a run of 1 s."""

    def __init__(self):
        contact = SimpleNamespace(value=3, rate=4)
        samples = [SimpleNamespace(period=0.01), SimpleNamespace(period=0.025)]
        self.plan = SimpleNamespace(contacts=[contact], sampled=samples, relations=[], kinks=[])
        self.span, self.nothing, self.next = (0.5, 1.5), 1e-12, np.zeros(2, dtype=np.int64)
        small = np.full(5, observer.SMALL)
        self.observer = SimpleNamespace(
            zeros=lambda rows: small[rows] / observer.SMALL * 1e-6, largest=np.ones(5), small=small
        )
        self._bounces = {}


def test_samples_are_due_once_each_whatever_their_instants_are_rounded_to():
    watch, met = Watch(), {0: 0, 1: 0}
    while (t := watch.next_sample()) < 0.6 + 1e-9:
        due = watch.due(t * (1.0 + 2e-16))
        assert due == [k for k, n in ((0, (t - 0.5) / 0.01), (1, (t - 0.5) / 0.025)) if abs(n - round(n)) < 1e-6]
        assert watch.due(t) == []
        for k in due:
            met[k] += 1
    assert met == {0: 11, 1: 5}


@pytest.mark.parametrize("speed", [1e-4, 0.1])
def test_behind_an_impact_a_gap_closes_below_a_part_of_what_it_rises_to(speed):
    watch, gap = Watch(), SimpleNamespace(row=np.array([3]), side=np.array([1]), rate=np.array([4]))
    assert (watch._edges(gap).small, watch._edges(gap).level) == (1e-6, 0.0)
    watch.bounces = {3: is_thrown(0.7, -1e-9, speed, G)}
    rises = 0.5 * speed**2 / G
    assert watch._edges(gap).small == pytest.approx(FALLEN * min(1e-6, rises), rel=1e-12)
    assert watch._edges(gap).level == -1e-9
    flight = 2.0 * speed / G
    assert watch.low_flights(0.7, 2.0 * rises) == pytest.approx((flight, 0.7 + 2.0 * flight), rel=1e-12)
    assert watch.low_flights(0.7, 0.5 * rises) == watch.low_flights(0.7 + 2.0 * flight, 2.0 * rises) == (np.inf, np.inf)
    watch.bounces = {}
    assert watch._edges(gap).small == pytest.approx(1e-6, rel=1e-12)


def test_the_rate_of_a_source_at_its_peak_is_zero():
    """d/dt 325 V sin(w t + pi/2) at t = 0 is -325 w sin(0), by its digits 6e-12 V/s; beside it a rate that is small."""
    w = 2.0 * np.pi * 50.0

    def residual(t, _):
        return np.array([325.0 * w * np.cos(w * t + np.pi / 2.0), 325.0, 1e-9])

    rows = SimpleNamespace(
        guess=np.zeros(3), residual=residual, groups=lambda *names: np.array(["phi_rate" in names, False, True])
    )
    free = residual(0.0, None)
    assert 0.0 < abs(free[0]) < 1e-9
    assert Residue().cleared(rows, 0.0, free) == pytest.approx([0.0, 325.0, 1e-9], rel=0.0, abs=0.0)
    assert np.array_equal(Residue().cleared(rows, 0.001, residual(0.001, None)), residual(0.001, None))


def first_step(values, method="radau", largest=1.0):
    """Of a run without contacts; values: of the one row watched, over the step's instants [s]."""
    handler = SimpleNamespace(
        contacts=SimpleNamespace(contacts=[], active=[]), nothing=1e-12, observer=SimpleNamespace(largest=[largest])
    )
    run = SimpleNamespace(request=SimpleNamespace(method=method))
    return FirstStep(run, handler, lambda t: np.array([values(t)])), [SimpleNamespace(contact=-1, row=0, side=1)]


def test_a_change_within_what_the_first_step_does_not_know_has_it_taken_again():
    step, watched = first_step(lambda t: 0.5 - t)
    early = 0.5 * EARLY["radau"]
    assert step.shorter(watched, (0.0, early, 1.0)) == pytest.approx(WIDER * early, rel=1e-15)
    assert step.shorter(watched, (2.0, 2.9, 3.0)) == 0.0, "that is of the motion"


def test_a_polynomial_that_falls_below_all_that_was_met_has_its_step_parted():
    """Ends at 1 and -1, and -28 between, where nothing larger than 1 was met."""
    step, watched = first_step(lambda t: 1.0 - 2.0 * t - 110.0 * t * (1.0 - t))
    assert step.shorter(watched, (0.0, 0.9, 1.0)) == pytest.approx(1.0 / PARTS, rel=1e-15)


def test_what_is_made_once_is_made_again_where_it_was_forgotten():
    facts, made = Facts(), []
    facts.form, facts.left_out = SimpleNamespace(name="3"), ()
    facts.description = SimpleNamespace(layouts={}, systems=None)
    for forget, number in ((lambda: None, 1), (lambda: facts.forget_once("a"), 2), (facts.spare, 3), (facts.forget, 4)):
        forget()
        for _ in range(2):
            facts.once("a", lambda: made.append(1) or len(made))
        assert len(made) == number


@pytest.mark.long
def test_multipliers_pivot_in_the_columns_of_what_they_move():
    """A chain of links x[i] - x[i - 1] = given; x[0] carries the state, each other x has the link before it."""
    links = 4 * SMALL
    moves = links + 1
    at = np.arange(links)
    row = np.concatenate([np.arange(moves), moves + at, moves + at, at, at + 1, moves + at])
    column = np.concatenate([np.arange(moves), at, at + 1, moves + at, moves + at, moves + at])
    pattern, _ = compress(moves + links, moves + links, [Places(row.astype(np.int32), column.astype(np.int32))])
    state = np.arange(moves) == 0
    order = saddle_order(pattern, state, lambda: np.append(-1, at).astype(np.int32))
    assert sorted(order.columns) == list(range(moves + links))
    dense = np.zeros((moves + links, moves + links))
    dense[row, column] = 1.0
    dense[moves + at, moves + at] = -1e-12
    dense[moves + at, at], dense[at, moves + at] = -1.0, -1.0
    assert np.linalg.matrix_rank(dense) == moves + links
    assert order.filled < 10 * row.size, "a line fills nothing to speak of"
