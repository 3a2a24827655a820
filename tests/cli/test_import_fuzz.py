"""Netlists cut, shuffled and filled with garbage: findings with lines, never a fault, no file outside their folder.

A slice; SYSDYN_LONG=1 takes 20000 texts.
"""

import json
import os
import random
import sys
from pathlib import Path

import pytest
from sysdyn.cli.main import run

NETLISTS = Path(__file__).with_name("netlists")
TEXTS = {path.stem: path.read_text() for path in sorted(NETLISTS.glob("*.cir"))}
CASES = 20_000 if os.environ.get("SYSDYN_LONG") else 400
JUNK = [
    "\0", "\x1b[2J", "{", "}", "'", '"', "(", ")", "=", ",", "+", "*", ";", "$ ", "//", "日", "\t", "\r", "\n", "\n+",
    ".", "..", "1e999", "-1", "0", "nan", "inf", "1e-320", "9" * 400, "{1/0}", "{" + "(" * 200, "PULSE(", "SIN(",
    "PWL(0", "EXP()", ".include /etc/passwd", "\n.include ../../secret.cir\n", "\n.lib '/etc/shadow' x\n",
    "\n.include .\n",
    "\n.subckt s a\n", "\n.ends\n", "\n.model m d(is=\n", "\n.param a={a}\n", "\nX1 a b inv\n", "\nK1 L1 L1 1\n",
    "\nE1 a 0 a 0 1\n", "\nV1 0 0 1\n", "\n.tran 0 0\n", "\n.tran 1 -1\n", "\n.ic v(=1\n",
    "\n.subckt r a b\nX1 a b r\n.ends\nX9 1 2 r\n",
]  # fmt: skip
_opened: list[str] = []
_watching = False


def _hook(event, arguments):
    if _watching and event == "open" and isinstance(arguments[0], str | bytes):
        _opened.append(os.fsdecode(arguments[0]))


sys.addaudithook(_hook)


def mutated(chance):
    text = TEXTS[chance.choice(sorted(TEXTS))]
    for _ in range(chance.choice((1, 1, 2, 3, 6))):
        way, at = chance.randrange(7), chance.randrange(len(text) + 1)
        lines, words = text.splitlines(), text.split(" ")
        if way == 0:
            text = text[:at]
        elif way == 1:
            text = text[:at] + chance.choice(JUNK) + text[at:]
        elif way == 2:
            text = text[:at] + text[at + chance.randrange(1, 8) :]
        elif way == 3 and len(lines) > 2:
            other = TEXTS[chance.choice(sorted(TEXTS))].splitlines()
            lines.insert(chance.randrange(len(lines)), chance.choice(other))
            text = "\n".join(lines)
        elif way == 4 and len(words) > 2:
            words[chance.randrange(len(words))] = chance.choice(words)
            text = " ".join(words)
        elif way == 5 and len(lines) > 2:
            del lines[chance.randrange(len(lines))]
            text = "\n".join(lines)
        else:
            noise = "".join(chr(chance.randrange(1, 0x2FF)) for _ in range(chance.randrange(1, 12)))
            text = text[:at] + noise + text[at:]
    return text


@pytest.mark.parametrize("part", range(8))
@pytest.mark.one_in(12)
def test_garbage_gives_findings(part, tmp_path, capsys):
    """Exit 0 or 1; errors have a line of the text; what is imported is a text that parses."""
    global _watching
    (tmp_path.parent / "secret.cir").write_text("t\nR1 a 0 1k\n")
    path, out = tmp_path / "n.cir", tmp_path / "out.sd"
    taken = 0
    for case in range(part, CASES, 8):
        text = mutated(random.Random(f"netlist {case}"))
        path.write_text(text, encoding="utf-8", errors="replace", newline="")
        out.unlink(missing_ok=True)
        _opened.clear()
        _watching = True
        try:
            code = run(["import", str(path), "-o", str(out), "--json"])
        finally:
            _watching = False
        found = json.loads(capsys.readouterr().out)
        assert code in (0, 1), (case, text, found)
        outside = [n for n in _opened if "passwd" in n or "shadow" in n or n.endswith("secret.cir")]
        assert not outside, (case, text, outside)
        for d in found["diagnostics"]:
            if d["severity"] == "error":
                assert d["line"] is None or 1 <= d["line"] <= text.count("\n") + text.count("\r") + 2, (case, d)
                assert d["file"], (case, d)
        if code == 0:
            taken += 1
            checked = run(["check", str(out), "--json"])
            said = json.loads(capsys.readouterr().out)
            assert checked in (0, 1), (case, text, said)
            assert not [d for d in said["diagnostics"] if d["code"].startswith("E1")], (case, text, said)
    assert taken > 5
