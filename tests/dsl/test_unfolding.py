"""Texts that unfold to more than they are: each is refused with its place before memory, patience or the stack ends."""

import pytest
from sysdyn.cli.main import run
from sysdyn.dsl.model import budget
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.expression_text import LONGEST, to_text

HEAD = "model m {\n  coord x: translation = 1 m\n  energy T* = 1/2*(1 kg)*x'^2\n"
BOXES = "component c0 {\n  param a = 2\n}\n" + "".join(
    f"component c{k} {{\n  in_: c{k - 1}()\n}}\n" for k in range(1, 3000)
)
UNFOLDING = {
    "lets": (
        HEAD
        + "  let a0 = 1 N\n"
        + "".join(f"  let a{k} = a{k - 1}*1.5\n" for k in range(1, 20_000))
        + "  work a19999 on x\n}\n",
        "E119: definitions are within each other more than 1000 deep",
    ),
    "deep expressions in lets": (
        HEAD
        + "  let a0 = 1\n"
        + "".join(f"  let a{k} = {'min(3, ' * 150}a{k - 1}{')' * 150}\n" for k in range(1, 300))
        + "  work (1 N)*a299 on x\n}\n",
        "E119: definitions, expressions and components are within each other more than 1000 deep",
    ),
    "components": (BOXES + HEAD + "  box: c2999()\n}\n", "E119: components are within each other more than 1000 deep"),
    "components that no model has": (BOXES, "E119: components that no model uses: more than the 100000 pieces"),
    "a function of a function": (
        "fn f(u: 1) -> 1 = sin(u)*cos(u)\n" + HEAD + f"  energy V = (1 J)*{'f(' * 40}x/(1 m){')' * 40}\n}}\n",
        "E119: its expressions: more than the 100000 pieces, and 4 a character, that a text may unfold to",
    ),
    "an infinite exponent": (
        HEAD + "  energy V = (1 J)*(x/(1 m))^inf\n}\n",
        "E204: the exponent is inf: beyond all numbers",
    ),
    "an exponent that overflows": (HEAD + "  let y = (x/(1 m))^(1e300*1e300)\n}\n", "E204: the exponent is inf"),
    "a product over a range that is differentiated": (
        "model m {\n  coord x: translation = 1 m\n  coord w[1..2]: translation = 1 m\n"
        "  energy T* = (1 kg)*x'^2 + sum(i in 1..2: (1 kg)*w[i]'^2)\n"
        "  phi a: x >= (1 m)*prod(i in 1..2: w[i]/(1 m))\n}\n",
        "E608: the derivative of prod(... in ...) is not supported yet",
    ),
    "an array without its index": (
        "model m {\n  coord x[1..2]: translation = 0 m\n  energy T* = sum(i in 1..2: (1 kg)*x[i]'^2)\n"
        "  expect always: x.f <= 1 m/s\n}\n",
        "E805: 'x' has 1 index, 0 given",
    ),
}


@pytest.mark.parametrize("kind", UNFOLDING)
@pytest.mark.one_in(3)
def test_a_text_that_unfolds_without_end_has_a_finding(kind, tmp_path, capsys):
    text, message = UNFOLDING[kind]
    path = tmp_path / "m.sd"
    path.write_text(text)
    assert run(["check", str(path)]) == 1
    said = capsys.readouterr().err
    assert message in said
    assert " --> " in said


@pytest.mark.long
def test_a_chain_that_people_write_is_taken(tmp_path):
    path = tmp_path / "m.sd"
    chain = "".join(f"  let a{k} = a{k - 1}*1.01\n" for k in range(1, budget.DEEPEST - 5))
    path.write_text(HEAD + "  let a0 = 1 N\n" + chain + f"  work a{budget.DEEPEST - 6} on x\n}}\n")
    assert run(["check", "--quiet", str(path)]) == 0


def test_exponents_that_multiply_to_more_than_a_number_stay_powers():
    x = ex.var("x", "q")
    once = ex.power(x, ex.const(1e200))
    assert ex.power(once, ex.const(1e200)).op == "pow"
    assert ex.power(ex.power(x, ex.const(2.0)), ex.const(3.0)) is ex.power(x, ex.const(6.0))


def test_the_text_of_shared_parts_does_not_double_with_each():
    node = ex.var("x", "q")
    for _ in range(60):
        node = ex.add(node, ex.power(node, ex.const(2.0)))
    assert LONGEST < len(to_text(node)) < LONGEST + 10


@pytest.mark.parametrize("body", ["", "  param a = 1\n"])
@pytest.mark.parametrize("command", ["simulate", "verify", "report"])
@pytest.mark.one_in(2)
def test_a_model_with_nothing_in_it_has_nothing_to_run(body, command, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.sd").write_text(f"model m {{\n{body}}}\nscene s of m {{\n  time 0 s to 1 s\n}}\n")
    assert run(["check", "--quiet", "m.sd"]) == 0
    code = run([command, "m.sd", *(["-o", "m.html"] if command == "report" else [])])
    assert code == 1
    assert "E607: nothing is unknown in the model, and nothing is traced" in capsys.readouterr().err


@pytest.mark.parametrize("method", ["bdf", "radau", "dopri", "energy"])
def test_what_is_traced_of_no_unknowns_runs_by_every_method(method, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.sd").write_text(
        "model m {\n  let y = sin(t/(1 s))\n}\nscene s of m {\n  time 0 s to 1 s\n  trace y\n}\n"
    )
    assert run(["simulate", "m.sd", "--quiet", "--backend", "numpy", "--method", method]) == 0
