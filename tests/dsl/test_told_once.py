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
