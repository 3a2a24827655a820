"""The forms of `sysdyn equations`: families, elements, efforts, senses; those that a model has not."""

import json
import re

import pytest
import sympy
from printed_equations import SEED, Values, model, printed
from sysdyn.cli.analysis.operating_point import compile_target
from sysdyn.cli.main import run
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.compiler.equations import matrices
from sysdyn.compiler.equations.algebra import Algebra
from sysdyn.compiler.equations.book import classes
from sysdyn.compiler.equations.elements import elements
from sysdyn.compiler.equations.matrices import rows_of
from sysdyn.compiler.equations.order import FactorOrder
from sysdyn.compiler.forms.momenta import momentum
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.calculus import derivative
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.text.diagnostics import Report
from texts import PENDULUM, run_json, write

ARRAYS = """
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
    assert run(["equations", str(write(tmp_path, ARRAYS)), "--quiet"]) == 0
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
    code, found = run_json(capsys, "equations", str(write(tmp_path, ARRAYS)), *options)
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


def test_a_sine_inside_a_sine_is_left_where_it_is():
    """It was a fault of sysdyn (exit 4): an angle that swings is no polynomial in the sine of its swing."""
    t = sympy.Symbol("t")
    inner, angle = sympy.sin(t), 3 * t + sympy.sin(t)
    value = inner * sympy.sin(angle) ** 2 + inner * sympy.cos(angle) ** 2
    assert matrices._sines_by_cosines(sympy, value) == inner


FAST = """\
model fast {
  param C = 1e-18 F
  node a, c: electrical
  E: effort(e = 1 mV*sin(2e13 rad/s*t)) a -> ground
  l: kinetic(p = 1 fH*f) a -> c
  k: potential(q = C*e) c -> ground
}
"""


@pytest.mark.parametrize("form", ["canonical", "matrices", "underlying"])
def test_a_fast_sine_is_not_sought_in_powers_of_a_slow_one(form, tmp_path, capsys):
    """The sine of 2e13 times an angle was, for more than a minute."""
    assert run(["equations", str(write(tmp_path, FAST)), "--form", form, "--quiet"]) == 0
    assert "sin(2e+13 t)" in capsys.readouterr().out


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
        _, prepared = compile_target(RunRequest(str(SEED / "diode_circuit.sd"), backend="numpy"), Report())
        found = {e.left[0].expression.data: e for e in elements(Algebra(FactorOrder()), prepared.network)}
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
@pytest.mark.one_in(9)
def test_efforts_by_class_add_up_to_the_balance(name, formulation):
    """(2.10): inertial, potential, dissipative, source, implicit and constraint efforts against the balances' rows."""
    with ex.fresh():
        made = model(name, formulation)
        if made is None:
            return
        sums = {}
        for e in classes(Algebra(FactorOrder()), made.energies, made.form):
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
