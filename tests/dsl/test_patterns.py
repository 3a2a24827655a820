"""Lines read by the recipe of their pattern give the tree, the places and the findings that the automaton gives."""

from __future__ import annotations

import os
import random
import re
from dataclasses import fields, is_dataclass
from pathlib import Path

import pytest
from sysdyn.dsl.parser import patterns
from sysdyn.dsl.parser.automaton import Automaton
from sysdyn.dsl.parser.grammar import load_tables
from sysdyn.dsl.parser.parse import parse
from sysdyn.dsl.text.source import SourceText

CORPUS = [path.read_bytes().decode() for path in sorted((Path(__file__).parent / "corpus").glob("*.sd"))]
LINES = """\
  node v{}: electrical
  ## what the next line is
  R{}: dissipator(e = 10{} ohm*f) v1 -> v{}  # a comment
  R{}: dissipator(e = 10{} ohm*f) v1 -> v{}
  C{}: capacitor(C = {}e-9 F) v{} -> ground
  L{}: inductor(L = 1.{} kg.m^2/s^3) on a[{}].x
  init C{}.e = -{} mV
  param k{}[1..{}] = [1, {}, (2 + 3^{})]
  let y{} = if a{} >= 1 and not b then T*{} else sin(t)' + f(a{}, "text")
  law x{} = {}*y{} + z{}'
  energy T* = 0.5*m{}*v^2
  phi c{}: x{} = y >= {} while t < {} s restitution 0.{}
  init t{} ~ {}m
  every {} ms {{ n{} := n{} + 1 }}
  param ground{} = 1e{}
  let if{} = {} s; let b = 1
  x{}: {} -> (
    y{})
""".splitlines()


def content(root):
    """All that a tree says, places included."""
    if isinstance(root, tuple):
        return [content(item) for item in root]
    if is_dataclass(root) and not isinstance(root, SourceText):
        return [type(root).__name__, *(content(getattr(root, field.name)) for field in fields(root))]
    return repr(root) if isinstance(root, float) else root


def both(text, monkeypatch):
    """What is read with recipes and without; lines read by recipes."""
    counts = []
    replay = patterns.Patterns._replay
    with monkeypatch.context() as patched:
        patched.setattr(patterns.Patterns, "_replay", lambda *given: (counts.append(1), replay(*given))[1])
        one = parse(SourceText("t.sd", text))
        patched.setattr(patterns.Patterns, "follow", lambda self, kind: None)
        other = parse(SourceText("t.sd", text))
    assert content(one[0].items) == content(other[0].items)
    assert content(one[0].comments) == content(other[0].comments)
    told = [[(d.code, d.message, d.help, d.place.span) for d in found] for _, found in (one, other)]
    assert told[0] == told[1]
    return len(counts)


def written(lines, number, end="\n"):
    filled = (re.sub(r"{}", lambda _: str(number()), line).replace("{{", "{").replace("}}", "}") for line in lines)
    body = "".join(line + end for line in filled)
    return f"model m {{{end}{body}}}{end}scene s of m {{ time 0 s to 1 s }}{end}"


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_each_line_is_read_as_before(end, monkeypatch):
    dice = random.Random(1)
    for line in LINES:
        both(written([line] * 6, lambda: dice.choice([0, 7, 12, 345]), end), monkeypatch)
    assert both(written(LINES[3:4] * 50, lambda: dice.randint(1, 99), end), monkeypatch) >= 30


def test_damaged_texts_are_read_as_before(monkeypatch):
    dice = random.Random(2)
    signs = [
        *"(){}[]=+-*/^.,:;<>~'\"$#\n\t ",
        *("->", ":=", "==", "..", "\n\n", " on ", " if ", "1e999", "3kg", "\u0663"),
    ]
    found = 0
    for case in range(int(os.environ.get("SYSDYN_FUZZ", "150"))):
        lines = dice.choices(LINES, k=3) * 9
        dice.shuffle(lines)
        text = CORPUS[case] if case < len(CORPUS) else written(lines, lambda: dice.choice([1, 2, 30]))
        for _ in range(dice.randint(0, 3)):
            at = dice.randrange(len(text))
            text = text[:at] + dice.choice(signs) + text[at + dice.choice([0, 1, 3]) :]
        found += both(text, monkeypatch)
    assert found > 300


def test_no_terminal_has_a_digit_in_it():
    assert not re.search(r"[0-9]", load_tables().lookaheads)


def test_a_netlist_is_read_by_its_recipes(monkeypatch):
    """Of 600 lines the automaton shifts the first token and the newline, but for two of each pattern."""
    dice = random.Random(3)
    shifted = []
    value = Automaton._value
    monkeypatch.setattr(Automaton, "_value", lambda self, kind: (shifted.append(kind), value(self, kind))[1])
    parse(SourceText("t.sd", written([LINES[0], LINES[3], LINES[4]] * 200, lambda: dice.randint(100, 999))))
    assert len(shifted) < 600 * 2 + 100
