"""Verifiers catch corrupted forms; printers show them; derivatives agree with sympy."""

from dataclasses import replace

import numpy as np
import pytest
import sympy
from catalogue import network
from chains import chain
from reference_values import load
from sysdyn.compiler.forms import descriptor
from sysdyn.compiler.forms.descriptor import verify_descriptor
from sysdyn.compiler.model import energies
from sysdyn.compiler.model.energies import verify_energies
from sysdyn.compiler.model.interpret import evaluate
from sysdyn.compiler.pipeline import compile_network
from sysdyn.compiler.program import program_text
from sysdyn.compiler.program.program import Assign, StoreInstruction
from sysdyn.compiler.program.program_text import verify_program
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.calculus import derivative


@pytest.fixture
def model():
    with x.fresh():
        yield compile_network(chain(4), "hamiltonian")


def test_energies(model):
    bad = replace(model.energies.functions["V"][0], loops=())
    with pytest.raises(AssertionError):
        verify_energies(replace(model.energies, functions={"V": (bad,)}))


def swapped(form, name, **change):
    block = form.block(name)
    kernel = block.kernels[0]
    summand = replace(kernel.rows[0], **change)
    changed = replace(block, kernels=(replace(kernel, rows=(summand,)),))
    return replace(form, blocks=tuple(changed if b.name == name else b for b in form.blocks))


@pytest.mark.parametrize(
    "change",
    [
        lambda form: swapped(form, "phi", expression=x.var("nobody", "q")),
        lambda form: swapped(form, "phi", expression=x.var("x", "f", x.const(1), order=1)),
        lambda form: swapped(form, "phi", expression=x.var("x", "q", x.const(1), order=1)),
        lambda form: swapped(form, "phi", expression=x.index("#7")),
        lambda form: swapped(form, "phi", row=0),
        lambda form: replace(form, families=(*form.families, form.families[0])),
    ],
)
def test_descriptor(model, change):
    verify_descriptor(model.form)
    with pytest.raises(AssertionError):
        verify_descriptor(change(model.form))


def with_body(program, body):
    return replace(program, routines=(replace(program.routines[0], body=body), *program.routines[1:]))


def test_program(model):
    program = model.program
    verify_program(program)
    body = program.routines[0].body
    first = next(s for s in body if isinstance(s, Assign))
    for broken in (body[1:], (first, *body), tuple(reversed(body))):
        with pytest.raises(AssertionError):
            verify_program(with_body(program, broken))
    with pytest.raises(AssertionError):
        verify_program(replace(program, slots=()))
    k, entries = next((k, r) for k, r in enumerate(program.routines) if r.part == "dy")
    without = tuple(s for s in entries.body if not isinstance(s, StoreInstruction))
    broken = tuple(replace(r, body=without) if j == k else r for j, r in enumerate(program.routines))
    with pytest.raises(AssertionError):
        verify_program(replace(program, routines=broken))


def test_printers(model):
    assert "phi link[#0]: for #0 in 2..n:" in energies.show(model.energies)
    text = descriptor.show(model.form)
    assert "block phi_acceleration" in text
    assert "init y[n] ~ 0.5" in text
    assert "dynamics rows kernel 0 for ix[" in program_text.show(model.program)


@pytest.mark.long
def test_lowering_twice_changes_nothing(model):
    again = compile_network(model.network, "hamiltonian")
    assert again.form == model.form
    assert again.program == model.program
    assert again.text == model.text


def to_sympy(root, symbols):
    done = {}
    for node in x.topological([root]):
        args = [done[a] for a in node.args]
        match node.op:
            case "const":
                done[node] = sympy.Float(node.data, 30)
            case "sum":
                done[node] = node.data[0] + sum(c * a for c, a in zip(node.data[1], args, strict=True))
            case "mul":
                done[node] = sympy.prod([a ** sympy.Rational(e) for e, a in zip(node.data, args, strict=True)])
            case "pow":
                done[node] = args[0] ** args[1]
            case "call":
                done[node] = getattr(sympy, {"ln": "log"}.get(node.data, node.data))(*args)
            case _:
                done[node] = symbols[node]
    return done[root]


NAMES = ("sin", "cos", "tan", "atan", "sinh", "cosh", "tanh", "asinh", "exp", "ln", "atan2")


def random_expression(random, leaves, depth):
    if depth == 0 or random.random() < 0.1:
        return leaves[random.integers(len(leaves))]
    parts = [random_expression(random, leaves, depth - 1) for _ in range(2)]
    match random.integers(6):
        case 0:
            return x.linear(random.uniform(-1, 1), zip(random.uniform(-2, 2, 2), parts, strict=True))
        case 1:
            return x.mul(*parts)
        case 2:
            return x.div(parts[0], x.add(x.const(3), x.mul(parts[1], parts[1])))
        case 3:
            return x.power(
                x.add(x.const(2), x.mul(parts[0], parts[0])), x.const(random.choice([0.5, -0.5, 2, -3, 1.5]))
            )
        case _:
            name = NAMES[random.integers(len(NAMES))]
            if name == "ln":
                return x.call("ln", x.add(x.const(2), x.mul(parts[0], parts[0])))
            if name == "atan2":
                return x.call(name, parts[0], x.add(x.const(2), x.mul(parts[1], parts[1])))
            return x.call(name, x.call("sin", parts[0]) if name in ("exp", "sinh", "cosh", "tan") else parts[0])


@pytest.mark.parametrize("seed", range(25))
@pytest.mark.long
def test_derivatives_are_sympy_s(seed):
    random = np.random.default_rng(seed)
    with x.fresh():
        leaves = [x.var(n, "q") for n in "abc"]
        root = random_expression(random, leaves, 4)
        values = dict(zip(leaves, random.uniform(0.3, 0.9, 3), strict=True))
        symbols = {n: sympy.Symbol(f"s{k}", real=True) for k, n in enumerate(leaves)}
        expression = to_sympy(root, symbols)
        point = {symbols[n]: sympy.Float(float(v), 30) for n, v in values.items()}
        first = derivative(root, leaves[0])
        for node, by in ((first, (0,)), (derivative(first, leaves[1]), (0, 1))):
            expected = float(sympy.diff(expression, *(symbols[leaves[k]] for k in by)).evalf(25, subs=point))
            got = float(evaluate([node], lambda n, _: values[n])[0])
            assert got == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_energy_model_can_be_written_directly():
    """The constructor is plain: families and terms, no network."""
    from catalogue import PLACE
    from sysdyn.compiler.forms.lagrangian import lagrangian
    from sysdyn.compiler.model.energies import EnergyModel, UnknownFamily
    from sysdyn.compiler.model.terms import Term

    with x.fresh():
        units = dict.fromkeys("qfpe", "1")
        kinetic = x.mul(x.const(0.5), x.var("a", "f"), x.var("a", "f"))
        form = lagrangian(
            EnergyModel((UnknownFamily("a", (), units, PLACE),), functions={"T*": (Term(kinetic, (), PLACE),)})
        )
        (kernel,) = form.block("dynamics").kernels
        assert kernel.rows[0].expression is x.var("a", "f", order=1)


@pytest.mark.long
def test_hamiltonian_needs_no_momentum_without_inertia():
    entry = load("catalogue.json")["rectifier_motor_crank"]
    with x.fresh():
        form = compile_network(network(entry, entry["models"][1]), "hamiltonian").form
    assert [f.owner for f in form.families if f.kind == "p"] == ["x5", "x6", "x7"]
