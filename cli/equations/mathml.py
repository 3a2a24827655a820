"""Expressions typeset as MathML.  Names of users become <mi> texts through `escape` and nothing else.

Nodes share subexpressions, text does not: a node that would be larger than LARGEST stands as an ellipsis.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

from sysdyn.cli.equations.letters import GREEK, SHORT, is_letter, letter_of_name, slips
from sysdyn.dsl.model.expression import Node, topological
from sysdyn.dsl.model.network import Loop, Switch

LARGEST = 500
"""Nodes of one expression that is written out."""
SUM, PRODUCT, POWER, ATOM = range(4)
"""How strongly a piece holds together."""

_GREEK = dict(zip(GREEK, "αβγδεζηθικλμνξοπρστυφχψω", strict=True))
_COUNTERS = "ijklmn"
_SIGNS = {"==": "=", "!=": "≠", "<": "&lt;", "<=": "≤", ">": "&gt;", ">=": "≥"}


def math(*pieces: str) -> str:
    """A formula of pieces side by side."""
    return f"<math>{''.join(pieces)}</math>"


def mi(text: str) -> str:
    """An identifier."""
    return f"<mi>{escape(text)}</mi>"


def mo(sign: str) -> str:
    """An operator; sign is HTML."""
    return f"<mo>{sign}</mo>"


def row(*pieces: str) -> str:
    """Pieces as one."""
    return pieces[0] if len(pieces) == 1 else f"<mrow>{''.join(pieces)}</mrow>"


def name(text: str, index: Sequence[str] = (), order: int = 0) -> str:
    """A name, dotted as a rate, with what stands below it: `q1`, `tau_m` and `M.R` are q, tau and R with an index."""
    letter = letter_of_name(text)
    below = [f"<mn>{part}</mn>" if part.isdigit() else mi(part) for part in letter.below]
    base = _with_dots(mi(_GREEK.get(SHORT.get(letter.base, letter.base), letter.base)), order)
    below += index
    return base if not below else f"<msub>{base}{row(*_comma_list(below))}</msub>"


def coordinate(text: str, index: Sequence[str] = (), order: int = 0) -> str:
    """A displacement coordinate: its own name where that is a symbol, else q with the name below."""
    return name(text, index, order) if is_letter(text) else _quantity_of("q", text, index, order)


def _comma_list(pieces: Sequence[str]) -> list[str]:
    found = [pieces[0]]
    for piece in pieces[1:]:
        found += [mo(","), piece]
    return found


def number(value: float) -> str:
    """A number, a power of ten written as one."""
    mantissa, _, exponent = f"{value:.12g}".partition("e")
    if not exponent:
        return f"<mn>{mantissa.replace('-', '−')}</mn>"
    raised = f"<msup><mn>10</mn><mn>{str(int(exponent)).replace('-', '−')}</mn></msup>"
    return raised if mantissa == "1" else row(f"<mn>{mantissa.replace('-', '−')}</mn>", mo("·"), raised)


class Typesetter:
    """Writes expressions of one model.  coordinates: families whose q and f are a name and its rate; switches:
    those of the model, whose senses and directions are parameters; elements: of the coordinates those named after an
    element, of which C1 is no letter; complementary: coordinates are momenta and efforts.
    """

    def __init__(
        self,
        coordinates: Iterable[str] = (),
        switches: Iterable[Switch] = (),
        elements: Iterable[str] = (),
        *,
        complementary: bool = False,
    ) -> None:
        self._coordinates, self._elements = frozenset(coordinates), frozenset(elements)
        self._complementary = complementary
        self._slips = {
            name: (_GREEK.get(base, base), switch.label, [f"<mn>{k}</mn>"] if kind == "direction" else [])
            for base, kind, switch, names in slips(switches)
            for k, name in enumerate(names, 1)
        }

    def expression(self, root: Node) -> str:
        """The expression as pieces of MathML."""
        size: dict[Node, int] = {}
        nodes = topological([root])
        for node in nodes:
            size[node] = min(1 + sum(size[a] for a in node.args), 10 * LARGEST)
        made: dict[Node, tuple[str, int]] = {}
        for node in nodes:
            made[node] = (mo("…"), ATOM) if size[node] > LARGEST else self._node(node, [made[a] for a in node.args])
        return made[root][0]

    def parenthesize(self, root: Node) -> str:
        """The expression, in parentheses where it is a sum."""
        text = self.expression(root)
        return row(mo("("), text, mo(")")) if root.op in ("sum", "cond", "cmp", "and", "or") else text

    def bounds(self, nest: Sequence[Loop]) -> str:
        """`i = 1, …, n` for each loop, as a formula."""
        pieces: list[str] = []
        for loop in nest:
            pieces += [mo(","), "<mspace width='.4em'/>"] if pieces else []
            ends = [mo("="), self.expression(loop.first)]
            if loop.first is not loop.last:
                ends += [mo(","), mo("…"), mo(","), self.expression(loop.last)]
            pieces += [counter(loop.index), *ends]
        return row(*pieces) if pieces else ""

    def sum_over(self, nest: Sequence[Loop], body: str) -> str:
        """The sum of a body over loops."""
        for loop in reversed(nest):
            low = row(counter(loop.index), mo("="), self.expression(loop.first))
            body = row(f"<munderover>{mo('∑')}{low}{row(self.expression(loop.last))}</munderover>", body)
        return body

    def _node(self, node: Node, args: list[tuple[str, int]]) -> tuple[str, int]:
        """MathML of a node with its strength, from those of its arguments."""
        texts = [text for text, _ in args]
        match node.op:
            case "const":
                return number(node.data), ATOM if node.data >= 0 else SUM
            case "param":
                if node.data in self._slips:
                    letter, label, part = self._slips[node.data]
                    return _quantity_of(letter, label, [*part, *texts]), ATOM
                return name(node.data.lstrip("#"), texts), ATOM
            case "index":
                return counter(node.data), ATOM
            case "time":
                return mi("t"), ATOM
            case "var":
                family, kind, order = node.data
                return self.typeset_unknown(family, kind, order, texts), ATOM
            case "sum":
                return _sum(node, args), SUM
            case "mul":
                return _product(node, args), PRODUCT
            case "pow":
                return f"<msup>{_parenthesize(args[0], ATOM)}{row(texts[1])}</msup>", POWER
            case _:
                return _function(node, args)

    def typeset_unknown(self, family: str, kind: str, order: int, index: Sequence[str] = ()) -> str:
        """An unknown: x, its rates dotted, momenta p, multipliers κ and μ; of branches and nodes their own e f q p."""
        # of a branch or node: the letter with its owner below
        if kind[0] in "nb" and len(kind) == 2:
            return _quantity_of(kind[1], family, index, order)
        if family.startswith("#"):
            family = family.lstrip("#")
        match kind:
            # rates of displacements are dotted; in the complementary family they are momenta
            case "q" | "f" if family in self._coordinates:
                order += kind == "f"
                if self._complementary:
                    return _quantity_of("p", family, index, order)
                own = family not in self._elements
                return coordinate(family, index, order) if own else _quantity_of("q", family, index, order)
            case "p":
                return _quantity_of("q" if self._complementary else "p", family, index, order)
            case "kappa" | "mu":
                return _quantity_of("κ" if kind == "kappa" else "μ", family, index, order)
            case "audit":
                return mi(f"audit.{family}")
            case _:
                return name(family, index, order)


def _quantity_of(letter: str, family: str, index: Sequence[str], order: int = 0) -> str:
    """A quantity of an object, which stands below it."""
    below = row(*_comma_list([*map(mi, family.split("#")), *index]))
    return f"<msub>{_with_dots(mi(letter), order)}{below}</msub>"


def counter(index: str) -> str:
    """A loop variable: of the canonical ones i, j, k, ..."""
    text = index.lstrip("#").removeprefix("rm#").removeprefix("r")
    if index.startswith("#") and text.isdigit():
        k = int(text)
        return mi(_COUNTERS[-1 - (k - 1) % 3] if index.startswith("#r") else _COUNTERS[k % 3])
    return mi(text or index)


def _with_dots(base: str, order: int) -> str:
    return base if not order else f"<mover accent='true'>{base}{mo('˙' if order == 1 else '¨')}</mover>"


def _parenthesize(piece: tuple[str, int], strength: int) -> str:
    """A piece in parentheses where it would fall apart."""
    text, own = piece
    return text if own >= strength else row(mo("("), text, mo(")"))


def _sum(node: Node, args: list[tuple[str, int]]) -> str:
    """MathML of a sum, positive terms first."""
    constant, coefficients = node.data
    pieces: list[str] = []
    parts = [(c, _parenthesize(a, PRODUCT)) for c, a in zip(coefficients, args, strict=True)]
    parts.sort(key=lambda part: part[0] < 0)  # a sum that can begin without a sign does
    for c, text in parts:
        # no + before the first; a - always
        if pieces or c < 0:
            pieces.append(mo("−" if c < 0 else "+"))
        if abs(c) != 1.0:
            pieces.append(_coefficient(abs(c)))
        pieces.append(text)
    if constant:
        pieces += [mo("−" if constant < 0 else "+"), number(abs(constant))]
    return row(*pieces)


def _coefficient(value: float) -> str:
    """Halves, thirds and quarters as fractions."""
    for below in (2, 3, 4, 6, 12):
        above = value * below
        if value < 10 and above == int(above) and value != int(value):
            return f"<mfrac><mn>{int(above)}</mn><mn>{below}</mn></mfrac>"
    return number(value)


def _product(node: Node, args: list[tuple[str, int]]) -> str:
    """MathML of a product: a fraction where there are negative exponents."""
    above: list[str] = []
    below: list[str] = []
    for e, piece in zip(node.data, args, strict=True):
        text, size = piece[0], abs(e)
        # one factor above or below the bar needs no parentheses
        alone = sum((x < 0) == (e < 0) for x in node.data) == 1 and any(x < 0 for x in node.data)
        if size == 0.5:
            text = f"<msqrt>{text}</msqrt>"
        elif size != 1.0:
            text = f"<msup>{_parenthesize(piece, ATOM)}{row(_coefficient(size))}</msup>"
        elif not alone:
            text = _parenthesize(piece, PRODUCT)
        (above if e > 0 else below).append(text)
    top = _juxtapose(above) if above else "<mn>1</mn>"
    return top if not below else f"<mfrac>{row(top)}{row(_juxtapose(below))}</mfrac>"


def _juxtapose(pieces: list[str]) -> str:
    found = [pieces[0]]
    for piece in pieces[1:]:
        found += ["<mspace width='.14em'/>", piece]
    return row(*found)


def _function(node: Node, args: list[tuple[str, int]]) -> tuple[str, int]:
    """MathML of conditions, comparisons, reductions, tables and functions."""
    texts = [text for text, _ in args]
    match node.op:
        case "cond":
            words = [f"<mtext>{w}</mtext>" for w in ("if ", " then ", " else ")]
            return row(*(x for pair in zip(words, texts, strict=True) for x in pair)), SUM
        case "cmp":
            return row(texts[0], mo(_SIGNS[node.data]), texts[1]), SUM
        case "and" | "or":
            pieces = [_parenthesize(args[0], PRODUCT)]
            for piece in args[1:]:
                pieces += [mo("∧" if node.op == "and" else "∨"), _parenthesize(piece, PRODUCT)]
            return row(*pieces), SUM
        case "not":
            return row(mo("¬"), _parenthesize(args[0], ATOM)), PRODUCT
        case "reduce":
            return _reduction(node, args), PRODUCT
        case "table":
            label, orders = node.data
            primes = "′" * orders if isinstance(orders, int) else f"({', '.join(map(str, orders))})"
            return row(mi(label + primes), mo("("), *_comma_list(texts), mo(")")), ATOM
    if node.data == "abs":
        return row(mo("|"), texts[0], mo("|")), ATOM
    if node.data == "exp" and "<mfrac>" not in texts[0]:
        return f"<msup><mi mathvariant='normal'>e</mi>{row(texts[0])}</msup>", POWER
    return row(mi(node.data), mo("&#x2061;"), mo("("), *_comma_list(texts), mo(")")), ATOM


def _reduction(node: Node, args: list[tuple[str, int]]) -> str:
    operator, index = node.data
    first, last, body = (text for text, _ in args)
    low = row(counter(index), mo("="), first)
    sign = {"sum": "∑", "prod": "∏"}.get(operator)
    if sign is not None:
        return row(f"<munderover>{mo(sign)}{low}{row(last)}</munderover>", _parenthesize(args[2], PRODUCT))
    return row(f"<munder>{mi(operator)}{row(low, mo('…'), last)}</munder>", mo("("), body, mo(")"))
