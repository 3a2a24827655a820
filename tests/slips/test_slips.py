"""Slips of the pen, one at a time: the right line first, the author's object, reason and remedy; nothing else."""

from collections import Counter

import pytest
from bases import BASES
from scoring import answer
from slips import SLIPS
from sysdyn.api import check


@pytest.mark.parametrize("slip", SLIPS, ids=[f"{s.kind}: {s.new.strip()[:40]!r}" for s in SLIPS])
def test_a_slip_is_told_once_and_well(slip):
    found = answer(slip)
    assert (found.points, found.wrong) == (3, ()), [(d.code, d.message, d.help) for d in found.findings]


@pytest.mark.parametrize("name", BASES)
def test_a_right_model_has_no_finding(name):
    assert [d for d in check(BASES[name]) if d.severity != "note"] == []


def test_every_class_has_slips():
    counted = Counter(s.kind for s in SLIPS)
    assert sum(counted.values()) >= 120
    for kind in ("misspelt", "units", "habits", "domains", "references", "redundancy", "starts", "values", "loops"):
        assert counted[kind] >= 4, kind
    assert len({(s.base, s.old, s.new) for s in SLIPS}) == len(SLIPS)
