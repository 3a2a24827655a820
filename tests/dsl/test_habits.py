"""Remedies are right: what is suggested for units and words of other places is what is written here."""

import re

import pytest
from sysdyn.dsl import load
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model import unit_habits, units
from sysdyn.dsl.text.diagnostics import Report, SourceText

MODEL = """from std.mechanical import mass

model m {{
{lines}
  coord x: translation = 1 m
  energy T* = 1/2*(1 kg)*x'^2
}}
"""


def findings(*lines):
    """(code, message, help) of a model with these lines, names and units judged."""
    report = Report()
    source = SourceText("m.sd", MODEL.format(lines="\n".join(f"  {line}" for line in lines)))
    document = load.document(source, report)
    with ex.fresh():
        for model in document.models.values():
            load.network(document, model, None, report, required=False)
    return [(d.code, d.message, d.help) for d in report if d.severity == "error"]


UNITS = {
    "Nm": "N.m", "kNm": "kN.m", "Nms": "N.m.s", "Ns/m": "N.s/m", "m/s²": "m/s^2", "m³": "m^3", "N/mm²": "N/mm^2",
    "Ohm": "ohm", "kOhm": "kohm", "MOhm": "Mohm", "Ω": "ohm", "kΩ": "kohm", "kgm^2": "kg.m^2", "kgm²/s": "kg.m^2/s",
    "sec": "s", "m/sec": "m/s", "rad/sec": "rad/s", "Volt": "V", "Volts": "V", "hz": "Hz", "KHz": "kHz", "RPM": "rpm",
    "Kg": "kg", "KN": "kN", "Ah": "A.h", "mAh": "mA.h", "Vs": "V.s", "Pas": "Pa.s", "J/kgK": "J/kg/K", "L": "l",
    "W/m²K": "W/m^2/K", "m2": "m^2", "m3/s": "m^3/s", "degrees": "deg", "kmh": "km/h", "Newton": "N", "milliamps": "mA",
    "rev/min": "turn/min", "litres": "l", "watts": "W", "hours": "h", "kelvin": "K", "bars": "bar",
}  # fmt: skip


@pytest.mark.parametrize(("wrong", "right"), UNITS.items())
def test_a_unit_is_rewritten(wrong, right):
    ((code, _, help_),) = findings(f"param k = 5 {wrong}")
    assert code == "E201"
    assert help_ == f"write '{right}'"
    assert findings(f"param k = 5 {right}") == []


@pytest.mark.parametrize("word", ["float", "foo", "xyz", "mhz", "q", "unit"])
def test_what_is_no_unit_is_not_made_one(word):
    assert unit_habits.correct_spelling(word) is None


@pytest.mark.parametrize("name", units.names())
def test_right_units_are_left_alone(name):
    assert unit_habits.correct_spelling(name) is None
    assert unit_habits.correct_spelling(f"{name}^2/s") is None


@pytest.mark.parametrize("name", unit_habits.OTHER_SYSTEMS)
def test_units_of_other_systems_can_be_declared_as_said(name):
    line = unit_habits.declaration(name)
    report = Report()
    document = load.document(SourceText("m.sd", f"{line}\nmodel m {{ param a = 3 {name} }}\n"), report)
    with ex.fresh():
        network = load.network(document, document.models["m"], None, report)
    assert not report.failed
    assert network is not None


def test_measures_of_other_systems():
    """Against the definitions of the international yard and pound, and of horsepower."""
    pound, inch, foot = 0.45359237, 0.0254, 0.3048
    values = {"lbf": pound * 9.80665, "psi": pound * 9.80665 / inch**2, "hp": 550 * foot * pound * 9.80665}
    values |= {"gpm": 231 * inch**3 / 60, "slug": pound * 9.80665 / foot, "ps": 75 * 9.80665, "btu": 1055.05585262}
    for name, value in values.items():
        number, unit = unit_habits.OTHER_SYSTEMS[name].split()
        scale = 1.0
        for sign, factor in re.findall(r"([./]?)([A-Za-z]+)", unit):
            scale = (
                scale / float(units.find_unit(factor)[1]) if sign == "/" else scale * float(units.find_unit(factor)[1])
            )
        assert float(number) * scale == pytest.approx(value, rel=1e-9)


SLIPS = [
    ("param d = 3 kN*s/m", "E101", "3 kN.s/m"),
    ("param J = 5 kg*m^2", "E104", "5 kg.m^2"),
    ("param k = 3 N m", "E113", "3 N.m"),
    ("param k = 3 N·m", "E113", "3 N.m"),
    ("param a = 3 m/s**2", "E113", "3 m/s^2"),
    ("param R = 10k", "E114", "10e3, or with its unit, as in '10 kohm'"),
    ("param C = 4u7", "E114", "4.7e-6"),
    ("param m = 3kg", "E114", "3 kg"),
    ("param M = 5Nm", "E114", "5 N.m"),
    ("let y = 2x", "E114", "2*x"),
    ("param k = 0,15 N/m", "E113", "0.15"),
    ("param k = 1,000 N/m", "E113", "1000"),
    ("param k = 5. N/m", "E113", "5.0"),
    ("param T = 20 °C", "E113", "celsius(20)"),
    ("let w = 2*PI", "E101", "pi"),
    ("let w = 2*time", "E101", "t"),
    ("let w = if True then 1 else 2", "E101", "true"),
    ("M: mass(m = 1 kg) x -> gnd", "E101", "ground"),
    ("M: mass(m = 1 kg) x -> 0", "E113", "ground"),
    ("work -(1 N.s/m)*der(x) on x", "E101", "x'"),
    ("let v = diff(x)", "E101", "x'"),
    ("let v = xdot", "E101", "x'"),
    ("let v = x_dot", "E101", "x'"),
    ("let v = dx", "E101", "x'"),
    ("let v = x.dot", "E102", "x'"),
    ("let y = pow(x, 2)", "E101", "x^2"),
    ("let y = log(2)", "E101", "ln"),
    ("let y = x**2", "E113", "a^b"),
    ("let y := x", "E113", "="),
    ("phi a: x == 1 m", "E111", "="),
    ("param k = 4 N/m // stiff", "E113", "#"),
    ("// stiff", "E113", "#"),
    ("param k = 4 N/m /* stiff */", "E113", "#"),
    ("let y = x > 0 m ? 3 : 4", "E113", "if c then a else b"),
    ("let y = 3 if x > 0 m else 4", "E113", "if c then a else b"),
    ("let y = (x if x > 0 m else 2*x)", "E113", "if c then a else b"),
    ("let y = sin(2*pi*50 Hz t)", "E113", "write '50 Hz*t'"),
    ("let y = (2*x)²", "E113", "^2"),
    ("node q1: mechanical", "E202", "'translation' or 'rotation'"),
    ("let y = 2*x(t)", "E101", "x"),
    ("param k = 2; let y = k(x + 1 m)", "E101", "k*(x + 1 m)"),
    ("let y = x^2 m", "E204", "^2*m; '2 m' is a quantity"),
    ("let y = 1/2*(4 N/m)x", "E113", ")*x"),
    ("R1 a b 1k", "E113", "R1: resistor(R = 1 kohm) a -> b"),
    ("C7 out 0 10u", "E113", "C7: capacitor(C = 1 uF) out -> ground"),
    ("assert(x > 0 m)", "E113", "require"),
    ("der(x) = 3 m/s", "E113", "dynamic x'"),
    ("R1: resistor(R = 1 ohm) x", "E101", "from std.electrical import resistor"),
    ("R1: resitor(R = 1 ohm) x", "E101", "from std.electrical import resistor"),
]


@pytest.mark.parametrize(("line", "code", "said"), SLIPS, ids=[s[0] for s in SLIPS])
def test_a_habit_of_elsewhere_meets_one_finding_that_says_what_to_write(line, code, said):
    found = findings(line)
    assert [c for c, _, _ in found] == [code]
    assert said in (found[0][2] or "")


BARE = [
    (("energy V = 1/2*k*x^2",), "param k = 4 N/m"),
    (("work -k*x on x",), "param k = 4 N/m"),
    (("work 3 N - k*x on x",), "param k = 4 N/m"),
    (("work -k*x' on x",), "param k = 4 N.s/m"),
    (("energy T* = 1/2*k*x'^2",), "param k = 4 kg"),
    (("phi a: k*x = 3 N",), "param k = 4 N/m"),
    (("K: potential(e = k*q) x -> ground",), "param k = 4 N/m"),
    (("state s: m = 0 m", "dynamic s' = k*(x - s)"), "param k = 4 s^-1"),
]


@pytest.mark.parametrize(("lines", "said"), BARE, ids=[b[0][-1] for b in BARE])
def test_a_bare_number_where_a_unit_is_wanted(lines, said):
    ((code, _, help_),) = findings("param k = 4", *lines)
    assert code in ("E203", "E208")
    assert help_.endswith(said)
    assert findings(said, *lines) == []


def test_a_size_is_not_asked_for_a_unit():
    ((_, _, help_),) = findings("param n = 2", "param a[1..n] = [1 N, 2 N]", "energy V = n*x^2")
    assert help_ == "a factor in N/m is missing"


def test_another_module_has_it():
    report = Report()
    load_text = "from std.mechanical import resistor\nmodel m { param a = 1 }\n"
    document = load.document(SourceText("m.sd", load_text), report)
    with ex.fresh():
        load.network(document, document.models["m"], None, report)
    ((code, help_),) = [(d.code, d.help) for d in report]
    assert (code, help_) == ("E103", "from std.electrical import resistor")


PRIMES = [
    (("param d = 3 N.s/m", "work -d*x on x"), "x' in place of x?"),
    (("param k = 3 N/m", "work -k*x' on x"), "x in place of x'?"),
    (("param d = 3 N.s/m", "param k = 3 N/m", "work -k*x - d*x on x"), "x' in place of x?"),
    (("energy T* = 1/2*(3 kg)*x^2",), "x' in place of x?"),
    (("energy V = 1/2*(3 N/m)*x'^2",), "x in place of x'?"),
    (("coord y: translation = 0 m", "psi tie: x' = 2*y"), "y' in place of y?"),
]


@pytest.mark.parametrize(("lines", "said"), PRIMES, ids=[p[0][-1] for p in PRIMES])
def test_a_forgotten_prime(lines, said):
    ((code, _, help_),) = findings(*lines)
    assert code in ("E203", "E208")
    assert help_ == said
