"""`sysdyn equations`: golden texts read against the book, and every simplification against numbers."""

import itertools
import json
import os
import re

import numpy as np
import pytest
from sysdyn.cli.analysis.asked import compiled
from sysdyn.cli.main import run
from sysdyn.cli.run.request.asked import Request
from sysdyn.compiler.equations import matrices
from sysdyn.compiler.equations.algebra import Algebra
from sysdyn.compiler.equations.book import BLOCKS, classes, equations
from sysdyn.compiler.equations.elements import elements
from sysdyn.compiler.equations.matrices import canonical, rows_of, underlying, unknowns
from sysdyn.compiler.equations.order import Order
from sysdyn.compiler.equations.pieces import pieces
from sysdyn.compiler.forms.momenta import momentum
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.calculus import derivative, without_signals
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.text.diagnostics import Report
from texts import PENDULUM, ROOT, run_json, write

SEED = ROOT / "models" / "seed"
MODELS = sorted(p.stem for p in SEED.glob("*.sd"))
LONG = os.environ.get("SYSDYN_LONG") == "1"
FAMILY = ("lagrangian", "hamiltonian")


def printed(capsys, name, *options):
    assert run(["equations", str(SEED / f"{name}.sd"), *options, "--quiet"]) == 0
    return capsys.readouterr().out


GOLDEN = {
    ("pendulum", "lagrangian"): """\
T* = 1/2 m (f1^2 + f2^2)
δW = -m g δq2

            q1' = f1
            q2' = f2
m f1' + 2 q1 κ1 = 0
m f2' + 2 q2 κ1 = -m g
              0 = q1^2 + q2^2 - l^2

κ1 of rod, line 11
""",
    ("pendulum", "hamiltonian"): """\
 T = p1^2/(2 m) + p2^2/(2 m)
δW = -m g δq2

q1' = f1
q2' = f2
p1' = -2 q1 κ1
p2' = -m g - 2 q2 κ1
 f1 = p1/m
 f2 = p2/m
  0 = q1^2 + q2^2 - l^2

κ1 of rod, line 11
""",
    ("em_suspension", "lagrangian"): """\
T* = 1/2 M f_x^2 + b0 f2^2/(2 (b1 + x))
 D = 1/2 R f3^2
δW = (F0 + F1 sin(w t)) δx + E δq3

                  x' = f_x
              M f_x' = -b0 f2^2/(2 (b1 + x)^2) + F0 + F1 sin(w t)
b0 f2'/(b1 + x) + μ1 = b0 f2 f_x/(b1 + x)^2
                  μ1 = R f3 - E
                   0 = f2 - f3

μ1 of series, line 22
""",
    ("pendulum_spring", "lagrangian"): """\
T* = 1/2 m (f1^2 + f2^2)
 V = 1/2 k w^2
 D = 1/2 b f_w^2
δW = -m g δq2

                  q1' = f1
                  q2' = f2
                   w' = f_w
      m f1' + 2 q1 κ1 = 0
m f2' + 2 (q2 - w) κ1 = -m g
        2 (q2 - w) κ1 = b f_w + k w
                    0 = (q2 - w)^2 + q1^2 - l^2

κ1 of rod, line 19
""",
    ("knife_edge", "lagrangian"): """\
T* = 1/2 M (f_x^2 + f_y^2) + 1/2 J f_th^2
δW = sin(al) M g δx

                 x' = f_x
                 y' = f_y
                th' = f_th
M f_x' + sin(th) μ1 = sin(al) M g
M f_y' - cos(th) μ1 = 0
            J f_th' = 0
                  0 = sin(th) f_x - cos(th) f_y

μ1 of edge, line 18
""",
    ("lead_filter", "lagrangian"): """\
 V = q_c^2/(2 C)
 D = 1/2 R1 f_r1^2 + 1/2 R2 f_supply^2
δW = -E sin(w t) δq_supply

q_supply' = f_supply
    q_r1' = f_r1
     q_c' = f_c
       κ1 = -R2 f_supply - E sin(w t)
       κ1 = -R1 f_r1
       κ1 = -q_c/C
        0 = q_c + q_r1 + q_supply - c_out_

κ1 of out_, line 12
""",
    ("co_circuit", "co_lagrangian"): """\
V* = 1/2 C1 e_a^2 + 1/2 C3 e_c^2
 T = (p_a - p_b)^2/(2 L1) + (p_b - p_c)^2/(2 L2)
 G = e_c^2/(2 R3) + e_b^2/(2 R2)
δW = A1 sin(w t) δp_a + A2 δp_c

   p_a' = e_a
   p_b' = e_b
   p_c' = e_c
C1 e_a' = -(p_a - p_b)/L1 + A1 sin(w t)
      0 = -e_b/R2 + (p_a - p_b)/L1 - (p_b - p_c)/L2
C3 e_c' = -e_c/R3 - (p_c - p_b)/L2 + A2
""",
    ("integral_controller", "lagrangian"): """\
T* = 1/2 M f_x^2
 V = 1/2 k x^2
 D = 1/2 b f_x^2
δW = -e δx

    x' = f_x
M f_x' = -e - b f_x - k x
     0 = e - Ki s
    s' = x - qr
""",
}


@pytest.mark.parametrize(("name", "formulation"), GOLDEN)
def test_equations_are_those_of_the_book(name, formulation, capsys):
    """Examples 6.1, 3.4, 6.6, 2.4.2, 6.4, 5.1 and 2.30, read by eye: rows, signs and classes of efforts."""
    found = printed(capsys, name, "--formulation", formulation)
    assert _same_terms(found, GOLDEN[name, formulation])


BOOK = sorted((ROOT / "tests" / "cli" / "book").glob("*.txt"))


def test_thirteen_systems_in_two_formulations():
    systems = {path.name.split(".")[0] for path in BOOK}
    assert len(systems) == 13
    assert len(BOOK) == 26


@pytest.mark.parametrize("path", BOOK, ids=lambda p: p.stem)
@pytest.mark.one_in(7)
def test_the_books_systems_are_printed_as_there(path, capsys):
    """Texts read by eye against (6.27), (6.40), Examples 3.1 to 3.4, 4.1, 4.2, 5.1 to 5.4, 6.6, 2.37 and 2.4.2."""
    system, formulation = path.name.split(".")[:2]
    file = ROOT / "models" / "book" / f"{system}.sd"
    assert run(["equations", str(file), "--scene", "reference", "--formulation", formulation, "--quiet"]) == 0
    assert _same_terms(capsys.readouterr().out, path.read_text())


def _same_terms(found, expected):
    """Line by line, up to the order of the energy functions' terms."""
    one, other = found.splitlines(), expected.splitlines()
    assert len(one) == len(other), found
    for a, b in zip(one, other, strict=True):
        left, right = (re.split(r" (?=[+-] )", line.partition("= ")[2]) for line in (a, b))
        assert a.partition("= ")[0] == b.partition("= ")[0], (a, b)
        terms = [sorted(t.removeprefix("+ ").replace("- ", "-") for t in side) for side in (left, right)]
        assert terms[0] == terms[1], (a, b)
    return True


def test_the_arm_has_the_terms_of_the_book(capsys):
    """Example 3.1: squares of sines and cosines joined, differences of angles, like terms: four terms a row."""
    found = printed(capsys, "two_link_arm", "--formulation", "lagrangian")
    rows = [line.strip() for line in found.splitlines() if "f_th1'" in line and line.strip() != "th1' = f_th1"]
    first, second = rows
    assert first == (
        "(m1 + m2) l1^2 f_th1' + m2 l1 l2 cos(th1 - th2) f_th2'"
        " = -m2 l1 l2 sin(th1 - th2) f_th2^2 - (m1 + m2) l1 g cos(th1) - l1 F3 sin(th1) sin(w t)"
    )
    assert second == (
        "m2 l1 l2 cos(th1 - th2) f_th1' + m2 l2^2 f_th2'"
        " = m2 l1 l2 sin(th1 - th2) f_th1^2 - m2 l2 g cos(th2) - l2 F3 sin(th2) sin(w t)"
    )


def test_the_canonical_suspension_has_the_row_of_the_book(capsys):
    """(4.22): the pull of the magnet is p2^2/(2 b0), whatever the gap."""
    found = printed(capsys, "em_suspension", "--form", "canonical", "--formulation", "hamiltonian")
    assert "p_x' = -p2^2/(2 b0) + F0 + F1 sin(w t)" in found
    assert "H = (b1 + x) p2^2/(2 b0) + p_x^2/(2 M)" in found


def test_matrices_by_name(capsys):
    assert (
        printed(capsys, "pendulum", "--form", "matrices")
        == """\
  M = [ m   0 ]
      [ 0   m ]
Φ_q = [ 2 q1   2 q2 ]
  Y = [ 0    ]
      [ -m g ]
 Z1 = [ 2 f1^2 + 2 f2^2 ]

f = (f1, f2)

degrees of freedom: n - m1 - m2 = 2 - 1 - 0 = 1, where the constraints are independent
index by structure: 3
  rate of q1: differentiated once
  rate of q2: differentiated once
  displacement constraint rod: differentiated twice
  all once more for the rates of what has none yet: κ of rod
"""
    )


def test_latex(capsys):
    found = printed(capsys, "pendulum", "--latex", "--formulation", "hamiltonian")
    assert r"\dot p_{2} &= -m \, g - 2 \, q_{2} \, \kappa_{1}" in found
    assert found.count(r"\begin{align*}") == found.count(r"\end{align*}") == 2


def test_a_page(capsys):
    found = printed(capsys, "pendulum", "--html")
    assert found.startswith("<!doctype html>")
    assert found.count("<math>") == found.count("</math>") == 5  # two functions, three rows


# -- numbers -----------------------------------------------------------------------------------------------------------


def model(name, formulation):
    report = Report()
    made = compiled(Request(str(SEED / f"{name}.sd"), formulation=formulation, backend="numpy"), report)
    return None if made is None else made[1].compiled


class Values:
    """A random number for each parameter and unknown."""

    def __init__(self, seed):
        self.random = np.random.default_rng(seed)
        self.known = {}

    def __call__(self, node):
        if node not in self.known:
            self.known[node] = float(self.random.uniform(0.4, 1.6))
        return self.known[node]

    def of(self, node):
        return evaluate([without_signals(node)], self)[0]


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.one_in(15)
def test_what_is_printed_is_what_is_compiled(name):
    """left - right of every equation against the sum of its row, at random values, up to one sign."""
    for formulation in ("lagrangian", "hamiltonian", "co_lagrangian"):
        with ex.fresh():
            made = model(name, formulation)
            if made is None:
                continue
            order = Order([p.name for p in made.network.parameters])
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
        found = underlying(Algebra(Order()), form)
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
@pytest.mark.one_in(2)
def test_the_canonical_equations_are_derivatives_of_h(name):
    """q' = dH/dp, and p' + dH/dq holds what is no conservative effort: the same at any momenta."""
    with ex.fresh():
        made = model(name, "hamiltonian")
        function, found = canonical(Algebra(Order()), made.functions, made.form)
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
@pytest.mark.one_in(6)
def test_every_model_is_printed(name, capsys):
    code, found = run_json(capsys, "equations", str(SEED / f"{name}.sd"))
    assert code == 0
    assert found["result"]["equations"]
    for line in (*found["result"]["functions"], *found["result"]["equations"]):
        assert "…" not in line["text"]
        text = line["latex"]
        assert text.count("{") == text.count("}")
        assert text.count(r"\left") == text.count(r"\right")


FAMILY = """
model chain {
  param n = 5
  param m = 1 kg
  param k = 2 N/m
  coord x[1..n]: translation
  energy T* = sum(i in 1..n: 1/2*m*x[i]'^2)
  energy V = sum(i in 2..n: 1/2*k*(x[i] - x[i-1])^2)
}
"""


def test_families_stay_families(tmp_path, capsys):
    assert run(["equations", str(write(tmp_path, FAMILY)), "--quiet"]) == 0
    out = capsys.readouterr().out
    assert "T* = sum(i = 1..n) 1/2 m f_x[i]^2" in out
    assert "x[i]' = f_x[i]    i = 1..n" in out
    lines = [line.strip() for line in out.splitlines()]
    assert "0 = m f_x[i]'    i = 1..n" in lines
    assert "+ k (x[i] - x[i - 1])    i = 2..n" in lines
    pulled = re.compile(r"[+-] k \(x\[i( \+ 1)?\] - x\[i( \+ 1)?\]\)    i = 1\.\.n - 1")
    assert any(pulled.fullmatch(line) for line in lines), lines


@pytest.mark.parametrize(
    ("options", "why"),
    [
        (("--form", "matrices"), "families over ranges"),
        (("--form", "canonical", "--formulation", "lagrangian"), "--formulation hamiltonian"),
    ],
)
def test_forms_that_do_not_exist(options, why, tmp_path, capsys):
    code, found = run_json(capsys, "equations", str(write(tmp_path, FAMILY)), *options)
    assert code == 1
    (error,) = found["diagnostics"]
    assert error["code"] == "E607"
    assert why in error["message"]


ALONE = """model decay { state x: kg = 1 kg; dynamic x' = -x/(3 s) }"""
DIVIDER = """
model divider {
  node a, b: electrical
  V: effort(e = 5 V) a -> ground
  R: dissipator(e = 100 ohm*f) a -> b
  S: dissipator(e = 200 ohm*f) b -> ground
}
"""


@pytest.mark.parametrize("form", ["matrices", "underlying", "port_hamiltonian", "efforts"])
@pytest.mark.parametrize("alphabet", ["--text", "--latex", "--html"])
def test_dynamic_variables_alone_have_no_coordinates(form, alphabet, tmp_path, capsys):
    code, found = run_json(capsys, "equations", write(tmp_path, ALONE), "--form", form, alphabet)
    assert code == 1
    (error,) = found["diagnostics"]
    assert (error["code"], "no coordinates" in error["message"]) == ("E607", True)


@pytest.mark.parametrize(("text", "form"), [(DIVIDER, "linear"), ("model none { param a = 1 kg }", "descriptor")])
def test_equations_that_there_are_none_of(text, form, tmp_path, capsys):
    code, found = run_json(capsys, "equations", write(tmp_path, text), "--form", form)
    assert code == 1
    assert [d["code"] for d in found["diagnostics"]] == ["E607"]


BODY = """\
model body {
  param J1 = 1 kg.m^2
  param J2 = 2 kg.m^2
  param J3 = 3 kg.m^2
  coord e0: rotation = 1
  coord e1, e2, e3: rotation = 0
  let w1 = 2*(-e1*e0' + e0*e1' + e3*e2' - e2*e3')
  let w2 = 2*(-e2*e0' - e3*e1' + e0*e2' + e1*e3')
  let w3 = 2*(-e3*e0' + e2*e1' - e1*e2' + e0*e3')
  energy T* = 1/2*J1*w1^2 + 1/2*J2*w2^2 + 1/2*J3*w3^2
  phi unit: e0^2 + e1^2 + e2^2 + e3^2 = 1
}
"""


def test_a_solution_that_nobody_reads_is_refused(tmp_path, capsys, monkeypatch):
    """Minutes and megabytes otherwise; here sooner than by default, for the sake of the test's own time."""
    monkeypatch.setattr(matrices, "LONGEST", 250)
    code, found = run_json(capsys, "equations", write(tmp_path, BODY), "--form", "underlying")
    assert code == 1
    assert "more than 250 operations" in found["diagnostics"][-1]["message"]
    assert "--form matrices" in found["diagnostics"][-1]["message"]


def test_a_circuit_has_no_underlying_equation(capsys):
    code, found = run_json(capsys, "equations", str(SEED / "lead_filter.sd"), "--form", "underlying")
    assert code == 1
    assert found["diagnostics"][0]["code"] == "E607"


# -- Paynter's diagram, Tables 2.4 to 2.10 -----------------------------------------------------------------------------


def test_elements_have_their_state_functions_side_by_side(capsys):
    assert printed(capsys, "lead_filter", "--form", "elements").splitlines() == [
        "e_r1 = R1 f_r1    e-f", "D_r1 = 1/2 R1 f_r1^2    e-f", "G_r1 = e_r1^2/(2 R1)    e-f",
        " q_c = C e_c    q-e", " V_c = q_c^2/(2 C)    q-e", "V*_c = 1/2 C e_c^2    q-e",
        "e_r2 = R2 f_r2    e-f", "D_r2 = 1/2 R2 f_r2^2    e-f", "G_r2 = e_r2^2/(2 R2)    e-f",
    ]  # fmt: skip
    found = run_json(capsys, "equations", str(SEED / "dc_motor.sd"), "--form", "elements")[1]["result"]["equations"]
    assert [e["text"] for e in found if "coil (p-f)" in e["label"]] == [
        "p_coil = L1 f_coil, p-f", "T*_coil = 1/2 L1 f_coil^2, p-f", "T_coil = p_coil^2/(2 L1), p-f",
    ]  # fmt: skip
    assert run(["equations", str(SEED / "pendulum.sd"), "--form", "elements", "--quiet"]) == 1  # no elements


def test_a_law_that_is_not_linear_has_its_content_by_the_legendre_transform(capsys):
    """D + G = e f at the diode's law, dD/df = e and dG/de = f (Legendre), at numbers."""
    with ex.fresh():
        _, prepared = compiled(Request(str(SEED / "diode_circuit.sd"), backend="numpy"), Report())
        found = {e.left[0].expression.data: e for e in elements(Algebra(Order()), prepared.network)}
        values = {ex.param("Is"): 0.3, ex.param("a"): 1.7, ex.param("e_diode"): 0.8}
        of = lambda name: evaluate(  # noqa: E731
            [ex.add(*(t.expression for t in found[name].right))], values.__getitem__
        )[0]
        values[ex.param("f_diode")] = of("f_diode")
        assert of("D_diode") + of("G_diode") == pytest.approx(0.8 * values[ex.param("f_diode")], rel=1e-14)
        g = ex.add(*(t.expression for t in found["G_diode"].right))
        slope = evaluate([derivative(g, ex.param("e_diode"))], values.__getitem__)[0]
        assert slope == pytest.approx(values[ex.param("f_diode")], rel=1e-14)


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian"])
@pytest.mark.parametrize("name", ["slider_crank", "two_link_arm", "dc_motor", "solenoid", "lcr_nonlinear"])
@pytest.mark.one_in(4)
def test_efforts_by_class_add_up_to_the_balance(name, formulation):
    """(2.10): inertial, potential, dissipative, source, implicit and constraint efforts against the balances' rows."""
    with ex.fresh():
        made = model(name, formulation)
        if made is None:
            return
        sums = {}
        for e in classes(Algebra(Order()), made.energies, made.form):
            sums.setdefault(e.owner, []).extend(t.expression for t in e.right)
        rows = {row.owner: row.expression for row in rows_of(made.form, "dynamics")}
        known = Values(5)
        for f in (f for f in made.form.families if f.kind == "p"):  # T(p, q) and T*(f, q) say the same at p = dT*/df
            own = ex.var(f.owner, "p")
            if (value := known.of(momentum(made.energies, own))) != 0.0:
                known.known[own] = -value if formulation.startswith("co_") else value
        assert set(sums) <= set(rows)
        for owner, row in rows.items():
            parts = sums.get(owner, [ex.const(0.0)])
            size = sum(abs(known.of(t)) for t in parts) + 1e-300
            assert sum(known.of(t) for t in parts) == pytest.approx(-known.of(row), abs=1e-11 * size), owner


SLIPS = """\
from std.mechanical import coulomb
model puck {
  param sigma_1 = 0.5 N
  coord x: translation = 0 m
  coord y: translation = 0 m
  coord z: translation = 0 m
  energy T* = 1/2*(1 kg)*(x'^2 + y'^2 + z'^2)
  content D = sigma_1*hypot(x', y')
  F: coulomb(Fc = 1 N) z -> ground
}
"""


def test_senses_and_directions_of_friction_are_letters(tmp_path, capsys):
    """sigma and n, numbered behind those of the text, and what they are of; no name of the compiler is printed."""
    code, found = run_json(capsys, "equations", write(tmp_path, SLIPS))
    assert code == 0
    result = found["result"]
    assert [(s["symbol"], s["of"], s["line"]) for s in result["senses"]][1:] == [
        ("σ3", "sense of content of line 8 (1)", 8),
        ("n1", "direction of content of line 8 (1)", 8),
    ]
    lines = [line["text"] + line["latex"] for line in (*result["functions"], *result["equations"])]
    assert not any("content" in text or "direction" in text or "sticking" in text for text in lines)
    balance = next(line["text"] for line in result["equations"] if line["text"].startswith("f_x'"))
    assert "σ1 σ3 (n1_1 + f_x)" in balance
    assert run(["equations", write(tmp_path, SLIPS), "--quiet"]) == 0
    assert "σ3, sense of content of line 8 (1), line 8\n" in capsys.readouterr().out


def test_a_page_sets_senses_and_directions_as_letters(tmp_path, capsys):
    assert run(["equations", write(tmp_path, SLIPS), "--html", "--quiet"]) == 0
    page = capsys.readouterr().out
    assert "<msub><mi>n</mi><mrow><mi>content of line 8 (1)</mi><mo>,</mo><mn>2</mn></mrow></msub>" in page
    assert "<msub><mi>σ</mi><mi>F sticking</mi></msub>" in page
    assert "direction" not in page


CART = """model cart {
  param M = 2 kg
  param m = 0.5 kg
  param l = 0.8 m
  coord x: translation = 0 m
  coord th: rotation = 0.7 rad
  energy T* = 1/2*M*x'^2 + 1/2*m*(x'^2 + 2*l*cos(th)*x'*th' + l^2*th'^2)
  energy V = -m*g0*l*cos(th)
}
"""


def test_numbers_of_many_digits_stay_as_they_are_written(tmp_path, capsys):
    """(M + m) l th'' = ... - (M + m) g sin(th): no common denominator is made of the decimals of g."""
    path = write(tmp_path, CART)
    for form in ("underlying", "port_hamiltonian"):
        assert run(["equations", path, "--form", form, "--formulation", "lagrangian", "--quiet"]) == 0
        text = capsys.readouterr().out
        assert "9.80665" in text
        assert "e-05" not in text
        assert "20000" not in text
    assert "-m l sin(th) (f_x f_th - 9.80665)" in text


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


@pytest.mark.parametrize("asked", [[], ["--formulation", "auto"]])
def test_canonical_equations_choose_hamiltons_formulation(asked, tmp_path, capsys):
    """What README shows; 'auto' took Lagrange's, and refused (E607)."""
    model = write(tmp_path, PENDULUM)
    assert run(["equations", model, "--form", "canonical", "--json", *asked]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["result"]["formulation"] == "hamiltonian"
    assert run(["equations", model, "--form", "canonical", "--formulation", "lagrangian"]) == 1


def test_a_model_with_several_scenes_has_its_own_equations(tmp_path, capsys):
    path = tmp_path / "m.sd"
    path.write_text(
        "model m { coord x: translation = 1 m; energy T* = 1/2*(2 kg)*x'^2; energy V = 1/2*(8 N/m)*x^2 }\n"
        "scene a of m { time 0 s to 1 s; trace x }\nscene b of m { time 0 s to 2 s; trace x }\n"
    )
    assert run(["equations", str(path)]) == 0
    several = capsys.readouterr().out
    assert run(["equations", str(path), "--scene", "a"]) == 0
    assert several == capsys.readouterr().out
    assert run(["equilibrium", str(path)]) == 0
    assert "x = 0 m" in capsys.readouterr().out
