"""Through a singular position of a linkage: on along the smooth branch, or refused; never on another in silence."""

from pathlib import Path

import numpy as np
import pytest
from running import ran

MODEL = Path(__file__).with_name("parallelogram.sd")
# over the top; and a turn just behind the flat position, where the linkage dwells
SETS = ((-2.05, 42.0, 1.1), (-3.05, 0.9, 2.3))


def energy(start, push, angle):
    """Speed of the cranks squared [rad^2/s^2] as one degree of freedom: a first integral."""
    inertia, weight = 2 * (0.1 + 0.25) + 2.0, (1.0 + 2.0) * 9.80665
    return 2 / inertia * (push * (angle - start) - weight * (np.sin(angle) - np.sin(start)))


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.parametrize("method", ["bdf", "radau"])
@pytest.mark.parametrize(("start", "push", "b"), SETS)
@pytest.mark.one_in(9)
def test_a_flat_parallelogram_stays_one_or_is_refused(tmp_path, start, push, b, method, formulation):
    settings = (("start", repr(start)), ("push", repr(push)), ("b", repr(b)))
    run = ran(tmp_path, MODEL, scene="turned", method=method, formulation=formulation, accuracy=1e-3, settings=settings)
    if method == "bdf":
        assert not run.refused
        assert run.met
    if run.refused or not run.met:
        return
    one, two, time = (np.asarray(x) for x in (run.trace["one"], run.trace["two"], run.trace.time))
    assert np.abs(two - one).max() <= 1e-3 * np.abs(one).max()
    assert one.max() > 0.0  # it was flat on the way
    speed = np.gradient(one, time)[5:-5]
    assert np.abs(speed**2 - energy(start, push, one[5:-5])).max() <= 0.02 * (speed**2).max()


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.parametrize("method", ["bdf", "radau"])
@pytest.mark.one_in(4)
def test_what_is_zero_by_symmetry_is_met(tmp_path, method, formulation):
    run = ran(tmp_path, MODEL, scene="hanging", method=method, formulation=formulation, settings=(("start", "-1.9"),))
    assert np.abs(np.asarray(run.trace["level"])).max() < 1e-13
    assert run.met
