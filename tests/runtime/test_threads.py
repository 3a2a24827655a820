"""Large systems by several threads: the same bits whatever their number, beside other runs and behind a fork."""

import os
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from textwrap import dedent

import pytest
from sysdyn import api
from sysdyn.runtime.model.core_library import core

CIRCUIT = """from std.electrical import resistor, capacitor, voltage

model net {{
  param n = {n}
  {nodes}
  source: voltage(v = 1 V*smoothstep(t/(1 ms))) {first} -> ground
  {body}
}}

scene run of net {{
  time 0 s to 10 ms
  trace {last}.e as v
}}
"""
LADDER = {
    "n": 10200,
    "nodes": "node v[1..n]: electrical",
    "first": "v[1]",
    "last": "v[n]",
    "body": """for i in 1..n - 1 { R[i]: resistor(R = 1 ohm) v[i] -> v[i + 1] }
  for i in 1..n { C[i]: capacitor(C = 1 uF) v[i] -> ground }""",
}
GRID = {
    "n": 101,
    "nodes": "node v[1..n, 1..n]: electrical",
    "first": "v[1, 1]",
    "last": "v[n, n]",
    "body": """for i in 1..n {
    for j in 1..n - 1 {
      across[i, j]: resistor(R = 1 kohm) v[i, j] -> v[i, j + 1]
      down[j, i]: resistor(R = 1 kohm) v[j, i] -> v[j + 1, i]
    }
    for j in 1..n { C[i, j]: capacitor(C = 1 uF) v[i, j] -> ground }
  }""",
}
STAR = {  # every member adds to one row
    "n": 10200,
    "nodes": "node v[1..n]: electrical\n  node bus: electrical",
    "first": "v[1]",
    "last": "bus",
    "body": """for i in 1..n {
    R[i]: resistor(R = i*1 ohm) v[i] -> bus
    C[i]: capacitor(C = 1 uF) v[i] -> ground
  }
  whole: capacitor(C = 1 mF) bus -> ground""",
}
TEXTS = {"ladder": LADDER, "grid": GRID, "star": STAR}
MODELS = Path(__file__).parents[2] / "models"


@pytest.fixture(autouse=True)
def _as_before():
    yield
    core.sd_threads_use(0)


@cache
def model(name, backend="c"):
    """Read and made ready once; of more unknowns than from which threads take part (SD_LARGE)."""
    if name == "line":
        return api.load(MODELS / "benchmark" / "lc_line.sd", scene="reference", set={"n": 5100}, backend=backend)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"{name}.sd"
        file.write_text(CIRCUIT.format(**TEXTS[name]))
        return api.load(file, backend=backend)


def found(loaded, threads, method="radau"):
    """Every number of a run of some steps, and its counts."""
    core.sd_threads_use(threads)
    assert core.sd_threads() == threads
    trace = loaded.run(method=method, rtol=1e-2, unmet="warn")
    values = [trace.time, *(trace[name].values for name in trace.names), trace["audit.energy"].values]
    counts = {key: n for key, n in trace.statistics.items() if isinstance(n, int)}
    assert trace.time.size > 10
    return [array.tobytes() for array in values], counts


@pytest.mark.parametrize("name", ["ladder", "line", "grid", "star"])
@pytest.mark.one_in(4)
def test_runs_are_the_same_bits_whatever_the_number_of_threads(name):
    one, two, three = (found(model(name), threads) for threads in (1, 2, 3))
    assert one == two
    assert one == three


def test_python_callbacks_are_called_by_one_thread():
    loaded = model("star", "numpy")
    assert found(loaded, 1) == found(loaded, 2)


def test_runs_side_by_side_share_the_threads():
    """Who finds them at work does its own part alone."""
    alone = [found(model(name), 1) for name in ("ladder", "star")]
    with ThreadPoolExecutor(2) as pool:
        assert list(pool.map(lambda name: found(model(name), 2), ("ladder", "star"))) == alone


FORKED = """
    import os, sys
    sys.path.insert(0, sys.argv[1])
    from test_threads import found, model
    before = found(model("star"), 2)
    child = os.fork()
    if child == 0:
        os._exit(0 if found(model("star"), 2) == before else 1)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    assert found(model("star"), 2) == before
"""


@pytest.mark.long
def test_a_forked_process_has_threads_of_its_own():
    made = subprocess.run(
        [sys.executable, "-c", dedent(FORKED), str(Path(__file__).parent)], check=False, capture_output=True, text=True
    )
    assert made.returncode == 0, made.stderr


@pytest.mark.parametrize(("said", "number"), [("1", 1), ("3", 3), ("1000", 8), ("", None), ("x", None)])
@pytest.mark.one_in(2)
def test_the_environment_says_how_many(said, number):
    """At most eight: memory feeds no more."""
    code = "from sysdyn.runtime.model.core_library import core; print(core.sd_threads())"
    environment = {**os.environ, "SYSDYN_THREADS": said}
    made = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True, env=environment)
    assert int(made.stdout) == (number or min(len(os.sched_getaffinity(0)), 8))
