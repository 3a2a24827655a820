"""Like terms joined: an expression as a list of terms, each a coefficient times flows, rates and multipliers.

The expression is a polynomial in what moves (rates, multipliers, flows, momenta, efforts); each coefficient takes the
shortest of the forms that sympy finds: as it stands, factored, trigonometric sums joined.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from sysdyn.compiler.equations.algebra import Algebra
from sysdyn.dsl.model.expression import Node, const, is_const, mul, product, variables

LARGEST = 120
"""Operations of a coefficient up to which shorter forms are looked for."""
TURNING = 40
"""The same of trigonometric ones."""
TURNS = 8
"""Times an angle up to which sines of it are those of the angle in powers."""
GRANTED = 1500
"""Operations of all coefficients of one model for which shorter forms are looked for: some seconds."""


def moving(node: Node) -> bool:
    """Whether an unknown is one of those in which terms are polynomials."""
    return node.op == "var" and (node.data[2] > 0 or node.data[1] not in ("q", "s"))


def collect_terms(algebra: Algebra, root: Node) -> tuple[Node, ...]:
    """The terms of an expression, rates first, then multipliers, flows, and what does not move."""
    if is_const(root, 0.0):
        return ()
    whole = algebra.object(root)
    leaves = sorted((n for n in variables(root) if moving(n)), key=_leading)
    # in rates, multipliers and flows
    polynomial = _polynomial(algebra, whole, leaves)
    if polynomial is None:  # flows inside of functions: what is linear in rates and multipliers is still apart
        leaves = [n for n in leaves if n.data[2] or n.data[1] in ("kappa", "mu")]
        polynomial = _polynomial(algebra, whole, leaves)
    if polynomial is None:
        return tuple(_split(algebra, whole))
    found: list[Node] = []
    # each monomial with its coefficient as short as it gets
    for powers, coefficient in polynomial:
        short = shortest(algebra, coefficient)
        if short == 0:
            continue
        if not any(powers):
            found += _split(algebra, short)
            continue
        pairs = sorted(zip(powers, leaves, strict=True), key=lambda pair: algebra.order.rank(pair[1]))
        held = product(1.0, ((float(k), leaf) for k, leaf in pairs if k))
        found.append(mul(sort_factors(algebra, algebra.node(short)), held))
    return tuple(found)


def shorter(algebra: Algebra, root: Node) -> tuple[Node, ...]:
    """The terms of an expression, as written or joined, whichever is shorter."""
    plain = algebra.sympy.Add.make_args(algebra.object(root))
    written = tuple(sort_factors(algebra, algebra.node(part)) for part in plain if part != 0)
    found = collect_terms(algebra, root)
    return min((found, written), key=lambda terms: length(algebra, terms))


def length(algebra: Algebra, terms: Sequence[Node]) -> int:
    """Operations of a sum of terms."""
    return len(terms) + sum(int(algebra.object(term).count_ops()) for term in terms)


def _leading(leaf: Node) -> tuple[int, int]:
    """Rates first, then multipliers, then the rest, as they were made."""
    kind, order = leaf.data[1], leaf.data[2]
    return (0 if order else 1 if kind in ("kappa", "mu") else 2), leaf.number


def _polynomial(algebra: Algebra, whole: Any, leaves: Sequence[Node]) -> list[tuple[tuple[int, ...], Any]] | None:
    """(powers, coefficient) of a polynomial in the leaves, highest first; None where it is none."""
    sympy = algebra.sympy
    symbols = [algebra.symbol(leaf) for leaf in leaves]
    rest, inside = whole.as_independent(*symbols, as_Add=True)
    opened = _expand_products(sympy, inside)
    found: dict[tuple[int, ...], Any] = {}
    for term in sympy.Add.make_args(opened):
        coefficient, moves = term.as_independent(*symbols, as_Add=False)
        powers = moves.as_powers_dict()
        if any(base not in symbols or not (e.is_Integer and e > 0) for base, e in powers.items() if base != 1):
            return None
        key = tuple(int(powers.get(s, 0)) for s in symbols)
        found[key] = found.get(key, 0) + coefficient
    still = (0,) * len(symbols)
    rest = rest + found.pop(still, 0)
    return [*sorted(found.items(), reverse=True), *([(still, rest)] if rest != 0 else [])]


def _expand_products(sympy: Any, whole: Any) -> Any:
    """Products of sums multiplied out, functions and what stands below left as they are."""
    held = {p: sympy.Dummy() for p in _over_sums(sympy, whole)}
    opened = sympy.expand(whole.xreplace(held), power_base=False, power_exp=False, log=False, basic=False)
    return opened.xreplace({symbol: p for p, symbol in held.items()})


def _over_sums(sympy: Any, whole: Any) -> list[Any]:
    """The whole negative powers of sums in it."""
    return [p for p in whole.atoms(sympy.Pow) if p.base.is_Add and p.exp.is_Integer and p.exp < 0]


def shortest(algebra: Algebra, coefficient: Any) -> Any:
    """The shortest form of a coefficient."""
    sympy = algebra.sympy
    size = coefficient.count_ops()
    algebra.spent += size
    # each simplification costs: large ones and late ones stay as they are
    if size > LARGEST or algebra.spent > GRANTED:
        return coefficient
    whole, held = _abstract_functions(sympy, coefficient)
    forms = [whole]
    waves = coefficient.has(sympy.sin, sympy.cos)
    # several rewritings are tried, and the shortest wins
    ways: list[Callable[[Any], Any]] = [sympy.factor]
    if waves and _over_sums(sympy, coefficient):
        pass  # its factors are looked at one by one
    elif waves and size <= TURNING:
        ways += [lambda c: sympy.fu(sympy.expand(c)), lambda c: sympy.factor(sympy.trigsimp(sympy.expand(c)))]
        ways += [lambda c: sympy.factor(sympy.fu(sympy.factor(c)))]
    elif not coefficient.is_Mul:
        ways.append(sympy.expand)
    for way in ways:
        try:
            forms.append(way(whole))
        except (sympy.PolynomialError, NotImplementedError):
            continue
    if waves:
        forms += [turned_factors(sympy, form) for form in forms[1:] if form.is_Mul]
    forms = [form.xreplace(held) for form in forms] if held else forms
    return min(forms, key=lambda c: (sympy.count_ops(c, visual=False), str(c)))


def _abstract_functions(sympy: Any, whole: Any) -> tuple[Any, dict[Any, Any]]:
    """Exponentials and broken powers as symbols, sines of many times an angle as those of one, and what these are: in
    polynomials exp(99 t) is of degree 99, and sin(64 t) becomes one in those of t.
    """
    broken = (p for p in whole.atoms(sympy.Pow) if not (2 * p.exp).is_Integer)
    held = {p: sympy.Dummy() for p in (*whole.atoms(sympy.exp), *broken)}
    waves = [w for w in whole.atoms(sympy.sin, sympy.cos) if abs(w.args[0].as_coeff_Mul()[0]) > TURNS]
    angles = {w.args[0]: sympy.Dummy() for w in waves}
    closed = whole.xreplace(held).xreplace({w.xreplace(held): w.func(angles[w.args[0]]) for w in waves})
    return closed, {symbol: p for p, symbol in {**held, **angles}.items()}


def turned_factors(sympy: Any, form: Any) -> Any:
    """A product with each sum of squares of sines and cosines in it as short as it can be."""
    found = []
    for factor in form.args if form.is_Mul else (form,):
        base, exponent = factor.as_base_exp()
        if base.is_Add and base.has(sympy.sin, sympy.cos) and base.count_ops() <= TURNING:
            base = min(base, sympy.fu(base), key=lambda c: (sympy.count_ops(c, visual=False), str(c)))
        found.append(base**exponent)
    return sympy.Mul(*found)


def _split(algebra: Algebra, whole: Any) -> list[Node]:
    """The terms of what does not move: as written, or with like ones joined where that is shorter."""
    sympy = algebra.sympy
    forms = [] if _laden(algebra, whole) else [[shortest(algebra, part) for part in sympy.Add.make_args(whole)]]
    if whole.is_Add or whole.is_Mul:
        forms.append(_alike(algebra, whole))
    best = min(forms, key=lambda parts: len(parts) + sum(int(p.count_ops()) for p in parts))
    nodes = [sort_factors(algebra, algebra.node(part)) for part in best]
    return sorted((n for n in nodes if not is_const(n, 0.0)), key=lambda n: (n.op == "const", _first(n)))


def _alike(algebra: Algebra, whole: Any) -> list[Any]:
    """Terms of the same unknowns and functions of them, their parameters joined."""
    sympy = algebra.sympy
    if whole.count_ops() > LARGEST:
        return list(sympy.Add.make_args(whole))
    still = {s for s in whole.free_symbols if algebra.node(s).op == "param"}
    found: dict[Any, Any] = {}
    for term in sympy.Add.make_args(_expand_products(sympy, whole)):
        held, moves = term.as_independent(*(whole.free_symbols - still), as_Add=False)
        found[moves] = found.get(moves, 0) + held
    parts = list(sympy.Add.make_args(found.pop(sympy.S.One, sympy.S.Zero)))
    by_held: dict[Any, Any] = {}
    for moves, held in found.items():
        short = shortest(algebra, held)
        sign = -1 if short.could_extract_minus_sign() else 1
        if short * sign == 1:
            parts.append(sign * moves)
        else:
            by_held[sign * short] = by_held.get(sign * short, 0) + sign * moves
    return [*parts, *(held * moves for held, moves in by_held.items())]


def _laden(algebra: Algebra, whole: Any) -> bool:
    """Whether it is a product with a sum in it whose terms have parameters of their own: no single term to a reader."""
    if not whole.is_Mul:
        return False
    sums = [factor for factor in whole.args if factor.is_Add]
    return any(
        algebra.node(s).op == "param" and not term.is_Symbol
        for factor in sums
        for term in factor.args
        for s in term.free_symbols
    ) and any(algebra.node(s).op != "param" for factor in sums for s in factor.free_symbols)


def _first(node: Node) -> tuple[int, int]:
    """Terms with unknowns before those of parameters alone, each as they were made."""
    found = sorted(n.number for n in variables(node) if n.op == "var")
    return (0, found[0]) if found else (1, node.number)


def sort_factors(algebra: Algebra, node: Node) -> Node:
    """A product with its factors in the order of a book."""
    if node.op == "sum" and node.data[0] == 0.0 and len(node.args) == 1:
        return mul(sort_factors(algebra, node.args[0]), const(node.data[1][0]))
    if node.op != "mul":
        return node
    pairs = sorted(zip(node.data, node.args, strict=True), key=lambda pair: algebra.order.rank(pair[1]))
    return product(1.0, pairs)
