"""The sines and cosines of generated C beside those of extended precision."""

import ctypes

import numpy as np
import pytest
from sysdyn.compiler.program.build import build
from sysdyn.compiler.program.emit_c_support import APART, HEAD, TURNS

MANY = """
void sd_many(int n, const double *angle, double *sine, double *cosine)
{
    for (int i = 0; i < n; ++i) {
        const sd_turn *kept = sd_turned(sd_turns(), angle[i]);
        sine[i] = kept->sine;
        cosine[i] = kept->cosine;
    }
}
"""


def turned(angle):
    library = ctypes.CDLL(str(build("\n".join([HEAD, APART, TURNS.replace("@", "{0.0, 0.0, 1.0}"), MANY]))))
    sine, cosine = np.empty_like(angle), np.empty_like(angle)
    library.sd_many(angle.size, *(ctypes.c_void_p(item.ctypes.data) for item in (angle, sine, cosine)))
    return sine, cosine


def angles(kind):
    rng = np.random.default_rng(1)
    n = 200_000
    return {
        "a turn": rng.uniform(-np.pi, np.pi, n),
        "many turns": rng.uniform(-1.1e5, 1.1e5, n),
        "tiny": 10.0 ** rng.uniform(-300, 0, n) * rng.choice([-1, 1], n),
        "near quarters": np.rint(rng.uniform(-6e4, 6e4, n)) * (np.pi / 2)
        + rng.choice([-1, 1], n) * 10.0 ** rng.uniform(-12, 0, n),
        "beyond": np.array([0.0, 1e5, -1e5, 2e5, 1e22, 1e300, 3e-4, -3e-4, np.pi, np.pi / 4]),
    }[kind]


@pytest.mark.parametrize("kind", ["a turn", "many turns", "tiny", "near quarters", "beyond"])
@pytest.mark.long
def test_sines_and_cosines_are_within_a_unit_in_the_last_place(kind):
    angle = angles(kind)
    for found, exact in zip(turned(angle), (np.sin, np.cos), strict=True):
        truth = exact(angle.astype(np.longdouble))
        assert (np.abs(found - truth) <= 0.8 * np.spacing(np.abs(truth.astype(float)))).all()


def test_what_is_no_number_has_no_sine():
    assert np.isnan(turned(np.array([np.nan, np.inf, -np.inf]))).all()
    assert np.signbit(turned(np.array([1.0, -0.0]))[0][1])
