"""Branches of laws, and inequalities that say the same, by values made by hand."""

import numpy as np
import pytest
from sysdyn.runtime.events import mates
from sysdyn.runtime.events.kinks import ABOVE, BELOW, LIVE, SLIDES, Kinks, NoBranchError
from sysdyn.runtime.events.plan import Happened, Kink, Plan, Relation

VALUE, RATE, OVER, UNDER = range(4)


class Zero:
    """What is zero but for round-off, of every row."""

    @staticmethod
    def zero(row):
        return 1e-9


def kinks(branch=LIVE, *, slides=False, rate=RATE):
    """One law whose branch stands in p[1]."""
    rows = (OVER, UNDER) if slides else (-1, -1)
    one = Kink("v > 0", "brake", 1, VALUE, rate, *rows, jumps=slides)
    return Kinks((one,), Zero(), np.array([7.0, branch]))


def values(value, rate=0.0, over=1.0, under=1.0):
    return np.array([value, rate, over, under])


@pytest.mark.parametrize(("value", "branch"), [(0.5, ABOVE), (-0.5, BELOW), (0.0, LIVE), (1e-10, LIVE)])
@pytest.mark.one_in(2)
def test_a_start_lies_on_the_branch_of_its_sign(value, branch):
    found = kinks()
    assert not found.begin(values(value))
    assert found.state() == [branch]


def test_a_law_that_jumps_is_never_live_on_its_surface():
    found = kinks(slides=True)
    assert found.begin(values(0.0))
    assert found.state() == [ABOVE]


def test_what_ends_a_piece_is_the_other_side_of_zero():
    assert kinks(LIVE).rows(0) == ((VALUE, 1), (VALUE, -1))
    assert kinks(BELOW).rows(0) == ((VALUE, -1),)
    assert kinks(SLIDES, slides=True).rows(0) == ((OVER, 1), (UNDER, 1))


def test_a_crossing_turns_the_branch_and_leaves_a_slide_by_its_side():
    found = kinks(ABOVE)
    found.cross(0, VALUE, 1)
    assert found.state() == [BELOW]
    for row, branch in ((OVER, ABOVE), (UNDER, BELOW)):
        found = kinks(SLIDES, slides=True)
        found.cross(0, row, 1)
        assert found.state() == [branch]


def test_a_branch_fits_on_zero_while_it_does_not_move_to_the_other_side():
    assert not kinks(ABOVE).turn(values(0.0, 1.0))
    assert not kinks(ABOVE, rate=-1).turn(values(0.0))
    found = kinks(ABOVE)
    assert found.turn(values(0.0, -1.0))
    assert found.state() == [BELOW]


def test_a_law_driven_back_from_both_sides_slides():
    """Filippov's solution: above it falls, below it rises."""
    found = kinks(ABOVE, slides=True)
    assert found.turn(values(0.0, -1.0))
    assert found.state() == [BELOW]
    assert found.turn(values(0.0, 1.0))
    assert found.state() == [SLIDES]
    assert not found.turn(values(0.0, over=0.2, under=1.8))
    assert found.turn(values(0.0, over=-0.1, under=2.1))
    assert found.state() == [ABOVE]


def test_branches_that_contradict_each_other_are_told_by_name():
    found = kinks(ABOVE)
    for sense in (-1.0, 1.0, -1.0, 1.0):
        assert found.turn(values(0.0, sense))
    with pytest.raises(NoBranchError, match=r"v > 0 \(brake\)") as told:
        found.turn(values(0.0, -1.0))
    assert not told.value.pushed
    found.begin_instant()
    assert found.turn(values(1.0)) or found.state() == [ABOVE]


def test_a_jump_off_the_surface_ends_a_slide():
    found = kinks(SLIDES, slides=True)
    found.leave(values(1e-10))
    assert found.state() == [SLIDES]
    found.leave(values(-0.3))
    assert found.state() == [BELOW]


def test_what_has_changed_is_told_in_words():
    found = kinks(ABOVE)
    assert found.changes(2.0, [BELOW]) == [Happened(2.0, "v > 0", "brake", "< 0", "> 0")]
    assert found.changes(2.0, [ABOVE]) == []


def test_a_plan_of_nothing_happens_not_at_all():
    one = Kink("v > 0", "brake", 1, VALUE)
    assert not Plan()
    assert not Plan(relations=(Relation(0, True),))
    assert Plan(kinks=(one,)).bends
    assert not Plan(kinks=(Kink("v > 0", "brake", 1, VALUE, jumps=True),)).bends
    assert Plan(kinks=(one,))


def test_pairs_whose_difference_lies_in_a_span():
    """Of e_0 - e_1 and e_1 - e_2 every pair of the three; the fourth is alone."""
    span = np.array([[1.0, 0.0], [-1.0, 1.0], [0.0, -1.0], [0.0, 0.0]])
    alike = mates._pairs(span)
    assert np.array_equal(np.argwhere(alike & ~np.eye(4, dtype=bool)) < 3, np.ones((6, 2), dtype=bool))
    assert not mates._pairs(np.zeros((3, 0))).any()


def test_what_of_a_span_vanishes_in_some_rows():
    vectors = np.array([[1.0, 1.0], [1.0, -1.0], [0.0, 2.0]])
    left = mates._null_span(vectors, np.array([False, False, True]))
    assert left.shape == (3, 1)
    assert np.abs(left[:, 0]) == pytest.approx([1.0, 1.0, 0.0])
    assert mates._null_span(vectors, np.zeros(3, dtype=bool)) is vectors


def test_a_contact_alone_has_no_mate():
    assert mates.mates(Plan(), None, []) == {}
