"""What is said of a model at a state, against closed forms: inertia, implicit efforts, order, rates, levels."""

import numpy as np
import pytest
import small_models as models
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.start import ConsistentState, consistent_start
from sysdyn.runtime.structure.implicit import undetermined_implicits
from sysdyn.runtime.structure.inertia import negative_inertia
from sysdyn.runtime.structure.levels import undifferentiated_families
from sysdyn.runtime.structure.order import order_and_manifold
from sysdyn.runtime.structure.rates import determined_rates, unique
from sysdyn.runtime.structure.structure import structure


def system_of(made, form="3"):
    manifest, binding, module = made
    return System(manifest, binding, load(module), form)


def at(system, **values):
    """A state with these values, the others zero."""
    names = [system.name(k) for k in range(system.unknowns)]
    y = np.zeros(system.unknowns)
    for name, value in values.items():
        y[names.index(name)] = value
    return ConsistentState(0.0, y, np.zeros(system.unknowns), (), 0.0)


@pytest.mark.parametrize("form", ["lagrangian", "hamiltonian"])
@pytest.mark.parametrize(
    ("kinetic", "least"),
    [
        ("f_x**2/2 + f_y**2/2", None),
        ("f_x**2/2 + f_x*f_y + f_y**2", None),  # [1 1; 1 2]: determinant 1
        ("f_x**2/2 + f_x*f_y + f_y**2/2", None),  # [1 1; 1 1]: the difference has none, no negative one
        ("f_x**2/2 - 3*f_y**2/2", ("f_y", -3.0)),
        ("f_x**2/2 + 2*f_x*f_y + f_y**2/2", (None, -2.0)),  # [1 2; 2 1] along (1, -1)
        ("1e-9*f_x**2/2 + 2e-3*f_x*f_y + 1e3*f_y**2/2", (None, None)),  # the same in ug and t
    ],
)
@pytest.mark.one_in(12)
def test_inertia_is_negative_where_the_matrix_is_indefinite(kinetic, least, form):
    system = system_of(models.small("x y", kinetic, form=form))
    found = negative_inertia(system, at(system))
    if least is None:
        assert found is None
        return
    name, value = found
    assert least[0] in (None, name)
    assert value == pytest.approx(least[1] or value, rel=1e-12, abs=0.0)
    assert value < 0.0


def test_an_effort_that_its_law_leaves_open_at_rest():
    """0 = e^3 - t has no slope in e at e = 0, and nothing else gives e.  Beside it it has one; where 0 = e^3 - f the
    balance f' = -e of the flow gives e.
    """

    def asleep(law, **values):
        system = system_of(models.small("x", "f_x**2/2", work={"x": "-e_1"}, implicit=("1",), gamma={"law": law}))
        state = at(system, **values)
        return undetermined_implicits(system, state, structure(system, state))

    assert asleep("e_1**3 - t") == ("e_1",)
    assert asleep("e_1**2 - f_x") == ()  # its balance determines it
    assert asleep("e_1**3 - t", e_1=0.5) == ()
    assert asleep("e_1 - t") == ()
    assert asleep("e_1**3 - f_x") == ()
    assert asleep("t") == ()  # nowhere: that is another fault


@pytest.mark.parametrize(
    ("made", "expected"),
    [
        (models.pendulum, (2, 2)),
        (models.mass_spring, (2, 2)),
        (models.dc_motor, (2, 4)),  # two currents; charges that nothing depends on
        (lambda: models.mass_spring("hamiltonian"), (2, 2)),
        # a spring and a damper without a mass
        (lambda: models.small("x", 0, "q_x**2/2", "f_x**2/2", initial={"q_x": (1, True)}), (1, 1)),
        # a knife edge x' sin a = y' cos a: 3 places, 2 speeds
        (
            lambda: models.small(
                "x y a",
                "f_x**2 + f_y**2 + f_a**2",
                psi={"edge": "f_x*sin(q_a) - f_y*cos(q_a)"},
                initial={"q_a": (0.3, True), "f_x": (np.cos(0.3), True), "f_y": (np.sin(0.3), False)},
            ),
            (5, 5),
        ),
    ],
)
@pytest.mark.long
def test_initial_values_a_model_takes(made, expected):
    system = system_of(made())
    owners = {f.owner for f in system.description.families if f.kind == "q"}
    idle = set() if expected[0] == expected[1] else owners
    assert order_and_manifold(system, consistent_start(system, 0.0), idle) == expected


@pytest.mark.long
def test_rates_that_only_a_difference_has():
    """T* = (a' - b')^2/2 + c'^2/2: c'' is determined, neither a'' nor b'' is, nor what is made of them."""
    system = system_of(
        models.small(
            "a b c",
            "(f_a - f_b)**2/2 + f_c**2/2",
            "q_a**2 + 2*q_b**2 + q_c**2",
            initial={"q_a": (0.1, False)},
            observe={"one": "f_a", "sum": "f_b + f_c", "third": "2*f_c + q_b", "place": "q_a"},
        )
    )
    state = at(system, q_a=0.3, f_a=0.2, f_c=0.1)
    known = unique(system, system.jacobian(0.0, state.y, state.yd)[1])
    names = [system.name(k) for k in range(system.unknowns)]
    assert {name for name, ok in zip(names, known, strict=True) if not ok} == {"f_a", "f_b"}
    assert determined_rates(system, state).tolist() == [False, False, True, True]


def test_constraints_that_are_not_differentiated():
    """Kirchhoff's law of a resistor's and a capacitor's current: neither has a rate, so the law stands as it is; of two
    inductors' currents its derivative does.
    """
    law = {"node": "f_a + f_b - f_c"}
    without = models.small("a b c", "f_c**2/2", "q_a**2/2", "f_b**2/2", psi=law)
    heavy = models.small("a b c", "f_a**2/2 + f_b**2/2 + f_c**2/2", "q_a**2/2", psi=law)
    assert len(undifferentiated_families(system_of(without))) == 1
    assert undifferentiated_families(system_of(heavy)) == ()


def test_balances_that_would_be_differentiated():
    """Two capacitors in parallel, each with a coordinate, of which a constraint ties the charges: there is no such
    equation.
    """
    tied = models.small("a b", 0, "q_a**2/2 + q_b**2/2", phi={"tie": "q_a - q_b - 1"})
    assert undifferentiated_families(system_of(tied)) is None
