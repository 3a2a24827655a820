"""What newcomers from other tools write: one error with a remedy; what the remedy says is right, and runs."""

import pytest
from bases import BASES
from sysdyn.api import Trace, check
from sysdyn.cli.main import run

RA = "Ra: resistor(R = R1) a -> b"
PORTS = "p = a, n = ground, shaft = shaft"
CASES = [
    # base, the right text, the slip, code, what the help holds, what follows the help
    ("cart", "coord x: translation = 0.1 m", "translation x = 0.1 m", "E113", "coord x: translation = 0.1 m", None),
    ("cart", "init x' = 0 m/s", "x' = 0 m/s", "E113", "init x' = ...", None),
    ("cart", "time 0 s to 2 s", "tspan 0 s to 2 s", "E113", "time 0 s to 5 s", "time 0 s to 5 s"),
    ("cart", "trace x in", "accuracy 1%\n  trace x in", "E113", "1 percent", "accuracy 1 percent\n  trace x in"),
    ("cart", "trace x in", "tolerance 1e-6\n  trace x in", "E113", "accuracy 1e-6", "accuracy 1e-6\n  trace x in"),
    ("cart", "trace x in", "method radau\n  trace x in", "E113", "solver radau", "solver radau\n  trace x in"),
    ("cart", "set push = 1 N", "input push = 1 N", "E107", "set push = ...", None),
    ("cart", "set push = 1 N", "set x = 1 m", "E910", "init x = ...", "init x = 1 m"),
    ("cart", "energy T* = 1/2*m*x'^2", "m*x'' = -k*x - d*x' + push", "E113", "energy T* = 1/2*m*x'^2", None),
    ("cart", "energy T* = 1/2*m*x'^2\n", "", "E903", "x lacks an inertia: energy T* = 1/2*m*x'^2", None),
    ("cart", "param d = 3 N.s/m", "param d: 3 N.s/m", "E113", "a value stands behind '='", None),
    ("cart", "param m = 2 kg", "param m", "E207", "param m = 3 N/m, or param m: N/m", None),
    ("cart", "x in mm, x' as v", "x; x'", "E113", "joined by commas: trace x, x'", "x, x'"),
    ("cart", "x in mm, x' as v", "cart.x", "E102", "x", "x"),
    ("cart", "x in mm, x' as v", "T as E", "E905", "audit.kinetic", "audit.kinetic as E"),
    ("cart", "every 10 ms", "every 100 Hz", "E208", "every 1/(100 Hz)", "every 1/(100 Hz)"),
    ("cart", "abs(audit.energy) <= 1 mJ", "x = 0 m within 1 m", "E113", "==", "x == 0 m within 1 m"),
    ("cart", "scene free of cart {", "scene free of cart", "E113", "{ ... }", None),
    ("cart", "scene free of cart {", "scene free of cart\n{", "E109", "the '{' at the end of the line above", None),
    ("cart", "model cart {", "model cart\n# a remark\n{", "E109", "the '{' at the end of the line above", None),
    ("filter", RA, "Ra: resistor(R = R1) a => b", "E113", "a -> b", None),
    ("filter", RA, "Ra: resistor(R = R1) b <- a", "E113", "a -> b", None),
    ("filter", RA, "Ra: resistor(R = R1) p = a, n = b", "E407", "a -> b", None),
    ("filter", RA, "Ra: resistor(R: R1) a -> b", "E113", "resistor(R = ...)", None),
    ("filter", RA, "Ra: resistor R = R1 a -> b", "E113", "resistor(R = R1) a -> ...", None),
    ("filter", RA, "Ra: resistor{R = R1} a -> b", "E113", "resistor(name = value)", None),
    ("filter", RA, "resistor(R = R1) a -> b", "E113", "R1: resistor(...)", None),
    ("filter", RA, "Ra: resistor(R = 1 k) a -> b", "E201", "1 kohm", "Ra: resistor(R = 1 kohm) a -> b"),
    ("filter", RA, "Ra: resistor(R = 1 Meg) a -> b", "E201", "1 Mohm", "Ra: resistor(R = 1 Mohm) a -> b"),
    ("filter", "2*pi*50 Hz*t", "50 Hz", "E205", "sin(2*pi*50 Hz*t)", None),
    ("filter", "2*pi", "2 pi", "E201", "2*pi", None),
    ("filter", "5 V*sin", "5 V sin", "E113", "factors are joined by '*'", None),
    ("filter", "b.e as out", "db(b.e/(1 V)) as out", "E101", "20*log10(x)", "20*log10(abs(b.e)/(1 V) + 1) as out"),
    ("filter", "init Cb.e = 0 V", "init b.e = 1 V; init Cb.e = 0 V", "E903", "'~'", "init b.e ~ 1 V; init Cb.e = 0 V"),
    ("pendulum", "phi rod: x^2", "phi: x^2", "E113", "phi name: ... = ...", None),
    ("pendulum", "phi rod: x^2", "let x^2", "E113", "phi name: ... = ...", None),
    ("pendulum", "phi rod: x^2", "gamma rod: x^2", "E102", "phi rod: ...", None),
    ("drive", PORTS, "p[1] = a, n = ground, shaft = shaft", "E113", "a port is given whole", None),
    ("drive", PORTS, "p -> a, n -> ground, shaft -> shaft", "E402", PORTS, None),
    ("drive", PORTS, "p = a, n = ground, shaft", "E402", "shaft = shaft", None),
    ("drive", "shaft.f in rpm", "shaft.w in rpm", "E102", "shaft.f", None),
    ("drive", "shaft.f in rpm", "M.shaft in rpm", "E104", "M.shaft.f", "M.shaft.f in rpm"),
    ("line", "v[0..n]: electrical", "v[0:n]: electrical", "E113", "0..n", None),
    ("line", "v[i - 1] -> v[i]", "v(i - 1) -> v(i)", "E113", "v[...]", None),
    ("line", "v[n].e as far", "v.e as far", "E805", "v[i]", "v[2].e as far"),
    ("oven", "every 1 min {", "every 0.1 Hz {", "E703", "every 1/(0.1 Hz) {", "every 1/(0.1 Hz) {"),
    ("oven", "on := false }", "T := 300 }", "E208", "300 K", "T := 300 K }"),
    ("oven", "on := false }", "on := false, T := 300 K }", "E113", "';'", "on := false; T := 300 K }"),
    ("oven", "dynamic T'", "dynamic T", "E508", "dynamic T' = ...", None),
    ("oven", "when T >= celsius(50) {", "if T >= celsius(50) {", "E113", "when c { a := b }", None),
    ("oven", "r = target, y = T", "target, T", "E402", "r = target, y = T", None),
    ("parts", "  port p, n: electrical", "  node p, n: electrical", "E407", "port p: electrical in component", None),
    ("parts", "set B.U", "set battery.U", "E910", "B.U", None),
    ("parts", "fn square(u: 1)", "fn square(u)", "E113", "fn f(x: m) -> N", None),
    ("parts", "  law e = R*f", "  e = R*f", "E113", "law e = ...", None),
    ("parts", "curve(L.f)", "curve", "E104", "curve(i)", None),
    ("ball", "h >= 0 m", "h > 0 m", "E113", ">=", None),
    ("ball", "restitution 0.7", "restitution = 0.7", "E113", "restitution 0.7, without a sign", None),
    ("ball", "restitution 0.7", ", restitution 0.7", "E113", "without a comma", None),
    ("tanks", "water.e in degC", "water.e in C", "E208", "in degC", None),
    ("tanks", "water.e in degC", "water.T in degC", "E102", "water.e", None),
]


def findings(text):
    return [d for d in check(text) if d.severity != "note"]


@pytest.mark.parametrize(
    ("base", "old", "wrong", "code", "help_", "right"), CASES, ids=[f"{c[0]}: {c[2]!r}" for c in CASES]
)
@pytest.mark.one_in(30)
def test_one_error_at_its_line_and_its_remedy(base, old, wrong, code, help_, right):
    whole = BASES[base]
    assert old in whole
    (found,) = findings(whole.replace(old, wrong, 1))
    assert (found.code, help_ in found.help) == (code, True), (found.code, found.message, found.help)
    assert findings(whole.replace(old, right or old, 1)) == []


FOLLOWED = [c for c in CASES if c[5]]


@pytest.mark.parametrize("case", FOLLOWED, ids=[f"{c[0]}: {c[5]!r}" for c in FOLLOWED])
@pytest.mark.long
def test_a_model_that_follows_the_remedy_runs(case, tmp_path, capsys):
    base, old, *_, right = case
    (tmp_path / "m.sd").write_text(BASES[base].replace(old, right, 1))
    assert run(["simulate", str(tmp_path / "m.sd"), "-o", str(tmp_path / "t.h5")]) == 0, capsys.readouterr().err
    assert Trace.open(tmp_path / "t.h5").met
