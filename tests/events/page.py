"""Random event models: python tests/events/page.py [NUMBER] [--from K] [FAMILY...]

Runs NUMBER (1000) seeded models of random_events.py, prints a table of the families and each model that is not met
with its reason.  Ends with 1 where a run hangs or has a fault, or where fewer than 95 % are met.
"""

import argparse
import sys
import tempfile
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from event_verdicts import KINDS, judge
from random_events import FAMILIES, drawn
from sysdyn.cli.page.columns import align

LEAST = 0.95
"""Of all models: how many must be met."""


def main() -> int:
    """Runs and prints."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("number", nargs="?", type=int, default=1000)
    parser.add_argument("words", nargs="*", metavar="FAMILY")
    parser.add_argument("--from", dest="first", type=int, default=0)
    given = parser.parse_args()
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(given.first, given.first + given.number):
            model = drawn(number)
            if given.words and model.family not in given.words:
                continue
            found.append(judge(Path(folder), model))
            if found[-1].kind != "met":
                print(f"{number} {found[-1].family}: {found[-1].kind}: {found[-1].reason[:200]}", flush=True)
    rows = [("family", *KINDS, "events", "steps", "cpu s")]
    for name in [*(f.__name__ for f in FAMILIES), "all"]:
        group = [v for v in found if name in (v.family, "all")]
        count = Counter(v.kind for v in group)
        sums = sum(v.events for v in group), sum(v.steps for v in group), round(sum(v.cpu for v in group), 1)
        rows.append((name, *(str(count[kind]) for kind in KINDS), *map(str, sums)))
    print(align(rows, right=range(1, 8)))
    count = Counter(v.kind for v in found)
    return int(count["hung"] + count["fault"] > 0 or count["met"] < LEAST * len(found))


if __name__ == "__main__":
    sys.exit(main())
