"""Rules of events and set-valued laws."""

import pytest
from sysdyn.api import ModelError, check, simulate

MODEL = """
model m {{
  param m = 1 kg
  coord x: translation = 1 m
  energy T* = 1/2*m*x'^2
  init x' = 1 m/s
}}
scene s of m {{
  time 0 s to 1 s
  {}
}}
"""


@pytest.mark.parametrize("asked", ["trace setsign(x')", "trace x\n  expect always: setsign(x') >= 0"])
def test_setsign_is_no_result(asked, tmp_path):
    file = tmp_path / "m.sd"
    file.write_text(MODEL.format(asked))
    with pytest.raises(ModelError) as caught:
        simulate(file, output=tmp_path / "m.h5")
    assert {d.code for d in caught.value.diagnostics} == {"E705"}
    assert all(d.place.start[0] >= 10 for d in caught.value.diagnostics)


# van der Pol's slope is zero at 1 m/s, as that of the second
@pytest.mark.parametrize("content", ["1/4*1 N.s^3/m^3*x'^4 - 1/2*1 N.s/m*x'^2", "1/2*1 N.s/m*x'^2 - 1 N*x'"])
def test_a_content_without_a_corner_is_no_friction(content):
    """A difference of slopes that shrinks with the distance is no jump, however small the slope is at the scale."""
    text = MODEL.format("").replace("  init", f"  content D = {content}\n  init")
    assert not any(d.code in ("N608", "W301") for d in check(text))
    sudden = text.replace(content, "1 N*x'*(if x' > 0 m/s then 2 else 1)")
    assert [d.code for d in check(sudden) if d.severity == "note"] == ["N608"]


@pytest.mark.parametrize(("target", "remedy"), [("x", "x' := ..., its rate"), ("K.q", None), ("K.e", None)])
def test_a_rate_is_the_remedy_where_there_is_one(target, remedy):
    """What a store holds has no rate that an event may assign: the store's flow is no unknown of its own."""
    element = "  K: potential(e = 3 N/m*q) on x\n  when x <= 0 m {{ {0} := 0 {1} }}\n  init x'"
    text = MODEL.format("").replace("  init x'", element.format(target, "N" if target == "K.e" else "m"))
    (found,) = [d for d in check(text) if d.code == "E702"]
    assert (found.help == remedy) if remedy else ("'" + " := ..." not in found.help)


NODES = """
model m {{
  node x, y: translation
  node a: electrical
  M: kinetic(p = 2 kg*f) x
  K: kinetic(p = 2 kg*f) x -> y
  L: kinetic(p = 2 H*f) a -> ground
  C: potential(q = 2 F*e) a -> ground
  when t > 0.2 s {{ {} }}
}}
"""


@pytest.mark.parametrize(
    ("assigned", "remedy"),
    [
        ("M.f := 3 m/s", "x.f := ..., the flow of its node"),
        ("M.p := 3 kg.m/s", "x.f := ..., the flow of its node"),
        ("K.f := 3 m/s", "x.f := ... or y.f := ..., the flow of a node"),
        ("L.f := 3 A", "a source that acts for a short time"),
        ("C.e := 3 V", "a source that acts for a short time"),
    ],
)
def test_what_an_event_may_assign_in_place_of_a_quantity_of_an_element(assigned, remedy):
    (found,) = [d for d in check(NODES.format(assigned)) if d.severity == "error"]
    assert found.code == "E702"
    assert found.help.startswith(remedy)


def test_the_flow_of_a_node_may_be_assigned():
    assert not [d for d in check(NODES.format("x.f := 3 m/s")) if d.severity == "error"]


@pytest.mark.parametrize("number", ["e_", "(if abs(x') > 3 m/s then 0.8 else 0.3)"])
def test_a_restitution_is_one_number_for_the_run(number):
    """One that an event changes kept the value of the start."""
    said = (
        f"  discrete e_ = 0.8\n  phi floor: x >= 0 m restitution {number}\n  when t > 0.7 s {{ e_ := 0.2 }}\n  init x'"
    )
    text = MODEL.format("").replace("  init x'", said)
    (found,) = [d for d in check(text) if d.severity == "error"]
    assert (found.code, found.place.start) == ("E807", (7, 35))
    assert "restitution is one number" in found.message


def test_an_input_named_on_is_bound_where_a_component_stands(tmp_path):
    (tmp_path / "m.sd").write_text("""
component switched { port p: electrical
  input on: 1
  R: dissipator(e = 1 ohm*(2 - on)*f) p -> ground }
model m {
  node a: electrical
  V: effort(e = 3 V) a -> ground
  S: switched() p = a, on = step(t - 0.5 s)
}
scene s of m { time 0 s to 1 s; trace S.R.f as i every 0.1 s }
""")
    found = simulate(tmp_path / "m.sd", output=tmp_path / "m.h5")["i"].values
    assert (found[0], found[-1]) == pytest.approx((1.5, 3.0), abs=1e-12)
