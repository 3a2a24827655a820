"""Every function of the language, conditions and powers: C, NumPy, the interpreter and the definition in dsl agree."""

import math

import numpy as np
import pytest
from carriers import CCarrier, NumpyCarrier
from catalogue import ONE, PLACE
from chains import blank, coordinate
from sysdyn.compiler.binding.oracle import Oracle
from sysdyn.compiler.forms.descriptor import BLOCKS, WITHOUT_ENTRIES
from sysdyn.compiler.pipeline import compile_network
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.functions import FUNCTIONS
from sysdyn.dsl.model.network import Constraint, Dynamic, EnergyTerm, Observation, State, Unknown, VirtualWork
from test_verifiers import random_expression

POINTS = (-2.5, -1.0, -0.3, 0.0, 0.3, 1.0, 2.5, 700.0, 720.0)


def q(name):
    return x.var(name, "q")


def f(name):
    return x.var(name, "f")


def expressions():
    a, b = q("a"), q("b")
    for name in sorted(set(FUNCTIONS) - {"setsign"}):  # set-valued: events take it out of laws
        two = name in ("atan2", "hypot", "min", "max", "mod")
        yield name, x.call(name, a, b) if two else x.call(name, a)
    for e in (-3.0, -2.0, -1.0, -0.5, 0.5, 1.5, 2.0, 3.0, 4.0, 7.0, 63.0, 64.0, 65.0, 0.3, -2.5):
        yield f"power {e}", x.power(a, x.const(e))
    yield "power", x.power(a, b)
    for name in ("clip", "smoothstep", "frac"):
        yield name, x.call(name, a, *((b, x.const(1)) if name == "clip" else ()))
    less, same = x.compare("<", a, b), x.compare("==", a, x.const(0.3))
    for name, test in (
        ("less", less),
        ("and", x.both(less, x.negate(same))),
        ("or", x.either(less, same)),
        ("not", x.negate(less)),
        *((op, x.compare(op, a, b)) for op in (">", ">=", "<=", "!=")),
    ):
        yield name, x.conditional(test, a, x.neg(x.mul(b, b)))
    yield "guarded", x.conditional(x.compare(">", a, x.const(0)), x.call("ln", a), x.const(7))
    for operator in ("sum", "prod", "min", "max"):
        body = x.add(x.mul(a, x.index("k")), b)
        yield f"fold {operator}", x.reduction(operator, "k", x.const(1), x.const(4), body)
        yield f"empty {operator}", x.reduction(operator, "k", x.const(1), x.const(0), body)
    inner = x.reduction("sum", "j", x.const(1), x.const(3), x.mul(x.index("j"), x.index("k"), a))
    yield "nested", x.sqrt(x.reduction("sum", "k", x.const(1), x.const(5), x.mul(inner, inner)))


def test_functions_conditions_and_powers(tmp_path):
    with x.fresh():
        found = dict(expressions())
        net = blank(
            coordinates=(coordinate("a"), coordinate("b")),
            energies=(EnergyTerm("T*", x.add(x.power(f("a"), x.const(2)), x.power(f("b"), x.const(2))), (), PLACE),),
            observations=tuple(Observation(name, node, ONE, name, PLACE) for name, node in found.items()),
        )
        model = compile_network(net)
        binding = model.bind()
        carriers = [Oracle(model.form, binding), CCarrier(model.program, model.form, binding)]
        carriers.append(NumpyCarrier(model.program, model.form, binding, tmp_path))
        rows = {r.label: k for k, r in enumerate(model.form.rows) if r.block == "observe"}
        for a in POINTS:
            for b in (-0.7, 0.3, 2.0):
                values = {q("a"): a, q("b"): b}
                y = np.zeros(carriers[0].at[-1])
                y[:2] = a, b
                expected = evaluate(list(found.values()), values.__getitem__)
                seen = [c.rows("observe", 0.0, y, y) for c in carriers]
                for name, value in zip(found, expected, strict=True):
                    got = [s[carriers[0].to[rows[name]]] for s in seen]
                    if math.isnan(value) or (math.isinf(value) and not np.isinf(got[0])):
                        continue  # powers of negative numbers: the definition and IEEE differ in nan and inf
                    np.testing.assert_allclose(got, value, rtol=1e-12, err_msg=f"{name} at {a}, {b}")


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.one_in(12)
def test_random_models(seed, tmp_path):
    """T*, V, D, work, phi, psi, gamma, lambda of random expressions: carriers against the oracle, entries as slopes."""
    random = np.random.default_rng(seed)
    with x.fresh():
        qs, fs = [q(n) for n in "abc"], [f(n) for n in "abc"]
        s, e, t = x.var("s", "s"), x.var("e", "e"), x.time()

        def some(leaves, depth=3):
            return random_expression(random, leaves, depth)

        laws = (("phi", some([*qs, t])), ("psi", x.add(*(x.mul(some([*qs, t], 2), n) for n in fs))))
        net = blank(
            coordinates=tuple(coordinate(n) for n in "abc"),
            unknowns=(Unknown("e", (), ONE, PLACE),),
            states=(State("s", (), ONE, PLACE),),
            energies=(
                EnergyTerm("T*", some([*qs, *fs, t], 4), (), PLACE),
                EnergyTerm("T*", x.add(*(x.mul(n, n) for n in fs)), (), PLACE),
                EnergyTerm("V", some([*qs, s, t], 4), (), PLACE),
                EnergyTerm("D", some([*fs, *qs]), (), PLACE),
            ),
            works=(VirtualWork(x.add(e, some([*qs, *fs, t])), some(qs), (), PLACE),),
            constraints=(
                *(Constraint(kind, kind, (), node, (), ONE, PLACE) for kind, node in laws),
                Constraint("gamma", "law", (), x.add(e, some([*qs, *fs, s])), (), ONE, PLACE),
            ),
            dynamics=(Dynamic(s, some([*qs, *fs, s, e, t]), (), PLACE),),
        )
        model = compile_network(net, "hamiltonian" if seed % 2 else "lagrangian", integrating=False)
        binding = model.bind()
        oracle = Oracle(model.form, binding)
        y, yd = (random.uniform(0.3, 0.9, oracle.at[-1]) for _ in range(2))
        carriers = [CCarrier(model.program, model.form, binding)]
        carriers.append(NumpyCarrier(model.program, model.form, binding, tmp_path))
        for block in BLOCKS:
            size = np.max(oracle.magnitudes(block, 0.4, y, yd), initial=1.0)
            r = oracle.rows(block, 0.4, y, yd)
            for carrier in carriers:
                np.testing.assert_allclose(carrier.rows(block, 0.4, y, yd), r, rtol=1e-12, atol=1e-12 * size)
            for order, part in enumerate(("dy", "dyd") if block not in WITHOUT_ENTRIES else ()):
                v, rows, columns = oracle.entries(block, order, 0.4, y, yd)
                for carrier in carriers:
                    large = np.max(np.abs(v), initial=1.0)
                    np.testing.assert_allclose(
                        carrier.entries(block, part, 0.4, y, yd), v, rtol=1e-11, atol=1e-12 * large
                    )
                direction = random.uniform(-1, 1, oracle.at[-1])
                step = [(h * direction * (order == 0), h * direction * (order == 1)) for h in (2e-4, 1e-4)]
                ends = [
                    oracle.rows(block, 0.4, y + a, yd + b) - oracle.rows(block, 0.4, y - a, yd - b) for a, b in step
                ]
                slope = np.zeros(oracle.to[-1])
                np.add.at(slope, rows.astype(int), v * direction[columns.astype(int)])
                scale = max(size, np.max(np.abs(slope), initial=0.0))
                np.testing.assert_allclose(slope, (8 * ends[1] - ends[0]) / 12e-4, rtol=1e-6, atol=1e-7 * scale)


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
def test_energy_balance_of_functions_of_time_and_states(formulation):
    """d(T + V)/dt + dissipated - supplied = 0 with rheonomic T*, V, phi and psi, and a state inside T* and V."""
    with x.fresh():
        t, s = x.time(), x.var("s", "s")
        a, b, c = (q(n) for n in "abc")
        fa, fb, fc = (f(n) for n in "abc")
        two = x.const(2)
        inertia = x.add(two, x.call("sin", t), s)
        kinetic = x.add(
            x.mul(inertia, fa, fa), x.mul(b, fb, x.call("cos", t)), x.mul(fb, fb), x.mul(fc, fc, x.call("cosh", a))
        )
        net = blank(
            coordinates=tuple(coordinate(n) for n in "abc"),
            states=(State("s", (), ONE, PLACE),),
            energies=(
                EnergyTerm("T*", kinetic, (), PLACE),
                EnergyTerm("V", x.add(x.mul(s, a, a), x.mul(t, b), x.power(c, x.const(4))), (), PLACE),
                EnergyTerm("D", x.power(fa, x.const(4)), (), PLACE),
            ),
            works=(VirtualWork(x.call("exp", x.neg(t)), x.mul(a, b), (), PLACE),),
            constraints=(
                Constraint("phi", "drive", (), x.sub(c, x.mul(a, t)), (), ONE, PLACE),
                Constraint(
                    "psi", "roll", (), x.linear(0.0, ((1.0, x.mul(b, fa)), (-1.0, fb), (-1.0, t))), (), ONE, PLACE
                ),
            ),
            dynamics=(Dynamic(s, x.sub(a, s), (), PLACE),),
        )
        model = compile_network(net, formulation)
        oracle = Oracle(model.form, model.bind())
        places = {(u.owner, u.kind): oracle.at[k] for k, u in enumerate(model.form.families)}
        now, random = 0.6, np.random.default_rng(3)
        y, yd = random.uniform(0.2, 0.9, oracle.at[-1]), np.zeros(oracle.at[-1])
        y[places["c", "q"]] = y[places["a", "q"]] * now
        y[places["c", "f"]] = y[places["a", "f"]] * now + y[places["a", "q"]]
        y[places["b", "f"]] = y[places["b", "q"]] * y[places["a", "f"]] - now
        yd[places["s", "s"]] = y[places["a", "q"]] - y[places["s", "s"]]
        moving = [places[n, "f"] for n in "abc"]
        rows = [oracle.to[k] for k, r in enumerate(model.form.rows) if r.block == "dynamics"]
        if formulation == "hamiltonian":
            momenta = [places[n, "p"] for n in "abc"]
            kept = [oracle.to[k] for k, r in enumerate(model.form.rows) if r.block == "momentum"]
            y[momenta] -= oracle.rows("momentum", now, y, yd)[kept]

        def residual(values):
            yd[moving] = values
            if formulation == "hamiltonian":
                yd[momenta] = 0.0
                yd[momenta] = -oracle.rows("momentum_rate", now, y, yd)[kept]
            r = sum(oracle.rows(k, now, y, yd) for k in ("dynamics", "phi_reaction", "psi_reaction"))
            return r[rows]

        zero = residual(np.zeros(3))
        matrix = np.stack([residual(np.eye(3)[k]) - zero for k in range(3)], axis=1)
        np.testing.assert_allclose(residual(np.linalg.solve(matrix, -zero)), 0.0, atol=1e-12)
        audit = {r.owner: oracle.to[k] for k, r in enumerate(model.form.rows) if r.block == "audit"}
        step = 1e-4
        rate = yd.copy()
        rate[[places[n, "q"] for n in "abc"]] = y[moving]

        def stored(h):
            return oracle.rows("audit", now + h, y + h * rate, yd)[[audit["kinetic"], audit["potential"]]].sum()

        slope = (8 * (stored(step) - stored(-step)) - (stored(2 * step) - stored(-2 * step))) / (12 * step)
        power = oracle.rows("audit", now, y, yd)
        assert abs(slope + power[audit["dissipated"]] - power[audit["supplied"]]) < 1e-9
