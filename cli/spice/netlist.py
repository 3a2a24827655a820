"""A netlist's lines: cards with their places, numbers, expressions of parameters."""

from __future__ import annotations

import ast
import math
import operator
import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field

from sysdyn.dsl.text.source import Place, SourceText
from sysdyn.values import dataclass

SCALES = {
    "t": 1e12, "g": 1e9, "meg": 1e6, "k": 1e3, "mil": 25.4e-6, "m": 1e-3, "u": 1e-6, "n": 1e-9, "p": 1e-12, "f": 1e-15,
    "\u00b5": 1e-6, "\u03bc": 1e-6,
}  # fmt: skip
POWERS = {letters: round(math.log10(scale)) for letters, scale in SCALES.items() if letters != "mil"}
_NUMBER = re.compile(
    r"([+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?)(meg|mil|[tgkmunpf\u00b5\u03bc])?[a-z\u03c9]*", re.IGNORECASE
)
_WORD = re.compile(r"\{[^{}]*\}|'[^']*'|[^\s(),={}']+|[(),=]")
_SCALED = re.compile(r"(?<![\w.])((?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?)(t|g|meg|k|mil|m|u|n|p|f)?[a-z]*(?![\w.(])")
MOST = 400
"""Characters of an expression."""


class UnreadableCard(Exception):  # noqa: N818 (a finding)
    """What a card says cannot be read; str: the reason; card: where it stands, if not where it is read."""

    card: Card | None = None


@dataclass(frozen=True, slots=True)
class Card:
    """One statement: words (names in small letters, expressions in their brackets), its first line's span in source."""

    words: tuple[str, ...]
    start: int
    end: int
    text: str
    source: SourceText = field(compare=False, repr=False)

    @property
    def place(self) -> Place:
        """Where it stands."""
        return self.source.place(self.start, self.end)

    @property
    def head(self) -> str:
        """The first word: a name, or a command with its dot."""
        return self.words[0]


def cards(source: SourceText, *, titled: bool = True) -> tuple[str, list[Card]]:
    """The title (an included text has none) and the statements of a text; lines that begin with '+' go on."""
    joined: list[tuple[int, int, str]] = []
    commands = False  # between .control and .endc stand the commands of another program
    for number in range(1 + titled, len(source.line_starts) + 1):
        line, start = source.line(number), source.line_starts[number - 1]
        first = line.split(None, 1)[0].lower() if line.strip() else ""
        if commands:
            commands = first != ".endc"
            continue
        commands = first == ".control"
        plain = re.split(r";|\$\s|//", line, maxsplit=1)[0].rstrip()
        if not plain.strip() or plain.lstrip().startswith("*"):
            continue
        if plain.lstrip().startswith("+") and joined:
            begin, end, text = joined[-1]
            joined[-1] = begin, end, f"{text} {plain.lstrip()[1:]}"
        else:
            joined.append((start + len(plain) - len(plain.lstrip()), start + len(plain), plain.strip()))
    found = [Card(tuple(w.lower() for w in _WORD.findall(text)), a, b, text, source) for a, b, text in joined]
    return source.line(1).strip(), [card for card in found if card.words]


def pairs(words: Sequence[str]) -> list[tuple[str, str]]:
    """`a = 1 b = 2` as pairs."""
    plain = [w for w in words if w not in ("(", ")", ",")]
    found = []
    for k in range(0, len(plain), 3):
        if k + 2 >= len(plain) or plain[k + 1] != "=":
            raise UnreadableCard(f"'{plain[k]}': NAME=VALUE is wanted")
        found.append((plain[k], plain[k + 2]))
    return found


def number(text: str) -> float | None:
    """`4.7k`, `10meg`, `100nF`, `1e-3`; None where it is none."""
    found = _NUMBER.fullmatch(text)
    if found is None:
        return None
    return scale_number(found[1], (found[2] or "").lower())


def scale_number(text: str, scale: str) -> float:
    """A number with the letters of a scale; one of ten as if it were written out, so that 0.1n is 1e-10."""
    if scale == "mil":
        return float(text) * SCALES[scale]
    if not scale:
        return float(text)
    digits, _, power = text.lower().partition("e")
    return float(f"{digits}e{int(power or '0') + POWERS[scale]}")


_OPERATORS: dict[type[ast.AST], Callable[..., float]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv, ast.Pow: math.pow,
    ast.USub: operator.neg, ast.UAdd: operator.pos,
}  # fmt: skip
_FUNCTIONS: dict[str, Callable[..., float]] = {
    "sqrt": math.sqrt, "exp": math.exp, "ln": math.log, "log": math.log, "log10": math.log10, "sin": math.sin,
    "cos": math.cos, "tan": math.tan, "atan": math.atan, "abs": abs, "min": min, "max": max, "pow": math.pow,
}  # fmt: skip
CONSTANTS = {"pi": math.pi}


def value(text: str, known: Mapping[str, float]) -> float:
    """A number, the name of a parameter, or an expression in brackets.  Unreadable.

    The expression is parsed and walked: numbers, names of parameters, + - * / ** ^ and a few functions, nothing else.
    """
    found = _value(text, known)
    if not math.isfinite(found):
        raise UnreadableCard(f"'{text[:60]}' has no value")
    return found


def _value(text: str, known: Mapping[str, float]) -> float:
    """Number of a text: a literal, a parameter, or an expression of both; Unreadable otherwise."""
    plain = text.strip("{}'").strip()
    found = number(plain)
    if found is not None:
        return found
    if plain in known:
        return known[plain]
    if len(plain) > MOST:
        raise UnreadableCard(f"an expression of more than {MOST} characters")

    def written(match: re.Match[str]) -> str:
        return repr(scale_number(match[1], match[2] or ""))

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of literals that are none: they are findings here
            # Python's parser reads it, and a walk allows what is allowed
            tree = ast.parse(_SCALED.sub(written, plain.replace("^", "**")), mode="eval")
        return _walk(tree.body, known)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise UnreadableCard(f"'{text}' is no number and no expression of parameters") from None
    except (ZeroDivisionError, OverflowError, TypeError):
        raise UnreadableCard(f"'{text}' has no value") from None


def _walk(node: ast.AST, known: Mapping[str, float]) -> float:
    """Value of a syntax tree of numbers, parameters, operators and functions; Unreadable of anything else."""
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        return float(node.value)
    if isinstance(node, ast.Name):
        if node.id not in known and node.id not in CONSTANTS:
            raise UnreadableCard(f"there is no parameter '{node.id}'")
        return known[node.id] if node.id in known else CONSTANTS[node.id]
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        return _OPERATORS[type(node.op)](_walk(node.left, known), _walk(node.right, known))
    if isinstance(node, ast.UnaryOp) and type(node.op) in _OPERATORS:
        return _OPERATORS[type(node.op)](_walk(node.operand, known))
    called = node.func.id if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) else ""
    if isinstance(node, ast.Call) and called in _FUNCTIONS and not node.keywords:
        return float(_FUNCTIONS[called](*(_walk(a, known) for a in node.args)))
    raise UnreadableCard("an expression of numbers, parameters, + - * / ** and functions is wanted")
