"""One slip, one error: what only follows from it is not told."""

import pytest
from sysdyn import api

BROKEN = """from std.electrical import resistor, voltage
from std.transduce import dc_motor

model m {{
  node a, b: electrical
  node w: rotation
  V: voltage(v = 1 V) a -> ground
  {}
}}
scene s of m {{
  time 0 s to 1 ms
  trace V.f
}}
"""
RESERVED = """model m {{
  state {0}: m = 1 m
  dynamic {0}' = -{0}/(1 s) + (if {0} > 0 m then 1 m/s else 2 m/s)
  let y = {0}
}}
scene s of m {{
  time 0 s to 1 s
  trace {0}, y
}}
"""


def told(text):
    return [(d.code, d.place.start[0]) for d in api.check(text) if d.severity == "error"]


@pytest.mark.parametrize(
    ("element", "connections"),
    [
        ("R: resistor(R = 1 ohm)", ["a -> b"]),
        ("R: dissipator(e = 1 ohm*f)", ["a -> b"]),
        ("R: dissipator(e = 1 N.m.s*f)", ["w"]),
        ("G: gyrator(e1 = 2 V.s*f2) a -> ground", ["w -> ground"]),
        ("M: dc_motor(R = 1 ohm, L = 1 mH, K = 1 V.s, J = 1 g.m^2)", ["p = a, n = ground, shaft = w"]),
        ("M: dc_motor(R = 1 ohm, L = 1 mH, K = 1 V.s, J = 1 g.m^2)", ["p = a", "n = ground", "shaft = w"]),
    ],
)
def test_connections_on_a_line_of_their_own(element, connections):
    """E109 alone: that the element lacks its ends (E402, E408) follows from it."""
    assert told(BROKEN.format("\n     ".join([element, *connections]))) == [("E109", 9)]


def test_an_element_without_ends_is_still_told_beside_a_statement_that_cannot_be_read():
    text = BROKEN.format("R: resistor(R = 1 ohm)\n  S: resistor(R = 1 ohm) a -> b\n  let y = = 2")
    assert told(text) == [("E113", 10), ("E408", 8)]


@pytest.mark.parametrize("word", ["if", "then", "else", "and", "or", "not", "true", "false"])
def test_a_reserved_word_as_a_name(word):
    """E115 where it is declared, and not again wherever it is read (E113, E203, E507)."""
    assert told(RESERVED.format(word)) == [("E115", 2)]
    assert told(RESERVED.format(word + "_")) == []


DRIVE = """from std.electrical import resistor, inductor, voltage
from std.mechanical import inertia
from std.control import pid
model drive {
  param setpoint = 1000 rpm
  param rate = 1000
  node a, b: electrical
  node shaft: rotation
  P: pid(kp = 2 V.s/rad, ki = 1 V/rad, lo = 0 V, hi = 24 V, r = setpoint, y = shaft.f)
  Va: voltage(v = P.u) a -> ground
  Ra: dissipator(e = (if t < 1 s then 2 ohm else 3 ohm)*f) a -> b
  G: gyrator(e1 = 1 V.s/rad*f2) b -> ground, shaft -> ground
  J: inertia(J = 1 kg.m^2) shaft
  init shaft.f = 0 rad/s
}
scene speed of drive {
  time 0 s to 2 s
  trace shaft.f in rpm, Ra.f as i every 1 ms
  accuracy 1e-5 on Ra.f
}
"""
SLIPS = [
    ("setpoint = 1000 rpm", "setpoint = 1000", "E209", "'r' of 'P' contradicts what", "a factor in 1/s is missing"),
    ("kp = 2 V.s/rad", "kp = 2", "E209", "'kp' of 'P' contradicts what", "a factor in Wb is missing"),
    ("y = shaft.f", "y = shaft.q", "E209", "'y' of 'P' contradicts what", "a factor in 1/s is missing"),
    ("v = P.u", "v = P", "E104", "element 'P' is not a value", "a member: P.u"),
    ("3 ohm)*f)", "3 ohm))", "E208", "law of 'Ra': e is in V, the law in ohm", "a factor in A is missing: ...*f"),
    ("time 0 s to 2 s", "time 0 s to 2 s; set Va = 3 V", "E910", "'Va' is not a parameter", "set Va.v = ..."),
    ("shaft.f in rpm", "shaft.f in deg", "E208", "is in 1/s, not deg", "in rad/s, deg/s or rpm of a speed of rotation"),
    ("rpm, Ra", "rpm Ra", "E113", "found 'Ra'", "trace shaft.f in rpm, Ra"),
    ("Ra.f as i", "Ra.f i", "E113", "found 'i'", "a name of one's own: as i"),
    ("Ra.f as i", "Ra.f in V as i", "E208", "'Ra.f' is in A, not V", "in A"),
    ("node a, b: electrical", "node a b: electrical", "E113", "found 'b'", "node a, b"),
    ("node a, b: electrical", "node a, b electrical", "E113", "found 'electrical'", "node a, b: electrical"),
    ("resistor, inductor", "resistor inductor", "E113", "found 'inductor'", "import resistor, inductor"),
    ("time 0 s to 2 s", "time 0 s to 2 m", "E208", "the end '2 m' is in m, wants s", "write '2 min'"),
    ("every 1 ms", "every 1/rate", "E208", "the interval", "'rate' is a number without unit; in s^-1"),
    (
        "init shaft.f = 0 rad/s", "init shaft.f = 0 rad/s; init J.f = 1 rad/s", "E903", "residual 1 1/s", "free one",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("right", "wrong", "code", "said", "help_"), SLIPS)
def test_a_slip_of_a_tired_engineer_is_told_with_what_to_write(right, wrong, code, said, help_):
    (error,) = [d for d in api.check(DRIVE.replace(right, wrong)) if d.severity == "error"]
    assert (error.code, said in error.message, help_ in error.help) == (code, True, True), (error.message, error.help)


def test_a_setting_of_another_level_names_it():
    text = """component spring {
  branch: translation
  level straight default { law e = 2 N/m*q }
  level hard { param k3 = 1 N/m^3; law e = k3*q^3 }
}
model m { node x: translation; S: spring() x; M: kinetic(p = 1 kg*f) x }
scene s of m { time 0 s to 1 s; set S.k3 = 2 N/m^3 }
"""
    (error,) = [d for d in api.check(text) if d.severity == "error"]
    assert (error.code, error.help) == ("E910", "level hard of 'S' has it")
