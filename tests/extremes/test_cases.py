"""The extremes: a slice of every family runs always, SYSDYN_LONG=1 runs all cases.  None is wrong, none unbounded.

`python tests/extremes/page.py` runs all of them and writes a page with figures.
"""

import os
from collections import Counter

import pytest
from cases import families
from judged import judge

LONG = os.environ.get("SYSDYN_LONG") == "1"
FAMILIES = families()
EACH = 4
"""Cases of a family in the slice: both ends and between."""
FALSELY = {
    # the ranks of the structure are cut at 1e-12 of the largest entry: reported, E516 or E903 instead of a run
    "two masses, ratio of stiffnesses",
    "two capacitors, ratio of capacities",
    "two capacitors, ratio of resistances",
    "two coils, ratio of inductances",
    "pendulum, unit of mass",
}

SLOW = {"oscillator, 1e4 periods": 2, "two masses, ratio of stiffnesses": 2}


def sliced(family):
    """EACH of its cases, evenly."""
    cases, number = family.cases, SLOW.get(family.name, EACH)
    last = len(cases) - 1
    return [cases[k] for k in sorted({round(n * last / (number - 1)) for n in range(number)})]


def judged(folder, family, cases):
    """Verdicts on cases."""
    return [judge(folder, family, case) for case in cases]


@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.name)
@pytest.mark.long
def test_a_slice_is_right_or_refused(tmp_path, family):
    found = judged(tmp_path, family, family.cases if LONG else sliced(family))
    assert not [v for v in found if v.kind in ("wrong", "unbounded")]
    if family.name not in FALSELY:
        assert not [v for v in found if v.kind == "falsely"]


@pytest.mark.long
def test_nine_of_ten_are_right(tmp_path):
    count = Counter(v.kind for family in FAMILIES for v in judged(tmp_path, family, family.cases))
    assert sum(count.values()) >= 300
    assert count["right"] >= 0.9 * sum(count.values())
    assert not count["wrong"] + count["unbounded"]


def test_there_are_enough_cases():
    assert sum(len(family.cases) for family in FAMILIES) >= 300
