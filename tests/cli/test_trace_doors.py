"""Doors of a trace: what a foreign file may make us read, who may write and read while a run lives, how it ends."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
from sysdyn.cli.main import run
from sysdyn.cli.sweep.sweep_results import Sweep
from sysdyn.runtime.model.failures import TraceError
from sysdyn.runtime.trace.claim import claim_trace
from sysdyn.runtime.trace.opening import replaceable
from sysdyn.runtime.trace.trace import Trace
from texts import ENDLESS, PENDULUM, write

SECRET = b"the reader's own file, which nobody shall see\n" * 40


@pytest.fixture
def trace(tmp_path, monkeypatch):
    path = write(tmp_path, PENDULUM)
    monkeypatch.chdir(tmp_path)
    assert run(["simulate", "-q", path, "-o", "good.h5"]) == 0
    (tmp_path / "secret.txt").write_bytes(SECRET)
    return tmp_path / "good.h5"


def _external_link(file):
    with h5py.File("other.h5", "w") as other:
        other["stolen"] = np.arange(file["time"].shape[0], dtype=float)
    file["x_stolen"] = h5py.ExternalLink("other.h5", "/stolen")


def _external_link_in_a_group(file):
    _external_link(file)
    file.move("x_stolen", "derivatives/x_stolen")
    file["x"].attrs["derivative"] = "/derivatives/x_stolen"


def _raw_storage(file):
    size = len(SECRET) // 8
    file.create_dataset("x_stolen", shape=(size,), dtype="f8", external=[(b"secret.txt", 0, 8 * size)])


def _virtual(file):
    with h5py.File("other.h5", "w") as other:
        other["stolen"] = np.arange(file["time"].shape[0], dtype=float)
    layout = h5py.VirtualLayout(shape=file["time"].shape, dtype="f8")
    layout[:] = h5py.VirtualSource("other.h5", "stolen", shape=file["time"].shape)
    file.create_virtual_dataset("x_stolen", layout)


def _hidden_deep(file):
    group = file.create_group("a/b/c")
    group["link"] = h5py.ExternalLink("other.h5", "/")


LEADING_OUT = (_external_link, _external_link_in_a_group, _raw_storage, _virtual, _hidden_deep)


@pytest.mark.parametrize("plant", LEADING_OUT, ids=lambda plant: plant.__name__.strip("_"))
@pytest.mark.parametrize(
    "command",
    [
        ["plot", "bad.h5", "-o", "bad.html"],
        ["plot", "bad.h5"],
        ["diff", "good.h5", "bad.h5"],
        ["diff", "bad.h5", "good.h5"],
        ["animate", "bad.h5", "-o", "bad.html"],
    ],
    ids=["plot html", "plot", "diff test", "diff reference", "animate"],
)
@pytest.mark.one_in(30)
def test_a_trace_that_leads_to_another_file_is_refused(trace, capsys, plant, command):
    Path("bad.h5").write_bytes(trace.read_bytes())
    with h5py.File("bad.h5", "a") as file:
        plant(file)
    assert run(command) == 5
    said = capsys.readouterr()
    assert "leads to another file" in said.err
    assert not Path("bad.html").exists()
    assert not Path("bad.png").exists()


@pytest.mark.parametrize("plant", LEADING_OUT, ids=lambda plant: plant.__name__.strip("_"))
@pytest.mark.one_in(3)
def test_the_interface_refuses_it_too(trace, plant):
    Path("bad.h5").write_bytes(trace.read_bytes())
    with h5py.File("bad.h5", "a") as file:
        plant(file)
        file["run"], file["exit"] = np.arange(3), np.zeros(3)
    with pytest.raises(TraceError, match="leads to another file"):
        Trace.open("bad.h5")
    with pytest.raises(OSError, match="leads to another file"):
        Sweep.open("bad.h5")


@pytest.mark.parametrize("plant", LEADING_OUT, ids=lambda plant: plant.__name__.strip("_"))
@pytest.mark.one_in(3)
def test_a_golden_and_a_scene_that_expects_one_refuse_it_too(trace, capsys, plant):
    assert run(["golden", "record", "-q", "model.sd"]) == 0
    (golden,) = Path("golden").glob("*/*.h5")
    with h5py.File(golden, "a") as file:
        plant(file)
    assert run(["golden", "check"]) == 5
    assert "leads to another file" in capsys.readouterr().err
    text = Path("model.sd").read_text()
    end = text.rindex("}")
    Path("model.sd").write_text(f'{text[:end]}  expect golden "{golden}" within 1e-2\n{text[end:]}')
    assert run(["simulate", "model.sd"]) in (1, 5)
    assert "leads to another file" in capsys.readouterr().err


def test_a_file_that_claims_more_than_it_can_hold_is_damaged(trace, capsys):
    with h5py.File("good.h5", "a") as file:
        file.create_dataset("huge", shape=(10**9,), dtype="f8", chunks=(1024,))
    for command in (["plot", "good.h5"], ["diff", "good.h5", "good.h5"], ["animate", "good.h5", "-o", "a.html"]):
        assert run(command) == 5
        assert "claim to hold" in capsys.readouterr().err


@pytest.mark.parametrize("kind", ["link", "empty link", "pipe", "words"])
@pytest.mark.one_in(2)
def test_the_journal_of_a_sweep_is_its_own(trace, capsys, kind):
    journal, foreign = Path(".s.h5.runs"), Path("foreign")
    foreign.write_bytes(b"" if kind == "empty link" else b"words without a line")
    if kind == "pipe":
        os.mkfifo(journal)
    elif kind == "words":
        journal.write_bytes(foreign.read_bytes())
    else:
        journal.symlink_to(foreign)
    before = foreign.read_bytes()
    assert run(["sweep", "model.sd", "--over", "m=1,2", "-o", "s.h5"]) == 2
    assert "remove it, or give -o another name" in capsys.readouterr().err
    assert foreign.read_bytes() == before
    assert kind != "words" or journal.read_bytes() == before


FOREIGN = ("residual.c", "binding.c", "manifest.json", "binding.json", "sysdyn_model.h")


@pytest.mark.parametrize("name", FOREIGN)
@pytest.mark.parametrize("kind", ["file", "link", "dangling link", "folder", "pipe"])
@pytest.mark.one_in(12)
def test_compile_overwrites_nothing_that_it_did_not_write(trace, capsys, kind, name):
    target, foreign = Path("out") / name, Path("foreign.c")
    target.parent.mkdir()
    if kind == "file":
        target.write_text("int theirs;\n")
    elif kind == "folder":
        target.mkdir()
    elif kind == "pipe":
        os.mkfifo(target)
    else:
        target.symlink_to(foreign.absolute())
    if kind == "link":
        foreign.write_text("int theirs;\n")
    assert run(["compile", "model.sd", "-o", "out"]) == 2
    assert f"out/{name} was not written by sysdyn" in capsys.readouterr().err
    assert kind != "file" or target.read_text() == "int theirs;\n"
    assert kind != "link" or foreign.read_text() == "int theirs;\n"
    assert kind != "dangling link" or not foreign.exists()
    assert [path.name for path in target.parent.iterdir()] == [name]


@pytest.mark.long
def test_compile_overwrites_its_own(trace):
    for _ in range(2):
        assert run(["compile", "-q", "model.sd", "-o", "out"]) == 0
        assert run(["compile", "-q", "model.sd", "-o", "out", "--backend", "numpy"]) == 0


@pytest.mark.long
def test_soft_links_inside_a_trace_are_its_own(trace):
    with h5py.File("good.h5", "a") as file:
        file["again"] = h5py.SoftLink("/x")
    assert run(["plot", "-q", "good.h5", "again", "-o", "again.svg"]) == 0


@pytest.mark.parametrize("command", [["plot", "pipe"], ["diff", "good.h5", "pipe"], ["diff", "pipe", "good.h5"]])
@pytest.mark.one_in(2)
def test_a_pipe_is_no_trace(trace, capsys, command):
    os.mkfifo("pipe")
    assert run(command) == 5
    assert "no regular file" in capsys.readouterr().err


def test_a_pipe_is_no_table(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    os.mkfifo("rows.csv")
    text = PENDULUM.replace("model pendulum", 'table f(x: m) -> N linear clamp file "rows.csv"\nmodel pendulum', 1)
    assert run(["check", write(tmp_path, text)]) == 1
    assert "E206" in capsys.readouterr().err


def test_what_is_no_trace_of_ours_is_not_overwritten(trace, tmp_path, capsys):
    with h5py.File("measured.h5", "w") as file:
        file["time"], file["x"] = np.arange(3.0), np.arange(3.0)
    kept = {name: Path(name).read_bytes() for name in ("secret.txt", "measured.h5", "model.sd")}
    for name, content in kept.items():
        assert run(["simulate", "-q", "model.sd", "-o", name]) == 2
        assert name in capsys.readouterr().err
        assert Path(name).read_bytes() == content
    Path("empty.h5").touch()
    for name in ("good.h5", "empty.h5", "new.h5"):
        assert run(["simulate", "-q", "model.sd", "-o", name]) == 0


def living(path, output, *more):
    """A run that has written some rows."""
    command = [sys.executable, "-m", "sysdyn.cli", "simulate", "-q", path, "-o", output, "--max-wall", "60", *more]
    child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        if Path(output).exists() and Trace.open(output).time.size:
            return child
        time.sleep(0.05)
    raise AssertionError(child.communicate())


@pytest.mark.parametrize("sent", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
@pytest.mark.long
def test_every_polite_end_keeps_the_rows_and_removes_what_was_hidden(tmp_path, monkeypatch, sent):
    monkeypatch.chdir(tmp_path)
    child = living(write(tmp_path, ENDLESS), "out.h5")
    rows = Trace.open("out.h5").time.size
    child.send_signal(sent)
    _, err = child.communicate(timeout=60)
    assert child.returncode == 130, err
    assert "Traceback" not in err
    trace = Trace.open("out.h5")
    assert trace.time.size >= rows > 0
    assert not trace.final
    assert {p.name for p in tmp_path.iterdir()} == {"model.sd", "out.h5"}


@pytest.mark.long
def test_a_command_that_shall_not_be_hung_up_is_not(tmp_path, monkeypatch):
    """nohup: SIGHUP ignored stays ignored."""
    monkeypatch.chdir(tmp_path)
    write(tmp_path, ENDLESS)
    code = (
        "import signal, sys; signal.signal(signal.SIGHUP, signal.SIG_IGN)\n"
        "from sysdyn.cli.main import main; main(sys.argv[1:])"
    )
    command = [sys.executable, "-c", code, "simulate", "-q", "model.sd", "-o", "out.h5", "--max-wall", "4"]
    child = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    while not Path("out.h5").exists():
        time.sleep(0.05)
    child.send_signal(signal.SIGHUP)
    child.communicate(timeout=60)
    assert child.returncode == 3, "it ran on to its limit of time"


def test_a_second_run_of_one_trace_is_refused_while_the_first_lives(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    path = write(tmp_path, ENDLESS)
    child = living(path, "out.h5")
    before = Trace.open("out.h5").time.size
    (tmp_path / "elsewhere").mkdir()
    Path("elsewhere/link.h5").symlink_to("../out.h5")
    for name in ("out.h5", "./out.h5", "elsewhere/link.h5"):
        assert run(["simulate", "-q", path, "-o", name, "--max-wall", "1"]) == 5
        assert "another run is writing" in capsys.readouterr().err
    assert Trace.open("out.h5").time.size >= before
    child.send_signal(signal.SIGINT)
    child.communicate(timeout=60)
    assert run(["simulate", "-q", path, "-o", "out.h5", "--until", "0.1"]) == 0


def test_a_trace_that_cannot_be_read_while_it_is_written_is_held_by_its_run(tmp_path):
    """At an instant between two writes a file is no HDF5 yet: without its run it is nobody's trace."""
    torn = tmp_path / "out.h5"
    torn.write_bytes(b"\x89HDF\r\n\x1a\n, torn")
    assert not replaceable(torn)
    with claim_trace(torn):
        assert replaceable(torn)
    assert not replaceable(torn)


READER = """
import sys, time, h5py, numpy as np
with h5py.File(sys.argv[1], "r") as file:
    first = {name: file[name][:] for name in ("time", "x")}
    print(first["time"].size, flush=True)
    sys.stdin.readline()
    for data in file.values():
        if hasattr(data, "id") and hasattr(data, "refresh"):
            data.refresh()
    assert all(np.array_equal(file[name][:], first[name]) for name in first)
print("same", flush=True)
"""


@pytest.mark.long
def test_a_running_trace_is_read_and_does_not_change_under_its_reader(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    child = living(write(tmp_path, ENDLESS), "out.h5")
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    reader = subprocess.Popen([sys.executable, "-c", READER, "out.h5"], **pipes)
    rows = int(reader.stdout.readline())
    assert rows > 0
    deadline = time.monotonic() + 60
    sizes = {rows}
    while len(sizes) < 5 and time.monotonic() < deadline:  # four flushes go by: both stores were written
        sizes.add(Trace.open("out.h5").time.size)
        time.sleep(0.1)
    assert len(sizes) >= 5
    assert reader.communicate("\n", timeout=60)[0].strip() == "same"
    assert run(["plot", "-q", "out.h5", "-o", "out.svg"]) == 0
    child.send_signal(signal.SIGINT)
    child.communicate(timeout=60)


def test_control_characters_of_names_do_not_reach_the_terminal(trace, tmp_path, capsys):
    evil = "x\x1b]0;owned\x07\x1b[2Jy"
    Path("bad.h5").write_bytes(trace.read_bytes())
    with h5py.File("bad.h5", "a") as file:
        file[evil] = file["x"]
        file.attrs["title"] = "t\x1b[31m"
    (tmp_path / f"{evil.replace(']', '')}.sd").write_text("model m {\n  coord\n}\n")
    commands = (
        ["plot", "bad.h5"],
        ["plot", "bad.h5", evil],
        ["plot", "bad.h5", "none\x1b[2J"],
        ["diff", "good.h5", "bad.h5"],
        ["diff", "bad.h5", "good.h5"],
        ["diff", "good.h5", f"missing{evil}.h5"],
        ["check", f"{evil.replace(']', '')}.sd"],
        ["simulate", f"{evil.replace(']', '')}.sd"],
        ["simulate", "model.sd", "--set", f"{evil}=1"],
        ["simulate", "model.sd", "--scene", evil],
        ["explain", evil],
        [evil],
    )
    for command in commands:
        run(command)
        said = capsys.readouterr()
        for text in (said.out, said.err):
            assert not {c for c in text if ord(c) < 32 or ord(c) == 127} - {"\n"}, (command, text)


@pytest.mark.long
def test_the_same_names_are_whole_in_json(trace, capsys):
    evil = "x\x1b[2Jy"
    with h5py.File("good.h5", "a") as file:
        file[evil] = file["x"]
    run(["plot", "--json", "good.h5", evil, "-o", "p.svg"])
    assert json.loads(capsys.readouterr().out)["result"]["quantities"] == [evil]


def test_a_thread_may_call_the_command_line(tmp_path, monkeypatch):
    """Signals are the main thread's: elsewhere they are left alone."""
    monkeypatch.chdir(tmp_path)
    path, codes = write(tmp_path, PENDULUM), []
    worker = threading.Thread(target=lambda: codes.append(run(["check", "-q", path])))
    worker.start()
    worker.join()
    assert codes == [0]
