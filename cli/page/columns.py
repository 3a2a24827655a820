"""Tables that line up, and what stands in them."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Collection, Iterable, Sequence


def align(rows: Sequence[Sequence[str]], right: Collection[int] = ()) -> str:
    """Rows of cells as lines; columns of the numbers `right` end at one place, the others begin at one."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for row in rows:
        cells = [t.rjust(w) if k in right else t.ljust(w) for k, (t, w) in enumerate(zip(row, widths, strict=True))]
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines)


def terminal() -> int | None:
    """Columns of the terminal that shows standard output; None where there is none."""
    return shutil.get_terminal_size().columns if sys.stdout.isatty() else None


def fit_columns(rows: Sequence[Sequence[str]], spare: Sequence[str], width: int | None) -> tuple[list[list[str]], str]:
    """Rows without as many of the columns that can be spared, the first first, as make them fit, and the line that says
    so; width: None: whatever they take.
    """
    heads, kept = list(rows[0]), list(range(len(rows[0])))
    widths = [2 + max(map(len, column)) for column in zip(*rows, strict=True)]
    gone = []
    for head in spare:
        if width is None or sum(widths[k] for k in kept) - 2 <= width:
            break
        kept.remove(heads.index(head))
        gone.append(head)
    said = f"{width} columns have no room for {'; '.join(gone)}" if gone else ""
    return [[row[k] for k in kept] for row in rows], said


def complex_text(value: complex, digits: int = 9) -> str:
    """A complex number; a part that is round-off beside the other is 0."""
    real, imaginary = (part if abs(part) > 1e-12 * abs(value) else 0.0 for part in (value.real, value.imag))
    return f"{real:.{digits}g}" if imaginary == 0.0 else f"{real:.{digits}g}{imaginary:+.{digits}g}i"


def spent(seconds: float) -> str:
    """A time of work: `0.483 ms`, `12.8 s`."""
    return f"{seconds:.3g} s" if seconds >= 1.0 else f"{1e3 * seconds:.3g} ms"


def refusals(pairs: Iterable[tuple[str, str]]) -> list[str]:
    """A line a reason: `not in kane, co_kane: why`; pairs: what cannot be had, and why."""
    reasons: dict[str, dict[str, None]] = {}
    for name, reason in pairs:
        reasons.setdefault(reason, {})[name] = None
    return [f"not in {', '.join(names)}: {reason}" for reason, names in reasons.items()]
