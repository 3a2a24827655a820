"""How far unknowns get by the linearised motion; what displacements and momenta are compared by."""

import ctypes

import numpy as np
import pytest
import small_models as models
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model import scales
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.start import consistent_start


def damped(form, quick):
    """Two masses of 1 kg and `quick` kg pushed from rest by 1 N, each with a damper of 1 N s/m and a spring of its
    own.
    """
    return models.small(
        "x z",
        f"f_x**2/2 + {quick!r}*f_z**2/2",
        potential=f"2*q_x**2/2 + {1.0 / quick!r}*q_z**2/2",
        content="f_x**2/2 + f_z**2/2",
        work={"x": "1", "z": "1"},
        initial={f"{kind}_{n}": (0.0, True) for kind in "qf" for n in "xz"},
        observe={"x": "q_x"},
        form=form,
    )


def at_start(made):
    manifest, binding, module = made
    system = System(manifest, binding, load(module), "2")
    y, yd = consistent_start(system, 0.0).for_form(system)
    return system, yd, *system.jacobian(0.0, y, yd)


@pytest.mark.parametrize("form", ["lagrangian", "hamiltonian"])
@pytest.mark.one_in(2)
def test_what_relaxes_gets_as_far_as_its_damper_lets_it(form):
    quick = 1e-6
    system, yd, jy, jyd = at_start(damped(form, quick))
    far = np.zeros(system.unknowns)
    rungs = scales.RUNGS.size, lib.pointer(scales.RUNGS)
    arrays = map(lib.pointer, (np.ascontiguousarray(jy), np.ascontiguousarray(jyd), yd))
    assert lib.core.sd_relaxed(ctypes.byref(system.core), None, *rungs, *arrays, 1e-2, lib.pointer(far)) == 0
    kind = "f" if form == "lagrangian" else "p"
    slow, fast = far[system.kinds == kind]
    # implicit Euler: v = h F/(m + h b + h^2 k)
    size = 1.0 if form == "lagrangian" else quick
    steps = 1e-2 * 1e-3 ** np.arange(4)
    assert slow == pytest.approx(1e-2 / (1.0 + 1e-2 + 2e-4), rel=1e-12)
    assert fast == pytest.approx(size * (steps / (quick + steps + steps**2 / quick)).max(), rel=1e-9, abs=0.0)


@pytest.mark.parametrize("form", ["lagrangian", "hamiltonian"])
@pytest.mark.one_in(2)
def test_like_is_compared_by_effort_and_flow(form):
    system, _, jy, jyd = at_start(damped(form, 1e-3))
    found = np.zeros(system.unknowns)
    core = scales.sizing(system).core
    assert lib.core.sd_compliance(ctypes.byref(core), *map(lib.pointer, (jy, jyd, found))) == 0
    np.testing.assert_allclose(found[system.kinds == "q"], [0.5, 1e-3], rtol=1e-12)
    if form == "hamiltonian":
        np.testing.assert_allclose(found[system.kinds == "p"], [1.0, 1e-3], rtol=1e-12)
    np.testing.assert_array_equal(found[~np.isin(system.kinds, ("q", "p"))], 1.0)
