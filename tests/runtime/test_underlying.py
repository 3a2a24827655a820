"""The underlying equation against the book: slopes at the states of every catalogue entry with inertia, A1..A8."""

import os
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import eigh
from sysdyn import api

sys.path.insert(0, str(Path(__file__).parents[1] / "compiler"))

from catalogue import network, state
from reference_values import load
from sysdyn.cli.run.numpy_module import module_of
from sysdyn.cli.run.prepare import Prepared
from sysdyn.cli.run.request.run_request import RunRequest as Simulation
from sysdyn.cli.run.running import run
from sysdyn.compiler.pipeline import compile_network
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.runtime.integrate.integrate import Integration
from sysdyn.runtime.integrate.request import Request
from sysdyn.runtime.integrate.underlying import Underlying, _unmatched_unknowns
from sysdyn.runtime.model import carrier
from sysdyn.runtime.model.description import describe
from sysdyn.runtime.model.patterns import Pattern
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.start import ConsistentState
from sysdyn.runtime.trace.trace import Trace

ROOT = Path(__file__).parents[2]
LONG = bool(os.environ.get("SYSDYN_LONG"))
FORMULATIONS = ("lagrangian", "hamiltonian")
CATALOGUE, VALUES = load("catalogue.json"), load("descriptor_values.json")


def cases():
    """Entries whose underlying equation the book's formulas give (its column `underlying_ode_check`)."""
    for key, entry in CATALOGUE.items():
        for k, (model, checked) in enumerate(zip(entry["models"], entry["underlying_ode_check"], strict=True)):
            name = f"{key}|{model['form']}|{model['label'] or k}"
            if model["form"] in ("lagrangian", "hamiltonian") and checked[0][0].isdigit() and name in VALUES:
                yield pytest.param(key, k, name, id=name)


def made(key, k):
    """The system of index 0, and the descriptor form."""
    model = CATALOGUE[key]["models"][k]
    with x.fresh():
        compiled = compile_network(network(CATALOGUE[key], model), model["form"], "numpy", integrating=False)
        binding = compiled.bind()
        description = describe(compiled.manifest(binding), Prepared.arrays_of(binding))
        return System.from_description(description, carrier.load(module_of(compiled.text)), "0"), compiled.form


def point(system, form, values, k):
    """t, state with multipliers and implicit efforts, slopes [unknowns] of the independent solution; p' unknown."""
    _, y, yd = state(form, values, k)
    n = system.unknowns
    return values["t"][k], np.array(y[:n]), np.array([np.nan if v is None else v for v in yd[:n]])


def underlying(system, t, y):
    return Underlying(system, np.ones(system.unknowns))


def test_the_seed_has_them():
    names = [case.values[2] for case in cases()]
    assert len(names) == 54
    for key in ("knife_edge", "rolling_disk", "bead_rod", "slider_crank"):
        assert {f"{key}|lagrangian|0", f"{key}|hamiltonian|1"} <= set(names)


@pytest.mark.parametrize(("key", "k", "name"), list(cases()))
@pytest.mark.one_in(5)
def test_slopes_are_those_of_the_independent_solution(key, k, name):
    system, form = made(key, k)
    values = VALUES[name]
    for row in range(len(values["t"])):
        t, y, yd = point(system, form, values, row)
        state_alone = np.where(np.isin(system.kinds, ("kappa", "mu")), 0.0, y)
        found, slopes = underlying(system, t, y).slopes(t, state_alone, np.zeros_like(y))
        size = np.maximum(np.abs(y), 1e-3 * np.abs(y).max(initial=1.0))
        assert np.all(np.abs(found - y) <= 1e-9 * size)
        flows = system.kinds == "f"
        size = np.abs(yd[flows]) + 1e-3 * np.abs(yd[flows]).max(initial=1.0)
        assert np.all(np.abs(slopes - yd)[flows] <= 1e-9 * size)
        # the rows as written hold with p' and s'
        written = system.another("3")
        assert np.abs(written.residual(t, found, slopes)).max() <= 1e-9 * max(1.0, np.abs(slopes).max())


@pytest.mark.parametrize(
    "name",
    ["slider_crank|lagrangian|0", "rolling_disk|lagrangian|0", "bead_rod|lagrangian|0", "knife_edge|lagrangian|0"],
)
def test_multipliers_by_the_books_formulas(name):
    """[kappa; mu] = [[A1, A2], [A3, A4]]^-1 [Phi_q M^-1 Y + Z1; Psi_f M^-1 Y + Z2] (3.64)-(3.66)."""
    key, _, k = name.split("|")
    system, form = made(key, int(k))
    t, y, _ = point(system, form, VALUES[name], 3)
    kinds = system.kinds
    q, f, m = (np.flatnonzero(np.isin(kinds, item)) for item in (("q",), ("f",), ("kappa", "mu")))
    still = np.where(np.isin(kinds, ("kappa", "mu")), 0.0, y)
    jy, jyd = (system.dense(item) for item in system.jacobian(t, y, np.zeros_like(y)))
    rest = system.residual(t, still, np.zeros_like(y))
    dynamics = q.size + np.arange(f.size)
    constraints = q.size + f.size + np.arange(m.size)
    inertia, a = jyd[np.ix_(dynamics, f)], jyd[np.ix_(constraints, f)]
    applied, z = -rest[dynamics], rest[constraints]
    inverse = np.linalg.inv(inertia)
    multipliers = np.linalg.solve(a @ inverse @ a.T, a @ inverse @ applied + z)
    found, slopes = underlying(system, t, y).slopes(t, still, np.zeros_like(y))
    np.testing.assert_allclose(found[m], multipliers, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(slopes[f], inverse @ (applied - a.T @ multipliers), rtol=1e-10, atol=1e-11)
    assert np.abs(jy[np.ix_(dynamics, m)] - a.T).max() < 1e-12


def test_projection_is_the_least_change_in_the_metric_of_the_inertia():
    system, form = made("slider_crank", 0)
    t, y, yd = point(system, form, VALUES["slider_crank|lagrangian|0"], 2)
    away = np.random.default_rng(0).standard_normal(y.size)
    moved = y + 1e-5 * np.where(np.isin(system.kinds, ("q", "f")), away, 0.0)
    found = underlying(system, t, y).project(t, moved, np.zeros_like(y))
    settled = system.another("constraints")
    assert np.abs(settled.residual(t, found, yd)).max() < 1e-15
    jyd = system.dense(system.jacobian(t, found, np.zeros_like(y))[1])
    q, f = np.flatnonzero(system.kinds == "q"), np.flatnonzero(system.kinds == "f")
    dynamics = q.size + np.arange(f.size)
    inertia = jyd[np.ix_(dynamics, f)]
    a = jyd[np.ix_(np.arange(q.size + f.size, system.rows), f)]
    tangent = np.linalg.svd(a)[2][a.shape[0] :].T
    # M dq is normal to what the constraints leave free
    change = found - moved
    assert np.abs(tangent.T @ inertia @ change[q]).max() < 1e-9
    assert np.abs(tangent.T @ inertia @ change[f]).max() < 1e-9


@pytest.mark.parametrize(
    "name",
    [
        "knife_edge|lagrangian|sin/cos form (regular at theta=pi/2)",
        "rolling_disk|lagrangian|0",
        "rolling_disk|hamiltonian|1",
        "bead_rod|lagrangian|sin/cos form",
        "slider_crank|hamiltonian|1",
    ],
)
@pytest.mark.one_in(5)
def test_accepted_points_stay_on_the_constraints(name):
    key, _, label = name.split("|")
    number = next(c.values[1] for c in cases() if c.values[2] == name)
    system, form = made(key, number)
    t, y, yd = point(system, form, VALUES[name], 0)
    span = 40.0 if key != "bead_rod" else 3.0  # the bead flies off like an exponential
    start = ConsistentState(t, y, np.nan_to_num(yd), (), 0.0)
    request = Request(span, np.array([span]), every_step=False, index=1, rtol=1e-6, method="dopri")
    integration = Integration(system, start, request)
    integration.run(lambda rows: None)
    end, rate = integration.method.point()
    size = np.abs(end).max()
    assert np.abs(system.another("constraints").residual(span, end, rate)).max() < 1e-14 * max(1.0, size) ** 2, label


def test_seed_models_meet_their_references(tmp_path):
    """Texts of models/seed in a primal formulation (SYSDYN_LONG=1: all of them, in both): all but those of which a
    constraint holds at times.
    """
    references = load("references.json")
    explicit = {"lead_filter", "diode_circuit", "ebers_moll", "thermal_two_node"}
    at_times = {"bouncing_ball", "coulomb_planar_stop", "coulomb_slide", "stick_slip_belt", "stiction_oscillator"}
    met, refused = [], []
    paths = [path for path in sorted((ROOT / "models" / "seed").glob("*.sd")) if path.stem in references]
    paths = [path for k, path in enumerate(paths) if LONG or k % 8 == 0 or path.stem in (*explicit, *at_times)]
    for number, path in enumerate(paths):
        for formulation in FORMULATIONS if LONG else FORMULATIONS[number % 2 :][:1]:
            wanted = references[path.stem]
            report = Report()
            request = Simulation(
                str(path),
                scene="reference",
                formulation=formulation,
                index="0",
                method="dopri",
                accuracy=1e-6,
                at=",".join(map(repr, wanted["t"])),
                output=str(tmp_path / "t.h5"),
            )
            ran = run(request, report)
            if ran is None:
                assert {d.code for d in report if d.code[0] == "E"} <= {"E602", "E601", "E607", "E603", "E604"}
                refused.append((path.stem, formulation))
                continue
            met.append((path.stem, formulation))
            assert (ran.exit, ran.outcome.method, ran.outcome.index) == (0, "dopri", "0")
            trace = Trace.open(tmp_path / "t.h5")
            places = [int(np.argmin(np.abs(trace.time - t))) for t in wanted["t"]]
            for name in trace.names:
                expected = np.asarray(wanted["values"][name], dtype=float)
                error = np.abs(trace[name].values[places] - expected).max()
                assert error <= 1e-5 * (np.abs(expected).max() or 1.0), (path.stem, formulation, name)
    assert explicit <= {model for model, _ in met}
    assert {model for model, _ in refused} == at_times


def test_what_is_singular_by_structure_is_so_whatever_its_values():
    """Two columns with one entry, in the same row, beside a regular band; a line of 20000 sections has two such."""
    n = 1000
    dense = np.eye(n, dtype=bool) | np.eye(n, k=1, dtype=bool)
    assert not _unmatched_unknowns(_pattern(dense)).any()
    dense[:, [3, 7]] = False
    dense[5, [3, 7]] = True
    assert _unmatched_unknowns(_pattern(dense)).sum() >= 1.0


def _pattern(dense):
    columns, rows = np.nonzero(dense.T)
    start = np.searchsorted(columns, np.arange(len(dense) + 1))
    return Pattern(len(dense), len(dense), start.astype(np.int32), rows.astype(np.int32))


TWO_MASSES = """model m {
  param k = 52 N/m
  coord x: translation = 1 m
  coord y: translation = 0 m
  energy T* = 1/2*(1 kg)*x'^2 + 1/2*(MASS)*y'^2
  energy V = 1/2*k*x^2 + 1/2*k*(x - y)^2
}
scene s of m { time 0 s to 1 s; trace x, y }
"""


@pytest.mark.parametrize(("mass", "constant"), [("2 kg", True), ("2 kg*(1 + (y/(1 m))^2)", False)])
@pytest.mark.long
def test_a_constant_inertia_is_factorised_once_in_a_short_run(tmp_path, mass, constant):
    """Of twelve stages a step; what varies is factorised at each."""
    file = tmp_path / "m.sd"
    file.write_text(TWO_MASSES.replace("MASS", mass))
    run = api.simulate(file, method="dopri", rtol=1e-4, output=tmp_path / "t.h5")
    assert (run.statistics["factorisations"] == 1) == constant
    k, moves = np.array([[104.0, -52.0], [-52.0, 52.0]]), np.diag([1.0, 2.0])
    if constant:
        values, modes = eigh(k, moves)
        exact = modes @ (np.cos(np.sqrt(values)[:, None] * run.time) * (modes.T @ moves @ [1.0, 0.0])[:, None])
        assert np.abs(run["x"].values - exact[0]).max() < 1e-4
