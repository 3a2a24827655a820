"""Rules of events and set-valued laws."""

import pytest
from sysdyn.api import ModelError, simulate

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
