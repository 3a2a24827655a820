# ruff: noqa: PLR0917, E731, RUF100
"""Compiled models made by hand (by sympy) for the runtime's tests: an oracle that knows no compiler.

`small(...)` writes down energies and constraints as the book does and hands back manifest, binding and module.
"""

import types

import numpy as np
import sympy as sp

T = sp.Symbol("t", real=True)


def _names(prefix, items):
    return [f"{prefix}_{name}" for name in items]


class _Builder:
    def __init__(self, families):
        self.families = families  # (name, kind, owner)
        self.y = {name: sp.Symbol(name, real=True) for name, _, _ in families}
        self.yd = {name: sp.Symbol(name + "_dot", real=True) for name, _, _ in families}
        self.rows, self.blocks, self.module = [], {}, types.SimpleNamespace(CONTRACT=3)

    def add_rows(self, block, labels, owners, **extra):
        for k, (label, owner) in enumerate(zip(labels, owners, strict=True)):
            row = {
                "block": block,
                "label": label,
                "owner": owner,
                "kind": block,
                "file": "m.sd",
                "line": k + 1,
            }
            self.rows.append({**row, "unit": "1", **{key: value[k] for key, value in extra.items()}})

    def add_block(self, name, base, expressions):
        if not expressions:
            return
        first = next(k for k, row in enumerate(self.rows) if row["block"] == base)
        order = [n for n, kind, _ in self.families]
        number, size = {n: k for k, n in enumerate(order)}, len(order)
        arguments = [T, *self.y.values(), *self.yd.values()]
        entries = {"dy": [], "dyd": []}
        values = {"dy": [], "dyd": []}
        for k, expression in enumerate(expressions):
            for part, symbols in (("dy", self.y), ("dyd", self.yd)):
                for n, symbol in symbols.items():
                    slope = sp.diff(expression, symbol)
                    if slope != 0:
                        entries[part].append([[first + k, []], [number[n], []]])
                        values[part].append(slope)
        rows = sp.lambdify(arguments, list(expressions), "numpy", cse=True)

        def call_rows(p, ix, at, to, t, y, yd, r):
            for k, value in enumerate(rows(t, *y[at[:size]], *yd[at[:size]])):
                r[to[first + k]] += value

        setattr(self.module, f"{name}_rows", call_rows)
        for part in ("dy", "dyd"):
            if entries[part]:
                function = sp.lambdify(arguments, values[part], "numpy", cse=True)

                def call_entries(p, ix, at, to, t, y, yd, v, function=function):
                    v[:] = function(t, *y[at[:size]], *yd[at[:size]])

                setattr(self.module, f"{name}_{part}", call_entries)
        self.blocks[name] = {
            "kernels": [{"loops": [], "rows": [[first + k, []] for k in range(len(expressions))], **entries}]
        }


def small(
    coordinates,
    kinetic,
    potential=0,
    content=0,
    work=None,
    phi=None,
    psi=None,
    gamma=None,
    implicit=(),
    states=None,
    initial=None,
    observe=None,
    form="lagrangian",
    intangible=(),
    source_power=None,
    momenta=None,
    units=None,
):
    """coordinates "x y"; expressions of q_x, f_x, e_<implicit>, s_<state>, t as text; phi {label: text}.

    initial {unknown: (value, fixed)}; observe {name: text, may use the _dot symbols}.
    """
    names = coordinates.split()
    phi, psi, gamma, states = phi or {}, psi or {}, gamma or {}, states or {}
    moving = [n for n in names if n not in intangible]
    carrying = [] if form == "lagrangian" else (momenta.split() if momenta is not None else names)
    families = [(f"q_{n}", "q", n) for n in moving] + [(f"f_{n}", "f", n) for n in names]
    families += [(f"p_{n}", "p", n) for n in carrying]
    families += [(f"kappa_{n}", "kappa", n) for n in phi] + [(f"mu_{n}", "mu", n) for n in psi]
    families += [(f"e_{n}", "e", f"e_{n}") for n in implicit] + [(f"s_{n}", "s", f"s_{n}") for n in states]
    b = _Builder(families)
    local = {**{s.name: s for s in b.y.values()}, **{s.name: s for s in b.yd.values()}, "t": T}
    read = lambda text: sp.sympify(text, locals=local)  # noqa: E731
    kin, pot, con = read(kinetic), read(potential), read(content)
    q = {n: b.y.get(f"q_{n}", sp.Symbol(f"q_{n}")) for n in names}
    f = {n: b.y[f"f_{n}"] for n in names}

    def rate(x):
        total = sp.diff(x, T)
        for n in names:
            total += sp.diff(x, q[n]) * f[n] + sp.diff(x, f[n]) * b.yd[f"f_{n}"]
        for n in carrying:
            total += sp.diff(x, b.y[f"p_{n}"]) * b.yd[f"p_{n}"]
        for n in [f"e_{k}" for k in implicit] + [f"s_{k}" for k in states]:
            total += sp.diff(x, b.y[n]) * b.yd[n]
        return total

    phis, psis, gammas = ([read(text) for text in item.values()] for item in (phi, psi, gamma))
    works = {n: read((work or {}).get(n, 0)) for n in names}
    b.add_rows("dynamics", names, names)
    rows = []
    for n in names:
        rest = -sp.diff(kin, q[n]) + sp.diff(pot, q[n]) + sp.diff(con, f[n]) - works[n]
        if form == "lagrangian":
            rows.append(rate(sp.diff(kin, f[n])) + rest)
        else:
            rows.append((b.yd[f"p_{n}"] if n in carrying else 0) + rest)
    b.add_block("dynamics", "dynamics", rows)
    if carrying:
        momentum = [b.y[f"p_{n}"] - sp.diff(kin, f[n]) for n in carrying]
        b.add_rows("momentum", carrying, carrying)
        b.add_block("momentum", "momentum", momentum)
        b.add_block("momentum_rate", "momentum", [rate(x) for x in momentum])
    if phi:
        b.add_rows("phi", list(phi), list(phi))
        reaction = [sum(b.y[f"kappa_{k}"] * sp.diff(x, q[n]) for k, x in zip(phi, phis, strict=True)) for n in names]
        b.add_block("phi_reaction", "dynamics", [sp.sympify(x) for x in reaction])
        b.add_block("phi", "phi", phis)
        b.add_block("phi_rate", "phi", [rate(x) for x in phis])
        b.add_block("phi_acceleration", "phi", [rate(rate(x)) for x in phis])
    if psi:
        b.add_rows("psi", list(psi), list(psi))
        reaction = [sum(b.y[f"mu_{k}"] * sp.diff(x, f[n]) for k, x in zip(psi, psis, strict=True)) for n in names]
        b.add_block("psi_reaction", "dynamics", [sp.sympify(x) for x in reaction])
        b.add_block("psi", "psi", psis)
        b.add_block("psi_rate", "psi", [rate(x) for x in psis])
    if gamma:
        b.add_rows("gamma", list(gamma), list(gamma))
        b.add_block("gamma", "gamma", gammas)
        b.add_block("gamma_rate", "gamma", [rate(x) for x in gammas])
    if states:
        b.add_rows("lambda", list(states), list(states))
        b.add_block("lambda", "lambda", [b.yd[f"s_{n}"] - read(x) for n, x in states.items()])
    b.add_rows("audit", ["kinetic", "potential", "dissipated", "supplied"], [""] * 4)
    stored = sum(f[n] * sp.diff(kin, f[n]) for n in names) - kin
    dissipated = sum(f[n] * sp.diff(con, f[n]) for n in names)
    supplied = read(source_power) if source_power is not None else sum(works[n] * f[n] for n in names)
    b.add_block("audit", "audit", [stored, pot, dissipated, supplied])
    audits = [
        ("audit." + n, "audit", n) for n in ["energy", "kinetic", "potential", "dissipated", "supplied", "constraints"]
    ]
    observe = observe if observe is not None else {n: n for n in b.y}
    expressions = [read(x) for x in observe.values()]
    known = [
        all(s.name[0] in "qfspe" for s in x.free_symbols - {T}) and not (x.free_symbols & set(b.yd.values()))
        for x in expressions
    ]
    b.add_rows("observe", list(observe), list(observe), name=list(observe), stored=[True] * len(observe), rate=known)
    b.add_block("observe", "observe", expressions)
    b.add_block(
        "observe_rate",
        "observe",
        [rate(x) if ok else sp.Integer(0) for x, ok in zip(expressions, known, strict=True)],
    )
    b.add_block(
        "observe_scale",
        "observe",
        [sum((sp.Abs(a) for a in sp.Add.make_args(x)), sp.Integer(0)) for x in expressions],
    )
    manifest = {
        "model": "small",
        "formulation": form,
        "structure": {
            "families": [
                {"name": n, "kind": k, "owner": o, "unit": (units or {}).get(n, "1"), "nominal": None}
                for n, k, o in families + audits
            ],
            "rows": b.rows,
            "blocks": b.blocks,
        },
    }
    binding = {
        "p": np.zeros(0),
        "ix": np.zeros(0, dtype=np.int32),
        "shapes": [[] for _ in families + audits],
        "row_shapes": [[] for _ in b.rows],
        "initial": [
            {
                "family": n,
                "positions": np.array([0]),
                "values": np.array([float(value)]),
                "fixed": fixed,
                "label": n,
                "file": "m.sd",
                "line": 100 + k,
            }
            for k, (n, (value, fixed)) in enumerate((initial or {}).items())
        ],
    }
    return manifest, binding, b.module


def pendulum(form="lagrangian", angle=np.pi / 18, m=1.13, l=2.34):
    """Seed system pendulum: m = 1.13 kg, l = 2.34 m, started at rest at 10 degrees."""
    return small(
        "x y",
        f"{m}*(f_x**2 + f_y**2)/2",
        work={"y": f"-{m}*9.81"},
        phi={"rod": f"q_x**2 + q_y**2 - {l}**2"},
        initial={"q_x": (l * np.sin(angle), True), "q_y": (-l, False), "f_x": (0, True)},
        form=form,
        observe={
            "q1": "q_x",
            "q2": "q_y",
            "f1": "f_x",
            "f2": "f_y",
            "kappa1": "kappa_rod",
            "a1": "f_x_dot",
            "a2": "f_y_dot",
        },
    )


def mass_spring(form="lagrangian"):
    """Seed system mass_spring: M = 2, k = 8, x = 0.5, v = 1: x = 0.5 cos 2t + 0.5 sin 2t."""
    return small("x", "f_x**2", "4*q_x**2", initial={"q_x": (0.5, True), "f_x": (1, True)}, form=form)


def dc_motor(form="lagrangian"):
    """Seed system dc_motor."""
    return small(
        "c a",
        "0.02*f_c**2/2 + 0.01*f_a**2/2",
        content="0.8*f_c**2/2 + 0.005*f_a**2/2",
        work={"c": "12 - e_1", "a": "e_2"},
        implicit=("1", "2"),
        gamma={"back": "e_1 - 0.25*f_a", "torque": "e_2 - 0.25*f_c"},
        initial=dict.fromkeys(("q_c", "q_a", "f_c", "f_a"), (0, True)),
        form=form,
    )


def lead_filter(form="lagrangian"):
    """Seed system lead_filter: R1 = 1000, R2 = 250, C = 1e-4, E = 1, w = 12.566370614359172954."""
    return small(
        "1 2 3",
        "0",
        "q_2**2/2e-4",
        "1000*f_1**2/2 + 250*f_3**2/2",
        work={"3": "sin(12.566370614359172954*t)"},
        phi={"node": "q_1 + q_2 - q_3"},
        initial={"q_1": (0, True), "q_2": (0, True)},
        form=form,
        momenta="",
    )


def springs():
    """A mass on two springs in series with nothing between them: the balance of y is one of positions."""
    return small("x y", "f_x**2/2", "(q_x - q_y)**2/2 + q_y**2/2", initial={"q_x": (1, True), "f_x": (0, True)})


def slider_crank(m1=1.0, m2=0.8, form="lagrangian"):
    """Seed system slider_crank: r = 1, l = 2, th = pi/4, om = 2."""
    a = np.sqrt(0.5)
    return small(
        "1 2 3",
        f"{m1}*(f_1**2 + f_2**2)/2 + {m2}*f_3**2/2",
        phi={"crank": "q_1**2 + q_2**2 - 1", "rod": "(q_3 - q_1)**2 + q_2**2 - 4"},
        initial={
            "q_1": (a, True),
            "q_2": (0.7, False),
            "q_3": (2.5, False),
            "f_1": (-2 * a, True),
            "f_2": (1, False),
        },
        form=form,
        momenta="1 2 3" if m1 else "3",
    )


def pendulum_spring(collar=0.0):
    """Seed system pendulum_spring: m = 2, l = 4, k = 15, b = 1, th = 0.5, w = -1.3."""
    return small(
        "1 2 3",
        f"f_1**2 + f_2**2 + {collar}*f_3**2/2",
        "15*q_3**2/2",
        "f_3**2/2",
        work={"2": "-2*9.81"},
        phi={"rod": "(q_2 - q_3)**2 + q_1**2 - 16"},
        initial={
            "q_1": (4 * np.sin(0.5), True),
            "q_3": (-1.3, True),
            "q_2": (-4.8, False),
            "f_1": (0, True),
            "f_3": (0, True),
        },
    )


def fluid_tank():
    """Seed system fluid_tank, inlet as rheonomic flow constraint: Q10 = 0.5, w = 1, R = 2, C = 1.5, V20 = 1."""
    return small(
        "1 2 3",
        "0",
        "q_2**2/3",
        "f_3**2",
        phi={"tank": "q_1 - q_2 - q_3 + 1"},
        psi={"inlet": "f_1 - 0.5*(1 + sin(t))"},
        initial={"q_1": (0, True), "q_2": (1, True)},
        source_power="-mu_inlet*0.5*(1 + sin(t))",
    )


def nonlinear_fluid():
    """Seed system nonlinear_fluid: valves C f|f|, source 1e6 ln(t + 1)."""
    return small(
        "1 2 3",
        "0",
        "q_2**2/5e-6",
        work={"1": "-4e6*f_1*Abs(f_1)", "3": "1e6*log(t + 1) - 4e6*f_3*Abs(f_3)"},
        phi={"tank": "q_1 + q_2 - q_3 - 2"},
        initial={"q_1": (0, True), "q_2": (2, True)},
    )


def diode_circuit():
    """A diode f = 1e-12 (exp(e/0.026) - 1) between a sine source behind 10 ohm and a 10 uF | 1 kohm load."""
    return small(
        "d c r",
        "0",
        "q_c**2/2e-5",
        "10*f_d**2/2 + 1000*f_r**2/2",
        work={"d": "5*sin(314.159*t) - e_d"},
        implicit=("d",),
        gamma={"diode": "f_d - 1e-12*(exp(e_d/0.026) - 1)"},
        phi={"node": "q_d - q_c - q_r"},
        initial={"q_d": (0, True), "q_c": (0, True)},
        source_power="5*sin(314.159*t)*f_d - e_d*f_d",
    )
