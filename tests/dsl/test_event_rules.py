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
