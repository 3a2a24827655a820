"""The page of the extremes: python tests/extremes/page.py [-o extremes.html] [FAMILY...]

Runs every case of cases.py (or of the families whose names contain a word given), prints a table of the families and
every case that is not right, and writes one page: counts, a figure a family (error over accuracy), all cases.
"""

import argparse
import html
import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from cases import families
from judged import RIGHT, Verdict, judge
from sysdyn.cli.page.columns import align
from sysdyn.cli.page.document import document, table

KINDS = ("right", "refused", "falsely", "wrong", "unbounded")
COLOURS = {"right": "#2f8f6b", "refused": "#e09f3e", "falsely": "#8c5a3c", "wrong": "#d1495b", "unbounded": "#7a4fa3"}
WIDE, HIGH, LEFT, BOTTOM = 420, 150, 44, 30
LOW, TOP = -8.0, 4.0
"""Of lg(error over accuracy) in a figure."""


def figure(name: str, axis: str, found: list[Verdict]) -> str:
    """lg(error/accuracy) over the family's axis; refusals stand on the upper edge."""
    xs = [v.x for v in found]
    low, high = min(xs), max(xs)
    span = (high - low) or 1.0

    def across(x: float) -> float:
        return LEFT + 8 + (x - low) / span * (WIDE - LEFT - 20)

    def down(y: float) -> float:
        return 12 + (TOP - y) / (TOP - LOW) * (HIGH - BOTTOM - 12)

    parts = [f'<svg viewBox="0 0 {WIDE} {HIGH}" role="img" aria-label="{html.escape(name, quote=True)}">']
    for y in (-8, -4, 0, 4):
        parts.append(f'<line class="grid" x1="{LEFT}" x2="{WIDE}" y1="{down(y):.1f}" y2="{down(y):.1f}"/>')
        parts.append(f'<text x="{LEFT - 4}" y="{down(y) + 4:.1f}" text-anchor="end">{y}</text>')
    limit = down(np.log10(RIGHT))
    across_it = f'x1="{LEFT}" x2="{WIDE}" y1="{limit:.1f}" y2="{limit:.1f}"'
    parts.append(f'<line {across_it} stroke="#d1495b" stroke-dasharray="4"/>')
    for x in sorted({low, 0.5 * (low + high), high}):
        parts.append(f'<text x="{across(x):.1f}" y="{HIGH - 14}" text-anchor="middle">{x:.3g}</text>')
    parts.append(f'<text x="{WIDE}" y="{HIGH - 2}" text-anchor="end">{html.escape(axis)}</text>')
    for v in found:
        y = TOP if not np.isfinite(v.ratio) else float(np.clip(np.log10(max(v.ratio, 1e-30)), LOW, TOP))
        title = f"{v.case}: {v.kind}, {v.ratio:.2g} of the accuracy {v.reason}"
        dot = f'cx="{across(v.x):.1f}" cy="{down(y):.1f}" r="3.2" fill="{COLOURS[v.kind]}"'
        parts.append(f"<circle {dot}><title>{html.escape(title)}</title></circle>")
    return "".join([*parts, "</svg>"])


def page(found: dict[str, tuple[str, list[Verdict]]]) -> str:
    """The whole page."""
    verdicts = [v for _, group in found.values() for v in group]
    count = Counter(v.kind for v in verdicts)
    counts = ", ".join(f"{count[kind]} {kind}" for kind in KINDS)
    body = ["<h1>The extremes</h1>", f"<p><strong>{len(verdicts)} cases: {counts}</strong></p>"]
    body.append(
        '<p class="soft">Each run at its accuracy against a closed form, mpmath or SciPy. Right: met, and within '
        f"{RIGHT:g} times the accuracy asked; refused: not met by the run's own judgement; falsely: a finding instead "
        "of a run, though there is a solution; wrong: met and off; "
        "figures: lg(error over accuracy).</p>"
    )
    body.append(table(("family", *KINDS), [[html.escape(n), *_counts(g)] for n, (_, g) in found.items()], left=(0,)))
    for name, (axis, group) in found.items():
        body.append(f"<h3>{html.escape(name)}</h3>{figure(name, axis, group)}")
        rows = [
            [html.escape(v.case), v.kind, f"{v.ratio:.2g}", f"{v.seconds:.2f}", html.escape(v.reason[:160])]
            for v in group
        ]
        listed = table(("case", "verdict", "error/accuracy", "s", "reason"), rows, left=(0, 1, 4))
        body.append(f"<details><summary>{len(group)} cases</summary>{listed}</details>")
    return document("The extremes", "\n".join(body))


def _counts(group: list[Verdict]) -> list[str]:
    count = Counter(v.kind for v in group)
    return [str(count[kind]) for kind in KINDS]


def main() -> int:
    """Runs, prints, writes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("words", nargs="*", metavar="FAMILY")
    parser.add_argument("-o", "--output", default="extremes.html")
    given = parser.parse_args()
    found: dict[str, tuple[str, list[Verdict]]] = {}
    with tempfile.TemporaryDirectory() as folder:
        for family in families():
            if given.words and not any(word in family.name for word in given.words):
                continue
            group = [judge(Path(folder), family, case) for case in family.cases]
            found[family.name] = family.axis, group
            print(f"{family.name:44s} {dict(Counter(v.kind for v in group))}", file=sys.stderr, flush=True)
    rows = [("family", *KINDS), *((name, *_counts(group)) for name, (_, group) in found.items())]
    print(align(rows, right=range(1, 6)))
    for _, group in found.values():
        for v in group:
            if v.kind != "right":
                off = f"{v.ratio:.2g} of the accuracy, {v.seconds:.1f} s"
                print(f"{v.kind}: {v.family}: {v.case}: {off} {v.reason[:150]}")
    Path(given.output).write_text(page(found), encoding="utf-8")
    print(given.output)
    return int(any(v.kind in ("wrong", "unbounded") for _, group in found.values() for v in group))


if __name__ == "__main__":
    sys.exit(main())
