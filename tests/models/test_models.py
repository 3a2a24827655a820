"""Every model of the repository: clean, in the canonical layout, and its scenes run and keep their promises."""

import json
import os
import tomllib

import numpy as np
import pytest
from model_runs import trace_of
from reduced import ROOT
from sysdyn.cli.main import run
from sysdyn.cli.run.prepare import prepare
from sysdyn.cli.run.request import targets
from sysdyn.dsl import load
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.runtime.trace.trace import Trace

MODELS = ROOT / "models"
PATHS = [path for path in MODELS.glob("*/*.sd") if path.parent.name != "book"]
FILES = sorted(path.relative_to(MODELS).with_suffix("").as_posix() for path in PATHS)
"""Those of models/book have a test of their own."""
REDUCED = tomllib.loads((MODELS / "ci.toml").read_text())


def settings(name):
    """The reduced size at which a model runs in CI, as options."""
    folder, file = name.split("/")
    values = REDUCED.get(folder, {}).get(file, {})
    return [option for key, value in values.items() for option in ("--set", f"{key}={value}")]


def result(capsys):
    """The JSON object that the command has printed."""
    return json.loads(capsys.readouterr().out)


def test_reduced_sizes_are_of_models_that_exist():
    assert {f"{folder}/{file}" for folder, files in REDUCED.items() for file in files} <= set(FILES)


@pytest.mark.parametrize("name", FILES)
@pytest.mark.long
def test_check_is_clean(name, capsys):
    code = run(["check", "--json", "--strict", str(MODELS / f"{name}.sd")])
    found = result(capsys)
    assert [d for d in found["diagnostics"] if d["severity"] != "note"] == []
    assert code == 0
    assert all(target["ok"] for file in found["result"]["files"] for target in file["targets"])


@pytest.mark.parametrize("name", FILES)
def test_layout_is_canonical(name, capsys):
    assert run(["fmt", "--check", str(MODELS / f"{name}.sd")]) == 0, capsys.readouterr().err


def scenes(name):
    """Names of the scenes of a file."""
    lines = (MODELS / f"{name}.sd").read_text().splitlines()
    return [line.split()[1] for line in lines if line.startswith("scene ")]


@pytest.mark.parametrize(
    ("name", "scene"), [(name, scene) for name in FILES if not name.startswith("seed/") for scene in scenes(name)]
)
@pytest.mark.long
def test_scenes_run_and_hold_what_they_expect(name, scene, tmp_path, capsys):
    output = tmp_path / "trace.h5"
    options = ["--scene", scene, "--json", "-o", str(output), *settings(name), "--max-wall", "120"]
    code = run(["simulate", str(MODELS / f"{name}.sd"), *options])
    found = result(capsys)
    assert code == 0, found
    assert found["result"]["final"] is True
    assert found["result"]["warnings"] == []
    assert all(claim["ok"] for claim in found["result"]["expects"])
    trace = Trace.open(output)
    assert trace.names
    assert all(np.all(np.isfinite(trace[n].values)) for n in trace.names)


def traced(tmp_path, name, scene, *options):
    """The trace of a scene."""
    output = tmp_path / f"{scene}.h5"
    assert run(["simulate", "-q", str(MODELS / f"{name}.sd"), "--scene", scene, "-o", str(output), *options]) == 0
    return Trace.open(output)


@pytest.mark.long
def test_both_coordinate_choices_of_the_arm_give_one_motion(tmp_path):
    angles = traced(tmp_path, "gallery/two_link_arm", "angles")
    cartesian = traced(tmp_path, "gallery/two_link_arm", "cartesian")
    for name in ("x2", "y2"):
        assert np.max(np.abs(angles[name].values - cartesian[name].values)) < 1e-5


@pytest.mark.long
def test_pendulum_swings_with_its_period(tmp_path):
    from scipy.special import ellipk

    trace = traced(tmp_path, "gallery/pendulum", "swing", "--accuracy", "1e-7")
    x, rate = trace["x"].values, trace["x"].derivative
    # x is greatest where its rate falls through zero: at one period, and nowhere before
    falls = np.flatnonzero((rate[1:-1] > 0.0) & (rate[2:] <= 0.0)) + 1
    k = falls[0]
    found = trace.time[k] + rate[k] / (rate[k] - rate[k + 1]) * (trace.time[k + 1] - trace.time[k])
    swing = np.arcsin(1.0 / 2.34)
    assert found == pytest.approx(4.0 * np.sqrt(2.34 / 9.80665) * ellipk(np.sin(swing / 2.0) ** 2), rel=1e-5)
    # at rest the rod carries the weight's component along it; the multiplier is the tension
    assert trace["tension"].values[0] == pytest.approx(1.13 * 9.80665 * np.cos(swing), rel=1e-6)
    assert x[0] == 1.0


@pytest.mark.long
def test_friction_acts_against_the_motion(tmp_path):
    trace = traced(tmp_path, "gallery/friction_book", "brakes")
    np.testing.assert_allclose(trace["ex"].values, -0.2 * 9.80665 * 2.0 / np.sqrt(5.0), rtol=1e-6)
    np.testing.assert_allclose(trace["y"].values, 0.5 * trace["x"].values, atol=1e-9)


PUBLISHED = [
    0.1581077119629904e2,
    -0.1575637105984298e2,
    0.4082224013073101e-1,
    -0.5347301163226948,
    0.5244099658805304,
    0.5347301163226948,
    0.1048080741042263e1,
]
"""Test Set for IVP Solvers, II-8: end values at 0.03 s, tolerance 1e-14."""


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.one_in(2)
def test_andrews_meets_the_published_end_values(tmp_path, formulation):
    options = ("--accuracy", "1e-8", "--formulation", formulation, "--max-wall", "120")
    trace = traced(tmp_path, "benchmark/andrews", "reference", *options)
    for k, value in enumerate(PUBLISHED):
        assert trace[f"y{k}"].values[-1] == pytest.approx(value, rel=1e-6, abs=1e-9)


def chain_text(tmp_path, n):
    """The C text of the chain with n links."""
    folder = tmp_path / str(n)
    file = str(MODELS / "gallery/chain_1000.sd")
    assert run(["compile", "-q", file, "--set", f"n={n}", "-o", str(folder)]) == 0
    return (folder / "residual.c").read_text()


def test_chain_has_one_c_text_for_every_length(tmp_path):
    assert chain_text(tmp_path, 10) == chain_text(tmp_path, 1000)


def test_chain_of_1000_links_takes_100_steps(tmp_path, capsys):
    output = tmp_path / "chain.h5"
    file = str(MODELS / "gallery/chain_1000.sd")
    assert run(["simulate", file, "--max-steps", "100", "--rtol", "1e-5", "--method", "radau", "-o", str(output)]) == 3
    said = capsys.readouterr().err
    assert "in 100 steps" in said
    assert "energy balance" in said
    trace = Trace.open(output)
    assert not trace.final
    assert trace.statistics["steps"] == 100
    # 2 kg fall for 53 ms: about 0.3 J are exchanged
    assert trace.time[-1] > 0.02
    assert np.max(np.abs(trace["audit.energy"].values)) < 1e-3
    assert np.max(trace["audit.constraints"].values) < 1e-9


def counts(name, capsys):
    """Static counts of each scene of a model."""
    assert run(["check", "--json", str(MODELS / f"{name}.sd")]) == 0
    targets = result(capsys)["result"]["files"][0]["targets"]
    return {t["scene"]: {k: t[k] for k in ("coordinates", "m1", "m2", "dof", "index")} for t in targets}


@pytest.mark.long
def test_the_lead_filter_is_the_books(capsys):
    """Example 6.4: three charges, one displacement constraint, index 2; `order == 1` stands in the model."""
    found = counts("gallery/lead_filter", capsys)["charges"]
    assert found == {"coordinates": 3, "m1": 1, "m2": 0, "dof": 2, "index": 2}
    assert "expect static: order == 1" in (MODELS / "gallery" / "lead_filter.sd").read_text()


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.long
def test_the_drive_closes_its_books(tmp_path, capsys, formulation):
    """Section 6.1 from network text: n = 6, m = 2; half a second of mains, speed and position come to a period."""
    found = counts("gallery/rectifier_motor_slider", capsys)["start"]
    assert (found["coordinates"], found["m1"] + found["m2"], found["dof"]) == (6, 2, 4)
    options = ("--formulation", formulation, "--until", "0.5")
    trace = traced(tmp_path, "gallery/rectifier_motor_slider", "start", *options)
    balance, supplied = trace["audit.energy"].values, trace["supplied"].values
    assert supplied[-1] > 10.0
    assert np.max(np.abs(balance)) < 1e-4 * np.max(np.abs(supplied))


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.long
def test_the_books_own_drive_closes_its_books(tmp_path, formulation):
    """The same in the book's seven coordinates."""
    text = (MODELS / "seed" / "rectifier_motor_crank.sd").read_text()
    text = text.replace("trace q3/C", "trace audit.supplied as supplied, q3/C")
    trace = trace_of(tmp_path, text, formulation=formulation, accuracy=1e-5)
    supplied = np.max(np.abs(trace["supplied"].values))
    assert supplied > 10.0
    assert np.max(np.abs(trace["audit.energy"].values)) < 1e-4 * supplied


def line_text(n):
    """The C text of the line with n sections (what `compile` writes as residual.c)."""
    report = Report()
    file = str(MODELS / "gallery/transmission_line.sd")
    target = targets.one(targets.read(file, report), file, None, None, report)
    with ex.fresh():
        network = load.network(target.document, target.model, target.scene, report, (("n", str(n)),))
        return prepare(network, report).compiled.text


@pytest.mark.long
def test_the_line_has_one_c_text_for_every_length():
    assert line_text(10) == line_text(100_000)


def ladder(n, times):
    """Voltages of nodes n/2 and n of the line's ladder at multiples of a step, by its matrix exponential."""
    from scipy.linalg import expm

    length, per_l, per_c, per_r, rise = 1000.0, 250e-9, 100e-12, 1e-3, 1e-6
    dx = length / n
    coil, cap, loss, load = per_l * dx, per_c * dx, per_r * dx, np.sqrt(per_l / per_c)
    # currents i[0..n-1], voltages v[0..n-1], and the source with its three derivatives
    a = np.zeros((2 * n + 4, 2 * n + 4))
    i, v, u = np.arange(n), n + np.arange(n), 2 * n
    a[i, i], a[i, v] = -loss / coil, -1.0 / coil
    a[i[1:], v[:-1]], a[0, u] = 1.0 / coil, 1.0 / coil
    a[v, i], a[v[:-1], i[1:]], a[v[-1], v[-1]] = 1.0 / cap, -1.0 / cap, -1.0 / (load * cap)
    a[[u, u + 1, u + 2], [u + 1, u + 2, u + 3]] = 1.0
    size = np.ones(2 * n + 4)
    size[u + 1 :] = rise ** -np.arange(1.0, 4.0)  # derivatives in their own scale
    step = expm(a * size / size[:, None] * (times[1] - times[0]))
    x = np.zeros(2 * n + 4)
    x[u:] = 0.0, 0.0, 6.0, -12.0  # 3 s^2 - 2 s^3
    found = [x[[v[n // 2 - 1], v[-1]]]]
    for t in times[1:]:
        x = step @ x
        if abs(t - rise) < 1e-12:
            x[u:] = 1.0, 0.0, 0.0, 0.0
        found.append(x[[v[n // 2 - 1], v[-1]]])
    return np.array(found)


@pytest.mark.parametrize("formulation", ["lagrangian", "co_lagrangian"])
@pytest.mark.one_in(2)
def test_the_line_meets_the_exponential_of_its_ladder(tmp_path, formulation):
    times = np.arange(101) * 1e-7
    options = ("--set", "n=200", "--accuracy", "1e-6", "--formulation", formulation)
    trace = traced(tmp_path, "gallery/transmission_line", "edge", *options)
    places = [int(np.argmin(np.abs(trace.time - t))) for t in times]
    found = np.array([trace["v[n\N{DIVISION SLASH}2].e"].values[places], trace["v[n].e"].values[places]]).T
    assert np.max(np.abs(found - ladder(200, times))) < 1e-5


@pytest.mark.skipif(os.environ.get("SYSDYN_LONG") != "1", reason="ten seconds: SYSDYN_LONG=1")
def test_a_line_of_100000_sections_takes_its_first_step(tmp_path, capsys):
    file = str(MODELS / "gallery/transmission_line.sd")
    assert run(["simulate", file, "--max-steps", "1", "-o", str(tmp_path / "line.h5")]) == 3
    assert "in 1 steps" in capsys.readouterr().err
