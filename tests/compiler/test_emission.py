"""What the generated text may depend on: nothing of the user's names, of the process, of an earlier model."""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from carriers import CCarrier, NumpyCarrier
from catalogue import PLACE, network
from chains import chain
from reference_values import load
from sysdyn.compiler.pipeline import compile_network
from sysdyn.compiler.program import build as build_
from sysdyn.compiler.program import cache as cache_
from sysdyn.compiler.program.emit_c import emit_c
from sysdyn.compiler.program.emit_numpy import emit_numpy
from sysdyn.dsl import load as dsl
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.text.diagnostics import Report

HERE = Path(__file__).parent
HOSTILE = ('x; system("ls")', "*/ #include </etc/passwd>", "größe_ß", "a" * 10_000, "int", "\\", "% s", "x\ny")

SCRIPT = """
import hashlib, sys
sys.path.insert(0, sys.argv[1])
from catalogue import load, network
from chains import chain
from sysdyn.compiler.pipeline import compile_network
from sysdyn.compiler.binding.manifest import structure
from sysdyn.dsl.model import expression as x
entries = load("catalogue.json")
total = hashlib.sha256()
for backend in ("c", "numpy"):
    primal = [k for k in sorted(entries) if entries[k]["models"][0]["form"] == "lagrangian"]
    for net in (lambda: chain(5), *((lambda k=k: network(entries[k], entries[k]["models"][0])) for k in primal)):
        with x.fresh():
            model = compile_network(net(), "hamiltonian", backend)
            total.update(model.text.encode())
            total.update(repr(structure(model.form, model.program, model.network)).encode())
print(total.hexdigest())
"""


@pytest.mark.long
def test_two_processes_print_the_same():
    prints = set()
    for seed in ("0", "1", "424242"):
        run = subprocess.run(
            [sys.executable, "-c", SCRIPT, str(HERE)],
            capture_output=True,
            text=True,
            check=True,
            env={**os.environ, "PYTHONHASHSEED": seed},
        )
        prints.add(run.stdout)
    assert len(prints) == 1


@pytest.mark.long
def test_an_earlier_model_changes_nothing():
    entries = load("catalogue.json")

    def text(key):
        with x.fresh():
            return compile_network(network(entries[key], entries[key]["models"][0])).text

    first = text("solenoid")
    text("two_link_arm")
    assert text("solenoid") == first


@pytest.mark.long
def test_where_values_lie_in_memory_changes_nothing():
    """The rate of a balance makes nodes of a set of unknowns: in the order of their making, not of their addresses."""
    document = dsl.read(HERE.parents[1] / "models" / "seed" / "msd_velocity_source.sd", Report())
    scene = next(iter(document.scenes.values()))
    texts, kept = set(), []
    for k in range(20):
        with x.fresh():
            net = dsl.network(document, document.models["msd_velocity_source"], scene, Report())
            kept.append([object() for _ in range(37 * k)])
            texts.add(compile_network(net, traced=True).text)
    assert len(texts) == 1


def renamed(net, change):
    """Every name of a scalar network replaced."""

    def node(n):
        swap = {}
        for part in x.topological([n]):
            if part.op == "param":
                swap[part] = x.param(change(part.data))
            elif part.op == "var":
                family, kind, order = part.data
                swap[part] = x.var(change(family), kind, order=order)
        return x.substitute(n, swap)

    def value(v):
        if isinstance(v, x.Node):
            return node(v)
        if isinstance(v, tuple):
            return tuple(value(i) for i in v)
        if hasattr(v, "__slots__") and type(v).__module__.endswith("network"):
            fields = {f: value(getattr(v, f)) for f in v.__slots__}
            if "name" in fields:
                fields["name"] = change(fields["name"])
            return type(v)(**fields)
        return v

    return value(replace(net, model="m"))


@pytest.mark.parametrize("name", HOSTILE)
@pytest.mark.parametrize("emit", [emit_c, emit_numpy])
@pytest.mark.long
def test_no_name_of_the_user_reaches_the_text(emit, name):
    entry = load("catalogue.json")["rectifier_motor_crank"]
    with x.fresh():
        plain = compile_network(renamed(network(entry, entry["models"][0]), lambda n: n + "_"))
    with x.fresh():
        other = compile_network(renamed(network(entry, entry["models"][0]), lambda n: n + name))
    assert emit(plain.program, plain.form) == emit(other.program, other.form)


@pytest.mark.long
def test_observations_by_name_do_not_either():
    with x.fresh():
        net = chain(3)
        hostile = replace(
            net, observations=tuple(replace(o, name=f"*/{k}", text="*/") for k, o in enumerate(net.observations))
        )
        assert compile_network(net).text == compile_network(hostile).text


def test_text_is_ascii_and_numbers_survive():
    with x.fresh():
        model = compile_network(chain(3))
        assert model.text.isascii()
        assert "0.2*" in model.text
        assert str(PLACE.start[0]) in model.text


@pytest.mark.long
def test_two_names_of_one_length_do_not_matter(tmp_path, monkeypatch):
    monkeypatch.setenv("SYSDYN_CACHE", str(tmp_path / "cache"))
    with x.fresh():
        model = compile_network(chain(3))
        path = model.library()
        assert path == model.library()
        assert path.parent == tmp_path / "cache"
        assert (tmp_path / "cache").stat().st_mode & 0o777 == 0o700
        assert [p.name for p in path.parent.iterdir()] == [path.name]
        assert CCarrier(model.program, model.form, model.bind()).library.sd_dynamics_rows


def test_no_compiler_is_its_own_error(monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler-anywhere")
    with pytest.raises(build_.NoCompilerError):
        build_.build("int x;")


def test_a_refused_text_says_what_the_compiler_said(tmp_path, monkeypatch):
    monkeypatch.setenv("SYSDYN_CACHE", str(tmp_path))
    with pytest.raises(build_.BuildError) as error:
        build_.build("this is no C")
    assert "error" in error.value.output
    assert not list(tmp_path.glob("*.so"))


def test_a_folder_that_others_write_is_not_used(tmp_path, monkeypatch):
    shared = tmp_path / "shared"
    shared.mkdir()
    shared.chmod(0o777)
    monkeypatch.setenv("SYSDYN_CACHE", str(shared))
    assert cache_.folder() != shared
    monkeypatch.setenv("SYSDYN_CACHE", str(tmp_path / "file"))
    (tmp_path / "file").write_text("")
    folder = cache_.folder()
    assert folder.stat().st_mode & 0o777 == 0o700
    assert build_.build("int sd_x;").parent == folder


@pytest.mark.long
def test_many_processes_build_one_text(tmp_path):
    run = "from sysdyn.compiler.program.build import build; import ctypes; ctypes.CDLL(str(build('int sd_x = 7;')))"
    env = {**os.environ, "SYSDYN_CACHE": str(tmp_path / "cache")}
    children = [subprocess.Popen([sys.executable, "-c", run], env=env) for _ in range(8)]
    assert [child.wait() for child in children] == [0] * 8
    assert len(list((tmp_path / "cache").iterdir())) == 1


@pytest.mark.long
def test_angles_are_turned_once_and_kept_for_each_thread(tmp_path):
    """Blocks and entries of a two-link arm from C, at points in any order and from two threads, beside NumPy."""
    entry = load("catalogue.json")["two_link_arm"]
    with x.fresh():
        model = compile_network(network(entry, entry["models"][0]))
        given = model.program, model.form, model.bind(dict.fromkeys(model.program.scalars, 1.3))
    assert model.text.count(" sin(") == 1
    c, oracle = CCarrier(*given), NumpyCarrier(*given, tmp_path)
    rng = np.random.default_rng(0)
    size = c.at[-1]
    points = [(0.0, *rng.normal(size=(2, size))) for _ in range(3)] + [(0.0, *np.zeros((2, size)))]
    parts = [(block, part) for block in model.program.blocks() for part in ("dy", "dyd")]

    def all_of(carrier, point):
        rows = [carrier.rows(block, *point) for block in model.program.blocks()]
        return np.concatenate(rows + [carrier.entries(block, part, *point) for block, part in parts])

    expected = [all_of(oracle, point) for point in points]

    def worst(seed):
        order = np.random.default_rng(seed).integers(0, len(points), 200)
        return max(np.abs(all_of(c, points[k]) - expected[k]).max() for k in order)

    with ThreadPoolExecutor(2) as pool:
        assert max(pool.map(worst, (1, 2))) < 1e-13 * max(np.abs(e).max() for e in expected)


@pytest.mark.long
def test_what_a_spared_loop_adds_is_left_out_and_nothing_else():
    """Of a chain each block's loops, one spared after the other: what is missing adds up to what all of them add."""
    with x.fresh():
        model = compile_network(chain(5))
        c = CCarrier(model.program, model.form, model.bind())
    y, yd = np.random.default_rng(0).normal(size=(2, c.at[-1]))
    for block in model.program.blocks():
        loops = np.array([bool(pattern.loops) for pattern in c.patterns[block]])

        def rows(spared, block=block):
            c.spared = np.array(spared, dtype=np.int32).ctypes
            return c.rows(block, 0.3, y, yd)

        whole, rest = rows(0 * loops), rows(loops)
        c.spared = None
        assert c.rows(block, 0.3, y, yd).tobytes() == whole.tobytes()
        missing = sum(whole - rows(np.arange(loops.size) == k) for k in range(loops.size))
        np.testing.assert_allclose(rest + missing, whole, atol=1e-12)
        assert loops.any() == bool(missing.any())
