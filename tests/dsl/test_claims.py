"""Claims that compare numbers of a run exactly (W909)."""

import numpy as np
import pytest
from sysdyn.api import check, load

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


STATIC = """
model m {
  param p0 = 30 bar
  param slack = 1 Pa
  node n: hydraulic
  S: effort(e = p0) n -> ground
  R: dissipator(e = 1 Pa.s/m^3*f) n -> ground
  expect static: p0 OP 3000.5 kPa WITHIN
}
"""


@pytest.mark.parametrize(
    ("op", "within", "failed"),
    [
        ("==", "within 501 Pa", False),
        ("==", "within 499 Pa", True),
        ("==", "within 501*slack", False),
        ("!=", "within 501 Pa", True),
        (">=", "within 501 Pa", False),
        (">=", "", True),
    ],
)
def test_a_static_claim_grants_what_it_says(op, within, failed):
    found = check(STATIC.replace("OP", op).replace("WITHIN", within))
    assert [d.code for d in found] == ["E909"] * failed
    assert all(d.message.endswith("found 3000000 Pa") for d in found)


BRIEF = """
model rc {
  param R = 1 kohm
  node a: electrical
  C: potential(q = 1 fF*e) a -> ground
  D: dissipator(e = R*f) a -> ground
  init C.e = 1 V
}
scene s of rc {
  time 0 s to 10 ps
  trace a.e every 0.5 ps
  expect at 5 ps: a.e == 1 V*exp(-5) within 10 uV
  expect at 1.25 ps: a.e == 1 V*exp(-1.25) within 100 uV
}
"""


def test_an_instant_is_told_from_one_a_picosecond_away(tmp_path):
    (tmp_path / "rc.sd").write_text(BRIEF)
    model = load(tmp_path / "rc.sd")
    assert abs(model.run()["a.e"][-1] - np.exp(-10.0)) < 1e-4
    swept = model.sweep({"R": [1e3, 2e3]}, keep="end")
    assert [number for number, *_ in swept.failed] == [1]


def test_a_static_claim_about_what_a_run_alone_knows_is_told():
    (found,) = check(MODEL.replace("CLAIM", "static: x >= 0 m"))
    assert (found.code, found.message) == ("E908", "'x' is no static quantity: only a run knows it")


def test_a_golden_file_that_is_missing_is_a_note_of_a_check():
    (found,) = check(MODEL.replace("CLAIM", 'golden "none.h5" within 1e-3'))
    assert (found.code, found.severity, found.message) == ("N907", "note", "the golden file 'none.h5' is missing")
