"""Damaged texts: only diagnostics come out, with places inside the text, and soon.

SYSDYN_FUZZ=N runs N cases instead of the few hundred of every day.
"""

from __future__ import annotations

import os
import random
from pathlib import Path

import pytest
from sysdyn.dsl.format.format import format_text
from sysdyn.dsl.parser.parse import parse
from sysdyn.dsl.text.codes import codes
from sysdyn.dsl.text.render import render
from sysdyn.dsl.text.source import SourceText
from sysdyn.dsl.tree.sameness import same_tree

CASES = int(os.environ.get("SYSDYN_FUZZ", "400"))
CORPUS = [path.read_bytes().decode() for path in sorted((Path(__file__).parent / "corpus").glob("*.sd"))]
SIGNS = [*"(){}[]=+-*/^.,:;<>~'\"$#\n\t \r\0", "->", ":=", "==", "..", "\u00a0", "\u65e5", "\ud7ff", "1e999", "3kg"]
# fmt: off
WORDS = [
    "if", "then", "else", "and", "or", "not", "true", "model", "scene", "component", "for", "when",
    "every", "level", "param", "node", "phi", "energy", "T*", "in", "of",
]
# fmt: on


def damaged(random_, text):
    """A text with a few cuts, splices and insertions."""
    for _ in range(random_.randint(1, 4)):
        at = random_.randrange(len(text) + 1)
        until = min(len(text), at + random_.choice([0, 1, 1, 2, 5, 30, 400]))
        choice = random_.randrange(6)
        if choice == 0:
            text = text[:at] + text[until:]
        elif choice == 1:
            text = text[:at] + random_.choice(SIGNS) * random_.choice([1, 1, 1, 3, 300]) + text[at:]
        elif choice == 2:
            text = text[:at] + f" {random_.choice(WORDS)} " + text[until:]
        elif choice == 3:
            other = random_.choice(CORPUS)
            start = random_.randrange(len(other))
            text = text[:at] + other[start : start + random_.randint(1, 200)] + text[until:]
        elif choice == 4:
            text = text[:at]
        else:
            signs = (chr(random_.choice([random_.randrange(128), random_.randrange(0xD7FF)])) for _ in range(9))
            text = text[:at] + "".join(signs) + text[until:]
    return text


def check(text):
    source = SourceText("fuzz.sd", text)
    tree, found = parse(source)
    for item in found:
        assert item.code in codes()
        assert 0 <= item.place.span.start <= item.place.span.end <= len(text)
        assert "\x1b" not in render(item)
    if not found:
        once = format_text(tree)
        again = SourceText("again.sd", once)
        assert same_tree(tree, parse(again)[0])
        assert format_text(again) == once
    return bool(found)


@pytest.mark.parametrize("part", range(8))
@pytest.mark.one_in(4)
def test_damaged_texts_give_diagnostics_only(part):
    random_ = random.Random(f"sysdyn {part}")
    wrong = 0
    for number in range(max(1, CASES // 8)):
        text = damaged(random_, random_.choice(CORPUS))
        try:
            wrong += check(text)
        except Exception as error:
            raise AssertionError(f"case {part}/{number}: {text!r}") from error
    assert wrong > 0


def test_random_characters():
    random_ = random.Random(7)
    for _ in range(max(1, CASES // 8)):
        check("".join(random_.choice(SIGNS + WORDS + ["x", "1", " "]) for _ in range(random_.randint(1, 300))))


def test_every_cut_of_a_text():
    text = CORPUS[-1]
    for end in range(0, len(text), max(1, 20_000 // CASES)):
        check(text[:end])
