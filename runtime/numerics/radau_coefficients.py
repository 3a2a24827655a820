"""The coefficients of Radau IIA of 3, 5 and 7 stages, with 60 digits, and `radau_coefficients.c` made of them.

The stages lie at the roots of P_s - P_{s-1} (Legendre, on [0, 1]; the last one is 1), A integrates Lagrange's
polynomials of these nodes, so A satisfies C(s) and, with the weights b (its last row), D(s-1) and B(2s-1).  Hairer &
Wanner, Solving Ordinary Differential Equations II, IV.5 and IV.8; the same authors, Stiff differential equations solved
by Radau methods, J. Comput. Appl. Math. 111 (1999): A^-1 = S diag(gamma, lambda_k, conj lambda_k) S^-1 with columns of
S that end in 1.  The error is estimated by weights b^ with a weight 1/gamma at the start of the step, of order s.
`python -m sysdyn.runtime.numerics.radau_coefficients` prints that file anew.
"""

from __future__ import annotations

from typing import Any

import mpmath as mp
from sysdyn.values import dataclass

STAGES = (3, 5, 7)
DIGITS = 60
WRITTEN = 20
WIDTH = 116


@dataclass(frozen=True, slots=True)
class Coefficients:
    """One method in mpmath's numbers.  c, b, estimate [s]; a, inverse [s][s]; gamma and its column and row [s]; values,
    columns, rows: of the complex pairs [(s-1)/2] with positive imaginary part; lift [s+1]: coefficients of the powers
    1..s+1 of the polynomial that is zero at 0 and 1, has no slope at any node and the slope 1 at 0; taylor: the
    derivatives s-1 and s of the stages' polynomial in the middle over their factorials, by z [2][s]; constant: what the
    estimate is of the Taylor coefficient s+1.
    """

    c: list[Any]
    b: list[Any]
    a: Any
    inverse: Any
    gamma: Any
    column: list[Any]
    row: list[Any]
    values: list[Any]
    columns: list[list[Any]]
    rows: list[list[Any]]
    estimate: list[Any]
    lift: list[Any]
    taylor: list[list[Any]]
    constant: Any


def nodes(stages: int) -> list[Any]:
    """The roots of P_s - P_{s-1} on [0, 1], ascending [s]."""
    power = [mp.mpf(0)] * (stages + 1)
    for degree, sign in ((stages, 1), (stages - 1, -1)):
        for k in range(degree + 1):  # of Legendre's polynomial in x = 2 c - 1
            power[k] += sign * (-1) ** (degree + k) * mp.binomial(degree, k) * mp.binomial(degree + k, k)
    return sorted(mp.re(root) for root in mp.polyroots(power[::-1], maxsteps=500, extraprec=400))


def _matrix(c: list[Any]) -> Any:
    """A [s][s]: sum_j a_ij c_j^(k-1) = c_i^k / k."""
    s = len(c)
    # c_i^k, and their integrals from 0
    powers = mp.matrix(s, s)
    integrals = mp.matrix(s, s)
    for i in range(s):
        for k in range(s):
            powers[i, k] = c[i] ** k
            integrals[i, k] = c[i] ** (k + 1) / (k + 1)
    return integrals * mp.inverse(powers)


def _eigenvalues(stages: int) -> list[Any]:
    """Of A^-1: the zeros of det(I - z A), the denominator of the Pade approximation (s-1, s) of exp(z)."""
    power = [
        (-1) ** j * mp.binomial(stages, j) * mp.factorial(2 * stages - 1 - j) / mp.factorial(2 * stages - 1)
        for j in range(stages + 1)
    ]
    return list(mp.polyroots(power[::-1], maxsteps=500, extraprec=400))


def _eigenvector(inverse: Any, value: Any) -> list[Any]:
    """Of A^-1 with its last component 1 [s]."""
    s = inverse.rows - 1
    matrix, right = mp.matrix(s, s), mp.matrix(s, 1)
    # the last component is 1: the other s - 1 from the first rows
    for i in range(s):
        right[i] = -inverse[i, s]
        for j in range(s):
            matrix[i, j] = inverse[i, j] - (value if i == j else 0)
    found = mp.lu_solve(matrix, right)
    return [*(found[i] for i in range(s)), mp.mpf(1)]


def _estimate(c: list[Any], b: list[Any], inverse: Any, gamma: Any) -> list[Any]:
    """Gamma (b^ - b) A^-1 [s]: (the embedded value - the value) gamma = h y' + estimate . z."""
    s = len(c)
    powers = mp.matrix(s, s)
    wanted = mp.matrix(s, 1)
    # exact for polynomials, the slope at the start counted with weight 1 / gamma
    for q in range(s):
        wanted[q] = mp.mpf(1) / (q + 1) - (1 / gamma if q == 0 else 0)
        for i in range(s):
            powers[q, i] = c[i] ** q
    embedded = mp.lu_solve(powers, wanted)
    row = mp.matrix([[embedded[i] - b[i] for i in range(s)]]) * inverse
    return [gamma * row[i] for i in range(s)]


def _lift(c: list[Any]) -> list[Any]:
    """The integral of prod (x - c_i) / prod (-c_i): coefficients of x^1 ... x^(s+1)."""
    # the product, factor by factor
    power = [mp.mpf(1)]
    for node in c:
        factor = [mp.mpf(1), -1 / node]  # 1 - x / c
        power = [
            sum((power[k - j] * factor[j] for j in (0, 1) if 0 <= k - j < len(power)), mp.mpf(0))
            for k in range(len(power) + 1)
        ]
    return [value / (k + 1) for k, value in enumerate(power)]


def _taylor(c: list[Any]) -> list[list[Any]]:
    """Of the polynomial through (0, 0) and (c_j, z_j), at 1/2: the coefficients of (x - 1/2)^(s-1) and of x^s, by z."""
    s = len(c)
    leading = [1 / (c[j] * mp.fprod(c[j] - c[k] for k in range(s) if k != j)) for j in range(s)]
    others = [mp.fsum(c) - node for node in c]
    return [[w * (mp.mpf(s) / 2 - rest) for w, rest in zip(leading, others, strict=True)], leading]


def coefficients(stages: int) -> Coefficients:
    """The method of so many stages (odd), to about DIGITS digits."""
    with mp.workdps(DIGITS):
        c = nodes(stages)
        a = _matrix(c)
        inverse = mp.inverse(a)
        b = [a[stages - 1, j] for j in range(stages)]
        values = _eigenvalues(stages)
        right = mp.matrix(stages, stages)
        # eigenvectors as columns; rows of the inverse are the left ones
        for k, value in enumerate(values):
            for i, item in enumerate(_eigenvector(inverse, value)):
                right[i, k] = item
        left = mp.inverse(right)
        # one real eigenvalue, pairs by their imaginary parts
        real = min(range(stages), key=lambda k: abs(mp.im(values[k])))
        pairs = sorted((k for k in range(stages) if mp.im(values[k]) > 1e-9), key=lambda k: mp.im(values[k]))
        gamma = mp.re(values[real])
        estimate = _estimate(c, b, inverse, gamma)
        return Coefficients(
            c,
            b,
            a,
            inverse,
            gamma,
            [mp.re(right[i, real]) for i in range(stages)],
            [mp.re(left[real, i]) for i in range(stages)],
            [values[k] for k in pairs],
            [[right[i, k] for i in range(stages)] for k in pairs],
            [[left[k, i] for i in range(stages)] for k in pairs],
            estimate,
            _lift(c),
            _taylor(c),
            abs(mp.fsum(e * node ** (stages + 1) for e, node in zip(estimate, c, strict=True))) / gamma,
        )


def _number(value: Any) -> str:
    return str(mp.nstr(value, WRITTEN, strip_zeros=True))


def _complex(value: Any) -> str:
    imaginary = mp.im(value)
    return f"{_number(mp.re(value))} {'-' if imaginary < 0 else '+'} {_number(abs(imaginary))} * I"


def _fill_lines(items: list[str], indent: str) -> str:
    """{a, b, ...} on lines of at most WIDTH characters."""
    lines, line = [], indent + "{"
    for k, item in enumerate(items):
        part = item + (", " if k + 1 < len(items) else "}")
        # too long for this line: on to the next
        if len(line) + len(part.rstrip()) > WIDTH:
            lines.append(line.rstrip())
            line = indent + " "
        line += part
    return "\n".join([*lines, line])


def _method(stages: int) -> str:
    """The initialiser of one method."""
    found = coefficients(stages)
    inner, pad = " " * 12, " " * 8
    real = [_number(found.inverse[i, j]) for i in range(stages) for j in range(stages)]
    lines = [f"    {{{stages}, {(stages - 1) // 2},"]
    lines.append(_fill_lines([_number(x) for x in found.c], pad) + ", /* c */")
    lines.append(_fill_lines([_number(x) for x in found.b], pad) + ", /* b */")
    rows = [_fill_lines(real[i * stages : (i + 1) * stages], inner) for i in range(stages)]
    lines.append(pad + "{ /* A^-1 */\n" + ",\n".join(rows) + "},")
    lines.append(f"{pad}{_number(found.gamma)},")
    lines.append(_fill_lines([_complex(x) for x in found.values], pad) + ", /* lambda */")
    lines.append(_fill_lines([_number(x) for x in found.column], pad) + ", /* column, row of gamma */")
    lines.append(_fill_lines([_number(x) for x in found.row], pad) + ",")
    for name, items in (("columns of lambda", found.columns), ("rows of lambda", found.rows)):
        blocks = [_fill_lines([_complex(x) for x in item], inner) for item in items]
        lines.append(pad + f"{{ /* {name} */\n" + ",\n".join(blocks) + "},")
    lines.append(_fill_lines([_number(x) for x in found.estimate], pad) + ", /* of the error */")
    lines.append(_fill_lines([_number(x) for x in found.lift], pad) + ", /* lift */")
    blocks = [_fill_lines([_number(x) for x in item], inner) for item in found.taylor]
    lines.append(pad + "{ /* taylor */\n" + ",\n".join(blocks) + "},")
    lines.append(f"{pad}{_number(found.constant)}}},")
    return "\n".join(lines)


def text() -> str:
    """core/steppers/radau/radau_coefficients.c."""
    head = [
        "/* Coefficients of Radau IIA with 3, 5 and 7 stages (see steppers/radau/radau.h).",
        " *",
        " * Written by numerics/radau_coefficients.py, which says what they are; not by hand.",
        " */",
        '#include "steppers/radau/radau.h"',
        "",
        "const sd_radau_method sd_radau_methods[SD_METHODS] = {",
    ]
    with mp.workdps(DIGITS):
        return "\n".join([*head, *(_method(stages) for stages in STAGES), "};", ""])


if __name__ == "__main__":
    print(text(), end="")
