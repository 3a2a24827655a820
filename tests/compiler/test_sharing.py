"""Routines with less arithmetic: the same numbers as the statements they were made of, by a small interpreter."""

import math
import random

import pytest
from sysdyn.compiler.model.integers import FamilyReference
from sysdyn.compiler.program.program import Assign, Fold, Routine, StoreInstruction
from sysdyn.compiler.program.sharing import share_operations

UNKNOWNS = 5


def values(routine, y):
    """What each place is given."""
    known, stored = {}, {}

    def of(a):
        return known[a] if isinstance(a, int) else a

    for s in routine.body:
        match s:
            case StoreInstruction():
                stored[s.place] = of(s.value)
            case Assign(op="y"):
                known[s.target] = y[s.data]
            case Assign(op="sum"):
                constant, coefficients = s.data
                known[s.target] = sum((c * of(a) for c, a in zip(coefficients, s.args, strict=True)), constant)
            case Assign(op="mul"):
                known[s.target] = math.prod(of(a) ** e for e, a in zip(s.data, s.args, strict=True))
            case Assign(op="call"):
                known[s.target] = math.sin(of(s.args[0]))
    return stored


def routine(body):
    return Routine("dynamics", "rows", 0, (), tuple(body), 0, (0,))


def read(number=UNKNOWNS):
    return [Assign(k, "y", k, ()) for k in range(number)]


def operations(made):
    """Multiplications, and statements that are not read."""
    times = 0
    for s in made.body:
        if isinstance(s, Assign) and s.op == "mul":
            times += int(sum(s.data)) - 1
    return times


def random_body(seed):
    rng = random.Random(seed)
    body, number = read(), UNKNOWNS
    for _ in range(40):
        args = tuple(rng.randrange(number) for _ in range(rng.randint(1, 3)))
        kind = rng.random()
        if kind < 0.55:
            powers = tuple(rng.choice((1.0, 1.0, 2.0, 3.0, -1.0)) for _ in args)
            body.append(Assign(number, "mul", powers, args))
        elif kind < 0.9:
            coefficients = tuple(rng.choice((1.0, -1.0, 2.0, -2.0, 0.5, 0.3)) for _ in args)
            body.append(Assign(number, "sum", (rng.choice((0.0, 0.0, 1.5)), coefficients), args))
        else:
            body.append(Assign(number, "call", "sin", args[:1]))
        number += 1
    return [*body, *(StoreInstruction(k, k) for k in range(UNKNOWNS, number))]


@pytest.mark.parametrize("seed", range(40))
def test_values_are_the_same_but_for_round_off(seed):
    given = routine(random_body(seed))
    rng = random.Random(100 + seed)
    y = [rng.uniform(0.5, 1.5) for _ in range(UNKNOWNS)]
    wanted, found = values(given, y), values(share_operations(given), y)
    assert wanted.keys() == found.keys()
    for place, value in wanted.items():
        if abs(value) < 1e6:  # sines of larger numbers show their round-off
            assert found[place] == pytest.approx(value, rel=1e-8, abs=1e-8)


def test_a_product_within_two_products_is_made_once():
    body = [*read(4), Assign(4, "mul", (1.0, 1.0, 1.0), (0, 1, 2)), Assign(5, "mul", (1.0, 2.0, 1.0), (0, 1, 3))]
    given = routine([*body, StoreInstruction(0, 4), StoreInstruction(1, 5)])
    made = share_operations(given)
    assert operations(given) == 5
    assert operations(made) == 4
    y = [1.1, 1.3, 1.7, 1.9]
    assert values(made, y) == pytest.approx(values(given, y), rel=1e-15)


def test_what_differs_by_a_sign_or_a_power_of_two_is_one_value_to_the_last_bit():
    signs = [Assign(4, "sum", (0.0, (-1.0, -1.0)), (0, 1)), Assign(5, "sum", (0.0, (2.0, 2.0)), (0, 1))]
    products = [Assign(6, "mul", (1.0, 1.0), (4, 2)), Assign(7, "mul", (1.0, 1.0), (5, 2))]
    given = routine([*read(4), *signs, *products, *(StoreInstruction(k, 4 + k) for k in range(4))])
    made = share_operations(given)
    y = [0.1, 0.7, 1.3, 0.0]
    assert values(made, y) == values(given, y)
    assert operations(made) == 1


def test_what_folds_read_keeps_its_number():
    double = Assign(1, "sum", (0.0, (2.0,)), (0,))
    inner = Assign(3, "mul", (1.0, 1.0), (1, 1))
    fold = Fold(2, "sum", 0, None, None, (inner,), 3)
    place = FamilyReference(0, (), -1, ())
    made = share_operations(routine([*read(1), double, fold, StoreInstruction(place, 2)]))
    assert [s.target for s in made.body if isinstance(s, Assign)] == [0, 1]
    assert fold in made.body


def test_what_nobody_reads_is_left_out():
    made = share_operations(routine([*read(2), Assign(2, "mul", (1.0, 1.0), (0, 1)), StoreInstruction(0, 1)]))
    assert [s.target for s in made.body if isinstance(s, Assign)] == [1]
