"""Work side by side: what comes of it, its order and its faults are those of one process."""

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import closing
from multiprocessing import resource_tracker, util
from pathlib import Path

import pytest
from sysdyn.cli.main import run
from sysdyn.cli.run.many import crew
from texts import PENDULUM, run_json

MODELS = Path(__file__).parents[2] / "models"
FALL = "model fall {\n  param m = 1 kg\n  coord x: translation = 0 m\n  energy T* = 1/2*m*x'^2\n  init x' = 1 m/s\n}\n"


def later_first(item):
    """The square of a number; the first ones take longest.  Of 13 there is none."""
    time.sleep(0.3 if item < 2 else 0.0)
    if item == 13:
        raise ValueError("13")
    if item == 14:
        os.kill(os.getpid(), signal.SIGKILL)
    return item * item, os.getpid()


def test_answers_come_in_the_order_of_the_items_whatever_is_ready_first():
    found = list(crew.each(later_first, range(6), 2))
    assert [square for square, _ in found] == [k * k for k in range(6)]
    assert os.getpid() not in {process for _, process in found}


@pytest.mark.parametrize("jobs", [1, 2])
@pytest.mark.one_in(2)
def test_a_fault_is_raised_in_its_turn(jobs):
    seen: list[int] = []
    with pytest.raises(ValueError, match="13"):
        seen.extend(square for square, _ in crew.each(later_first, [0, 1, 13, 2, 13], jobs))
    made = crew.each(later_first, [0, 1, 13], jobs)
    assert [next(made)[0], next(made)[0]] == [0, 1]
    made.close()


@pytest.mark.long
def test_an_item_that_kills_its_process_costs_its_own_answer():
    one, two, three = crew.each(later_first, [2, 14, 3], 2)
    assert (one[0], two, three[0]) == (4, crew.Lost("signal 9"), 9)


@pytest.mark.long
def test_processes_begin_where_what_is_left_foreseeably_pays(monkeypatch):
    monkeypatch.setattr(crew, "PAYS", 3.0)
    monkeypatch.setattr(crew, "cores", lambda: 2)
    assert {p for _, p in crew.each(later_first, [2, 3, 4], None)} == {os.getpid()}, "too small"
    first, *others = (p for _, p in crew.each(later_first, [0, *[2] * 28], None))
    assert first == os.getpid()
    assert os.getpid() not in others
    assert os.getpid() not in {p for _, p in crew.each(later_first, [2, 3], None, like=9.0)}
    monkeypatch.setattr(crew, "cores", lambda: 1)
    assert {p for _, p in crew.each(later_first, [2, 3], None, like=9.0)} == {os.getpid()}


def test_what_is_called_here_stands_for_what_is_called_elsewhere():
    assert list(crew.each(later_first, [2, 3], 1, lambda item: -item)) == [-2, -3]


def test_one_item_goes_beside_what_takes_long(monkeypatch):
    monkeypatch.setattr(crew, "PAYS", 0.05)
    monkeypatch.setattr(crew, "cores", lambda: 2)
    for item, answer in ((3, 9), (14, None), (13, None)):
        with closing(crew.Beside(later_first, item, None)) as beside:
            beside._timer.join()  # it begins when it is time, however busy the machine is
            found = beside.answer()
        assert (found and found[0]) == answer
    assert crew.Beside(later_first, 3, 1).answer() is None
    with closing(crew.Beside(later_first, 3, 2)) as beside:
        assert beside.answer() is None, "before it began"


@pytest.mark.long
def test_a_reference_made_beside_the_other_changes_nothing(tmp_path, capsys, monkeypatch):
    file = tmp_path / "pendulum.sd"
    file.write_text(PENDULUM)
    made = []
    monkeypatch.setattr(crew, "cores", lambda: 2)
    monkeypatch.setattr(crew.Crew, "_give", lambda self, *job, give=crew.Crew._give: made.append(job) or give(*job))
    found = []
    for pays in (60.0, 0.0):
        monkeypatch.setattr(crew, "PAYS", pays)
        found.append(run_json(capsys, "trade", str(file), "--no-timings", "--until", "0.3"))
    assert made, "the second way was made by a process"
    assert found[0] == found[1]


@pytest.mark.parametrize("command", ["verify", "record"])
@pytest.mark.one_in(2)
def test_commands_that_choose_processes_say_what_one_says(tmp_path, capsys, monkeypatch, command):
    Path("pendulum.sd").write_text(PENDULUM)
    asked = {"verify": ["verify"], "record": ["golden", "record", "--folder", "{}"]}[command]
    monkeypatch.setattr(crew, "cores", lambda: 2)
    told = []
    for pays in (60.0, 0.0):
        monkeypatch.setattr(crew, "PAYS", pays)
        words = [word.format(f"kept{pays}") for word in asked]
        told.append(run([*words, "pendulum.sd", *([] if command == "record" else ["--no-timings"])]))
        told.append(capsys.readouterr())
    assert told[:2] == told[2:]
    assert told[0] == 0
    for file in Path("kept60.0").rglob("*.*"):
        if file.suffix in (".json", ".toml"):
            assert file.read_text() == Path("kept0.0", *file.parts[1:]).read_text()


@pytest.mark.long
def test_checks_say_the_same_in_any_number_of_processes(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("a.sd").write_text(FALL)
    Path("b.sd").write_text(FALL.replace("m/s", "m"))
    Path("c.sd").write_bytes(b"\xff\x00")
    Path("d.sd").write_text("## nothing\n")
    Path("e.sd").write_text(FALL.replace("model", "modle"))
    files = ["a.sd", "b.sd", "gone.sd", "c.sd", "d.sd", "e.sd", str(MODELS / "gallery" / "pendulum.sd")]
    for options in (["--strict"], ["--explain"], ["--json"]):
        told = []
        for jobs in ("1", "2", "3"):
            code = run(["check", *files, *options, "--jobs", jobs])
            told.append((code, *capsys.readouterr()))
        assert told[0] == told[1] == told[2]
        assert told[0][0] == 5


def goes_on(group):
    """Whether a process of the group lives."""
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.long
def test_an_interrupt_ends_every_process_and_keeps_what_was_computed(tmp_path):
    """Of a trade: the runs of its journal; nobody goes on."""
    andrews = str(MODELS / "benchmark" / "andrews.sd")
    asked = [sys.executable, "-m", "sysdyn", "trade", andrews, "--full", "--jobs", "2", "-q"]
    environment = {**os.environ, "SYSDYN_CACHE": str(tmp_path)}
    process = subprocess.Popen(asked, env=environment, start_new_session=True, stdout=subprocess.DEVNULL)
    kept: list[Path] = []
    while not kept and process.poll() is None:
        time.sleep(0.05)
        kept = list(tmp_path.glob("trades/*/runs.jsonl"))
    os.killpg(process.pid, signal.SIGINT)
    assert process.wait(60) == 130
    while goes_on(process.pid):  # for ever, where one does
        time.sleep(0.05)
    assert len(kept[0].read_text().split("\n")) > 1


def _hears_of_interruptions(_):
    return signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())


def test_a_worker_hears_of_no_interruption_from_its_first_instruction():
    """One of the whole group, by Ctrl-C, ended those that were beginning with a page of where they were."""
    assert dict(crew.as_ready(_hears_of_interruptions, [0, 1], 2)) == {0: False, 1: False}


def test_an_interruption_waits_until_a_worker_has_begun(monkeypatch, capfd):
    """Between the process and what it is handed, the worker found its pipe closed: EOFError, on the terminal."""
    begin = util.spawnv_passfds

    def interrupted(*said):
        number = begin(*said)
        signal.raise_signal(signal.SIGINT)
        return number

    resource_tracker.ensure_running()
    monkeypatch.setattr(util, "spawnv_passfds", interrupted)
    with pytest.raises(KeyboardInterrupt):
        list(crew.as_ready(_hears_of_interruptions, [0], 1))
    time.sleep(0.5)
    assert multiprocessing.active_children() == []
    assert capfd.readouterr().err == ""
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def _end_within(seconds):
    """Whether no process is left; two threads that wait for one may know of its end one after the other."""
    until = time.monotonic() + seconds
    while multiprocessing.active_children() and time.monotonic() < until:
        time.sleep(0.01)
    return not multiprocessing.active_children()


def test_a_worker_that_is_beginning_beside_is_ended_too(monkeypatch):
    begin, began = util.spawnv_passfds, threading.Event()

    def slowly(*said):
        began.set()
        time.sleep(0.3)
        return begin(*said)

    resource_tracker.ensure_running()
    monkeypatch.setattr(util, "spawnv_passfds", slowly)
    monkeypatch.setattr(crew, "PAYS", 0.0)
    beside = crew.Beside(_hears_of_interruptions, 0, 2)
    assert began.wait(5.0)
    beside.close()
    assert _end_within(5.0)
    time.sleep(0.5)
    assert multiprocessing.active_children() == []
