"""Texts that the language's page refuses: each slip is told once, with its code, place and remedy."""

import numpy as np
import pytest
from sysdyn.api import check, simulate
from sysdyn.cli.main import run
from sysdyn.cli.run.start import starting
from sysdyn.runtime.model.failures import InconsistentStart

RATCHET = """model z {{
  node a, b: rotation
  A: kinetic(p = 1 kg.m^2*f) a
  B: kinetic(p = 2 kg.m^2*f) b
  C: dissipator(e = 1 N.m*setsign(f)) a
  R: ratchet() a -> b
  init A.f = -1 rad/s
  {0}
}}
component ratchet {{ branch: rotation; psi one_way: f >= 0 rad/s }}
"""
REFUSED = {
    "a product in parentheses is no unit": (
        "model a {\n let x = 30 N/(m.s^2)*3\n}\n",
        ("E101", 2, "'m'", "30 N/m/s^2: a unit has no parentheses: '.' multiplies, '/' divides the next factor only"),
    ),
    "nor with a space in it": ("model a {\n let x = 30 W/(m K)\n}\n", ("E113", 2, "no parentheses", "'30 W/m/K'")),
    "nor behind a colon": ("model a {\n param x: N.m/(rad/s)\n}\n", ("E113", 2, "no parentheses", "'N.m.s/rad'")),
    "ground has no value": (
        "model a { node x: electrical\n R: dissipator(e = 1 ohm*f) x\n S: effort(e = 1 V) x\n"
        " let u = x.e - ground.e }\n",
        ("E104", 4, "'ground' is not a value", "0: its"),
    ),
    "a branch is no node": (
        "component k { branch el: electrical\n R: dissipator(e = 1 ohm*f) el }\n"
        "model m { node a: electrical\n K: k() el = a -> ground\n S: effort(e = 1 V) a }\n",
        ("E407", 2, "'el' is no node", "on el.q"),
    ),
    "kelvins take no prefix": ("model m { let a = 3 mK }\n", ("E201", 1, "'mK'", "1e-3 K")),
    "what divides behind a unit is a variable": (
        "model z { param n = 3\n param c = 4 kJ/K/n }\n",
        ("E201", 2, "'n' is not a unit, in '4 kJ/K/n'", "'4 kJ/K / n'"),
    ),
    "unit variables that disagree": (
        "component c { param k: $u\n input u: $u\n output y = u + k }\nmodel z { K: c(k = 3 A) u = 3 V }\n",
        ("E209", 4, "is A by 'k' and V by 'u'", ""),
    ),
    "a level does not replace one pair of ends by two": (
        "component A { port a, b: electrical\n level grob default { R1: dissipator(e = 1 ohm*f) a -> b }\n"
        " level fein extends grob { R1: transformer(e1 = 3*e2) a -> b, b -> a } }\n"
        "model z { node n: electrical\n i: A() a = n, b = ground\n S: effort(e = 1 V) n }\n",
        ("E808", 3, "'R1'", "a new label"),
    ),
    "a traced quotient by zero": (
        "model z { param n = 0 kg\n param p = 2 N.s\n let x = p/n }\nscene s of z { time 0 s to 1 s; trace x }\n",
        ("E324", 4, "p/n, n = 0 kg", ""),
    ),
    "a bound is a whole number": (
        "model a {\n coord y[1..2.5]: translation = 0 m\n}\n",
        ("E805", 2, "a bound is 2.5", "an index within the bounds"),
    ),
    "a file of rows that is not there": (
        'table f(x: m) -> N linear file "nope.csv"\nmodel a { let y = f(1 m) }\n',
        ("E206", 1, "'nope.csv' cannot be read", "rows of numbers"),
    ),
    "a text is no value": ('model a {\n let y = "abc"\n}\n', ("E203", 2, "a text stands", "a number")),
    "what is fixed is named as it is written": (
        "model z {\n node a: electrical\n I: flow(f = 1 A) ground -> a\n L: kinetic(p = 1 H*f) a\n init L.f = 0 A\n}\n",
        ("E903", 3, "fixed initial values of 'L.f'", "free 'L.f'"),
    ),
    "an impact at the start": (
        "model z {\n coord h: translation = 0 m\n energy T* = 1/2*(1 kg)*h'^2\n phi floor: h >= 0 m\n"
        " init h' = -2 m/s\n}\n",
        ("E903", 4, "contradict floor", "the rate behind the impact"),
    ),
    "an input that is a condition": (
        "component s { port a: electrical\n input g: 1\n R: dissipator(e = (if g > 0.5 then 1 ohm else 2 ohm)*f) a }\n"
        "model z {\n node a: electrical\n S: s(g = t > 1 s) a = a\n C: potential(e = 1 V/C*q) a\n}\n",
        ("E203", 3, "'g' is a condition", "(if t > 1 s then 1 else 0)"),
    ),
    "a source whose ends are one": (
        "from std.electrical import voltage\nmodel z {\n node a: electrical\n V: voltage(v = 1 V) ground -> ground\n"
        " R: dissipator(e = 1 ohm*f) a\n C: potential(e = 1 V/C*q) a\n}\n",
        ("E411", 4, "both ends of the effort source V are one node", ""),
    ),
    "a value for an element": (
        "component c { port a: electrical\n param k: V/C\n C: potential(e = k*q) a }\nmodel z {\n node a: electrical\n"
        " K: c(k = 1 V/C) a = a\n R: dissipator(e = 1 ohm*f) a\n}\n"
        "scene s of z { time 0 s to 1 s; set K = 3 V/C; trace a.e }\n",
        ("E910", 9, "'K' is not a parameter", "set K.k = ..."),
    ),
    "a ratchet that begins backwards, beside friction": (
        RATCHET.format("init b.f = 0 rad/s"),
        ("E903", 10, "fixed initial values of 'A.f', 'b.f' contradict R", "free one of"),
    ),
    "ground is declared once": ("model z {\n node ground: electrical\n}\n", ("E108", 2, "'ground'", "")),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_slip_is_told_once_with_its_remedy(name):
    text, (code, line, said, remedy) = REFUSED[name]
    (found,) = [d for d in check(text) if d.severity == "error"]
    assert (found.code, found.place.start[0]) == (code, line)
    assert said in found.message
    assert remedy in (found.help or "")


def test_sets_that_ask_for_each_other_are_told_with_their_remedy(monkeypatch):
    """Where no point between them is found either (events/start.py)."""

    def asked(*_, **__):
        raise InconsistentStart("stuck", float("inf"), names=("R.one_way",))

    monkeypatch.setattr(starting, "eventful_start", asked)
    (found,) = [d for d in check(RATCHET.format("")) if d.severity == "error"]
    assert (found.code, found.place.start[0]) == ("E903", 10)
    assert "would let go at once, and hold" in found.message
    assert "initial values of all that it ties" in found.help


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian"])
def test_what_is_unsaid_behind_a_ratchet_begins_where_it_lets_go(tmp_path, formulation):
    """B is taken along to -1 rad/s at least, and not held there: the friction on A brakes it by 1 rad/s^2."""
    scene = "scene s of z { time 0 s to 0.5 s; trace A.f, B.f every 0.1 s }"
    (tmp_path / "z.sd").write_text(RATCHET.format("") + scene)
    trace = simulate(tmp_path / "z.sd", output=tmp_path / "t.h5", formulation=formulation)
    assert np.abs(trace["A.f"].values - (trace.time - 1.0)).max() < 1e-9
    assert np.abs(trace["B.f"].values + 1.0).max() < 1e-12


ENDLESS = "model z {{\n state x: 1 = 0\n dynamic x' = {rate}\n let y = {read}\n}}\n"
ENDLESS += "scene s of z {{ time 0 s to 1 s; trace y }}\n"
TABLE = "table k(x: 1) -> N pchip stop [ (0, 1), (0.5, 2), (0.75, 0) ]\n"


@pytest.mark.parametrize(
    ("text", "code", "since"),
    [
        (ENDLESS.format(rate="0 Hz", read="1/x"), "E920", 0.0),
        (TABLE + ENDLESS.format(rate="1 Hz", read="k(x)"), "E932", 0.75),
    ],
)
@pytest.mark.one_in(2)
def test_no_run_is_met_whose_trace_is_no_number(tmp_path, capsys, text, code, since):
    file = tmp_path / "m.sd"
    file.write_text(text)
    assert run(["simulate", str(file), "-o", str(tmp_path / "m.h5")]) == 3
    said = capsys.readouterr().err
    assert code in said
    assert float(said.partition("t = ")[2].split()[0]) == pytest.approx(since, abs=0.01)
