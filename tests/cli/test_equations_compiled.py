"""What `sysdyn equations` prints is what is compiled: every simplification against numbers."""

import itertools
import os

import numpy as np
import pytest
from printed_equations import SEED, Values, model, printed
from sysdyn.cli.main import run
from sysdyn.compiler.equations import matrices
from sysdyn.compiler.equations.algebra import Algebra
from sysdyn.compiler.equations.book import BLOCKS, equations
from sysdyn.compiler.equations.matrices import canonical, rows_of, underlying, unknowns
from sysdyn.compiler.equations.order import FactorOrder
from sysdyn.compiler.equations.pieces import pieces
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.calculus import derivative
from texts import run_json, write

MODELS = sorted(p.stem for p in SEED.glob("*.sd"))

LONG = os.environ.get("SYSDYN_LONG") == "1"

FAMILY = ("lagrangian", "hamiltonian")


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.one_in(77)
def test_what_is_printed_is_what_is_compiled(name):
    """left - right of every equation against the sum of its row, at random values, up to one sign."""
    for formulation in ("lagrangian", "hamiltonian", "co_lagrangian"):
        with ex.fresh():
            made = model(name, formulation)
            if made is None:
                continue
            order = FactorOrder([p.name for p in made.network.parameters])
            found = [e for e in equations(Algebra(order), made.functions, made.form, 1000) if e.kind != "kinematic"]
            rows = [k for k, row in enumerate(made.form.rows) if row.block in BLOCKS]
            by_row = [list(group) for _, group in itertools.groupby(found, key=lambda e: (e.kind, e.owner))]
            assert len(by_row) == len(rows)
            for number, group in zip(rows, by_row, strict=True):
                values = Values(number)
                terms = [(t, 1.0) for e in group for t in e.left] + [(t, -1.0) for e in group for t in e.right]
                if any(t.over for t, _ in terms) or any(e.where for e in group):
                    continue
                ours = sum(sign * values.of(t.expression) for t, sign in terms)
                theirs = sum(values.of(p.expression) for p in pieces(made.form, number))
                size = sum(abs(values.of(t.expression)) for t, _ in terms) + 1e-300
                assert min(abs(ours - theirs), abs(ours + theirs)) <= 1e-12 * size, (formulation, group[0].owner)


SOLVED = {
    "pendulum": FAMILY, "mass_spring": FAMILY[1:], "two_link_arm": FAMILY[:1], "slider_crank": FAMILY[1:],
    "knife_edge": FAMILY[1:], "bead_rod": FAMILY[:1],
}  # fmt: skip
"""Formulations; SYSDYN_LONG=1: both of each."""


@pytest.mark.parametrize(
    ("name", "formulation"), [(name, f) for name, some in SOLVED.items() for f in (FAMILY if LONG else some)]
)
@pytest.mark.one_in(12)
def test_the_underlying_equations_solve_the_rows(name, formulation):
    """Rates and multipliers printed against a numerical solution of the rows that they come from."""
    with ex.fresh():
        form = model(name, formulation).form
        found = underlying(Algebra(FactorOrder()), form)
        rows = rows_of(form, "dynamics", "momentum_rate", "phi_acceleration", "psi_rate")
        kinds = (("f", 1), ("p", 1), ("kappa", 0), ("mu", 0))
        wanted = [n for kind, order in kinds for n in unknowns(form, kind, order)]
        values = Values(3)
        matrix = np.array([[values.of(derivative(row.expression, n)) for n in wanted] for row in rows])
        still = dict.fromkeys(wanted, ex.const(0.0))
        right = np.array([-values.of(ex.substitute(row.expression, still)) for row in rows])
        solution = dict(zip(wanted, np.linalg.solve(matrix, right), strict=True))
        compared = 0
        for e in found:
            (left,) = e.left
            if left.expression in solution:
                value = sum(values.of(t.expression) for t in e.right)
                assert value == pytest.approx(solution[left.expression], rel=1e-9, abs=1e-12), e.owner
                compared += 1
        assert compared >= 1


@pytest.mark.parametrize("name", ["pendulum", "two_link_arm", "slider_crank", "em_suspension", "mass_spring"])
@pytest.mark.one_in(3)
def test_the_canonical_equations_are_derivatives_of_h(name):
    """q' = dH/dp, and p' + dH/dq holds what is no conservative effort: the same at any momenta."""
    with ex.fresh():
        made = model(name, "hamiltonian")
        function, found = canonical(Algebra(FactorOrder()), made.functions, made.form)
        h = ex.add(*(t.expression for t in function.terms))
        carriers = [f.owner for f in made.form.families if f.kind == "p"]
        values = Values(4)
        rates = {e.owner: ex.add(*(t.expression for t in e.right)) for e in found if e.kind == "kinematic"}
        for owner in carriers:
            if owner in rates:
                slope = derivative(h, ex.var(owner, "p"))
                assert values.of(rates[owner]) == pytest.approx(values.of(slope), rel=1e-9), owner
            (row,) = (e for e in found if e.kind == "dynamics" and e.owner == owner)
            conservative = derivative(h, ex.var(owner, "q"))
            rest = ex.add(*(t.expression for t in row.right), conservative)
            dependent = [n for n in ex.variables(rest) if n.op == "var" and n.data[1] == "p"]
            slopes = [values.of(derivative(rest, n)) for n in dependent]
            dissipated = any(t.expression is not None for t in made.energies.function("D"))
            assert dissipated or slopes == pytest.approx([0.0] * len(slopes), abs=1e-9), owner


def test_the_linear_form_is_that_of_linearize(capsys):
    found = printed(capsys, "dc_motor", "--form", "linear")
    assert "f_supply' = 12.5 f_shaft - 40 f_supply" in found
    assert "f_shaft' = -1/2 f_shaft - 25 f_supply" in found


DRIVEN = """
model frame {
  input u: m = 0.2 m
  coord x: translation = 0 m
  let z = x + u
  energy T* = 1/2*(1 kg)*z'^2
  energy V = 1/2*(9 N/m)*x^2
  work -(0.5 N.s/m)*x' on x
}
scene frame_s of frame { time 0 s to 1 s
  trace x }
model base {
  input v: m/s = 0 m/s
  node b, x: translation
  F: flow(f = v) b -> ground
  K: potential(e = 100 N/m*q) b -> x
  D: dissipator(e = 1 N.s/m*f) b -> x
  M: kinetic(p = 1 kg*f) x
}
scene base_s of base { time 0 s to 1 s
  trace x.f }
component seat {
  param k = 100 N/m
  input u: m
  port x: translation
  let z = x.q + u
  energy T* = 1/2*(2 kg)*z'^2
  K: potential(e = k*q) x -> ground
}
model two {
  input u[1..2]: m = [0.1 m, 0.2 m]
  node a, b: translation
  A: seat(k = 50 N/m) u = u[1], x = a
  B: seat() u = u[2], x = b
}
scene two_s of two { time 0 s to 1 s
  trace a.q }
"""


@pytest.mark.parametrize(
    ("scene", "expected"),
    [
        ("frame_s", ["x' = f_x", "f_x' = -9 x - 1/2 f_x - u''"]),
        ("base_s", ["q_x' = f_x", "f_x' = -100 q_x - f_x + 100 integral of v + v", "integral of v' = v"]),
        ("two_s", ["q_a' = f_a", "q_b' = f_b", "f_a' = -25 q_a - u[1]''", "f_b' = -50 q_b - u[2]''"]),
    ],
)
def test_the_linear_form_is_of_the_unknowns_that_it_names(scene, expected, tmp_path, capsys):
    """Not of combinations with an input; what follows the integral of an input names that, no multiplier."""
    assert run(["equations", str(write(tmp_path, DRIVEN)), "--scene", scene, "--form", "linear", "-q"]) == 0
    lines = [line.strip() for line in capsys.readouterr().out.splitlines()]
    assert lines[: len(expected)] == expected


# -- the command -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.long
def test_every_model_is_printed(name, capsys):
    code, found = run_json(capsys, "equations", str(SEED / f"{name}.sd"))
    assert code == 0
    assert found["result"]["equations"]
    for line in (*found["result"]["functions"], *found["result"]["equations"]):
        assert "…" not in line["text"]
        text = line["latex"]
        assert text.count("{") == text.count("}")
        assert text.count(r"\left") == text.count(r"\right")


FOUR_BAR = """
model four_bar {
  param a = 0.1 m
  param b = 0.3 m
  param c = 0.25 m
  param d = 0.32 m
  coord x1, y1, x2, y2: translation ~ 0.2 m
  coord al: rotation = 20 deg
  energy T* = 1/2*(0.5 kg)*(x1'^2 + y1'^2) + 1/2*(0.8 kg)*(x2'^2 + y2'^2) + 1/2*(0.01 kg.m^2)*al'^2
  work 1.2 N.m on al
  phi cx: x1 = a*cos(al)
  phi cy: y1 = a*sin(al)
  phi coupler: (x2 - x1)^2 + (y2 - y1)^2 = b^2
  phi rocker: (x2 - d)^2 + y2^2 = c^2
}
"""


@pytest.mark.long
def test_long_terms_are_not_factored(tmp_path, monkeypatch, capsys):
    """A solution longer than anyone reads is refused; factors of one of its terms alone took minutes."""
    import sympy

    factor, longest = sympy.factor, []
    monkeypatch.setattr(sympy, "factor", lambda value: longest.append(value.count_ops()) or factor(value))
    assert run(["equations", write(tmp_path, FOUR_BAR), "--form", "underlying"]) == 1
    assert "more than 2000 operations" in capsys.readouterr().err
    assert max(longest) <= matrices.FACTORED
