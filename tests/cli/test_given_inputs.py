"""Inputs of components that a scene or the command line gives by their path: a resistor behind a source."""

import numpy as np
import pytest
from sysdyn.api import ModelError, load, simulate

TEXT = """from std.electrical import capacitor, resistor, voltage
component feed {
  port a: electrical
  V: voltage(v = 5 V) a -> ground
}
model rc {
  node a, b: electrical
  S: feed() a = a
  R: resistor(R = 1 kohm) a -> b
  C: capacitor(C = 1 mF) b -> ground
  init C.e = 0 V
}
scene plain of rc { time 0 s to 1 s; trace b.e as v }
scene more of rc { time 0 s to 1 s; set S.V.v = 8 V; trace b.e as v }
scene turning of rc { time 0 s to 1 s; set S.V.v = 3 V*sin(t/(1 s)); trace b.e as v }
scene wrong of rc { time 0 s to 1 s; set S.V.v = 3 A; trace b.e as v }
scene unknown of rc { time 0 s to 1 s; set S.V.u = 3 V; trace b.e as v }
"""


@pytest.fixture
def model(tmp_path):
    path = tmp_path / "m.sd"
    path.write_text(TEXT)
    return path


@pytest.mark.parametrize(
    ("scene", "given", "end"),
    [
        ("plain", {}, 5 * (1 - np.exp(-1))),
        ("more", {}, 8 * (1 - np.exp(-1))),
        ("more", {"S.V.v": 2}, 2 * (1 - np.exp(-1))),
        ("more", {"S.V.v": "2 kV"}, 2000 * (1 - np.exp(-1))),
        ("turning", {}, 3 * (np.sin(1) - np.cos(1) + np.exp(-1)) / 2),
        ("plain", {"S.V.v": "exp(-t/(1 s))*(1 V)"}, np.exp(-1)),
    ],
)
@pytest.mark.long
def test_an_input_is_given_by_its_path(model, tmp_path, scene, given, end):
    trace = simulate(model, scene=scene, set=given, accuracy=1e-7, output=tmp_path / "t.h5")
    assert trace["v"].values[-1] == pytest.approx(end, rel=1e-6)


def test_a_constant_is_a_parameter(model):
    loaded = load(model, scene="more")
    assert loaded.parameters["S.V.v"] == 8.0
    for volts in (1.0, 2.0):
        assert loaded.run(set={"S.V.v": volts})["v"].values[-1] == pytest.approx(volts * (1 - np.exp(-1)), rel=1e-3)


@pytest.mark.parametrize(("scene", "code"), [("wrong", "E207"), ("unknown", "E910")])
def test_what_does_not_fit_is_told(model, tmp_path, scene, code):
    with pytest.raises(ModelError) as raised:
        simulate(model, scene=scene, output=tmp_path / "t.h5")
    assert code in [d.code for d in raised.value.diagnostics]
