"""Wrong traces are rejected, all of them; right ones in other clothes are not."""

from dataclasses import replace

import numpy as np
import pytest
from corpus import BASES, MUTANTS, SPAN, mutants
from sysdyn.cli.compare.diffing import differences
from sysdyn.runtime.comparison.verdict import Incomparable, Tolerance, TraceEvent

DEFAULT = Tolerance()


def verdict(ref, test, tolerance=DEFAULT):
    return differences(ref.arrays(), test.arrays(), tolerance)


def test_the_corpus_is_large():
    assert len(MUTANTS) >= 60
    assert len(mutants()) >= 180


@pytest.mark.parametrize(("base", "name"), mutants())
@pytest.mark.one_in(100)
def test_wrong_traces_are_rejected(base, name):
    right = BASES[base]()
    wrong = MUTANTS[name](right)
    for one, two in ((right, wrong), (wrong, right)):
        try:
            found = verdict(one, two)
        except Incomparable:
            continue
        assert not found.equal
        assert found.worst.worst.ratio > 1.0
        assert not found.worst.equal


@pytest.mark.parametrize("base", BASES)
@pytest.mark.one_in(2)
def test_a_trace_equals_itself(base):
    right = BASES[base]()
    found = verdict(right, right, Tolerance(rtol=0.0))
    assert found.equal
    assert found.worst.worst.ratio == 0.0


def test_few_points_with_rates_tell_the_same():
    right = BASES["oscillator"]()
    names = ("x", "v")
    whole = replace(right, values={n: right.values[n] for n in names})
    few = whole.rows(np.arange(0, 501, 5))
    assert verdict(whole, few).equal
    assert verdict(few, whole).equal
    assert not verdict(whole, replace(few, rates={})).equal


@pytest.mark.parametrize("base", BASES)
@pytest.mark.one_in(2)
def test_other_units_of_the_same_dimension_are_converted(base):
    right = BASES[base]()
    name = right.first
    other = right.with_value(right.values[name] * 1e3, rates=right.rates[name] * 1e3)
    other = replace(other, units={**right.units, name: "m" + right.units[name]})
    other = replace(other, nominal={**right.nominal, name: right.nominal[name] * 1e3})
    found = verdict(right, other)
    assert found.equal
    assert found.notes
    assert verdict(other, right).equal


def test_time_in_another_unit_is_converted():
    right = BASES["oscillator"]()
    other = replace(right, time=right.time / 60.0, rates={n: r * 60.0 for n, r in right.rates.items()}, time_unit="min")
    assert verdict(right, other).equal
    assert verdict(other, right).equal


def test_jumps_and_events_within_the_time_tolerance_are_equal():
    right = BASES["bouncing"]()
    time = right.time.copy()
    pairs = np.flatnonzero(np.diff(time) == 0.0)
    for k, pair in enumerate(pairs):
        time[[pair, pair + 1]] += 1e-5 * (-1) ** k
    moved = tuple(TraceEvent(e.time + 1e-5 * (-1) ** k, e.name) for k, e in enumerate(right.events))
    other = replace(right, time=time, events=moved)
    assert not verdict(right, other).equal
    assert verdict(right, other, Tolerance(tau=1.1e-5)).equal
    assert verdict(other, right, Tolerance(tau=1.1e-5)).equal
    assert not verdict(right, other, Tolerance(tau=0.9e-5)).equal


def test_events_of_one_instant_have_no_order():
    """Formulations list the diodes that commutate together in orders of their own."""
    right = BASES["bouncing"]()
    first, *others = right.events
    names = ("D1", "D2", "D3")
    one = replace(right, events=(*(TraceEvent(first.time, n) for n in names), *others))
    two = replace(
        right, events=(*(TraceEvent(first.time + k * 1e-7, n) for k, n in enumerate(reversed(names))), *others)
    )
    assert verdict(one, two, Tolerance(tau=1e-6)).equal
    assert verdict(two, one, Tolerance(tau=1e-6)).equal
    assert not verdict(one, two, Tolerance(tau=1e-8)).equal
    other = replace(right, events=(*(TraceEvent(first.time, n) for n in ("D1", "D2", "D4")), *others))
    assert not verdict(one, other, Tolerance(tau=1e-6)).equal


def test_nan_equal_in_both_is_equal():
    right = BASES["oscillator"]()
    values = right.values["x"].copy()
    values[100:120], values[300] = np.nan, np.inf
    holes = right.with_value(values, rates=right.rates["x"])
    assert verdict(holes, holes).equal
    assert not verdict(right, holes).equal
    other = values.copy()
    other[300] = -np.inf
    assert not verdict(holes, right.with_value(other, rates=right.rates["x"])).equal
    other = values.copy()
    other[101] = 0.3
    assert not verdict(holes, right.with_value(other, rates=right.rates["x"])).equal


def test_renamed_is_recognised():
    right = BASES["oscillator"]()
    found = verdict(right, MUTANTS["renamed"](right))
    assert [(c.name, c.status) for c in found.quantities if not c.equal] == [("x", "renamed")]
    assert "x_new" in found.quantities[0].note


def test_a_row_twice_changes_nothing():
    right = BASES["oscillator"]()
    twice = right.rows(np.sort(np.append(np.arange(501), [0, 0, 17, 17, 500])))
    assert verdict(right, twice).equal
    assert verdict(twice, right).equal


def test_a_trace_of_one_instant():
    right = BASES["oscillator"]().rows(np.array([7]))
    assert verdict(right, right).equal
    assert not verdict(right, right.with_value(right.values["x"] + 0.1)).equal


def test_a_nominal_that_lets_everything_pass_does_not():
    right = BASES["oscillator"]()
    wrong = right.with_value(right.values["x"] + 1.0)
    for nominal in (np.inf, np.nan, -1.0):
        found = verdict(replace(right, nominal={**right.nominal, "x": nominal}), wrong)
        assert not found.equal


def test_without_a_nominal_the_reference_decides():
    right = replace(BASES["oscillator"](), nominal={})
    size = 1e-3 * float(np.max(np.abs(right.values["x"])))
    assert verdict(right, right.with_value(right.values["x"] + 0.9 * size, rates=right.rates["x"])).equal
    assert not verdict(right, right.with_value(right.values["x"] + 1.1 * size, rates=right.rates["x"])).equal


def test_what_is_zero_everywhere_has_no_tolerance():
    right = replace(BASES["tiny"](), nominal={})
    assert verdict(right, right).equal
    assert not verdict(right, right.with_value(np.full(right.time.size, 1e-300), "q")).equal
    assert verdict(right, right.with_value(np.full(right.time.size, 1e-300), "q"), Tolerance(atol=1e-299)).equal


def test_the_worst_moment_is_between_the_rows():
    right = BASES["oscillator"]()
    rates = right.rates["x"].copy()
    rates[250] += 8.0  # the values agree at every row
    found = verdict(right, right.with_value(right.values["x"], rates=rates))
    worst = found.worst.worst
    assert found.worst.name == "x"
    assert 0.0 < abs(worst.time - SPAN / 2) < SPAN / 500
    # the extremum of h x (1-x)^2 is 4/27 h
    assert worst.ratio == pytest.approx(4.0 / 27.0 * 8.0 * 0.02 / 1e-3, rel=1e-6)
