"""Determinants and inverses of small matrices of expressions, by their minors."""

from __future__ import annotations

from collections.abc import Sequence

from sysdyn.dsl.model.expression import Node, add, const, is_const, mul, neg, power

Square = Sequence[Sequence[Node]]


class _Minors:
    """The minors of a square matrix, each once."""

    def __init__(self, c: Square) -> None:
        self.c = c
        self.known: dict[tuple[tuple[int, ...], tuple[int, ...]], Node] = {((), ()): const(1.0)}

    def __call__(self, rows: tuple[int, ...], columns: tuple[int, ...]) -> Node:
        if (rows, columns) not in self.known:
            terms = []
            for place, column in enumerate(columns):
                entry = self.c[rows[0]][column]
                if not is_const(entry, 0.0):
                    rest = self(rows[1:], columns[:place] + columns[place + 1 :])
                    terms.append(mul(entry, rest) if place % 2 == 0 else neg(mul(entry, rest)))
            self.known[rows, columns] = add(*terms)
        return self.known[rows, columns]


def determinant(c: Square) -> Node:
    """The determinant of a square matrix."""
    every = tuple(range(len(c)))
    return _Minors(c)(every, every)


def inverse(c: Square) -> list[list[Node]]:
    """C^-1 by minors over the determinant."""
    n = len(c)
    minor = _Minors(c)
    every = tuple(range(n))
    over = power(minor(every, every), const(-1.0))
    found = []
    for j in range(n):
        line = []
        for k in range(n):
            own = minor(every[:k] + every[k + 1 :], every[:j] + every[j + 1 :])
            line.append(mul(own if (j + k) % 2 == 0 else neg(own), over))
        found.append(line)
    return found
