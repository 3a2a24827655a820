"""Declarations before use are not required: units in which others are written, sizes of loops around parameters."""

import numpy as np
import pytest
from sysdyn.api import check, load

UNITS = """unit gpd = 24 lph
unit lph = 1 l/h
model m {
  param Q = 3 gpd
  coord x: translation = 1 m
  energy T* = 1/2*(1 kg)*x'^2
}
"""
LOOPS = """model m {
  energy V = sum(i in 1..n: sum(j in 1..n: 1/2*K[i, j]*x[i]*x[j]))
  for i in first..n { for j in 1..m { param K[i, j] = (1 N/m)*(i + 10*j) } }
  param first = 1
  energy T* = sum(i in 1..n: 1/2*(1 kg)*x[i]'^2)
  coord x[1..n]: translation = 0 m
  param n = m
  param m = 2
}
scene s of m { time 0 s to 1 s; trace x[1] }
"""


@pytest.mark.long
def test_a_unit_may_be_written_in_one_that_follows(tmp_path):
    path = tmp_path / "m.sd"
    path.write_text(f"{UNITS}scene s of m {{ time 0 s to 1 s; trace x }}\n")
    assert load(path).parameters["Q"] == pytest.approx(72.0 * 1e-3 / 3600, rel=1e-14)


@pytest.mark.long
def test_a_loop_around_parameters_may_run_to_one_that_follows(tmp_path):
    path = tmp_path / "m.sd"
    path.write_text(LOOPS)
    assert np.array_equal(load(path).parameters["K"], [[11.0, 21.0], [12.0, 22.0]])


@pytest.mark.parametrize(
    ("units", "said"),
    [
        ("unit a = 2 b\nunit b = 3 c\nunit c = 4 a\nunit d = 5 b\n", ["circular definition: a -> b -> c -> a"]),
        ("unit a = 2 a\n", ["circular definition: a -> a"]),
        ("unit a = Pa.s/m\n", ["unknown name 'Pa'"]),
        ("unit a = -1 m\n", ["unit 'a' is not a positive constant"]),
        ("unit a = 1 m\nunit a = 2 m\n", ["unit 'a' is declared twice"]),
    ],
)
def test_a_unit_that_is_none_is_told_once(units, said):
    found = check(f"{units}model m {{ param k = 3 a; coord x: translation = 1 m; energy T* = 1/2*(1 kg)*x'^2 }}\n")
    assert [d.message for d in found if d.severity == "error"] == said


@pytest.mark.long
def test_many_units_in_turn():
    units = "".join(f"unit u{i} = 1 u{i + 1}\n" for i in range(1500))
    text = "unit u1500 = 1 m\nmodel m { coord x: translation = 1 u0; energy T* = 1/2*(1 kg)*x'^2 }\n"
    assert check(units + text) == []


READER = "P{0}: low_pass(tau = 1 s, u = R{0}.f)"
ELEMENTS = {
    "": ("La: kinetic(p = 1 mH*f) a -> b", "R: dissipator(e = 1 ohm*f) b -> c", "C: effort(e = 0 V) c -> ground"),
    "[i]": ("La: kinetic(p = 1 mH*f) a -> b", "R[1]: dissipator(e = 1 ohm*f) b -> c",
            "for i in 2..3 { R[i]: dissipator(e = 2 ohm*f) c -> ground }"),
}  # fmt: skip


@pytest.mark.parametrize("at", ["", "[i]"])
def test_an_input_may_read_an_element_that_follows(at):
    """What `$u` is of a component is told by an element below it as by one above."""
    reader = READER.format(at)
    reader = f"for i in 1..3 {{ {reader} }}" if at else reader
    nodes = ("node a, b: electrical", "node c: electrical", "V: effort(e = 1 V) a -> ground")
    elements = ELEMENTS[at]
    for lines in ((*nodes, *elements, reader), (*nodes, reader, *elements)):
        body = "\n  ".join(lines)
        assert check(f"from std.control import low_pass\nmodel m {{\n  {body}\n}}\n") == []


BEGUN = """coord x[1..2]: translation = y[2]/4 + k
state s = 3*h
state h = r
let k = g - y[2]
discrete d = 2*e
discrete e = c
let c = 1 m
state g: m = y[1]
coord y[1..2]: translation = [1 m, 2 m]
let r = 2*c
"""


@pytest.mark.parametrize("trace", ["s, g, x[1], x[2]", "s, g, x[1], x[2], y[1], y[2]"])
@pytest.mark.parametrize("lines", [BEGUN.splitlines(), BEGUN.splitlines()[::-1]], ids=["written", "turned"])
def test_a_start_may_read_what_is_declared_behind_it(lines, trace, tmp_path):
    """Also where nothing but a start reads where y is: it has no force and is not traced."""
    moved = "for i in 1..2 { energy T* = 1/2*(1 kg)*(x[i]'^2 + y[i]'^2) }\ndynamic s' = 1 m/s\ndynamic g' = 0 m/s"
    moved += "\ndynamic h' = 0 m/s"
    scene = f"scene a of m {{ time 0 s to 1 s; trace {trace}, d every 1 s }}"
    text = "\n".join(["model m {", *lines, moved, "}", scene])
    (path := tmp_path / "m.sd").write_text(text)
    run = load(path).run()
    assert {n: run[n][0] for n in ("s", "g", "x[1]", "x[2]", "d")} == pytest.approx(
        {"s": 6.0, "g": 1.0, "x[1]": -0.5, "x[2]": -0.5, "d": 2.0}, abs=1e-12
    )


def test_values_to_begin_with_in_a_circle_are_told():
    text = "model m { state s = r; state r = 2*s; dynamic s' = 0; dynamic r' = 0; discrete g = h; discrete h = g }\n"
    said = [d.message for d in check(text) if d.severity == "error"]
    assert said == ["circular definition: s -> r -> s", "circular definition: g -> h -> g"]
