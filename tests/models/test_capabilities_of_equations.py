"""What the seed asks a modeller to be able to do (tests/data/README.md): principles and equations, 23 to 43."""

import numpy as np
import pytest
from book_entries import BOOK, begin, filled, solution, state
from capabilities import RC, REFERENCES, counts, entries, meets, printed
from model_runs import trace_of
from sysdyn.compiler.binding.oracle import Oracle
from sysdyn.compiler.forms.descriptor import BESIDE
from sysdyn.dsl.model import expression as ex


@pytest.mark.long
def test_23_virtual_work(capsys):
    """Printed as the sum of efforts by virtual displacements, in mechanical and electrical letters."""
    assert "δW = (F0 + F1 sin(w t)) δq1 + E δq3" in printed(capsys, "em_suspension", "lagrangian")


@pytest.mark.long
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


@pytest.mark.long
def test_25_kinetic_efforts(capsys):
    """The pull of the suspension's magnet is physical; the arm's terms in f^2 come of its angles alone."""
    assert "M f1' = -b0 f2^2/(2 (b1 + q1)^2) + F0 + F1 sin(w t)" in printed(capsys, "em_suspension", "lagrangian")
    angles = printed(capsys, "two_link_arm_lagrange_coordinates", "lagrangian")
    assert any("m2 l1 l2 sin(q1 - q2) f1^2" in line for line in angles)
    assert not any("f1^2" in line for line in printed(capsys, "two_link_arm_cartesian", "lagrangian")[3:])


@pytest.mark.long
def test_26_applied_efforts(capsys):
    """A torque resolved on the pin's Cartesian coordinates."""
    meets("slider_crank")
    assert "δW = -tau q2/r^2 δq1 + tau q1/r^2 δq2" in printed(capsys, "slider_crank", "lagrangian")


@pytest.mark.long
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


@pytest.mark.long
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


@pytest.mark.long
def test_30_lagrange_ode():
    """Independent coordinates: no multiplier, index 0."""
    for key in ("pendulum", "two_link_arm"):
        made = [m for m in meets(key, "lagrangian") if m[2].index == 0]
        assert [entry.counts[1:5] for entry, _, _ in made] == [(0, 0, 0, 0)]


@pytest.mark.long
def test_31_lagrangian_dae(capsys):
    """The multiplier rule: M f' + Phi_q^T kappa = Y."""
    lines = printed(capsys, "pendulum", "lagrangian")
    for wanted in ("m f1' + 2 q1 κ1 = 0", "m f2' + 2 q2 κ1 = -m g", "0 = q1^2 + q2^2 - l^2"):
        assert wanted in lines


@pytest.mark.long
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


@pytest.mark.long
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


@pytest.mark.long
def test_38_co_lagrangian_dae():
    for key in ("co_circuit", "msd_velocity_source", "two_tank", "mass_spring"):
        meets(key, "co_lagrangian")


@pytest.mark.long
def test_39_co_hamiltonian_dae(capsys):
    """The book's sign: k q2 + e2 = 0."""
    for key in ("co_circuit", "msd_velocity_source", "two_tank", "mass_spring"):
        meets(key, "co_hamiltonian")
    assert "e2 = -k q2" in printed(capsys, "msd_velocity_source", "co_hamiltonian")


@pytest.mark.long
def test_40_complementary_constraints():
    """Momentum constraints with initial momenta, an effort constraint."""
    assert counts("msd_velocity_source") == {(3, 2, 0, 0, 0)}
    assert counts("two_tank", "co_lagrangian", "co_hamiltonian") == {(4, 1, 1, 0, 0)}


@pytest.mark.long
def test_41_duality(capsys):
    """Two tanks: balances of flows in momenta, balances of efforts in displacements; one solution."""
    meets("two_tank")
    lines = [line.partition("C1 e1' + κ1 = ")[2] for line in printed(capsys, "two_tank", "co_lagrangian")]
    assert {"F0", "F0 sin(w t)"} in [set(line.split(" + ")) for line in lines]
    assert "κ1 = q2/C1" in printed(capsys, "two_tank_lagrangian_counterpart", "lagrangian")


# -- chapter 6 ---------------------------------------------------------------------------------------------------------


@pytest.mark.long
def test_42_analysis_procedure(tmp_path):
    """Text to trace in one call: coordinates, energies, constraint, work, parameters, start, solution."""
    text = (BOOK / "pendulum_minimal.sd").read_text()
    reference = REFERENCES["pendulum"]
    found = trace_of(tmp_path, text, scene="reference", accuracy=1e-7, at=",".join(map(repr, reference["t"])))
    places = [int(np.argmin(np.abs(found.time - t))) for t in reference["t"]]
    wanted = np.array([float(v) for v in reference["state_values"]["th"]])
    assert np.max(np.abs(found["q1"].values[places] - wanted)) <= 1e-6 * np.max(np.abs(wanted))


@pytest.mark.long
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
