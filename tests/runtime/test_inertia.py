"""Inertia by the rows of a form: one matrix, whether rows are p - M f, M^-1 p - f, or hold M f' themselves."""

import sys
from pathlib import Path

import numpy as np
import pytest
import small_models as models
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.inertia import inertia, own_inertia
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.start import ConsistentState, consistent_start
from sysdyn.runtime.structure.inertia import negative_inertia

sys.path.insert(0, str(Path(__file__).parents[1] / "compiler"))

from catalogue import ONE, PLACE
from chains import blank, coordinate
from sysdyn.cli.run.numpy_module import module_of
from sysdyn.cli.run.prepare import Prepared
from sysdyn.compiler.pipeline import compile_network
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.network import Constraint, EnergyTerm, InitialCondition
from sysdyn.runtime.model.description import describe

M = np.array([[101.0, -100.0], [-100.0, 100.0]])


def system_of(matrix, formulation, *guesses):
    """T* = f^T M f/2 of x, y; guesses of their flows, which a constraint then ties."""
    with x.fresh():
        f = [x.var(name, "f") for name in "xy"]
        terms = [x.mul(x.const(matrix[j, k] / 2.0), f[j], f[k]) for j in range(2) for k in range(2)]
        tie = Constraint("psi", "tie", (), x.sub(*f), (), ONE, PLACE)
        spring = x.power(x.var("x", "q"), x.const(2.0))
        network = blank(
            coordinates=(coordinate("x"), coordinate("y")),
            energies=(EnergyTerm("T*", x.add(*terms), (), PLACE), EnergyTerm("V", spring, (), PLACE)),
            constraints=(tie,) if guesses else (),
            initials=tuple(InitialCondition(n, x.const(v), False, (), PLACE) for n, v in zip(f, guesses, strict=False)),
        )
        model = compile_network(network, formulation, "numpy")
        binding = model.bind()
        description = describe(model.manifest(binding), Prepared.arrays_of(binding))
        return System.from_description(description, load(module_of(model.text)), "3")


FORMULATIONS = ["lagrangian", "hamiltonian"]


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_the_matrix_of_a_compiled_model(formulation):
    system = system_of(M, formulation)
    y = np.zeros(system.unknowns)
    slopes = system.jacobian(0.0, y, y)
    assert inertia(system, *slopes) == pytest.approx(M, rel=1e-12)


def test_the_transformed_energy_is_what_the_compiler_writes():
    """Rows of momentum are M^-1 p - f: else the tests here would see one case twice."""
    system = system_of(M, "hamiltonian")
    y = np.zeros(system.unknowns)
    rows = np.flatnonzero(system.of_groups("momentum"))
    slopes = system.dense(system.jacobian(0.0, y, y)[0])[rows]
    momenta = slopes[:, system.are("p")]
    assert momenta == pytest.approx(np.linalg.inv(M), rel=1e-12)
    assert slopes[:, system.are("f")] == pytest.approx(-np.eye(2))


@pytest.mark.parametrize("form", FORMULATIONS)
def test_the_matrix_of_a_model_made_by_hand(form):
    """Rows M f'; a row p - M f of one coordinate, and another without momentum and inertia."""
    if form == "lagrangian":
        manifest, binding, module = models.small("a b", "5*f_a**2/2 + 7*f_b**2/2")
    else:  # `small` leaves the balance of b without inertia
        manifest, binding, module = models.small("a b", "5*f_a**2/2", form=form, momenta="a")
    system = System(manifest, binding, load(module))
    y = np.zeros(system.unknowns)
    slopes = system.jacobian(0.0, y, y)
    expected = np.diag([5.0, 7.0 if form == "lagrangian" else 0.0])
    assert inertia(system, *slopes) == pytest.approx(expected)
    assert own_inertia(system, *slopes)[np.flatnonzero(system.are("f"))] == pytest.approx(np.diag(expected))


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_a_negative_mass_is_seen_in_every_formulation(formulation):
    system = system_of(M - np.diag([3.0, 0.0]), formulation)
    state = ConsistentState(0.0, np.zeros(system.unknowns), np.zeros(system.unknowns), (), 0.0)
    name, value = negative_inertia(system, state)
    assert name in ("x'", "y'", "x.f", "y.f")
    assert -2.1 < value < -1.9  # along (1, 1): 98 - 200 + 100, and a little less beside it


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("matrix", [np.diag([1.0, 100.0]), M])
@pytest.mark.one_in(5)
def test_guesses_of_flows_move_by_what_they_hold(formulation, matrix):
    """x' ~ 3 and y' ~ 1 tied: the least change of the momenta M_ii f_i, so v = (M11^2 3 + M22^2 1)/(M11^2 + M22^2)."""
    system = system_of(matrix, formulation, 3.0, 1.0)
    found = consistent_start(system, 0.0).y[: system.unknowns]
    weights = np.diag(matrix) ** 2
    flows = found[np.flatnonzero(system.are("f"))[:2]]
    assert flows == pytest.approx(2 * [(weights @ [3.0, 1.0]) / weights.sum()], rel=1e-9)
