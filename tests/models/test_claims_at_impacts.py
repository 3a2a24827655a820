"""`expect always` at impacts: inequalities hold up to what no run resolves, and no further."""

import pytest
from sysdyn import api

BALL = """\
model m {
  param r = 0.1 m
  coord y: translation = 1.3 m
  energy T* = 1/2*(1 kg)*y'^2
  energy V = (1 kg)*g0*y
  phi floor: y - r >= 0.2 m restitution 0.7
  init y' = 0 m/s
  expect always: CLAIM
}
scene s of m { time 0 s to 3 s; trace y every 10 ms }
"""


def _run(folder, claim, method):
    (folder / "m.sd").write_text(BALL.replace("CLAIM", claim))
    return api.simulate(folder / "m.sd", output=folder / "m.h5", method=method)


@pytest.mark.parametrize("method", ["radau", "bdf", "rosenbrock"])
@pytest.mark.long
def test_a_ball_is_above_its_floor(tmp_path, method):
    found = _run(tmp_path, "y - r >= 0.2 m", method)
    off = 0.3 - found["y"].values.min()
    assert 0.0 < off < 1e-12  # it is below, by what its terms leave open


@pytest.mark.parametrize("claim", ["y - r >= (0.2 + 1e-11)*(1 m)", "0.2 m*(1 + 1e-11) <= y - r", "y - r > 0.2 m"])
@pytest.mark.long
def test_what_is_off_by_more_or_asked_strictly_fails(tmp_path, claim):
    with pytest.raises(api.ModelError, match="E909"):
        _run(tmp_path, claim, "radau")
