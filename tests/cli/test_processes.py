"""The command as a process: interruptions, what it imports, what it costs."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from sysdyn.cli.main import run
from sysdyn.runtime.trace.trace import Trace
from texts import ENDLESS, PENDULUM, ROOT, environment, process, write


def started(path, *options):
    """A simulation that runs for long; returns when its trace exists."""
    command = [sys.executable, "-m", "sysdyn.cli", "simulate", path, "-o", "out.h5", *options]
    child = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    for _ in range(600):
        if Path("out.h5").exists() or child.poll() is not None:
            break
        time.sleep(0.05)
    assert child.poll() is None, child.communicate()
    return child


@pytest.mark.long
def test_exit_codes_of_the_process(tmp_path):
    path = write(tmp_path, PENDULUM)
    assert process("check", path).returncode == 0
    assert process("check", path + "x").returncode == 5
    assert process("chek", path).returncode == 2


@pytest.mark.long
def test_interrupt_leaves_what_was_computed(tmp_path):
    child = started(write(tmp_path, ENDLESS), "--max-wall", "60")
    time.sleep(1.5)
    child.send_signal(signal.SIGINT)
    _, err = child.communicate(timeout=30)
    assert child.returncode == 130
    assert "interrupted" in err
    assert "Traceback" not in err
    trace = Trace.open("out.h5")
    assert not trace.final
    assert trace.time.size > 100
    assert trace.names == ("speed", "x", "y")


@pytest.mark.parametrize("seconds", [0.0, 0.4, 1.1, 1.9])
@pytest.mark.long
def test_kill_leaves_a_readable_trace(tmp_path, seconds):
    child = started(write(tmp_path, ENDLESS), "--max-wall", "60")
    time.sleep(seconds)
    child.kill()
    child.communicate(timeout=30)
    for _ in range(3):
        trace = Trace.open("out.h5")
        assert not trace.final
        assert trace["x"].values.size == trace.time.size
    if seconds > 1.5:  # flushed at least every second
        assert trace.time.size > 100


@pytest.mark.long
def test_reader_that_goes_away(tmp_path):
    command = f"{sys.executable} -m sysdyn.cli explain E208 | head -c 1"
    ran = subprocess.run(["bash", "-c", command], capture_output=True, text=True, timeout=60, check=False)
    assert "Traceback" not in ran.stderr


def imported(*arguments):
    """Modules that a command has imported."""
    code = (
        "import sys; from sysdyn.cli.main import run; code = run(sys.argv[1:]);"
        "print('\\n' + ' '.join(sorted({m.partition('.')[0] for m in sys.modules} | {*sys.modules}))); sys.exit(code)"
    )
    ran = subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, timeout=120, check=True
    )
    return set(ran.stdout.splitlines()[-1].split())


HEAVY = {"numpy", "scipy", "sympy", "h5py", "matplotlib", "xarray", "lark"}


@pytest.mark.long
def test_help_imports_nothing_heavy():
    assert not imported("--help") & HEAVY
    assert not imported("--version") & HEAVY
    assert not imported("explain", "E208") & (HEAVY - {"lark"})


@pytest.mark.parametrize("command", ["simulate", "verify", "report", "golden", "plot", "diff", "new", "doctor"])
@pytest.mark.long
def test_help_of_a_command_costs_little(command):
    """0.07 s of CPU and 17 MB, start of Python included, while nothing heavy is imported."""
    assert not imported(command, "--help") & HEAVY


@pytest.mark.long
def test_fmt_and_plot_import_what_they_need(tmp_path):
    path = write(tmp_path, PENDULUM)
    assert not imported("fmt", "--check", path) & (HEAVY - {"lark"})


@pytest.mark.parametrize("name", ["gallery/pendulum", "seed/rectifier_motor_crank", "benchmark/andrews"])
@pytest.mark.long
def test_check_of_small_models_imports_no_algebra(name):
    assert not imported("check", str(ROOT / "models" / f"{name}.sd")) & {"scipy", "sympy", "matplotlib", "h5py"}


@pytest.mark.long
def test_a_short_run_imports_nothing_for_a_handful_of_numbers(tmp_path):
    model = str(ROOT / "models/book/dc_motor.sd")
    run = "simulate", "-q", model, "-o", str(tmp_path / "x.h5")
    imported(*run)  # compiles it
    slow = {"numpy.ma", "numpy.random", "numpy.ctypeslib", "importlib.metadata", "scipy", "sympy"}
    assert not imported(*run) & slow


@pytest.mark.long
def test_check_of_200_unknowns_imports_no_algebra(tmp_path):
    path = write(tmp_path, row_of_masses(50))
    found = imported("check", path)
    assert not found & {"scipy", "sympy"}


def row_of_masses(masses):
    """A model of 4 lines and 2 unknowns a mass."""
    lines = ["model row {"]
    for k in range(masses):
        lines += [
            f"  param m{k} = {1 + k % 7} kg",
            f"  coord x{k}: translation = {k} mm",
            f"  energy T* = 1/2*m{k}*x{k}'^2",
            f"  energy V = 1/2*(3 N/m)*{f'(x{k} - x{k - 1})' if k else 'x0'}^2",
        ]
    return "\n".join([*lines, "}", "scene s of row {", "  time 0 s to 1 s", "  trace x0", "}", ""])


@pytest.mark.long
def test_check_is_linear_in_the_lines_of_a_model(tmp_path, effort):
    """1000 lines cost 0.85 s of CPU, start of Python included."""

    def lines(masses):
        path = write(tmp_path, row_of_masses(masses))
        code, count = effort(lambda: run(["check", path]))
        assert code == 0
        return count

    lines(5)
    assert lines(80) < 2.2 * lines(40)


@pytest.mark.long
def test_progress_is_silent_where_nobody_looks(tmp_path):
    ran = process("simulate", write(tmp_path, PENDULUM))
    assert "%" not in ran.stderr


@pytest.mark.long
def test_home_that_cannot_be_written(tmp_path):
    """The cache goes elsewhere; nothing is said."""
    path = write(tmp_path, PENDULUM)
    environ = environment(HOME="/nonexistent", SYSDYN_CACHE=None, XDG_CACHE_HOME=None, MPLCONFIGDIR=None)
    ran = process("simulate", path, "--json", env=environ)
    assert ran.returncode == 0, ran.stderr
    assert json.loads(ran.stdout)["ok"]
    assert process("plot", "model-swing.h5", env=environ).returncode == 0


LOST = """
import os, signal, time, click
from sysdyn.cli import main
class Held:
    def __del__(self):
        print("taken apart", flush=True)
        time.sleep(3600.0)
@click.command()
def command():
    Held()
    print("went on", flush=True)
    time.sleep(3600.0)
main.Group.get_command = lambda *_: command
main.main(["check"])
"""


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.long
def test_an_interruption_while_an_object_is_taken_apart_is_not_lost(sent):
    """Python drops what is raised there."""
    command = [sys.executable, "-c", LOST]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "taken apart\n"
        process.send_signal(sent)
        out, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert out == "went on\n"
    assert said.split() == ["interrupted"]


EARLY = """import os, signal, sys
class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == "click":
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Finder())
from sysdyn.entry import main
main()
"""


@pytest.mark.parametrize("option", ["--quiet", "--json"])
def test_an_interruption_while_the_command_is_imported_ends_it_as_any_other(tmp_path, option):
    """A traceback before."""
    command = [sys.executable, "-c", EARLY, "check", write(tmp_path, PENDULUM), option]
    ran = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert ran.returncode == 130
    if option == "--json":
        assert json.loads(ran.stdout)["exit"] == 130
        assert ran.stderr == ""
    else:
        assert ran.stderr == "interrupted\n"
