"""What the answer to a slip is worth: the right line first; the author's object; the reason and the remedy."""

import re
from dataclasses import dataclass

from bases import BASES
from sysdyn.api import check
from sysdyn.dsl.text.diagnostics import Diagnostic


@dataclass(frozen=True)
class Answer:
    """findings: errors and warnings, in the order shown; points: of the three; wrong: what is missing."""

    findings: tuple[Diagnostic, ...]
    points: int
    wrong: tuple[str, ...]


def text_of(slip):
    """The text with the slip in it."""
    before = BASES[slip.base]
    assert before.count(slip.old) >= 1, slip
    return before.replace(slip.old, slip.new, 1)


def lines_of(slip, text):
    """The lines, counted from 1, on which the first finding may stand."""
    if slip.at is None:
        start = BASES[slip.base].index(slip.old)
        return {text.count("\n", 0, start + len(slip.new) - len(slip.new.lstrip())) + 1}
    marks = slip.at.split("|")
    return {number for number, line in enumerate(text.split("\n"), 1) if any(mark in line for mark in marks)}


def answer(slip, found=None):
    """What `check` says of a slip, or what was found in its run."""
    text = text_of(slip)
    shown = check(text) if found is None else found
    findings = tuple(d for d in shown if d.severity != "note")
    if not findings:
        return Answer((), 0, ("nothing is found",))
    first = findings[0]
    said = " ".join([first.message, first.label or "", *(r.message for r in first.related)])
    wrong = []
    if first.place is None or first.place.start[0] not in lines_of(slip, text):
        wrong.append(f"line {first.place and first.place.start[0]}, not {sorted(lines_of(slip, text))}")
    objects = slip.object.split("|") if slip.object != "|" else ["|"]
    if not any(_names(first.message, one) for one in objects):
        wrong.append(f"'{slip.object}' is not named")
    reason = re.search(slip.reason, said, re.IGNORECASE)
    remedy = re.search(slip.remedy, first.help or "")
    if not (reason and first.help and remedy):
        wrong.append("reason" if not reason else "remedy")
    points = 3 - len(wrong)
    if len(findings) > 1:
        wrong.append(f"{len(findings)} findings")
    return Answer(findings, points, tuple(wrong))


def _names(message, name):
    """Whether a message names this, as a word of its own where it is one."""
    ends = (r"(?<!\w)" if name[0].isalnum() else "", r"(?!\w)" if name[-1].isalnum() else "")
    return re.search(ends[0] + re.escape(name) + ends[1], message) is not None
