"""What the seed asks a modeller to be able to do (seed/README.md, section 2), a test named after each capability.

Most use the texts of models/book: the compiled rows must hold on the independent solution (`meets`), beside what is
particular to the capability.  Stability and inequalities (53, 54) are tested in files of their own too.
"""

import json

import numpy as np
import pytest
from book_entries import BOOK, ENTRIES, begin, filled, residual, solution, state
from model_runs import trace_of
from reduced import ROOT, load
from sysdyn.cli.analysis.asked import compiled
from sysdyn.cli.main import run
from sysdyn.cli.run.request.asked import Request
from sysdyn.compiler.binding.oracle import Oracle
from sysdyn.compiler.forms.descriptor import BESIDE
from sysdyn.compiler.model.mirror import letter
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.calculus import derivative
from sysdyn.dsl.model.dimensions import ENERGY, POWER
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.units import multiply
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.runtime.structure.structure import structure

REFERENCES = load("references.json")


def entries(key, *formulations):
    found = [e for e in ENTRIES if e.key == key and (not formulations or e.formulation in formulations)]
    assert found, key
    return found


def meets(key, *formulations):
    """Every descriptor model of a system holds on its independent solution; returns (entry, form, facts) of each."""
    made = []
    for entry in entries(key, *formulations):
        with ex.fresh():
            prepared, found = begin(entry)
            assert residual(entry, prepared) < 1e-12, entry.name
            made.append((entry, prepared.compiled, structure(found.system, found.state)))
    return made


def counts(key, *formulations):
    """(n, m1, m2, m3, m4) of each model, all checked."""
    return {entry.counts[:5] for entry, _, _ in meets(key, *formulations)}


def printed(capsys, file, formulation, form="descriptor"):
    """The lines of `sysdyn equations` of a text of models/book."""
    options = ["--scene", "reference", "--formulation", formulation, "--form", form, "--quiet"]
    assert run(["equations", str(BOOK / f"{file}.sd"), *options]) == 0
    return [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()]


# -- chapters 1 and 2 --------------------------------------------------------------------------------------------------


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
    warm = compiled(Request(str(ROOT / "models" / "seed" / "thermal_two_node.sd"), backend="numpy"), Report())
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


RC = """model rc {
  node a: electrical
  C: potential(q = 2 F*e) a -> ground
  R: dissipator(e = 0.5 ohm*f) a -> ground
  init C.e = 3 V
}
scene s of rc {
  time 0 s to 1 s
  accuracy 1e-9
  trace C.power as absorbed, R.power as lost, R.energy as heat, C.V as stored, audit.energy as balance every 0.1 s
}
"""


def test_03_power_and_energy(tmp_path):
    """P = e f, E = its integral: what the capacitor gives the resistor turns to heat."""
    found = trace_of(tmp_path, RC)
    t = found.time
    lost = 9.0 / 0.5 * np.exp(-2 * t)
    assert found["lost"].values == pytest.approx(lost, abs=1e-7 * 18)
    assert found["absorbed"].values == pytest.approx(-lost, abs=1e-7 * 18)
    assert found["heat"].values == pytest.approx(9.0 * (1 - np.exp(-2 * t)), abs=1e-7 * 9)
    assert found["stored"].values == pytest.approx(9.0 * np.exp(-2 * t), abs=1e-7 * 9)


def test_04_kinetic_stores():
    """Linear, saturating with speed (relativistic), and with an inductance that moves; by T* and by T."""
    for key in ("mass_spring", "relativistic_mass", "solenoid"):
        meets(key)


def test_05_potential_stores():
    """A linear and a cubic spring by V, a spring by V*."""
    meets("nonlinear_spring")
    meets("mass_spring", "lagrangian", "co_lagrangian")


def test_06_dissipators():
    """Content D, cocontent G, and Coulomb friction through virtual work alone."""
    meets("nonlinear_spring", "lagrangian")
    meets("co_circuit", "co_lagrangian")
    (made,) = meets("coulomb_planar")
    assert not made[1].energies.function("D")


def test_07_sources_of_time():
    """An effort source, and a flow source as implicit effort and as rheonomic constraint: one solution."""
    meets("electrical_transformer")
    assert counts("fluid_tank") == {(3, 1, 0, 1, 0), (3, 1, 1, 0, 0)}


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


def test_09_transformers():
    for key in ("lever", "gear_pair", "electrical_transformer", "fluid_transformer"):
        meets(key)


def test_10_transforming_transducers():
    for key in ("rack_pinion", "ram_cylinder", "pd_pump"):
        meets(key)


def test_11_gyrators():
    """Two implicit efforts each, which do no work together."""
    for key in ("dc_motor", "mechanical_gyrator", "voice_coil"):
        assert counts(key) == {(2, 0, 0, 2, 0)}


def test_12_signal_transducers():
    """The speed that a controller reads loads nothing: the brake's rows have no effort of the sensor."""
    meets("brake_by_wire")
    meets("pi_controller")


def test_13_transactors():
    """The four controlled sources as effort constraints: the controlling port is not loaded."""
    for key in ("transactor_vcvs", "transactor_ccvs", "transactor_vccs", "transactor_cccs"):
        assert all(m3 == 1 for _, _, _, m3, _ in counts(key))


def test_14_configuration_coordinates():
    """The arm in four Cartesian coordinates and in two angles: one motion, dof 2 in both."""
    made = meets("two_link_arm", "lagrangian")
    assert {entry.counts[0] for entry, _, _ in made} == {2, 4}
    assert {facts.dof for _, _, facts in made} == {2}


def test_15_complementary_configuration():
    """Momenta as coordinates."""
    assert counts("co_circuit") == {(3, 0, 0, 0, 0)}


def test_16_displacement_constraints():
    """Scleronomic (slider-crank) and rheonomic (bead on a turning rod)."""
    meets("slider_crank")
    meets("bead_rod")


def test_17_flow_constraints():
    """Integrable and nonholonomic; the disk keeps four configurations for two degrees of freedom."""
    meets("electrical_transformer")
    for key, dof, configurations in (("knife_edge", 2, 3), ("rolling_disk", 2, 4)):
        for _, _, facts in meets(key, "lagrangian"):
            assert (facts.dof, facts.configuration_dof) == (dof, configurations)


def test_18_tangible_displacements():
    """A flow constraint that moves a charge is integrated with its initial content, a constant of the form."""
    with ex.fresh():
        _, prepared = compiled(Request(str(ROOT / "models/seed/lead_filter.sd"), backend="numpy"), Report())
        assert len(prepared.compiled.form.offsets) == 1
        assert any(d.code == "N501" for d in prepared.compiled.notes)


def test_19_degrees_of_freedom():
    """n - m1 - m2 where the constraints are independent."""
    for key in ("pendulum", "slider_crank", "parallelogram", "rolling_disk", "lead_filter", "lc_ladder"):
        for entry, _, facts in meets(key, "lagrangian"):
            n, m1, m2 = entry.counts[:3]
            assert facts.dof == n - m1 - m2


def test_20_effort_constraints():
    """A diode, a motor, friction: implicit efforts closed by gamma."""
    for key in ("diode_circuit", "dc_motor", "incline_friction", "coulomb_planar"):
        assert all(m3 > 0 for _, _, _, m3, _ in counts(key))


def test_21_dynamic_constraints():
    """Integral control and the junctions of a transistor."""
    assert counts("integral_controller") == {(1, 0, 0, 1, 1)}
    assert counts("ebers_moll") == {(2, 0, 0, 2, 2)}


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


def test_23_virtual_work(capsys):
    """Printed as the sum of efforts by virtual displacements, in mechanical and electrical letters."""
    assert "δW = (F0 + F1 sin(w t)) δq1 + E δq3" in printed(capsys, "em_suspension", "lagrangian")


def test_24_lagranges_principle():
    """Constraint efforts do no virtual work: -(Phi_q^T kappa) dq = 0 for every dq with Phi_q dq = 0."""
    (entry,) = entries("slider_crank", "lagrangian")
    with ex.fresh():
        prepared, _ = begin(entry)
        form = prepared.compiled.form
        oracle = Oracle(form, prepared.binding)
        t, values = list(solution(entry))[2]
        y, yd = state(form, values)
        rows = [int(oracle.to[k]) for k, r in enumerate(form.rows) if r.block == "dynamics"]
        efforts = -oracle.rows("phi_reaction", t, y, filled(oracle, t, y, yd))[rows]
        q1, q2, q3 = (values[f"q{k}"] for k in (1, 2, 3))
    gradients = np.array([[2 * q1, 2 * q2, 0.0], [-2 * (q3 - q1), 2 * q2, 2 * (q3 - q1)]])
    virtual = np.linalg.svd(gradients)[2][-1]
    assert np.linalg.norm(efforts) > 1e-2
    assert abs(efforts @ virtual) <= 1e-14 * np.linalg.norm(efforts)


def test_25_kinetic_efforts(capsys):
    """The pull of the suspension's magnet is physical; the arm's terms in f^2 come of its angles alone."""
    assert "M f1' = -b0 f2^2/(2 (b1 + q1)^2) + F0 + F1 sin(w t)" in printed(capsys, "em_suspension", "lagrangian")
    angles = printed(capsys, "two_link_arm_lagrange_coordinates", "lagrangian")
    assert any("m2 l1 l2 sin(q1 - q2) f1^2" in line for line in angles)
    assert not any("f1^2" in line for line in printed(capsys, "two_link_arm_cartesian", "lagrangian")[3:])


def test_26_applied_efforts(capsys):
    """A torque resolved on the pin's Cartesian coordinates."""
    meets("slider_crank")
    assert "δW = -tau q2/r^2 δq1 + tau q1/r^2 δq2" in printed(capsys, "slider_crank", "lagrangian")


def test_27_multipliers_are_reactions(tmp_path):
    """The force of the pendulum's rod: 2 l kappa = m (l om^2 + g cos th)."""
    (entry,) = (e for e in entries("pendulum", "lagrangian") if e.counts[0] == 2)
    m, length, g = (REFERENCES["pendulum"]["parameters"][n] for n in ("m", "l", "g"))
    for _, row in solution(entry):
        speed = np.hypot(row["f1"], row["f2"])
        assert 2 * length * row["kappa1"] == pytest.approx(m * (speed**2 / length - g * row["q2"] / length), rel=1e-12)
    meets("pendulum", "lagrangian")


def test_28_virtual_momentum(capsys):
    """delta H by virtual displacements and virtual momenta; (e, -f) is orthogonal to the phase trajectory."""
    lines = printed(capsys, "mass_spring", "hamiltonian", "canonical")
    assert "δH = k q1 δq1 + p1/M δp1" in lines
    (entry,) = entries("mass_spring", "hamiltonian")
    m, k = (REFERENCES["mass_spring"]["parameters"][n] for n in ("M", "k"))
    with ex.fresh():
        prepared, _ = begin(entry)
        form = prepared.compiled.form
        oracle = Oracle(form, prepared.binding)
        places = {(f.owner, f.kind): int(oracle.at[j]) for j, f in enumerate(form.families)}
        for t, row in solution(entry):
            y, yd = state(form, row)
            yd = filled(oracle, t, y, yd)
            dq, dp = yd[places["q1", "q"]], yd[places["q1", "p"]]
            effort, flow = -k * row["q1"], row["p1"] / m
            assert abs(effort * dq - flow * dp) <= 1e-14 * (abs(effort * dq) + 1e-3)


# -- chapter 3 ---------------------------------------------------------------------------------------------------------


def test_29_first_law_in_variational_form():
    """d(T + V)/dt + dissipated - supplied = 0 along every virtual motion: the audit's identity on random states."""
    for entry in entries("em_suspension"):
        with ex.fresh():
            prepared, _ = begin(entry)
            form = prepared.compiled.form
            oracle = Oracle(form, prepared.binding)
            rows = {r.owner: int(oracle.to[k]) for k, r in enumerate(form.rows) if r.block == "audit"}
            for t, row in solution(entry):
                y, yd = state(form, row)
                yd = filled(oracle, t, y, yd)
                audit = oracle.rows("audit", t, y, yd)
                h = 1e-6
                stored = [oracle.rows("audit", t, y + s * h * yd, yd) for s in (-1, 1)]
                rate = sum((stored[1] - stored[0])[rows[n]] for n in ("kinetic", "potential")) / (2 * h)
                balance = rate + audit[rows["dissipated"]] - audit[rows["supplied"]]
                size = abs(rate) + abs(audit[rows["dissipated"]]) + abs(audit[rows["supplied"]])
                assert abs(balance) <= 1e-7 * max(size, 1e-3)


def test_30_lagrange_ode():
    """Independent coordinates: no multiplier, index 0."""
    for key in ("pendulum", "two_link_arm"):
        made = [m for m in meets(key, "lagrangian") if m[2].index == 0]
        assert [entry.counts[1:5] for entry, _, _ in made] == [(0, 0, 0, 0)]


def test_31_lagrangian_dae(capsys):
    """The multiplier rule: M f' + Phi_q^T kappa = Y."""
    lines = printed(capsys, "pendulum", "lagrangian")
    for wanted in ("m f1' + 2 q1 κ1 = 0", "m f2' + 2 q2 κ1 = -m g", "0 = q1^2 + q2^2 - l^2"):
        assert wanted in lines


def test_32_work_energy_statement(tmp_path):
    """The balance of energy of a run is the sum of what is stored, dissipated and supplied."""
    found = trace_of(tmp_path, RC)
    assert np.max(np.abs(found["balance"].values)) <= 1e-7


def test_33_underlying_lagrange_ode_holonomic(capsys):
    """kappa = (Phi_q M^-1 Phi_q^T)^-1 (Phi_q M^-1 Y + Z1): m (f1^2 + f2^2 - g q2)/(2 l^2) of the pendulum."""
    lines = printed(capsys, "pendulum", "lagrangian", "underlying")
    assert "κ1 = -m (g q2 - f1^2 - f2^2)/(2 q1^2 + 2 q2^2)" in lines
    assert "f1' = (g q1 q2 - q1 f1^2 - q1 f2^2)/(q1^2 + q2^2)" in lines


def test_34_underlying_lagrange_ode_nonholonomic(capsys):
    lines = printed(capsys, "knife_edge_sin_cos_form", "lagrangian", "underlying")
    assert "f3' = 0" in lines
    assert any(line.startswith("μ1 =") for line in lines)


# -- chapter 4 ---------------------------------------------------------------------------------------------------------


def test_35_hamiltonian_dae(capsys):
    """Coordinates with a momentum and without: the suspension's third has none."""
    for _, made, _ in meets("em_suspension", "hamiltonian"):
        assert [f.owner for f in made.form.families if f.kind == "p"] == ["q1", "q2"]
    lines = printed(capsys, "em_suspension", "hamiltonian")
    for wanted in ("p1' = -p2^2/(2 b0) + F0 + F1 sin(w t)", "p2' = -μ1", "μ1 = R f3 - E", "f2 = (b1 + q1) p2/b0"):
        assert wanted in lines


def test_36_underlying_hamilton_ode(capsys):
    """With a displacement and with a flow constraint."""
    for file in ("pendulum", "knife_edge_sin_cos_form"):
        lines = printed(capsys, file, "hamiltonian", "underlying")
        assert sum(line.startswith("p") for line in lines) >= 2
        assert not any("p1'" in line.partition("=")[2] for line in lines)


def test_37_canonical_form(capsys):
    """q' = dH/dp, p' = -dH/dq without f."""
    lines = printed(capsys, "mass_spring", "hamiltonian", "canonical")
    for wanted in ("H = p1^2/(2 M) + 1/2 k q1^2", "q1' = p1/M", "p1' = -k q1"):
        assert wanted in lines


# -- chapter 5 ---------------------------------------------------------------------------------------------------------


def test_38_co_lagrangian_dae():
    for key in ("co_circuit", "msd_velocity_source", "two_tank", "mass_spring"):
        meets(key, "co_lagrangian")


def test_39_co_hamiltonian_dae(capsys):
    """The book's sign: k q2 + e2 = 0."""
    for key in ("co_circuit", "msd_velocity_source", "two_tank", "mass_spring"):
        meets(key, "co_hamiltonian")
    assert "e2 = -k q2" in printed(capsys, "msd_velocity_source", "co_hamiltonian")


def test_40_complementary_constraints():
    """Momentum constraints with initial momenta, an effort constraint."""
    assert counts("msd_velocity_source") == {(3, 2, 0, 0, 0)}
    assert counts("two_tank", "co_lagrangian", "co_hamiltonian") == {(4, 1, 1, 0, 0)}


def test_41_duality(capsys):
    """Two tanks: balances of flows in momenta, balances of efforts in displacements; one solution."""
    meets("two_tank")
    lines = [line.partition("C1 e1' + κ1 = ")[2] for line in printed(capsys, "two_tank", "co_lagrangian")]
    assert {"F0", "F0 sin(w t)"} in [set(line.split(" + ")) for line in lines]
    assert "κ1 = q2/C1" in printed(capsys, "two_tank_lagrangian_counterpart", "lagrangian")


# -- chapter 6 ---------------------------------------------------------------------------------------------------------


def test_42_analysis_procedure(tmp_path):
    """Text to trace in one call: coordinates, energies, constraint, work, parameters, start, solution."""
    text = (BOOK / "pendulum_minimal.sd").read_text()
    reference = REFERENCES["pendulum"]
    found = trace_of(tmp_path, text, scene="reference", accuracy=1e-7, at=",".join(map(repr, reference["t"])))
    places = [int(np.argmin(np.abs(found.time - t))) for t in reference["t"]]
    wanted = np.array([float(v) for v in reference["state_values"]["th"]])
    assert np.max(np.abs(found["q1"].values[places] - wanted)) <= 1e-6 * np.max(np.abs(wanted))


def test_43_consistent_initial_conditions():
    """Multipliers and hidden constraints at the start, against the first row of the known solution."""
    for key in ("pendulum_spring", "slider_crank", "rectifier_motor_crank"):
        (entry,) = entries(key, "lagrangian")
        with ex.fresh():
            prepared, found = begin(entry)
            _, row = next(iter(solution(entry)))
            y, _ = state(prepared.compiled.form, row)
            kinds = [f.kind for f in prepared.compiled.form.families]
            places = [k for k, kind in enumerate(kinds) if kind not in BESIDE]
            assert found.state.y[places] == pytest.approx(y[places], rel=1e-8, abs=1e-9 * np.max(np.abs(y)))


@pytest.mark.parametrize(
    ("method", "error"), [("euler", 2e-2), ("bdf", 1e-6), ("radau", 1e-6)],
    ids=["44_implicit_euler", "45_bdf", "46_implicit_runge_kutta"],
)  # fmt: skip
def test_44_45_46_methods(method, error, tmp_path):
    """The undamped oscillator over one of its periods."""
    text = (BOOK / "mass_spring.sd").read_text().replace("scene reference of mass_spring {", "scene s of mass_spring {")
    how = "solver euler(step = 1 ms)" if method == "euler" else f"solver {method}\n  accuracy 1e-8"
    text = text.replace("  trace q1", f"  {how}\n  trace q1")
    found = trace_of(tmp_path, text, until="1")
    values = REFERENCES["mass_spring"]
    m, k = (values["parameters"][n] for n in ("M", "k"))
    x, v = (values["initial"][n] for n in ("x", "v"))
    w = np.sqrt(k / m)
    exact = x * np.cos(w * found.time) + v / w * np.sin(w * found.time)
    assert np.max(np.abs(found["q1"].values - exact)) <= error * np.max(np.abs(exact))


def test_47_differential_index():
    """0 to 3, of each kind of constraint; none where a constraint is stated twice."""
    wanted = {"mass_spring": 0, "dc_motor": 1, "knife_edge": 2, "slider_crank": 3, "redundant_pendulum": None}
    for key, index in wanted.items():
        assert {facts.index for _, _, facts in meets(key, "lagrangian")} == {index}


def test_48_index_reduction():
    """Phi replaced by its second derivative: the rows hold on the solution and determine f' and kappa."""
    (entry,) = entries("slider_crank", "lagrangian")
    with ex.fresh():
        prepared, found = begin(entry)
        form = prepared.compiled.form
        oracle = Oracle(form, prepared.binding)
        for t, row in solution(entry):
            y, yd = state(form, row)
            yd = filled(oracle, t, y, yd)
            for block in ("phi_rate", "phi_acceleration"):
                scale = oracle.magnitudes(block, t, y, yd).max()
                assert np.max(np.abs(oracle.rows(block, t, y, yd))) <= 1e-13 * max(scale, 1.0)
        assert found.system.another("1").form.name == "1"


def test_49_drift_and_its_stabilisation(tmp_path):
    """Forms of lower index keep the constraint where the plain underlying equation leaves it (the seed: 4e-6)."""
    text = (BOOK / "pendulum.sd").read_text().replace("trace q1", "trace q1^2 + q2^2 as square, q1")
    for index in ("1", "2"):
        found = trace_of(tmp_path, text, scene="reference", accuracy=1e-5, index=index)
        length = REFERENCES["pendulum"]["parameters"]["l"]
        assert np.max(np.abs(found["square"].values - length**2)) <= 1e-8


def test_50_generated_files(tmp_path, capsys):
    """Function file, its data, and the names of rows and unknowns."""
    options = ["--scene", "reference", "-o", str(tmp_path), "--quiet"]
    assert run(["compile", str(BOOK / "slider_crank.sd"), *options]) == 0
    capsys.readouterr()
    assert {"residual.c", "binding.json", "manifest.json", "sysdyn_model.h"} <= {p.name for p in tmp_path.iterdir()}
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    assert "phi_1.multiplier" in [u["name"] for u in manifest["unknowns"]]


def test_51_constraint_errors(tmp_path):
    """A meter in every trace."""
    found = trace_of(tmp_path, (BOOK / "slider_crank.sd").read_text(), scene="reference", until="1")
    assert 0.0 <= np.max(found["audit/constraints"].values) <= 1e-6


def test_52_verification_by_a_transfer_function(tmp_path):
    """(6.43): the lead filter in the steady state against its transfer function."""
    text = (ROOT / "models" / "seed" / "lead_filter.sd").read_text()
    found = trace_of(tmp_path, text, scene="reference", accuracy=1e-7)
    p = REFERENCES["lead_filter"]["parameters"]
    s = 1j * p["w"]
    gain = p["R2"] * (1 + p["R1"] * p["C"] * s) / (p["R1"] + p["R2"] + p["R1"] * p["R2"] * p["C"] * s)
    rate = (p["R1"] + p["R2"]) / (p["R1"] * p["R2"] * p["C"])
    late = np.exp(-rate * found.time) < 1e-7
    assert late.sum() > 100
    steady = np.imag(p["E"] * gain * np.exp(s * found.time))
    assert np.max(np.abs(found["e_o"].values - steady)[late]) <= 1e-6 * abs(p["E"] * gain)


# -- afterword ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", ["bouncing_ball", "stiction_oscillator"])
def test_53_inequality_constraints(model, tmp_path):
    """Unilateral contact with restitution, dry friction with sticking: against the exact piecewise solutions."""
    reference = REFERENCES[model]
    text = (ROOT / "models" / "seed" / f"{model}.sd").read_text()
    times = reference["t"][1:]
    found = trace_of(tmp_path, text, scene="reference", accuracy=1e-7, at=",".join(map(repr, times)))
    places = [int(np.argmin(np.abs(found.time - t))) for t in times]
    for name, values in reference["values"].items():
        assert np.max(np.abs(found[name].values[places] - values[1:])) <= 1e-6 * np.max(np.abs(values)), name


def test_54_stability_of_constrained_systems(capsys):
    """Of the inverted pendulum in Cartesian coordinates: one growing mode, that of th'' = (g/l) th - (c/m) th'."""
    path = str(ROOT / "models" / "seed" / "inverted_pendulum.sd")
    assert run(["linearize", path, "--scene", "reference", "--set", "th_0=3.141592653589793", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["result"]["eigenvalues"]
    p = REFERENCES["inverted_pendulum"]["parameters"]
    damping = p["c"] / p["m"] / 2
    growing = -damping + np.sqrt(damping**2 + p["g"] / p["l"])
    assert max(re for re, _ in found) == pytest.approx(growing, rel=1e-6)


def test_55_distributed_parameters():
    """A line in pieces: eight cells, 17 branches, 8 junctions."""
    assert counts("lc_ladder") == {(17, 8, 0, 0, 0)}


def test_56_multibody():
    """A closed chain, an arm, slider and crank."""
    for key in ("parallelogram", "two_link_arm", "slider_crank"):
        meets(key)


def test_57_kane(capsys):
    """Without the multiplier of the blade, and of an effort constraint; quasi-velocities: test_kane.py."""
    lines = printed(capsys, "knife_edge_sin_cos_form", "kane")
    assert not any("μ" in line for line in lines)
    assert "J f3' = 0" in lines
    assert not any("μ" in line for line in printed(capsys, "two_tank", "co_kane"))


def test_58_control_laws():
    """Integral and proportional-integral: a dynamic and an effort constraint."""
    for key in ("integral_controller", "pi_controller", "brake_by_wire"):
        assert all(m3 and m4 for _, _, _, m3, m4 in counts(key))


def test_59_redundant_constraints():
    """The rod stated twice: its rows hold for any share of the two multipliers, and one row is named redundant."""
    for _, _, facts in meets("redundant_pendulum"):
        assert (facts.dof, facts.redundant, facts.index) == (1, 1, None)
