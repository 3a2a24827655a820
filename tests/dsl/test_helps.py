"""What is told to write where a number, a condition or an array is not what is wanted there."""

import pytest
from sysdyn.api import check

MODEL = """
table f(x: 1) -> 1 linear clamp [ (0, 1), (1, 2) ]
model m {
  param a[1..3] = [1 m, 2 m, 3 m]
  coord x: translation = 1 m
  energy T* = 1/2*(1 kg)*x'^2
  discrete k[1..2] = 0
  LINE
}
"""


@pytest.mark.parametrize(
    ("line", "code", "help_"),
    [
        ("let y = a + 1", "E203", "arrays of one size are added; an element of one is a[1]"),
        ("let y = a > a", "E203", "an element of one: a[1] < b[1]"),
        ("let y = (x > 0 m) + 1", "E203", "if x > 0 m then 1 else 0"),
        ("let y = if x then 1 else 2", "E203", "x > 0 m, or another comparison"),
        ("let y = if a then 1 else 2", "E203", "compare it"),
        ("let y = if x > 1 then 1 else 2", "E203", "write '1 m'"),
        ("let y = if x > 0 m then x else 3", "E203", "write '3 m'"),
        (
            "let y = [[1, 2], [3, 4]]",
            "E203",
            "one row of values: [1, 2, 3]; of several indices one value for all, and --set M[1,2]=3",
        ),
        ("let y = f(x)", "E206", "x/(1 m)"),
        ("let y = min(x, 3)", "E206", "write '3 m'"),
        ("let y = min(x, t)", "E206", "both in m"),
        (
            "energy T* = 1/2 kg*x'^2",
            "E208",
            "'1/2 kg' divides by 2 kg; '(1/2)*1 kg' is that part of a unit",
        ),
        (
            "param N = 2 kg; energy T* = 1/2 N*x'^2",
            "E208",
            "'1/2 N' divides by 2 N; '1/2*N' multiplies by the variable N",
        ),
        (
            "let y = 1/12 A/V^3*(1 V)^4 - 1/2 A/V*(1 V)^2",
            "E203",
            "'1/2 A/V' divides by 2 A/V; '(1/2)*1 A/V' is that part of a unit",
        ),
        (
            "param V = 2 m^3; let y = 3 kg/V + 2 kg/m^3",  # s^3.A/m^2 by volts
            "E203",
            "'3 kg / V' divides by the variable V: in '3 kg/V' it is the unit",
        ),
        (
            "state V: m/s = 1 m/s; dynamic V' = 4 m^2/s^3/V*2 + 2 m/s^2",
            "E203",
            "'4 m^2/s^3 / V' divides by the variable V: in '4 m^2/s^3/V' it is the unit",
        ),
        ("param V = 2 m^3; let y = 3 kg/V + 2 s", "E203", "write '2 s^3.A/m^2'"),  # by neither it fits
        ("param p = 0x10 kg", "E114", "16: numbers are written in digits of ten"),
        ("param p = 1_000 kg", "E114", "1000: digits stand together"),
        ("param p = 1_000 kg/m", "E114", "1000: digits stand together"),
        ("work 10 N/m on x", "E208", "write '10 N'"),  # no joules: what is wanted is an effort
        ("k[1] := 3; let z = 2", "E113", "when CONDITION { k[1] := 3 }, or every 10 ms { k[1] := 3 }"),
    ],
)
def test_one_finding_with_what_to_write(line, code, help_):
    found = check(MODEL.replace("LINE", line))
    assert [(d.code, d.help) for d in found] == [(code, help_)]


def test_a_name_of_the_file_that_hides_one_of_the_language_is_told():
    own = "unit l = 2 m\nconst g0 = 1.62 m/s^2\nfn sin(x: 1) -> 1 = 7*x\nconst own = 1\n"
    found = check(own + MODEL.replace("LINE", "let y = sin(own)*1 l*g0"))
    assert [(d.code, d.place.start[0]) for d in found] == [("N102", 1), ("N102", 2), ("N102", 3)]


def test_a_quantity_of_a_component_of_several_ends_is_that_of_an_end():
    found = check("""
from std.fluid import relief_valve
model m {
  node p: hydraulic
  Q: flow(f = 0.2 l/s) ground -> p
  V: relief_valve(opens = 50 bar, R = 1e9 Pa.s/m^3) a = p, b = ground
}
scene s of m { time 0 s to 1 s; trace V.f }
""")
    assert [(d.code, d.help) for d in found] == [("E102", "V.a.f or V.b.f; of an element inside, V.poppet.f")]


@pytest.mark.parametrize(
    ("law", "content", "line"),
    [
        ("law e = 2 ohm*f - 5 V", "content D = 1 ohm*f^2 - 5 V*f", "content D = ... (int e df)"),
        ("law f = 2 S*e - 5 A", "content G = 1 S*e^2 - 5 A*e", "content G = ... (int f de)"),
    ],
)
def test_an_element_that_delivers_power_is_led_to_its_content(law, content, line):
    text = f"component cell {{ branch: electrical; {law} }}\nmodel m {{ node a: electrical; B: cell() a -> ground\n"
    text += "  R: dissipator(e = 10 ohm*f) a -> ground }\n"
    (active,) = check(text)
    assert (active.code, active.help[-len(line) :]) == ("E313", line)
    assert [d for d in check(text.replace(law, content)) if d.severity != "note"] == []


@pytest.mark.parametrize(
    ("given", "help_"),
    [
        ("inp = x -> ground", "inp = x: a port is one node"),
        ("in_ = x -> ground", "nearest: 'inp'"),
        ("foo = x -> ground", "it has inp, out"),
    ],
)
def test_a_port_that_is_given_two_ends(given, help_):
    text = "from std.mechanical import gear\nmodel m {\n  node x, y: rotation\n  A: gear(ratio = 2) %s, out = y\n}\n"
    found = next(d for d in check(text % given) if d.severity == "error")
    assert (found.code, found.help) == ("E407", help_)
