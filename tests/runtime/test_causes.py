"""What a run that cannot go on says: when, which unknown, which row, the last good point; closed forms."""

from types import SimpleNamespace

import numpy as np
import pytest
import small_models as models
from sysdyn.runtime.accuracy.options import Options
from sysdyn.runtime.integrate.causes import _null_place, _worst
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.failures import SolverFailure
from sysdyn.runtime.simulate import simulate

METHODS = pytest.mark.parametrize("method", ["bdf", "radau"])


def failed(made, method):
    """How a run to 3 s ends."""
    manifest, binding, module = made
    with pytest.raises(SolverFailure) as caught:
        simulate(manifest, binding, load(module), Options(None, 0.0, 3.0, method=method, rtol=1e-6))
    found = caught.value
    assert found.state[0] == found.time
    assert np.isfinite(found.state[1]).all()
    return found, found.state[1]


@METHODS
@pytest.mark.long
def test_what_runs_away_is_named(method):
    """a' = a^2 from 1 is 1/(1 - t); b beside it falls."""
    found, y = failed(
        models.small(
            "x", "f_x**2/2", states={"b": "-s_b", "a": "s_a**2"}, initial={"s_a": (1, True), "s_b": (1, True)}
        ),
        method,
    )
    assert found.time == pytest.approx(1.0, abs=1e-4)
    assert found.unknown == "s_a"
    assert y[2] == pytest.approx(np.exp(-found.time), rel=1e-4)
    assert y[3] > 1e10


@METHODS
@pytest.mark.long
def test_the_flow_of_a_mass_that_vanishes_is_named(method):
    """Its momentum stays: (1 - t) v = 1, so y = -log(1 - t)."""
    initial = {"q_x": (0, True), "f_x": (0, True), "q_y": (0, True), "f_y": (1, True)}
    found, y = failed(models.small("x y", "(f_x**2 + (1 - t)*f_y**2)/2", initial=initial), method)
    assert found.time == pytest.approx(1.0, abs=1e-9)
    assert found.unknown == "f_y"
    assert y[:2] == pytest.approx([0.0, -np.log1p(-found.time)], rel=0.05)


@METHODS
@pytest.mark.one_in(2)
def test_a_row_that_is_no_number_is_named(method):
    """x'' = log(1 - t) ends at 1 s, where x' = -1 and x = -1/4."""
    rest = {"q_x": (0, True), "f_x": (0, True)}
    found, y = failed(models.small("x", "f_x**2/2", work={"x": "log(1 - t)"}, initial=rest), method)
    assert (found.cause, found.row.label, found.row.line) == ("nonfinite", "x", 1)
    assert 1.0 - 1e-12 < found.time < 1.0
    assert y == pytest.approx([-0.25, -1.0], abs=2e-3)


def test_slopes_that_no_factors_bring_together_are_no_place_of_singularity():
    """A junction that blocks and one far above its voltage, 1e467 apart in one column: a failure says what it knows."""
    slopes = np.array([[9.4e-236, 0.0, 0.0], [0.0, 5.4e5, 1.1e65], [1.4e231, -4.4e-4, 0.0]])
    inertia = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 2.8e5], [0.0, 0.0, 0.0]])
    system = SimpleNamespace(jacobian=lambda *_: (slopes, inertia), dense=lambda values: values)
    run = SimpleNamespace(system=system, method=SimpleNamespace(point=lambda: (0, 0), contents=SimpleNamespace(t=0.0)))
    assert _null_place(run) == ((), -1)


def test_a_correction_without_bounds_is_named(monkeypatch):
    """Weighted it is beyond what numbers hold: the unknown is told, without a warning of NumPy's."""
    told = {"ee": np.array([1.0, 1e300]), "weight": np.array([1.0, 1e300])}
    monkeypatch.setattr("sysdyn.runtime.integrate.causes.lib.reader", lambda name, n: told[name])
    stepped = SimpleNamespace(unknowns=2, name=lambda k: "ab"[k])
    method = SimpleNamespace(contents=SimpleNamespace(ee="ee", weight="weight"))
    test = SimpleNamespace(test=np.array([-1.0, 0.0]))
    assert _worst(SimpleNamespace(method=method, stepped=stepped, told=test)) == "b"
