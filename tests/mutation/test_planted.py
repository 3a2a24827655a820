"""Faults planted in the residual rows of generated code are noticed by the run itself (the audit is left intact)."""

import os
import random
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
import planted

NUMBER = 200 if os.environ.get("SYSDYN_LONG") else 8

LINES = {
    "    r[to[0]] += a9;": {("sign", "    r[to[0]] -= a9;")},
    "    const double a9 = a2 + a5;": {("sign", "    const double a9 = a2 - a5;")},
    "    const double a4 = y[at[1]];": {
        ("index", "    const double a4 = y[at[0]];"),
        ("index", "    const double a4 = y[at[2]];"),
    },
    "    const double a0 = p[0];": {("index", "    const double a0 = p[1];")},
}


@pytest.mark.parametrize("line", LINES)
@pytest.mark.one_in(2)
def test_changes_are_what_they_say(line):
    found = {change for seed in range(20) for change in planted.changes(line, random.Random(seed))}
    assert LINES[line] <= found
    assert all(new != line for _, new in found)


def test_planted_faults_are_noticed():
    found = list(planted.plant(NUMBER))
    assert len(found) == NUMBER
    counted, noticed, missed = planted.summary(found)
    assert counted >= NUMBER // 3
    assert noticed >= 0.95 * counted, missed
