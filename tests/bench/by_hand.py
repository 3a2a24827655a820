"""What netlists written line by line cost: python tests/bench/by_hand.py [--lines N ...] [NAME ...]

CPU seconds and largest resident memory, imports and C compiler included, of `check` and of the text to its first step
(`simulate --max-steps 1`); NAME: ladder chain mesh stages uneven mixed lattice power_grid
(tests/models/handwritten.py), all where none.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[1] / "models"), str(Path(__file__).parent)]

import handwritten as texts  # noqa: E402
from large import cost  # noqa: E402

LINES = {
    "ladder": lambda lines: texts.ladder(lines // 3),
    "chain": lambda lines: texts.chain(lines // 4),
    "mesh": lambda lines: texts.mesh(round((lines / 4) ** 0.5), round((lines / 4) ** 0.5)),
    "stages": lambda lines: texts.stages(lines // 9),
    "uneven": lambda lines: texts.uneven(lines // 3),
    "mixed": lambda lines: texts.mixed(3 * lines // 11),
    "lattice": lambda lines: texts.lattice(int(lines / 6.45)),
    "power_grid": lambda lines: texts.power_grid(max(int(lines / 7.5), 20)),
}


def main() -> int:
    """The table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=list(LINES))
    parser.add_argument("--lines", type=int, nargs="*", default=[1500, 6000, 30_000, 100_000])
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        for name in asked.names:
            for lines in asked.lines:
                file = Path(place) / f"{name}.sd"
                file.write_text(LINES[name](lines))
                step = ("simulate", str(file), "-o", str(Path(place) / "t.h5"), "--max-steps", "1")
                print(f"{name:11}{lines:8} lines  check {cost('check', str(file))}  step {cost(*step)}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
