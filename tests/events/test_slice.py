"""A slice of the random event models: three of each family; the whole is `python tests/events/page.py`."""

import pytest
from event_verdicts import judge
from random_events import FAMILIES, drawn

SLICE = 3 * len(FAMILIES)


@pytest.mark.parametrize("number", range(SLICE), ids=lambda k: f"{FAMILIES[k % len(FAMILIES)].__name__}-{k}")
@pytest.mark.long
def test_ends_met_or_says_why(number, tmp_path):
    found = judge(tmp_path, drawn(number))
    assert found.kind in ("met", "refused"), found.reason


@pytest.mark.long
def test_a_jump_that_projections_miss_is_searched(tmp_path):
    """Diodes that commutate where no nearest point settles: Gauss-Newton from the state held finds it."""
    found = judge(tmp_path, drawn(182))
    assert found.kind == "met", found.reason


def test_the_same_for_ever():
    assert drawn(7) == drawn(7)
    assert len({drawn(k).text for k in range(200)}) == 200
