"""The stabilised form does not see the unit of length: metres and radians do not mix."""

import numpy as np
import pytest
import small_models as models
from sysdyn.runtime.integrate.integrate import Integration
from sysdyn.runtime.integrate.request import Request
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.inertia import own_inertia
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.start import consistent_start


def bar(length, form="lagrangian"):
    """A bar of 2 kg m^2 per length^2 hung at one end, in coordinates of its centre and its angle; `length` a metre."""
    mass = 2.0 / length**2
    coordinates = {f"{kind}_{n}": "rad" if n == "th" else "m" for n in ("x", "y", "th") for kind in "qf"}
    return models.small(
        "x y th",
        f"{mass!r}*(f_x**2 + f_y**2)/2 + 0.3*f_th**2/2",
        potential=f"{mass * 9.81 * length!r}*q_y",
        phi={"x": f"q_x - {length / 2!r}*sin(q_th)", "y": f"q_y + {length / 2!r}*cos(q_th)"},
        initial={"q_th": (0.9, True), "f_th": (1.0, True), "q_x": (0.3 * length, False), "q_y": (-0.3 * length, False)},
        observe={"th": "q_th", "kappa": "kappa_x"},
        form=form,
        units=coordinates,
    )


def integrated(made, method):
    manifest, binding, module = made
    system = System(manifest, binding, load(module), "2")
    request = Request(3.0, np.array([3.0]), every_step=False, index=2, rtol=1e-6, method=method)
    integration = Integration(system, consistent_start(system, 0.0), request)
    finished = integration.run(lambda rows: None)
    return integration, finished.statistics


@pytest.mark.parametrize("form", ["lagrangian", "hamiltonian"])
@pytest.mark.parametrize("method", ["bdf", "radau"])
@pytest.mark.long
def test_the_unit_of_length_changes_nothing(form, method):
    one, counted = integrated(bar(1.0, form), method)
    other, again = integrated(bar(1024.0, form), method)
    assert (counted.steps, counted.rejected_steps) == (again.steps, again.rejected_steps)
    place = list(one.system.kinds).index("q") + 2
    assert other.method.point()[0][place] == pytest.approx(one.method.point()[0][place], rel=1e-6)


@pytest.mark.parametrize("form", ["lagrangian", "hamiltonian"])
@pytest.mark.long
def test_factors_are_inertias_and_one_where_there_is_one_unit(form):
    integration, _ = integrated(bar(1.0, form), "bdf")
    np.testing.assert_allclose(integration.system.kinematic_scale, [2.0 / 0.3, 2.0 / 0.3, 1.0], rtol=1e-12)
    system, start = integration.system, integration.start
    found = own_inertia(system, *system.jacobian(0.0, *start.for_form(system)))
    np.testing.assert_allclose(found[system.form.k_f], [2.0, 2.0, 0.3])
    integration, _ = integrated(models.pendulum(form), "bdf")
    assert (integration.system.kinematic_scale == 1.0).all()
