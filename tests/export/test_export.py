"""The files of `compile`: what is called outside is what is evaluated inside, in every index form."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
from exported import COMPILER, MODELS, Outside, compiled, module
from sysdyn import api
from sysdyn.cli.main import run
from sysdyn.cli.run.request.sizes import sizes

C = pytest.mark.skipif(COMPILER is None, reason="no C compiler")
FORMS = ("3", "2", "2v", "1")
LONG = bool(os.environ.get("SYSDYN_LONG"))
EVERY = sorted(f"{path.parent.name}/{path.stem}" for path in MODELS.glob("*/*.sd") if path.parent.name != "book")
SLICE = (
    "gallery/slider_crank",
    "gallery/co_circuit",
    "gallery/heat_exchanger",
    "benchmark/andrews",
    "gallery/chain_1000",
)

CHAIN = """model chain {
  param n = 4
  param k = 3 N/m
  param soft = k/5
  param c[1..n] = 2*k
  param gap = 2 cm
  param m[1..n] = 1 kg
  coord x[1..n], z: translation
  energy T* = sum(i in 1..n: 1/2*m[i]*x[i]'^2) + 1/2*m[1]*z'^2
  energy V = sum(i in 1..n: 1/2*c[i]*x[i]^2) + 1/2*soft*z^2
  psi tie: z' = 2*x[1]'
  for i in 1..n {
    init x[i] = i*gap
    init x[i]' = 0 m/s
  }
  init z = 3*gap
}
"""


def inside(model, index, backend="c", **options):
    return api.compile_model(
        model if Path(model).is_absolute() else MODELS / f"{model}.sd", index=index, backend=backend, **options
    )


def points(y0, yd0, number=3):
    rng = np.random.default_rng(5)
    for k in range(number):
        yield 0.1 * k, y0 + k * 1e-2 * rng.normal(size=y0.size), yd0 + k * 1e-2 * rng.normal(size=y0.size)


def same(model, folder, index, backend, size=()):
    """Residual, Jacobian and mass matrix outside are those of the inside, to the last bit."""
    folder.mkdir(exist_ok=True)
    scenes = api_scenes(model)
    settings = size or [f"--set={name}={value}" for name, value in sizes(str(MODELS / f"{model}.sd"))[1]]
    assert compiled(folder, model, "--index", index, "--backend", backend, *scenes, *settings) == 0
    formed = formed_of(model, index, backend, scenes[1] if scenes else None, settings)
    if backend == "c":
        outside = Outside(folder)
        y0, yd0 = outside.y0, outside.yd0
    else:
        outside = module(folder)
        y0, yd0 = outside.sd_start()
    for t, y, yd in points(y0, yd0):
        jy, jyd = formed.jacobian(t, y, yd)
        if backend == "c":
            found = [outside.residual(t, y, yd)[1], outside.jacobian(t, y, yd, 3.7)[1], outside.mass(t, y, yd)[1]]
        else:
            found = [outside.sd_residual(t, y, yd), outside.sd_jacobian(t, y, yd, 3.7), outside.sd_mass(t, y, yd)]
        for one, other in zip(found, (formed.residual(t, y, yd), jy + 3.7 * jyd, jyd), strict=True):
            np.testing.assert_array_equal(one, other)


def api_scenes(model):
    text = (MODELS / f"{model}.sd").read_text()
    names = [line.split()[1] for line in text.splitlines() if line.startswith("scene ")]
    return ["--scene", names[0]] if names else []


def formed_of(model, index, backend, scene, settings):
    """The runtime's own system of a model's form."""
    from sysdyn.cli.export.tabulation import choose
    from sysdyn.cli.run.prepare import prepare
    from sysdyn.cli.run.request import targets
    from sysdyn.cli.run.start.starting import start
    from sysdyn.dsl import load
    from sysdyn.dsl.model import expression as ex
    from sysdyn.dsl.text.diagnostics import Report

    report = Report()
    document = targets.read(str(MODELS / f"{model}.sd"), report)
    target = targets.whole(document, model, None, scene, report)
    pairs = tuple(tuple(item.removeprefix("--set=").split("=", 1)) for item in settings)
    with ex.fresh():
        network = load.network(target.document, target.model, target.scene, report, pairs, required=scene is not None)
        prepared = prepare(network, report, backend=backend)
        said = prepared.network.scene
        t0 = prepared.binding.evaluate(said.start) if said and said.start else 0.0
        return choose(prepared, start(prepared, t0, report), index).system


@C
@pytest.mark.parametrize("backend", ["c", "numpy"])
@pytest.mark.parametrize("model", EVERY if LONG else SLICE)
@pytest.mark.long
def test_outside_is_inside_to_the_last_bit(tmp_path, model, backend):
    for index in ("auto", *FORMS) if LONG else ("auto", "1"):
        same(model, tmp_path / index, index, backend)


@C
@pytest.mark.parametrize("backend", ["c", "numpy"])
@pytest.mark.long
def test_arrays_of_thousands(tmp_path, backend):
    same("gallery/transmission_line", tmp_path, "auto", backend, ["--set=n=3000"])


@C
def test_residual_does_not_depend_on_the_index(tmp_path):
    texts = set()
    for index in (*FORMS, "0"):
        assert compiled(tmp_path / index, "seed/slider_crank", "--scene", "reference", "--index", index) == 0
        texts.add((tmp_path / index / "residual.c").read_bytes())
        header = (tmp_path / index / "sysdyn_model.h").read_text()
        assert 'extern "C"' in header
        assert "SD_EXPORT_VERSION 1" in header
    assert len(texts) == 1


def test_index_forms_by_name(tmp_path):
    """Form 2 has both constraint rows and a nu; form 1 their second derivatives; form 0 the state alone."""
    rows, kinds = {}, {}
    for index in (*FORMS, "0", "auto"):
        assert compiled(tmp_path / index, "seed/slider_crank", "--scene", "reference", "--index", index) == 0
        manifest = json.loads((tmp_path / index / "manifest.json").read_text())
        rows[index] = [row["kind"] for row in manifest["rows"] if row["kind"] not in ("kinematic", "dynamics")]
        kinds[index] = [item["kind"] for item in manifest["unknowns"]]
        assert manifest["index"] == {"2v": "2v", "auto": 2}.get(index) or manifest["index"] == int(index)
    assert rows == {
        "3": ["phi"], "2": ["phi", "phi_rate"], "2v": ["phi_rate"], "1": ["phi_acceleration"], "0": ["slope"] * 4,
        "auto": ["phi", "phi_rate"],
    }  # fmt: skip
    assert kinds["2"] == [*kinds["3"], "nu"]
    assert set(kinds["0"]) == {"q", "f"}


@C
@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.long
def test_index_0_is_the_underlying_equation(tmp_path, formulation):
    """A pendulum: f' = -g (q - ...) by hand; the Jacobian by differences; the Python beside the C."""
    options = ("--scene", "reference", "--index", "0", "--formulation", formulation)
    assert compiled(tmp_path / "c", "seed/pendulum", *options) == 0
    assert compiled(tmp_path / "py", "seed/pendulum", *options, "--backend", "numpy") == 0
    c, python = Outside(tmp_path / "c"), module(tmp_path / "py")
    names = [item["name"] for item in c.binding["unknowns"]]
    y = c.y0.copy()
    y[names.index("q1'")], y[names.index("q2'")] = 0.3, 0.3 * -y[0] / y[1]  # along the circle
    if formulation == "hamiltonian":
        for name in ("q1", "q2"):
            y[names.index(f"{name}.p")] = 1.13 * y[names.index(f"{name}'")]
    code, r = c.residual(0.0, y, np.zeros(c.n))
    assert code == 0
    q, f = y[:2], np.array([y[names.index("q1'")], y[names.index("q2'")]])
    pull = (f @ f - 9.81 * q[1]) / (q @ q)
    acceleration = -pull * q - [0.0, 9.81]
    np.testing.assert_allclose(-r[:2], f, rtol=1e-14)
    np.testing.assert_allclose(-r[[names.index("q1'"), names.index("q2'")]], acceleration, rtol=1e-12)
    np.testing.assert_allclose(python.sd_residual(0.0, y, np.zeros(c.n)), r, rtol=1e-12, atol=1e-13)
    numeric = np.zeros((c.n, c.n))
    for k, step in enumerate(1e-6 * np.eye(c.n)):
        up, down = (c.residual(0.0, y + sign * step, 3.0 * (sign * step))[1] for sign in (1, -1))
        numeric[:, k] = (up - down) / 2e-6
    exact = c.dense(c.jacobian(0.0, y, np.zeros(c.n), 3.0)[1])
    np.testing.assert_allclose(exact, numeric, atol=1e-7 * np.abs(exact).max())
    np.testing.assert_allclose(
        python.sd_jacobian(0.0, y, np.zeros(c.n), 3.0), c.jacobian(0.0, y, y, 3.0)[1], rtol=1e-10, atol=1e-12
    )
    np.testing.assert_array_equal(c.dense(c.mass(0.0, y, y)[1]), np.eye(c.n))


def test_no_underlying_equation_is_said(tmp_path, capsys):
    assert compiled(tmp_path / "out", "gallery/diode_circuit", "--index", "0") == 1
    assert "E607" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@C
@pytest.mark.parametrize("index", ["auto", "1"])
@pytest.mark.parametrize(
    ("model", "changed"),
    [
        ("pendulum", {"l": 0.9, "th_0": 0.7}), ("slider_crank", {"l": 2.6, "th_0": 1.9}), ("lever", {"m1": 3.3}),
        ("knife_edge", {"J": 0.9, "v_0": 2.0}), ("parallelogram", {}), ("rolling_disk", {"r": 0.7, "om_0": -0.4}),
    ],
)  # fmt: skip
@pytest.mark.one_in(6)
def test_starts_at_other_parameters(tmp_path, model, changed, index):
    """Outside as inside: initial values by their formulas, constraints and everything that follows from them."""
    found = inside(f"seed/{model}", index, scene="reference")
    changed = changed or {next(iter(found.parameters)): 1.3 * next(iter(found.parameters.values()))}
    y, yd = found.start(changed)
    for backend in ("c", "numpy"):
        folder = tmp_path / backend
        assert compiled(folder, f"seed/{model}", "--scene", "reference", "--index", index, "--backend", backend) == 0
        if backend == "c":
            outside = Outside(folder)
            p = outside.changed(**changed)
            code, *start = outside.start(p)
            assert code == 0
            r = outside.residual(outside.t0, *start, p)[1]
        else:
            python = module(folder)
            p = python.parameters(**changed)
            start = python.sd_start(p)
            r = python.sd_residual(0.0, *start, p)
        scale = np.abs(y).max()
        assert np.max(np.abs(start[0] - y)) <= 1e-9 * scale
        assert np.max(np.abs(start[1] - yd)) <= 1e-8 * max(np.abs(yd).max(), scale)
        assert np.max(np.abs(r)) <= 1e-9 * scale
    assert np.max(np.abs(y - found.y0)) > 1e-3 * scale or np.max(np.abs(yd - found.yd0)) > 1e-3


@C
@pytest.mark.parametrize("backend", ["c", "numpy"])
def test_positions_tell_stretches_outside(tmp_path, backend):
    """Two springs in series from a mass at a to the ground: 4 N/m and 2 N/m share a = 0.3 m as 0.1 m and 0.2 m."""
    path = tmp_path / "series.sd"
    path.write_text(
        "model series {\n  param a = 0.1 m\n  node x, y: translation\n  M: kinetic(p = 1 kg*f) x\n"
        "  K: potential(e = 4 N/m*q) x -> y\n  L: potential(e = 2 N/m*q) y -> ground\n  init x.q = a\n}\n"
        "scene go of series { time 0 s to 1 s; trace K.q, L.q, x.q }\n"
    )
    folder = tmp_path / "out"
    assert compiled(folder, str(path), "--scene", "go", "--formulation", "co_lagrangian", "--backend", backend) == 0
    names = [item["name"] for item in json.loads((folder / "binding.json").read_text())["outputs"]]
    if backend == "c":
        outside = Outside(folder)
        p = outside.changed(a=0.3)
        code, *start = outside.start(p)
        assert code == 0
        w = outside.outputs(outside.t0, *start, p)[1]
    else:
        python = module(folder)
        p = python.parameters(a=0.3)
        w = python.sd_outputs(0.0, *python.sd_start(p), p)
    found = dict(zip(names, w, strict=True))
    assert found == pytest.approx({"K.q": 0.1, "L.q": 0.2, "x.q": 0.3}, abs=1e-9)


@C
@pytest.mark.long
def test_rates_of_a_blocked_diode_are_no_noise(tmp_path):
    """Its slope is 1e-50 A/V: whatever stands in the voltage's rate, the rows hold; 1e33 V/s stood there."""
    changed = {"K": 0.353, "th_0": 0.326}
    found = inside("seed/rectifier_motor_crank", "auto", scene="reference")
    y, yd = found.start(changed)
    model, options = "seed/rectifier_motor_crank", ("--scene", "reference")
    assert compiled(tmp_path / "c", model, *options) == 0
    assert compiled(tmp_path / "numpy", model, *options, "--backend", "numpy") == 0
    outside, python = Outside(tmp_path / "c"), module(tmp_path / "numpy")
    code, *start = outside.start(outside.changed(**changed))
    assert code == 0
    for a, b in (start, python.sd_start(python.parameters(**changed))):
        np.testing.assert_allclose(a, y, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(b, yd, rtol=1e-6, atol=1e-6 * np.abs(yd).max())


@C
@pytest.mark.long
def test_what_follows_from_parameters(tmp_path):
    """Parameters by others, arrays too, and the constant of an integrated row: 3 gap - 2 gap."""
    path = tmp_path / "chain.sd"
    path.write_text(CHAIN)
    assert compiled(tmp_path / "c", path) == 0
    outside = Outside(tmp_path / "c")
    code, p = outside.follow(outside.p0)
    assert code == 0
    np.testing.assert_allclose(p, outside.p0, rtol=1e-15)
    follows = {name: item["follows"] for name, item in outside.places.items() if item["follows"]}
    assert follows == {"soft": ["k"], "c": ["k"]}
    p = outside.changed(k=7.0, gap=0.5)
    first, size = outside.places["c"]["place"], outside.places["c"]["size"]
    np.testing.assert_allclose(p[first : first + size], 14.0)
    assert p[outside.places["soft"]["place"]] == pytest.approx(1.4)
    code, y, yd = outside.start(p)
    assert code == 0
    names = [item["name"] for item in outside.binding["unknowns"]]
    place = {name: item["place"] for name, item in zip(names, outside.binding["unknowns"], strict=True)}
    assert y[place["z"]] == pytest.approx(1.5)
    np.testing.assert_allclose(y[place["x[1..4]"] :][:4], 0.5 * np.arange(1, 5))
    assert np.max(np.abs(outside.residual(0.0, y, yd, p)[1])) < 1e-12
    # the constraint is z - 2 x[1] = its value at the start, not at that of other parameters
    y[place["z"]] += 0.25
    assert np.max(np.abs(outside.residual(0.0, y, yd, p)[1])) >= 0.25
    bad = outside.p0.copy()
    bad[outside.places["n"]["place"]] = 5.0
    assert outside.places["n"]["structural"]
    assert outside.residual(0.0, y, yd, bad)[0] == -1
    assert outside.start(bad)[0] == -1


@C
@pytest.mark.long
def test_a_point_that_is_none(tmp_path):
    path = tmp_path / "root.sd"
    path.write_text(
        "model r {\n  coord x: translation = 1 m\n  energy T* = 1/2*(1 kg)*x'^2\n  work -sqrt(x/(1 m))*(1 N) on x\n}\n"
    )
    assert compiled(tmp_path / "c", path) == 0
    outside = Outside(tmp_path / "c")
    assert outside.residual(0.0, outside.y0, outside.yd0)[0] == 0
    assert outside.residual(0.0, -outside.y0, outside.yd0)[0] == 1


@C
@pytest.mark.long
def test_outputs_are_those_of_the_trace(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = MODELS / "seed" / "slider_crank.sd"
    trace = api.simulate(path, scene="reference", accuracy=1e-6)
    for backend, index in (("c", "auto"), ("c", "0"), ("numpy", "auto")):
        folder = tmp_path / f"{backend}{index}"
        asked = ("--scene", "reference", "--backend", backend, "--index", index)
        assert compiled(folder, "seed/slider_crank", *asked) == 0
        names = [item["name"] for item in json.loads((folder / "binding.json").read_text())["outputs"]]
        if backend == "c":
            outside = Outside(folder)
            code, w = outside.outputs(outside.t0, outside.y0, outside.yd0)
            assert code == 0
        else:
            python = module(folder)
            w = python.sd_outputs(0.0, *python.sd_start())
        assert sorted(names) == sorted(trace.names)
        np.testing.assert_allclose(w, [trace[name][0] for name in names], rtol=1e-9, atol=1e-12)


@pytest.mark.long
def test_letters_of_complementary_forms(tmp_path):
    for formulation in ("co_lagrangian", "co_hamiltonian"):
        folder = tmp_path / formulation
        assert compiled(folder, "seed/lcr_nonlinear", "--scene", "reference", "--formulation", formulation) == 0
        manifest = json.loads((folder / "manifest.json").read_text())
        units = {"p": {"Wb"}, "e": {"V"}, "q": {"C"}, "f": {"A"}}
        found = {}
        for item in manifest["unknowns"]:
            found.setdefault(item["kind"], set()).add(item["unit"])
        for kind in ("p", "e", *(("q",) if formulation == "co_hamiltonian" else ())):
            assert found[kind] == units[kind]
        assert found["f"] <= units["f"]  # the implicit flow of the quadratic resistor
        if formulation == "co_hamiltonian":
            assert "displacement" in {row["kind"] for row in manifest["rows"]}


@pytest.mark.long
def test_parameters_that_may_change_the_index(tmp_path):
    path = tmp_path / "two.sd"
    path.write_text(
        "model two {\n  param light = 1 g\n  param k = 2 N/m\n  param far = 3 N\n  coord x: translation = 1 cm\n"
        "  energy T* = 1/2*light*x'^2\n  energy V = 1/2*k*x^2\n  work far*sin(t*(1 rad/s)) on x\n}\n"
    )
    assert compiled(tmp_path / "out", path) == 0
    manifest = json.loads((tmp_path / "out" / "manifest.json").read_text())
    assert "light" in manifest["index_parameters"]
    assert "far" not in manifest["index_parameters"]
    assert {p["name"]: (p["value"], p["unit"]) for p in manifest["parameters"]}["light"] == (1.0, "g")
    binding = json.loads((tmp_path / "out" / "binding.json").read_text())
    assert binding["p"][[p["name"] for p in binding["parameters"]].index("light")] == 1e-3


def test_without_a_scene_the_whole_model(tmp_path, capsys):
    """Scenes are not asked for; several models and none named are wrong usage."""
    path = tmp_path / "many.sd"
    text = "model one {\n  coord x: translation = 1 m\n  energy T* = 1/2*(1 kg)*x'^2\n}\n"
    scenes = "".join(f"scene s{k} of one {{\n  time 0 s to {k} s\n  trace x\n}}\n" for k in (1, 2))
    path.write_text(text + scenes)
    assert run(["compile", "-q", str(path), "-o", str(tmp_path / "a")]) == 0
    assert json.loads((tmp_path / "a" / "manifest.json").read_text())["scene"] is None
    assert json.loads((tmp_path / "a" / "binding.json").read_text())["outputs"] == []
    path.write_text(text + text.replace("one", "other"))
    assert run(["compile", "-q", str(path), "-o", str(tmp_path / "b")]) == 2
    assert "one | other" in capsys.readouterr().err
    assert run(["compile", "-q", str(path), "-o", str(tmp_path / "b"), "--model", "other"]) == 0


@pytest.mark.parametrize("index", ["auto", "0"])
def test_module_of_the_api(index):
    found = inside("seed/slider_crank", index, scene="reference")
    assert found.y0.shape == found.yd0.shape == (len(found.unknowns),)
    assert np.max(np.abs(found.residual(found.t0, found.y0, found.yd0))) < 1e-12
    n = found.y0.size
    matrix = np.zeros((n, n))
    columns = np.repeat(np.arange(n), np.diff(found.indptr))
    matrix[found.indices, columns] = found.jacobian(0.0, found.y0, found.yd0, 2.5)
    numeric = np.zeros((n, n))
    for k, step in enumerate(1e-6 * np.eye(n)):
        up, down = (found.residual(0.0, found.y0 + s * step, found.yd0 + 2.5 * s * step) for s in (1, -1))
        numeric[:, k] = (up - down) / 2e-6
    np.testing.assert_allclose(matrix, numeric, atol=1e-7 * np.abs(matrix).max())
    mass = np.zeros((n, n))
    mass[found.indices, columns] = found.mass(0.0, found.y0, found.yd0)
    if index == "0":
        np.testing.assert_array_equal(mass, np.eye(n))
    assert found.outputs(0.0, found.y0, found.yd0).shape == (len(found.traced),)
    assert found.parameters["m1"] == 1.0
