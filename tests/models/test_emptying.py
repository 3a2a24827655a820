"""Vessels that empty, or fill, in finite time: the law's slope vanishes (or is infinite) where the flow ends."""

import numpy as np
import pytest
from sysdyn import api

VESSEL = """\
model vessel {
  node s, a: hydraulic
  supply: effort(e = PRESSURE Pa) s -> ground
  C: potential(q = 1 m^3/Pa*e) a -> ground
  O: dissipator(f = 0.25 m^3/s*sign(e)*sqrt(abs(e)/(1 Pa))) a -> s
  init C.e = START Pa
}
scene flows of vessel {
  time 0 s to 12 s
  trace C.e as h every 0.1 s
}
"""


@pytest.mark.parametrize("accuracy", [1e-3, 1e-6])
@pytest.mark.parametrize(("pressure", "start"), [(0.0, 1.0), (1.0, 0.0)])
@pytest.mark.parametrize("method", ["bdf", "radau"])
def test_what_flows_ends_in_finite_time(tmp_path, method, pressure, start, accuracy):
    """Torricelli: the root of the difference falls evenly, to nothing at 8 s, and nothing flows from then on."""
    text = VESSEL.replace("PRESSURE", repr(pressure)).replace("START", repr(start))
    (tmp_path / "model.sd").write_text(text)
    trace = api.simulate(tmp_path / "model.sd", method=method, accuracy=accuracy, output=tmp_path / "out.h5")
    exact = pressure + (start - pressure) * np.maximum(1.0 - trace.time / 8.0, 0.0) ** 2
    assert np.abs(trace["h"].values - exact).max() <= accuracy
