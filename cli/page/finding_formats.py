"""Findings in the forms that CI and editors read: one line each, GitHub's annotations, JUnit, SARIF 2.1.0.

Pure functions of (findings of texts, findings without a place as in --json) to a text.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import PurePath
from typing import Any
from urllib.parse import quote

from sysdyn import __version__
from sysdyn.cli.page.junit import junit as junit_file
from sysdyn.dsl.text import codes
from sysdyn.dsl.text.diagnostics import Diagnostic
from sysdyn.dsl.text.render import printable
from sysdyn.dsl.text.source import Place

Plain = Sequence[dict[str, object]]
SCHEMA = "https://json.schemastore.org/sarif-2.1.0.json"
_GITHUB = {"error": "error", "warning": "warning", "note": "notice"}


def line(d: Diagnostic) -> str:
    """`file:line:column: E101 message (help)`."""
    where = "" if d.place is None else f"{d.place.file}:{d.place.start[0]}:{d.place.start[1]}: "
    return printable(f"{where}{d.severity} {d.code}: {d.message}{f' ({d.help})' if d.help else ''}")


def concise(found: Sequence[Diagnostic], plain: Plain) -> str:
    """One line a finding."""
    return "\n".join([*map(line, found), *(printable(f"sysdyn: {p['message']}") for p in plain)])


def github(found: Sequence[Diagnostic], plain: Plain) -> str:
    """Workflow commands, which GitHub shows beside the lines of a change."""
    lines = []
    for d in found:
        fields = {"title": d.code}
        if d.place is not None:
            (first, start), (last, end) = d.place.start, d.place.end
            fields = {"file": d.place.file, "line": str(first), "endLine": str(last)} | fields
            if first == last:  # columns of several lines would be those of the first
                fields |= {"col": str(start), "endColumn": str(max(end - 1, start))}
        text = d.message + (f"\nhelp: {d.help}" if d.help else "")
        listed = ",".join(f"{k}={_escape(v, field=True)}" for k, v in fields.items())
        lines.append(f"::{_GITHUB[d.severity]} {listed}::{_escape(text)}")
    return "\n".join([*lines, *(f"::error::{_escape(str(p['message']))}" for p in plain)])


def _escape(text: str, *, field: bool = False) -> str:
    """As workflow commands want it: no line ends, in fields no colon and comma."""
    text = text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")
    return text.replace(":", "%3A").replace(",", "%2C") if field else text


def junit(found: Sequence[Diagnostic], plain: Plain, files: Sequence[str]) -> str:
    """A suite a file with a case for each of its errors, or one case that passed; warnings never fail."""
    suites: list[tuple[str, float, list[tuple[str, str | None]]]] = []
    errors = [d for d in found if d.severity == "error"]
    named = list(dict.fromkeys([*files, *("" if d.place is None else d.place.file for d in errors)]))
    for name in named:
        own = [d for d in errors if ("" if d.place is None else d.place.file) == name]
        cases: list[tuple[str, str | None]] = [(_case(d), line(d)) for d in own]
        suites.append((name or "sysdyn", 0.0, cases or [("check", None)]))
    if plain:
        suites.append(("sysdyn", 0.0, [(str(p["code"]), str(p["message"])) for p in plain]))
    return junit_file(suites)


def _case(d: Diagnostic) -> str:
    return d.code if d.place is None else f"{d.code} line {d.place.start[0]} column {d.place.start[1]}"


def sarif(found: Sequence[Diagnostic], plain: Plain) -> str:
    """SARIF 2.1.0: the pages of the codes are its rules; columns are counted in code points."""
    used = sorted({d.code for d in found})
    pages = codes.codes()
    rules = [
        {
            "id": code,
            "shortDescription": {"text": pages[code].title},
            "fullDescription": {"text": pages[code].why},
            "help": {"text": codes.explain(code)},
            "defaultConfiguration": {"level": pages[code].severity},
        }
        for code in used
    ]
    notices = [{"level": "error", "message": {"text": str(p["message"])}} for p in plain]
    driver = {"name": "sysdyn", "version": __version__, "rules": rules}
    run: dict[str, Any] = {
        "tool": {"driver": driver},
        "columnKind": "unicodeCodePoints",
        "results": [_result(d, used.index(d.code)) for d in found],
        "invocations": [{"executionSuccessful": not plain, "toolExecutionNotifications": notices}],
    }
    return json.dumps({"$schema": SCHEMA, "version": "2.1.0", "runs": [run]}, indent=1)


def _result(d: Diagnostic, rule: int) -> dict[str, Any]:
    """A finding as a result of SARIF, with places, notes and the change that mends it."""
    text = d.message + (f"\nhelp: {d.help}" if d.help else "")
    result: dict[str, Any] = {"ruleId": d.code, "ruleIndex": rule, "level": d.severity, "message": {"text": text}}
    # where it stands; a finding on the whole run has no place
    if d.place is not None:
        result["locations"] = [{"physicalLocation": _physical(d.place)}]
    if d.related:
        result["relatedLocations"] = [
            {"physicalLocation": _physical(r.place), "message": {"text": r.message}} for r in d.related
        ]
    # a change that an editor may offer: what goes, what comes
    if d.edit is not None:
        change = _physical(d.edit.place)
        replacement = {"deletedRegion": change["region"], "insertedContent": {"text": d.edit.text}}
        changes = [{"artifactLocation": change["artifactLocation"], "replacements": [replacement]}]
        result["fixes"] = [{"description": {"text": d.help or d.message}, "artifactChanges": changes}]
    return result


def _physical(place: Place) -> dict[str, Any]:
    (first, start), (last, end) = place.start, place.end
    path = PurePath(place.file)
    uri = path.as_uri() if path.is_absolute() else quote(path.as_posix())
    region = {"startLine": first, "startColumn": start, "endLine": last, "endColumn": end}
    return {"artifactLocation": {"uri": uri}, "region": region}
