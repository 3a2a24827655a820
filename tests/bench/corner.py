"""Lines of the corner of issue 10: what stood in 17 files at commit 17c57ae, by today's files.

`python tests/bench/corner.py [COMMIT]` counts the working tree, or a commit.  A file that was split off one of these
counts with it; what grew beside them (quadratures, settled, levels, left_out) is shown apart, for it was never among
the 17.
"""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
CORNER = {
    "positions, linkages": ["compiler/network/positions.py"],
    "islands": ["compiler/network/floating_parts.py"],
    "initially, overlaps": ["compiler/network/primal/overlaps.py"],
    "unsaid": ["compiler/network/primal/store_guesses.py"],
    "rings": ["compiler/network/primal/cycles.py"],
    "contents": ["compiler/network/primal/contents.py"],
    "floating": ["compiler/forms/relative_coordinates.py"],
    "starter": [f"runtime/start/{name}.py" for name in ("starter", "least", "equations", "sums")],
    "start": [f"runtime/start/{name}.py" for name in ("start", "exact", "strategies", "held", "flat", "moved")],
    "impulses": ["runtime/start/instant.py"],
    "redundancy": ["runtime/structure/redundancy.py"],
    "implicit": ["runtime/structure/implicit.py"],
    "inertia": ["runtime/structure/inertia.py"],
    "order": ["runtime/structure/order.py"],
    "rates": ["runtime/structure/rates.py"],
}
BESIDE = [
    "compiler/network/quadratures.py",
    "runtime/start/settled.py",
    "runtime/structure/levels.py",
    "runtime/structure/left_out.py",
]
FIRST, WANTED = 2503, 1669


def lines(path, commit=None):
    """Of a file; 0 where it is not there."""
    if commit is None:
        file = ROOT / path
        return len(file.read_text().splitlines()) if file.is_file() else 0
    found = subprocess.run(["git", "show", f"{commit}:{path}"], cwd=ROOT, capture_output=True, text=True, check=False)
    return len(found.stdout.splitlines())


def main(commit=None):
    total = 0
    for name, files in CORNER.items():
        for file in files:
            number = lines(file, commit)
            total += number
            print(f"{number:6}  {name:20} {file}")
    print(f"{total:6}  in all; {FIRST} at 17c57ae, {WANTED} wanted")
    for file in BESIDE:
        print(f"{lines(file, commit):6}  {'(beside)':20} {file}")


if __name__ == "__main__":
    main(*sys.argv[1:2])
