"""Expressions written as text and as LaTeX: one walk, two alphabets.

Names of users are letters, digits and underscores (the language's rule): in LaTeX the underscore alone is escaped.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

from sysdyn.cli.equations.letters import GREEK, SHORT, Letter, Letters, letter_of_name
from sysdyn.compiler.equations.book import Summed
from sysdyn.compiler.equations.order import FactorOrder
from sysdyn.dsl.model.expression import Node, topological
from sysdyn.dsl.model.network import Loop

SUM, PRODUCT, POWER, ATOM = range(4)
"""How strongly a piece holds together."""
LARGEST = 2000
"""Nodes of one expression that is written out."""
_COUNTERS = "ijklmn"
_SIGNS = {"==": "=", "!=": "≠", "<": "<", "<=": "≤", ">": ">", ">=": "≥"}
Piece = tuple[str, int]


class ExpressionWriter(ABC):
    """Writes expressions of one model."""

    minus = "-"

    def __init__(self, letters: Letters, order: FactorOrder) -> None:
        self.letters = letters
        self._rank = order.rank

    @abstractmethod
    def symbol(self, letter: Letter, index: Sequence[str]) -> str:
        """A symbol with indices."""

    @abstractmethod
    def fraction(self, above: str, below: Piece, held: Piece) -> Piece:
        """A quotient; held: what stands above, as one factor."""

    @abstractmethod
    def power(self, base: Piece, exponent: str) -> str:
        """A power."""

    @abstractmethod
    def root(self, inner: str) -> str:
        """A square root."""

    @abstractmethod
    def parenthesize(self, text: str) -> str:
        """In parentheses."""

    @abstractmethod
    def function(self, name: str, args: Sequence[str]) -> str:
        """A call."""

    @abstractmethod
    def total(self, sign: str, loop: Loop, body: str) -> str:
        """A sum or product over a range."""

    @abstractmethod
    def product(self, factors: Sequence[str]) -> str:
        """A product."""

    @abstractmethod
    def variation(self, on: Node) -> str:
        """The variation of a displacement."""

    def expression(self, root: Node) -> str:
        """The expression."""
        return self.piece(root)[0]

    def piece(self, root: Node) -> Piece:
        """The expression, and how strongly it holds together."""
        nodes = topological([root])
        size: dict[Node, int] = {}
        made: dict[Node, Piece] = {}
        for node in nodes:
            size[node] = min(1 + sum(size.get(a, 1) for a in node.args), 10 * LARGEST)
            made[node] = ("…", ATOM) if size[node] > LARGEST else self._node(node, [made[a] for a in node.args])
        return made[root]

    def sum_of(self, terms: Sequence[Summed]) -> str:
        """Terms with their signs; 0 where there is none."""
        found: list[str] = []
        for term in terms:
            sign, text = self._sign_and_text(term)
            if not found:
                found.append(f"{self.minus}{text}" if sign < 0 else text)
            else:
                found.append(f"{self.minus if sign < 0 else '+'} {text}")
        return " ".join(found) or "0"

    def _sign_and_text(self, term: Summed) -> tuple[int, str]:
        """Sign and text of a term with its sums, so that a minus stands between terms and not inside of them."""
        sign, node = 1, term.expression
        text, strength = self.piece(node)
        # -2 x: the sign in front
        if node.op == "sum" and node.data[0] == 0.0 and len(node.args) == 1 and node.data[1][0] < 0.0:
            sign = -1
            text = text.removeprefix(self.minus)
            strength = PRODUCT
        elif node.op == "const" and node.data < 0:
            sign, text = -1, text.removeprefix(self.minus)
        # a sum under a summation sign
        if term.over and strength < PRODUCT:
            text = self.parenthesize(text)
        for loop in reversed(term.over):
            text = self.total("sum", loop, text)
        return sign, text

    def counter(self, name: str) -> str:
        """A loop variable: of the canonical ones i, j, k, ..."""
        text = name.lstrip("#").removeprefix("rm#").removeprefix("r")
        if name.startswith("#") and text.isdigit():
            k = int(text)
            return _COUNTERS[-1 - (k - 1) % 3] if name.startswith("#r") else _COUNTERS[k % 3]
        return text or name

    def number(self, value: float) -> Piece:
        """A number; simple fractions as such."""
        sign = self.minus if value < 0 else ""
        size = abs(value)
        for below in (2, 3, 4, 6, 8, 12):
            above = size * below
            if size < 10 and above == int(above) and size != int(size):
                text, strength = self.fraction(f"{int(above)}", (f"{below}", ATOM), (f"{int(above)}", ATOM))
                return f"{sign}{text}", SUM if sign else strength
        return f"{sign}{size:.12g}", SUM if sign else ATOM

    def _node(self, node: Node, args: list[Piece]) -> Piece:
        """Text of a node with its strength, from those of its arguments."""
        texts = [text for text, _ in args]
        match node.op:
            case "const":
                return self.number(node.data)
            # leaves
            case "param":
                return self.symbol(self.letters.name(node.data), texts), ATOM
            case "index":
                return self.counter(node.data), ATOM
            case "time":
                return "t", ATOM
            case "var":
                return self.symbol(self.letters.letter_of(node), texts), ATOM
            # operations
            case "sum":
                return self._sum(node, args)
            case "mul":
                return self._product(1.0, node, args)
            case "pow":
                return self.power(args[0], texts[1]), POWER
            case _:
                return self._call(node, args)

    def _sum(self, node: Node, args: list[Piece]) -> Piece:
        """Text of a sum, positive terms first, then in the order of a book."""
        constant, coefficients = node.data
        # a multiple
        if constant == 0.0 and len(args) == 1:
            return self._times(coefficients[0], node.args[0], args[0])
        parts = sorted(zip(coefficients, node.args, args, strict=True), key=lambda p: (p[0] < 0, self._rank(p[1])))
        found: list[str] = []
        for c, inner, piece in parts:
            text = self._times(abs(c), inner, piece)[0] if abs(c) != 1.0 else self._hold(piece, PRODUCT)
            sign = self.minus if c < 0 else "+"
            found.append((f"{self.minus}{text}" if c < 0 else text) if not found else f"{sign} {text}")
        if constant:
            sign = self.minus if constant < 0 else "+"
            found.append(f"{sign} {self.number(abs(constant))[0]}")
        return " ".join(found), SUM

    def _times(self, factor: float, node: Node, piece: Piece) -> Piece:
        """A number times an expression."""
        sign, size = (self.minus if factor < 0 else ""), abs(factor)
        if size == 1.0:
            text, strength = self._hold(piece, PRODUCT), PRODUCT
        elif node.op == "mul":
            text, strength = self._product(size, node, [self.piece(a) for a in node.args])
        else:
            text, strength = self._quotient(size, [self._hold(piece, PRODUCT)], [])
        return f"{sign}{text}", SUM if sign else strength

    def _product(self, factor: float, node: Node, args: list[Piece]) -> Piece:
        """Text of a product, above and below the bar; square roots as roots."""
        above: list[str] = []
        below: list[str] = []
        pairs = sorted(zip(node.args, node.data, args, strict=True), key=lambda p: self._rank(p[0]))
        alone = sum(e < 0 for e in node.data) == 1
        for _, exponent, piece in pairs:
            size = abs(exponent)
            if size == 0.5:
                text = self.root(piece[0])
            elif size != 1.0:
                text = self.power(piece, self.number(size)[0])
            else:
                text = piece[0] if exponent < 0 and alone and self.bare_below else self._hold(piece, PRODUCT)
            (above if exponent > 0 else below).append(text)
        return self._quotient(factor, above, below)

    bare_below = False
    """Whether what stands below needs no parentheses."""

    def _quotient(self, factor: float, above: list[str], below: list[str]) -> Piece:
        """Factor times what stands above, by what stands below."""
        if factor != 1.0:
            whole = factor * 12.0
            # 0.5 x / m reads x / (2 m), as 1/3 and 1/12 do; 0.3 x stays
            if below and factor < 10 and whole == int(whole) and factor != int(factor):
                over = next(k for k in (2, 3, 4, 6, 12) if factor * k == int(factor * k))
                below = [str(over), *below]
                above = ([str(int(factor * over))] if factor * over != 1 or not above else []) + above
            else:
                above = [self.number(factor)[0], *above]
        top = self.product(above) if above else "1"
        # no fraction: a product, or the factor alone
        if not below:
            return top, PRODUCT if len(above) > 1 else ATOM if factor == 1.0 else PRODUCT
        under = self.product(below)
        return self.fraction(top, (under, PRODUCT if len(below) > 1 else ATOM), (top, ATOM))

    def _hold(self, piece: Piece, strength: int) -> str:
        return piece[0] if piece[1] >= strength else self.parenthesize(piece[0])

    def _call(self, node: Node, args: list[Piece]) -> Piece:
        """Text of conditions, comparisons, reductions, tables and functions."""
        texts = [text for text, _ in args]
        match node.op:
            case "cond":
                return f"(if {texts[0]} then {texts[1]} else {texts[2]})", ATOM
            case "cmp":
                return f"{texts[0]} {_SIGNS[node.data]} {texts[1]}", SUM
            case "and" | "or":
                return f" {node.op} ".join(self._hold(a, PRODUCT) for a in args), SUM
            case "not":
                return f"not {self._hold(args[0], ATOM)}", SUM
            # a sum, product, least or largest over a counter
            case "reduce":
                operator, name = node.data
                loop = Loop(name, node.args[0], node.args[1])
                return self.total(operator, loop, self._hold(args[2], PRODUCT)), PRODUCT
            # K'(x), K''(x); of several arguments K(1, 0)(x, y)
            case "table":
                label, orders = node.data
                primes = "'" * orders if isinstance(orders, int) else f"({', '.join(map(str, orders))})"
                return self.function(label + primes, texts), ATOM
        return (texts[0], args[0][1]) if node.data == "signal" else (self.function(node.data, texts), ATOM)


class TextWriter(ExpressionWriter):
    """For a terminal: f1', kappa as κ1, products side by side."""

    def symbol(self, letter: Letter, index: Sequence[str]) -> str:
        """f1', x_0, κ1[i]."""
        base = _GREEK.get(letter.base, letter.base) if letter.below else letter.base
        below = list(letter.below)
        if below and below[0].isdigit():
            base += below.pop(0)
        base += "".join(f"_{part}" for part in below)
        return base + (f"[{', '.join(index)}]" if index else "") + "'" * letter.dots

    def fraction(self, above: str, below: Piece, held: Piece) -> Piece:
        """a/b."""
        return f"{above}/{below[0] if below[1] == ATOM else self.parenthesize(below[0])}", PRODUCT

    def power(self, base: Piece, exponent: str) -> str:
        """a^b."""
        exponent = exponent if exponent.replace(".", "").isalnum() else self.parenthesize(exponent)
        return f"{self._hold(base, ATOM)}^{exponent}"

    def root(self, inner: str) -> str:
        """Of a square."""
        return f"sqrt({inner})"

    def parenthesize(self, text: str) -> str:
        """(a)."""
        return f"({text})"

    def function(self, name: str, args: Sequence[str]) -> str:
        """f(a, b); |a|."""
        return f"|{args[0]}|" if name == "abs" else f"{name}({', '.join(args)})"

    def total(self, sign: str, loop: Loop, body: str) -> str:
        """sum(i = 1..n) a."""
        first, last = self.expression(loop.first), self.expression(loop.last)
        return f"{sign}({self.counter(loop.index)} = {first}..{last}) {body}"

    def product(self, factors: Sequence[str]) -> str:
        """A b c."""
        return " ".join(factors)

    def variation(self, on: Node) -> str:
        """δx, δ(x + y)."""
        text, strength = self.piece(on)
        return f"δ{text}" if strength == ATOM else f"δ({text})"


class Latex(ExpressionWriter):
    """For LaTeX's mathematics."""

    bare_below = True

    def symbol(self, letter: Letter, index: Sequence[str]) -> str:
        r"""\dot f_{1}, \kappa_{1,i}."""
        base = SHORT.get(letter.base, letter.base)
        if base in GREEK and base != "omicron":
            base = f"\\{base}"
        elif len(base) > 1:
            face = "\\textit" if " " in base else "\\mathit"
            base = f"{face}{{{_escape(base)}}}"
        base = ("", "\\dot ", "\\ddot ")[min(letter.dots, 2)] + base
        below = ",".join([*map(_below, letter.below), *index])
        return f"{base}_{{{below}}}" if below else base

    def fraction(self, above: str, below: Piece, held: Piece) -> Piece:
        r"""\frac{a}{b}."""
        return f"\\frac{{{above}}}{{{below[0]}}}", ATOM

    def power(self, base: Piece, exponent: str) -> str:
        """a^{b}."""
        return f"{{{self._hold(base, ATOM)}}}^{{{exponent}}}"

    def root(self, inner: str) -> str:
        r"""\sqrt{a}."""
        return f"\\sqrt{{{inner}}}"

    def parenthesize(self, text: str) -> str:
        r"""\left(a\right)."""
        return f"\\left({text}\\right)"

    def function(self, name: str, args: Sequence[str]) -> str:
        r"""\sin\left(a\right)."""
        if name == "abs":
            return f"\\left|{args[0]}\\right|"
        known = name in ("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "ln", "min", "max")
        shown = f"\\{name}" if known else f"\\operatorname{{{_escape(name)}}}"
        return f"{shown}\\left({', '.join(args)}\\right)"

    def total(self, sign: str, loop: Loop, body: str) -> str:
        r"""\sum_{i=1}^{n} a."""
        shown = {"sum": "\\sum", "prod": "\\prod"}.get(sign, f"\\{sign}")
        first, last = self.expression(loop.first), self.expression(loop.last)
        return f"{shown}_{{{self.counter(loop.index)}={first}}}^{{{last}}} {body}"

    def product(self, factors: Sequence[str]) -> str:
        r"""A \, b."""
        return " \\, ".join(factors)

    def variation(self, on: Node) -> str:
        r"""\delta x."""
        text, strength = self.piece(on)
        return f"\\delta {text}" if strength == ATOM else f"\\delta {self.parenthesize(text)}"


_GREEK = {"kappa": "κ", "mu": "μ", "sigma": "σ"}
"""In text, of letters with an index."""


def _below(part: str) -> str:
    """What stands below a letter: numbers and letters as they are, Greek names as letters, words upright."""
    if part.isdigit() or len(part) == 1:
        return part
    found = letter_of_name(part)
    base = SHORT.get(found.base, found.base)
    if base in GREEK and base != "omicron" and all(p.isdigit() for p in found.below):
        return f"\\{base}_{{{found.below[0]}}}" if found.below else f"\\{base}"
    return f"\\mathrm{{{_escape(part)}}}"


def _escape(name: str) -> str:
    return name.replace("_", "\\_")
