"""Array models written as Networks: a hanging chain of links, and its residual in plain NumPy."""

import numpy as np
from catalogue import ONE, PLACE
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.network import (
    Constraint,
    Coordinate,
    EnergyTerm,
    Expectation,
    InitialCondition,
    Loop,
    Network,
    Observation,
    Parameter,
    VirtualWork,
)


def parameter(name, value, shape=(), indices=(), whole=False):
    values = value if isinstance(value, tuple) else (value if isinstance(value, x.Node) else x.const(value),)
    return Parameter(name, shape, ONE, values, indices, PLACE, whole)


def coordinate(name, shape=(), asserted=None):
    return Coordinate(name, shape, False, ONE, ONE, ONE, ONE, asserted, PLACE)


def blank(**parts):
    names = (
        "parameters tables coordinates unknowns states energies works constraints dynamics initials observations "
        "expectations statics goldens"
    )
    empty = dict.fromkeys(names.split(), ())
    return Network(**{"model": "m", "place": PLACE, **empty, "scene": None, **parts})


def chain(n=10):
    """Masses m[i] hung by links of length l, springs to the neighbours' heights, drag, gravity; x and y[1..n]."""
    i, j = x.index("i"), x.index("j")
    size, one = x.param("n"), x.const(1)
    before = x.sub(i, one)
    each, later = Loop("i", one, size), Loop("i", x.const(2), size)
    shape = ((one, size),)

    def q(name, at):
        return x.var(name, "q", at)

    def f(name, at):
        return x.var(name, "f", at)

    mass = x.param("m", i)
    kinetic = x.mul(x.const(0.5), mass, x.add(x.mul(f("x", i), f("x", i)), x.mul(f("y", i), f("y", i))))
    stretch = x.sub(q("x", j), q("x", x.sub(j, one)))
    spring = x.reduction("sum", "j", x.const(2), size, x.call("cosh", stretch))
    link = x.linear(
        0.0,
        (
            (1.0, x.power(x.sub(q("x", i), q("x", before)), x.const(2))),
            (1.0, x.power(x.sub(q("y", i), q("y", before)), x.const(2))),
            (-1.0, x.mul(x.param("l"), x.param("l"))),
        ),
    )
    first = x.sub(
        x.add(x.power(q("x", one), x.const(2)), x.power(q("y", one), x.const(2))), x.power(x.param("l"), x.const(2))
    )
    total = x.reduction("sum", "i", one, size, x.mul(mass, q("y", i)))
    return blank(
        parameters=(
            parameter("k", 3.0),
            parameter("l", 0.2),
            parameter("n", float(n), whole=True),
            parameter("m", x.add(one, x.div(i, size)), shape, ("i",)),
        ),
        coordinates=(coordinate("x", shape), coordinate("y", shape)),
        energies=(
            EnergyTerm("T*", kinetic, (each,), PLACE),
            EnergyTerm("V", x.mul(x.param("k"), spring), (), PLACE),
            EnergyTerm("D", x.mul(x.const(0.1), x.power(f("x", size), x.const(2))), (), PLACE),
        ),
        works=(VirtualWork(x.mul(x.const(-9.81), mass), q("y", i), (each,), PLACE),),
        constraints=(
            Constraint("phi", "link", (i,), link, (later,), ONE, PLACE),
            Constraint("phi", "link", (one,), first, (), ONE, PLACE),
        ),
        initials=(
            InitialCondition(q("x", i), x.mul(x.param("l"), i), True, (each,), PLACE),
            InitialCondition(q("y", size), x.const(0.5), False, (), PLACE),
            InitialCondition(x.mul(q("x", i), q("y", i)), x.const(0.0), True, (later,), PLACE),
        ),
        observations=(
            Observation("tip", q("x", size), ONE, "tip", PLACE),
            Observation("height", x.div(total, x.param("k")), ONE, "height", PLACE),
            Observation(
                "norm", x.sqrt(x.reduction("sum", "i", one, size, x.power(q("y", i), x.const(2)))), ONE, "norm", PLACE
            ),
            Observation("pull", x.var("link", "kappa", one), ONE, "pull", PLACE),
            Observation("tip.p", x.var("x", "p", size), ONE, "tip.p", PLACE),
        ),
        expectations=(Expectation("always", None, "<=", q("y", one), x.const(1), x.const(0.1), ONE, "text", PLACE),),
    )


def reference(n, y, yd, k=3.0, length=0.2):
    """Residual of the chain as written: dynamics + reactions, then phi (y: x y x' y' kappa)."""
    x_, y_, vx, _ = (y[a * n : (a + 1) * n] for a in range(4))
    ax, ay = yd[2 * n : 3 * n], yd[3 * n : 4 * n]
    kappa = y[4 * n : 5 * n]
    m = 1 + np.arange(1, n + 1) / n
    rx, ry = m * ax, m * ay + 9.81 * m
    pull = k * np.sinh(np.diff(x_))
    rx[1:] += pull
    rx[:-1] -= pull
    rx[-1] += 0.2 * vx[-1]
    dx, dy = np.diff(x_, prepend=0.0), np.diff(y_, prepend=0.0)
    rx += 2 * kappa * dx
    ry += 2 * kappa * dy
    rx[:-1] -= 2 * (kappa * dx)[1:]
    ry[:-1] -= 2 * (kappa * dy)[1:]
    return np.concatenate((rx, ry, dx**2 + dy**2 - length**2))
