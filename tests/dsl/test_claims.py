"""Claims that compare numbers of a run exactly (W909)."""

import pytest
from sysdyn.api import check

MODEL = """
model m {
  coord x: translation = 1 m
  energy T* = 1/2*(1 kg)*x'^2
  energy V = 1/2*(4 N/m)*x^2
  init x' = 0 m/s
  discrete n = 0
  state count: 1 = 0
  dynamic count' = 0
  when x < 0 m { n := n + 1; count := count + 1 }
  expect static: dof == 1
}
scene s of m {
  time 0 s to 1 s
  trace x
  expect CLAIM
}
"""


@pytest.mark.parametrize(
    ("claim", "warned"),
    [
        ("finally: x == cos(2)*1 m", True),
        ("at 0.5 s: (if x > 0 m then x else 0 m) == 0 m", True),
        ("always: audit.energy == 0 J", True),
        ("finally: x == cos(2)*1 m within 1 um", False),
        ("finally: x <= 1 m", False),
        ("finally: n == 1", False),
        ("finally: count == 1", False),
        ("finally: sign(x) == -1", False),
        ("finally: (if x > 0 m then 1 else 2) == 2", False),
    ],
)
def test_what_varies_is_compared_within(claim, warned):
    found = [d.code for d in check(MODEL.replace("CLAIM", claim))]
    assert (found == ["W909"]) is warned, found
