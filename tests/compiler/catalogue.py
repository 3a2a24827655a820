"""Networks of the seed's catalogue, read from its Python-syntax strings with `ast` (never evaluated)."""

import ast
from pathlib import Path

from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.network import (
    Constraint,
    Coordinate,
    Dynamic,
    EnergyTerm,
    Network,
    Observation,
    Parameter,
    State,
    Unknown,
    VirtualWork,
)
from sysdyn.dsl.model.units import Unit
from sysdyn.dsl.text.diagnostics import SourceText

ROOT = Path(__file__).resolve().parents[2]
ONE = Unit((), 1.0, "1")
PLACE = SourceText("catalogue", "model\n").place(0, 5)
BLOCKS = ("dynamics", "phi_reaction", "psi_reaction", "momentum", "phi", "psi", "gamma", "lambda")


def convert(text, names):
    """A Python expression as nodes; names: what each identifier stands for."""
    return _convert(ast.parse(text, mode="eval").body, names)


_BINARY = {ast.Add: x.add, ast.Sub: x.sub, ast.Mult: x.mul, ast.Div: x.div, ast.Pow: x.power}
_CALLS = {"Abs": "abs", "log": "ln"}


def _convert(node, names):
    match node:
        case ast.BinOp():
            return _BINARY[type(node.op)](_convert(node.left, names), _convert(node.right, names))
        case ast.UnaryOp(op=ast.USub()):
            return x.neg(_convert(node.operand, names))
        case ast.Constant():
            return x.const(node.value)
        case ast.Name():
            return names[node.id]
        case ast.Call():
            name = node.func.id
            return x.call(_CALLS.get(name, name), *(_convert(a, names) for a in node.args))
    raise AssertionError(ast.dump(node))


def names_of(entry, model):
    names = {"t": x.time()} | {n: x.param(n) for n in entry["parameters"]}
    for k in range(1, model["n"] + 1):
        names |= {f"{kind}{k}": x.var(f"x{k}", kind) for kind in "qfp"}
    names |= {n: x.var(n, "e") for n in model["implicit"]}
    names |= {n: x.var(n, "s") for n in model["s"]}
    return names


def network(entry, model, *, energy="T*"):
    """The entry as a Network; energy "T" takes the author's T(p) instead of T*."""
    names = names_of(entry, model)
    n = model["n"]

    def node(text):
        return convert(text, names)

    kinetic = model["energy_after_legendre"] if energy == "T" else model["kinetic_or_potential_coenergy"]
    functions = ((energy, kinetic), ("V", model["dual_energy"]), ("D", model["content"]))
    constraints = [(kind, k, text) for kind in ("phi", "psi", "gamma") for k, text in enumerate(model[kind], 1)]
    observed = [Observation(f"q{k}", x.var(f"x{k}", "q"), ONE, f"q{k}", PLACE) for k in range(1, n + 1)]
    return Network(
        model="m",
        place=PLACE,
        parameters=tuple(
            Parameter(k, (), ONE, (x.const(float(v)),), (), PLACE) for k, v in entry["parameters"].items()
        ),
        tables=(),
        coordinates=tuple(Coordinate(f"x{k}", (), False, ONE, ONE, ONE, ONE, None, PLACE) for k in range(1, n + 1)),
        unknowns=tuple(Unknown(name, (), ONE, PLACE) for name in model["implicit"]),
        states=tuple(State(name, (), ONE, PLACE) for name in model["s"]),
        energies=tuple(EnergyTerm(f, node(text), (), PLACE) for f, text in functions),
        works=tuple(
            VirtualWork(node(text), x.var(f"x{k}", "q"), (), PLACE) for k, text in enumerate(model["applied"], 1)
        ),
        constraints=tuple(
            Constraint(kind, f"{kind}{k}", (), node(text), (), ONE, PLACE) for kind, k, text in constraints
        ),
        dynamics=tuple(
            Dynamic(x.var(s, "s"), node(text), (), PLACE) for s, text in zip(model["s"], model["lam"], strict=True)
        ),
        initials=(),
        observations=tuple(observed),
        expectations=(),
        statics=(),
        goldens=(),
        scene=None,
    )


def state(form, values, k):
    """y, yd of a form (all families scalar) at row k of an entry of descriptor_values.json."""
    row = dict(zip(values["names"], (float(v) for v in values["rows"][k]), strict=True))
    y, yd = [], []
    for family in form.families:
        owner, kind = family.owner, family.kind
        number = owner[1:]
        if kind == "q":
            y.append(row[f"q{number}"]), yd.append(row[f"f{number}"])
        elif kind == "f":
            y.append(row[f"f{number}"]), yd.append(row.get(f"df{number}/dt", 0.0))
        elif kind == "p":
            y.append(row[f"p{number}"]), yd.append(None)
        elif kind in ("s", "e"):
            y.append(row[owner]), yd.append(None)
        elif kind in ("kappa", "mu"):
            y.append(row[f"{kind}{owner[3:]}"]), yd.append(None)
        else:
            y.append(0.0), yd.append(0.0)
    return row, y, yd
