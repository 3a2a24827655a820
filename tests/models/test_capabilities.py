"""What the seed asks a modeller to be able to do (tests/data/README.md), a test named after each: 1 to 22.

Most use the texts of models/book: the compiled rows must hold on the independent solution (`meets`), beside what is
particular to the capability.  Stability and inequalities (53, 54) are tested in files of their own too.
"""

import numpy as np
import pytest
from book_entries import begin, filled, solution, state
from capabilities import RC, REFERENCES, counts, entries, meets
from model_runs import trace_of
from reduced import ROOT
from sysdyn.cli.analysis.operating_point import compile_target
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.compiler.binding.oracle import Oracle
from sysdyn.compiler.model.mirror import letter
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.calculus import derivative
from sysdyn.dsl.model.dimensions import ENERGY, POWER
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.units import multiply
from sysdyn.dsl.text.diagnostics import Report

# -- chapters 1 and 2 --------------------------------------------------------------------------------------------------


@pytest.mark.long
def test_01_unified_variables():
    """Effort times flow is a power; momentum and displacement are their integrals; heat is the pseudo domain."""
    seen = set()
    for key in ("lever", "brake_by_wire"):
        (_, made, _), *_ = meets(key, "lagrangian")
        for c in made.network.coordinates:
            seen.add(c.flow.text)
            for pair, product in (
                ((c.effort, c.flow), POWER),
                ((c.effort, c.displacement), ENERGY),
                ((c.momentum, c.flow), ENERGY),
            ):
                one, other = (unit.dimension for unit in pair)
                assert multiply(one, other) == product
    assert len(seen) == 4  # translation, rotation, electrical, fluid
    warm = compile_target(RunRequest(str(ROOT / "models" / "seed" / "thermal_two_node.sd"), backend="numpy"), Report())
    assert all(multiply(c.effort.dimension, c.flow.dimension) != POWER for c in warm[1].compiled.network.coordinates)


@pytest.mark.parametrize(
    ("formulation", "kinds"),
    [("lagrangian", {"q", "f"}), ("hamiltonian", {"q", "f", "p"}), ("co_lagrangian", {"p", "e"}),
     ("co_hamiltonian", {"p", "e", "q"})],
)  # fmt: skip
def test_02_paynter_diagram(formulation, kinds):
    """Which variables of the diagram are unknowns: (q, f), (q, p), (p, e), (p, q)."""
    (made,) = meets("mass_spring", formulation)
    found = {letter(formulation, f.kind) for f in made[1].form.families if f.kind != "audit"}
    assert found == kinds


@pytest.mark.long
def test_03_power_and_energy(tmp_path):
    """P = e f, E = its integral: what the capacitor gives the resistor turns to heat."""
    found = trace_of(tmp_path, RC)
    t = found.time
    lost = 9.0 / 0.5 * np.exp(-2 * t)
    assert found["lost"].values == pytest.approx(lost, abs=1e-7 * 18)
    assert found["absorbed"].values == pytest.approx(-lost, abs=1e-7 * 18)
    assert found["heat"].values == pytest.approx(9.0 * (1 - np.exp(-2 * t)), abs=1e-7 * 9)
    assert found["stored"].values == pytest.approx(9.0 * np.exp(-2 * t), abs=1e-7 * 9)


@pytest.mark.long
def test_04_kinetic_stores():
    """Linear, saturating with speed (relativistic), and with an inductance that moves; by T* and by T."""
    for key in ("mass_spring", "relativistic_mass", "solenoid"):
        meets(key)


@pytest.mark.long
def test_05_potential_stores():
    """A linear and a cubic spring by V, a spring by V*."""
    meets("nonlinear_spring")
    meets("mass_spring", "lagrangian", "co_lagrangian")


@pytest.mark.long
def test_06_dissipators():
    """Content D, cocontent G, and Coulomb friction through virtual work alone."""
    meets("nonlinear_spring", "lagrangian")
    meets("co_circuit", "co_lagrangian")
    (made,) = meets("coulomb_planar")
    assert not made[1].energies.function("D")


@pytest.mark.long
def test_07_sources_of_time():
    """An effort source, and a flow source as implicit effort and as rheonomic constraint: one solution."""
    meets("electrical_transformer")
    assert counts("fluid_tank") == {(3, 1, 0, 1, 0), (3, 1, 1, 0, 0)}


@pytest.mark.long
def test_08_legendre_transformation():
    """T + T* = p f and dT*/dq = -dT/dq on the solution of the solenoid, from the compiled rows of both forms."""
    (_, lagrange, _), (_, hamilton, _) = meets("solenoid")
    (entry,) = entries("solenoid", "hamiltonian")
    values = next(row for _, row in list(solution(entry))[3:])
    at = {ex.var(f"q{k}", kind): values[f"{kind}{k}"] for k in (1, 2) for kind in "qfp"}
    at |= {ex.param(n): float(v) for n, v in REFERENCES["solenoid"]["parameters"].items()}
    coenergy = ex.add(*(t.expression for t in lagrange.energies.function("T*")))
    energy = ex.add(*(t.expression for t in hamilton.functions.function("T")))
    look = {repr(k): v for k, v in at.items()}
    x = ex.var("q2", "q")
    roots = [coenergy, energy, derivative(coenergy, _own(coenergy, x)), derivative(energy, _own(energy, x))]
    tstar, t, pull, back = evaluate(roots, lambda n: look[repr(n)])
    assert tstar + t == pytest.approx(sum(values[f"p{k}"] * values[f"f{k}"] for k in (1, 2)), rel=1e-12)
    assert pull == pytest.approx(-back, rel=1e-12)


def _own(root, node):
    """The node of an expression that was made in another table of nodes."""
    return next(n for n in ex.variables(root) if repr(n) == repr(node))


@pytest.mark.long
def test_09_transformers():
    for key in ("lever", "gear_pair", "electrical_transformer", "fluid_transformer"):
        meets(key)


@pytest.mark.long
def test_10_transforming_transducers():
    for key in ("rack_pinion", "ram_cylinder", "pd_pump"):
        meets(key)


@pytest.mark.long
def test_11_gyrators():
    """Two implicit efforts each, which do no work together."""
    for key in ("dc_motor", "mechanical_gyrator", "voice_coil"):
        assert counts(key) == {(2, 0, 0, 2, 0)}


@pytest.mark.long
def test_12_signal_transducers():
    """The speed that a controller reads loads nothing: the brake's rows have no effort of the sensor."""
    meets("brake_by_wire")
    meets("pi_controller")


@pytest.mark.long
def test_13_transactors():
    """The four controlled sources as effort constraints: the controlling port is not loaded."""
    for key in ("transactor_vcvs", "transactor_ccvs", "transactor_vccs", "transactor_cccs"):
        assert all(m3 == 1 for _, _, _, m3, _ in counts(key))


@pytest.mark.long
def test_14_configuration_coordinates():
    """The arm in four Cartesian coordinates and in two angles: one motion, dof 2 in both."""
    made = meets("two_link_arm", "lagrangian")
    assert {entry.counts[0] for entry, _, _ in made} == {2, 4}
    assert {facts.dof for _, _, facts in made} == {2}


@pytest.mark.long
def test_15_complementary_configuration():
    """Momenta as coordinates."""
    assert counts("co_circuit") == {(3, 0, 0, 0, 0)}


@pytest.mark.long
def test_16_displacement_constraints():
    """Scleronomic (slider-crank) and rheonomic (bead on a turning rod)."""
    meets("slider_crank")
    meets("bead_rod")


@pytest.mark.long
def test_17_flow_constraints():
    """Integrable and nonholonomic; the disk keeps four configurations for two degrees of freedom."""
    meets("electrical_transformer")
    for key, dof, configurations in (("knife_edge", 2, 3), ("rolling_disk", 2, 4)):
        for _, _, facts in meets(key, "lagrangian"):
            assert (facts.dof, facts.configuration_dof) == (dof, configurations)


def test_18_tangible_displacements():
    """A flow constraint that moves a charge is integrated with its initial content, a constant of the form."""
    with ex.fresh():
        _, prepared = compile_target(RunRequest(str(ROOT / "models/seed/lead_filter.sd"), backend="numpy"), Report())
        assert len(prepared.compiled.form.offsets) == 1
        assert any(d.code == "N501" for d in prepared.compiled.notes)


@pytest.mark.long
def test_19_degrees_of_freedom():
    """n - m1 - m2 where the constraints are independent."""
    for key in ("pendulum", "slider_crank", "parallelogram", "rolling_disk", "lead_filter", "lc_ladder"):
        for entry, _, facts in meets(key, "lagrangian"):
            n, m1, m2 = entry.counts[:3]
            assert facts.dof == n - m1 - m2


@pytest.mark.long
def test_20_effort_constraints():
    """A diode, a motor, friction: implicit efforts closed by gamma."""
    for key in ("diode_circuit", "dc_motor", "incline_friction", "coulomb_planar"):
        assert all(m3 > 0 for _, _, _, m3, _ in counts(key))


@pytest.mark.long
def test_21_dynamic_constraints():
    """Integral control and the junctions of a transistor."""
    assert counts("integral_controller") == {(1, 0, 0, 1, 1)}
    assert counts("ebers_moll") == {(2, 0, 0, 2, 2)}


@pytest.mark.long
def test_22_displacement_classes():
    """Phi_q f + Phi_t = 0 of the bead: the actual motion has the term of time, the virtual one has not."""
    (entry,) = (e for e in entries("bead_rod", "lagrangian") if e.file == "bead_rod_sin_cos_form")
    with ex.fresh():
        prepared, _ = begin(entry)
        oracle = Oracle(prepared.compiled.form, prepared.binding)
        (row,) = (int(oracle.to[k]) for k, r in enumerate(prepared.compiled.form.rows) if r.block == "phi")
        t, values = list(solution(entry))[3]
        y, yd = state(prepared.compiled.form, values)
        yd = filled(oracle, t, y, yd)
        actual = oracle.rows("phi_rate", t, y, yd)[row]
        families = prepared.compiled.form.families
        frozen = np.array([0.0 if f.kind == "f" else v for f, v in zip(families, y, strict=True)])
        of_time = oracle.rows("phi_rate", t, frozen, yd)[row]
    assert abs(actual) < 1e-14
    w0, c = (REFERENCES["bead_rod"]["parameters"][n] for n in ("w0", "c"))
    partial = w0 * (values["q1"] * np.cos(w0 * t) + (values["q2"] - c) * np.sin(w0 * t))
    assert of_time == pytest.approx(partial, rel=1e-12)
    assert abs(partial) > 1e-2
