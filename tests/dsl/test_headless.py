"""A line that begins a block, or its brace, is left out: one finding; what stands in the block is judged as ever."""

import pytest
from sysdyn.api import check
from sysdyn.dsl.names.laws import ONE_PORTS, TWO_PORTS
from sysdyn.dsl.parser.headless import BUILTINS

TEXT = """from std.electrical import resistor, voltage
component part {
  param R = 1 ohm
  port a, b: electrical
  r: resistor(R = R) a -> b
}
component lag {
  input u: V
  state x: V = 0 V
  dynamic x' = (u - x)/(1 s)
  output y = x
}
model net {
  node a: electrical
  V: voltage(v = 5 V) a -> ground
  P: part() a = a, b = ground
  F: lag() u = a.e
  for i in 1..2 {
    G[i]: part(R = i*1 ohm) a = a, b = ground
  }
}
scene run of net {
  time 0 s to 1 s
  trace P.r.f, F.y, G[2].r.f
}
"""
HEADS = {"component part {": 2, "component lag {": 7, "model net {": 13, "scene run of net {": 22}


@pytest.mark.parametrize("head", HEADS)
@pytest.mark.one_in(5)
def test_a_head_that_is_missing_is_told_once(head):
    assert not check(TEXT)
    (found,) = check(TEXT.replace(head + "\n", ""))
    assert (found.code, found.place.start[0]) == ("E107", HEADS[head])
    assert "the line that begins it is missing" in found.message
    assert found.help == head.replace("run", "NAME")


@pytest.mark.parametrize("head", [*HEADS, "  for i in 1..2 {"])
@pytest.mark.parametrize("beside", ["", " # {"])
@pytest.mark.one_in(4)
def test_a_brace_that_is_missing_is_told_once(head, beside):
    (found,) = check(TEXT.replace(head, head[:-2] + beside))
    assert found.code == "E113"
    assert "expected" in found.message
    assert "'{'" in found.message


def test_what_stands_in_such_a_block_is_judged():
    codes = [d.code for d in check(TEXT.replace("model net {\n", "").replace("v = 5 V", "v = 5 A"))]
    assert codes == ["E107", "E207"]


def test_a_brace_too_many_is_no_head_too_few():
    assert {d.code for d in check(TEXT.replace("  P: part()", "  }\n  P: part()"))} >= {"E112"}


FOLLOWING = {
    "component part {": ("component pat {", ["E101"]),
    "  for i in": ("  fo i in", ["E113"]),
    "  r: resistor": ("  r: resistr", ["E101"]),
    "(R = i*1 ohm)": ("(R = i*1 ohm", ["E113"]),
    "  dynamic x' = (u - x)/(1 s)\n": ("", ["E507"]),
    "  state x: V": ("  state x: Vx", ["E201"]),
}


@pytest.mark.parametrize("old", FOLLOWING)
def test_what_follows_from_a_slip_is_not_told(old):
    new, codes = FOLLOWING[old]
    assert [d.code for d in check(TEXT.replace(old, new))] == codes


def test_what_needs_no_component_is_what_names_hold():
    assert {*ONE_PORTS, *TWO_PORTS} == BUILTINS


@pytest.mark.parametrize("names", ["resistor, voltage, part", "resistor,\n  voltage,\n  part"])
def test_what_is_imported_is_no_component_that_is_missing(names, tmp_path):
    """The lost head is that of `lag`: `part` comes from elsewhere, whether its name stands on the first line or not."""
    first, part, rest = TEXT.partition(TEXT[TEXT.index("component part") : TEXT.index("component lag")])
    text = first.replace("from std.electrical import resistor, voltage", f"from other import {names}") + rest
    (found, *_) = [d for d in check(text.replace("component lag {\n", "")) if d.code == "E107"]
    assert found.help == "component lag {"
    assert part
