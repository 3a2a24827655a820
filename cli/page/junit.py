"""Results as JUnit XML, which every CI shows."""

from __future__ import annotations

import re
from collections.abc import Sequence
from xml.sax.saxutils import escape, quoteattr

_FORBIDDEN = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""What XML 1.0 cannot hold."""


def junit(suites: Sequence[tuple[str, float, Sequence[tuple[str, str | None]]]]) -> str:
    """A JUnit file of suites (name, seconds, cases); a case fails where its second item is a text."""

    def attribute(text: str) -> str:
        return quoteattr(_FORBIDDEN.sub("\ufffd", text))

    lines = ['<?xml version="1.0" encoding="UTF-8"?>']
    total = [case for _, _, found in suites for case in found]
    wrong = sum(text is not None for _, text in total)
    lines.append(f'<testsuites tests="{len(total)}" failures="{wrong}" errors="0">')
    # a suite for each run or file
    for name, seconds, found in suites:
        failed = sum(text is not None for _, text in found)
        head = f'tests="{len(found)}" failures="{failed}" errors="0" time="{seconds:.3f}"'
        lines.append(f"  <testsuite name={attribute(name)} {head}>")
        for case, text in found:
            start = f"    <testcase classname={attribute(name)} name={attribute(case)}"
            # passed
            if text is None:
                lines.append(start + "/>")
            else:
                first = text.splitlines()[0] if text else "failed"
                lines += [
                    start + ">",
                    f"      <failure message={attribute(first)}>{escape(_FORBIDDEN.sub(chr(0xFFFD), text))}</failure>",
                    "    </testcase>",
                ]
        lines.append("  </testsuite>")
    lines.append("</testsuites>")
    return "\n".join(lines) + "\n"
