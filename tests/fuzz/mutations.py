"""Mutated texts of all models: characters, numbers, words and whole lines, from a seed."""

from __future__ import annotations

import random
import re
import tomllib
from pathlib import Path

MODELS = Path(__file__).resolve().parents[2] / "models"
NUMBERS = (
    "0", "1", "-1", "2", "3", "0.5", "1e-300", "1e300", "1e-9", "1e12", "-0", "1e5", "7", "100000", "1e-30", "0.1",
)  # fmt: skip
SIGNS = [*"(){}[]=+-*/^.,:;<>~'\"$#\n\t \0", "->", "..", "''", "^2", "^0.5", "^-1", "日", "\x1b[2J", " m", " s", " kg"]
CALLS = (
    "sin({})", "sqrt({})", "ln({})", "exp({})", "abs({})", "1/({})", "({})^2", "({})^3", "-({})", "({})'", "({})''",
    "atan2({}, {})", "max({}, 0)", "tanh({})", "asin({})", "(if {} > 0 then {} else 0)",
)  # fmt: skip
_NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d+)?(?:[eE][+-]?\d+)?(?![\w.])")
_WORD = re.compile(r"[A-Za-z_]\w*'*")


def texts() -> dict[str, str]:
    """Every model's text at the sizes of models/ci.toml, by `folder/name`."""
    sizes = tomllib.loads((MODELS / "ci.toml").read_text())
    found = {}
    for path in sorted(p for p in MODELS.rglob("*.sd") if p.parent.name != "book"):
        text = path.read_text(encoding="utf-8")
        for name, value in sizes.get(path.parent.name, {}).get(path.stem, {}).items():
            text = re.sub(rf"(param {name} = )[^#\n;]*", rf"\g<1>{value}", text, count=1)
        found[f"{path.parent.name}/{path.stem}"] = text
    return found


def mutated(chance: random.Random, text: str, others: list[str]) -> str:
    """One to three changes."""
    for _ in range(chance.choice((1, 1, 1, 2, 3))):
        text = chance.choice(_WAYS)(chance, text, others)
    return text


def _number(chance: random.Random, text: str, others: list[str]) -> str:
    places = list(_NUMBER.finditer(text))
    if not places:
        return text
    at = chance.choice(places)
    return text[: at.start()] + chance.choice(NUMBERS) + text[at.end() :]


def _word(chance: random.Random, text: str, others: list[str]) -> str:
    """A word becomes another one of the text, or of another text."""
    places = list(_WORD.finditer(text))
    if not places:
        return text
    at = chance.choice(places)
    pool = places if chance.random() < 0.8 else list(_WORD.finditer(chance.choice(others))) or places
    source = chance.choice(pool)
    return text[: at.start()] + source.group() + text[at.end() :]


def _wrapped(chance: random.Random, text: str, others: list[str]) -> str:
    places = list(_WORD.finditer(text))
    if not places:
        return text
    at = chance.choice(places)
    return text[: at.start()] + chance.choice(CALLS).format(at.group(), at.group()) + text[at.end() :]


def _line(chance: random.Random, text: str, others: list[str]) -> str:
    """A line goes, comes twice, changes places, or one of another model comes in."""
    lines = text.splitlines()
    if len(lines) < 3:
        return text
    at, to = chance.randrange(len(lines)), chance.randrange(len(lines))
    way = chance.randrange(4)
    if way == 0:
        del lines[at]
    elif way == 1:
        lines.insert(to, lines[at])
    elif way == 2:
        lines[at], lines[to] = lines[to], lines[at]
    else:
        lines.insert(at, chance.choice(chance.choice(others).splitlines() or [""]))
    return "\n".join(lines) + "\n"


def _characters(chance: random.Random, text: str, others: list[str]) -> str:
    at = chance.randrange(len(text) + 1)
    until = min(len(text), at + chance.choice((0, 0, 1, 1, 2, 8)))
    return text[:at] + chance.choice(SIGNS) + text[until:]


def _operator(chance: random.Random, text: str, others: list[str]) -> str:
    places = [k for k, sign in enumerate(text) if sign in "+-*/^=~<>'"]
    if not places:
        return text
    at = chance.choice(places)
    return text[:at] + chance.choice("+-*/^=~<>' ") + text[at + 1 :]


_WAYS = (_number, _number, _word, _word, _wrapped, _line, _line, _characters, _operator)
