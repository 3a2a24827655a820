"""One command where another one's result stands: what would be lost, what is no trace, which exit counts."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from sysdyn.cli.failures import classify, worst
from sysdyn.cli.main import run
from sysdyn.runtime.trace.claim import claim_trace
from texts import BROKEN, ENDLESS, PENDULUM, process, write

DRIVEN = """\
from std.electrical import resistor, capacitor, voltage

model driven {
  param r = 1 ohm
  node a, b: electrical
  V: voltage(v = 5 V*sin(2*pi*1 kHz*t)) a -> ground
  R: resistor(R = r) a -> b
  C: capacitor(C = 1 uF) b -> ground
}

scene long of driven {
  time 0 s to 1e7 s
  trace b.e
}
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with a model, its trace and its sweep, made once."""
    folder = tmp_path_factory.mktemp("made")
    path = Path(write(folder, PENDULUM))
    assert run(["simulate", "-q", str(path), "-o", str(folder / "trace.h5")]) == 0
    assert run(["sweep", "-q", str(path), "--over", "l=2,3", "-o", str(folder / "runs.h5")]) == 0
    (folder / "notes.txt").write_text("a year of measurements\n")
    return path


@pytest.fixture
def model(made, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(made.parent, tmp_path, dirs_exist_ok=True)
    return str(tmp_path / made.name)


OVER = ["--over", "l=2,3"]


@pytest.mark.parametrize(
    ("command", "output"),
    [
        (["sweep", *OVER], "notes.txt"),
        (["sweep", *OVER], "trace.h5"),
        (["simulate"], "runs.h5"),
        (["simulate"], "notes.txt"),
        (["linearize"], "trace.h5"),
        (["linearize"], "runs.h5"),
        (["reduce"], "trace.h5"),
    ],
)
@pytest.mark.one_in(3)
def test_a_result_takes_no_other_result_s_place(model, capsys, command, output):
    before = Path(output).read_bytes()
    assert run([*command, "-q", model, "-o", output]) == 2
    assert output in capsys.readouterr().err
    assert Path(output).read_bytes() == before


@pytest.mark.long
def test_a_result_takes_the_place_of_its_like(model):
    for command, output in ((["sweep", *OVER], "runs.h5"), (["simulate"], "trace.h5"), (["linearize"], "matrices.h5")):
        Path("empty.h5").write_bytes(b"")
        for name in (output, output, "empty.h5"):
            assert run([*command, "-q", model, "-o", name]) == 0


@pytest.mark.parametrize("command", [["simulate"], ["sweep", *OVER]], ids=["simulate", "sweep"])
def test_an_output_that_leads_nowhere_is_one_of_input_and_output(model, capsys, command):
    Path("circle.h5").symlink_to("circle.h5")
    Path("folder.h5").mkdir()
    for name in ("circle.h5", "folder.h5", "notes.txt/x.h5"):
        assert run([*command, "-q", model, "-o", name]) == 5
        said = capsys.readouterr().err
        assert said.count(name) == 1, said
        assert "part" not in said


@pytest.mark.parametrize("command", [["simulate"], ["sweep", *OVER]], ids=["simulate", "sweep"])
@pytest.mark.long
def test_an_output_that_is_a_link_stays_one(model, command):
    kept = Path("trace.h5" if command == ["simulate"] else "runs.h5")
    link = Path("link.h5")
    link.symlink_to(kept)
    before = kept.stat().st_ino
    Path("old.h5").hardlink_to(kept)  # the number of a file that is gone may be another's
    assert run([*command, "-q", model, "-o", str(link)]) == 0
    assert link.is_symlink()
    assert kept.stat().st_ino != before


def test_a_sweep_is_no_trace(model, capsys):
    for command in (["plot", "runs.h5"], ["plot", "trace.h5", "runs.h5"]):
        assert run([*command, "-o", "p.png"]) == 5
        assert "runs of a sweep" in capsys.readouterr().err
    assert run(["diff", "trace.h5", "runs.h5"]) == 3


@pytest.mark.parametrize("values", [np.full(101, b"text"), np.full(101, 1j)], ids=["texts", "complex"])
@pytest.mark.long
def test_what_is_no_number_over_time_is_not_drawn(model, capsys, recwarn, values):
    with h5py.File("trace.h5", "a") as file:
        file["odd"] = values
        file.attrs["final"] = [1, 1]
    assert run(["plot", "trace.h5", "-o", "p.svg", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert "odd" not in found["result"]["quantities"]
    assert not [w for w in recwarn if issubclass(w.category, np.exceptions.ComplexWarning)]


@pytest.mark.parametrize(
    "line", [b"no json\n", b"\xff\xfe\n", b"[]\n", b'{"study": 1}\n', b'{"block": {"runs": 3}}\n', b'{"odd": 3}\n']
)
@pytest.mark.one_in(5)
def test_a_damaged_journal_is_named(model, capsys, line):
    journal = Path(".runs.h5.runs")
    poison = ["sweep", "-q", model, *OVER, "-o", "runs.h5"]
    kept = Path("runs.h5").read_bytes()
    begun = _begun(model)
    for text in (line, begun + line) if b"study" not in line else (line,):
        journal.write_bytes(text)
        assert run(poison) in (2, 5)
        assert journal.name in capsys.readouterr().err
        assert Path("runs.h5").read_bytes() == kept
        assert journal.read_bytes() == text


def _begun(model):
    """The first line of the journal of this sweep."""
    from sysdyn.cli.sweep import journal

    lines, kept = [], journal.SweepJournal._line
    journal.SweepJournal._line = lambda self, item: (lines.append(item), kept(self, item))[1]
    try:
        assert run(["sweep", "-q", model, *OVER, "-o", "other.h5"]) == 0
    finally:
        journal.SweepJournal._line = kept
    return (json.dumps(lines[0]) + "\n").encode()


def test_one_sweep_at_a_time_writes_a_file(model, capsys):
    with claim_trace(Path("runs.h5").resolve()):
        assert run(["sweep", "-q", model, *OVER, "-o", "runs.h5"]) == 5
    assert "another run is writing" in capsys.readouterr().err
    assert run(["sweep", "-q", model, *OVER, "-o", "runs.h5"]) == 0


def test_the_exit_that_counts_first():
    assert worst([]) == 0
    assert worst([0, 1, 3, 2]) == 2
    assert worst([1, 5, 4]) == 4
    assert worst([4, 130]) == 130
    assert worst([3, 1, 0]) == 3


@pytest.mark.parametrize(
    "options",
    [["--until", "1 m"], ["--max-wall", "0"], ["--max-wall", "1 V"], ["--until", "-1"], ["--set", "nosuch=1"]],
)
@pytest.mark.one_in(5)
def test_wrong_usage_of_a_sweep_is_no_failure_of_its_runs(model, options):
    assert run(["sweep", "-q", model, *OVER, "-o", "new.h5", *options]) == 2
    assert run(["simulate", "-q", model, "-o", "new.h5", *options]) == 2


@pytest.mark.parametrize("command", ["verify", "trade", "reduce", "report", "equations", "compile", "equilibrium"])
@pytest.mark.parametrize("options", [["--set", "nosuch=1"], ["--set", "l=2 kg"], ["--level", "a=b"]])
def test_a_value_that_was_typed_wrong_is_wrong_usage(model, capsys, command, options):
    assert run([command, model, *options, "--json"]) == 2
    (found,) = [d for d in json.loads(capsys.readouterr().out)["diagnostics"] if d["severity"] == "error"]
    assert found["file"] == options[0]


@pytest.mark.parametrize("command", ["trade", "reduce"])
@pytest.mark.one_in(2)
def test_a_limit_of_wall_time_has_a_unit(model, capsys, command):
    for text in ("1 m", "soon", "inf"):
        assert run([command, model, "--max-wall", text]) == 2
        assert "a number of seconds" in capsys.readouterr().err
    assert run([command, "-q", model, "--max-wall", "1 min"]) == 0


def test_the_limit_of_a_reduction_counts_from_its_first_run(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    path = write(tmp_path, DRIVEN.replace("1e7 s", "400 s"))  # of more steps the end would be out of reach
    assert run(["reduce", path, "--max-wall", "0.3"]) == 3
    assert "E934" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["simulate", "reduce", "report"])
@pytest.mark.long
def test_a_limit_of_steps_ends_every_command_as_a_run(tmp_path, monkeypatch, capsys, command):
    monkeypatch.chdir(tmp_path)
    assert run([command, write(tmp_path, ENDLESS), "--max-steps", "3", "--json"]) == 3
    assert "E934" in [d["code"] for d in json.loads(capsys.readouterr().out)["diagnostics"]]


def test_a_netlist_goes_to_standard_output_by_its_name(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("f.cir").write_text("low pass\nV1 a 0 1\nR1 a b 1k\nC1 b 0 1u\n.tran 1u 5m\n.end\n")
    assert run(["import", "f.cir"]) == 0
    plain = capsys.readouterr().out
    assert run(["import", "f.cir", "-o", "-"]) == 0
    assert capsys.readouterr().out == plain
    assert not Path("-").exists()


@pytest.mark.parametrize("command", [["verify"], ["trade", "--accuracy", "1e-2"]], ids=["verify", "trade"])
@pytest.mark.long
def test_processes_side_by_side_read_standard_input_too(command):
    run_ = [*command, "-", "--until", "0.2", "--no-timings", "--json"]
    found = [process(*run_, "--jobs", n, input=PENDULUM) for n in ("1", "2")]
    assert [ran.returncode for ran in found] == [0, 0], found[1].stdout
    assert found[0].stdout == found[1].stdout


@pytest.mark.parametrize(
    ("command", "code"), [("help --json", 0), ("list {}", 0), ("check {0} --json", 1), ("check {0} 2>&1", 1)]
)
@pytest.mark.long
def test_a_reader_that_goes_away_changes_no_exit(tmp_path, command, code):
    path = write(tmp_path, BROKEN if code else PENDULUM)
    line = f"{sys.executable} -m sysdyn.cli {command.format(path)} | true; exit ${{PIPESTATUS[0]}}"
    ran = subprocess.run(["bash", "-c", line], capture_output=True, text=True, timeout=60, check=False)
    assert (ran.returncode, ran.stderr) == (code, "")


@pytest.mark.long
def test_a_window_that_matplotlib_does_not_know_is_no_fault(model):
    environment = {**os.environ, "MPLBACKEND": "none such"}
    ran = process("plot", "trace.h5", "-o", "p.png", env=environment)
    assert ran.returncode == 0, ran.stderr


@pytest.mark.parametrize("command", ["simulate -", "check -", "plot - -o p.png", "diff - trace.h5", "import -"])
@pytest.mark.long
def test_a_closed_standard_input_is_one_of_input_and_output(model, command):
    line = f"{sys.executable} -m sysdyn.cli {command} <&-"
    ran = subprocess.run(["bash", "-c", line], capture_output=True, text=True, timeout=60, check=False)
    assert ran.returncode == 5, ran.stderr
    assert "the standard input stream is closed" in ran.stderr


@pytest.mark.long
def test_a_netlist_comes_from_standard_input(tmp_path, monkeypatch):
    netlist = "low pass\nV1 a 0 1\nR1 a b 1k\nC1 b 0 1u\n.tran 1u 5m\n.end\n"
    monkeypatch.chdir(tmp_path)
    Path("stdin.cir").write_text(netlist)
    assert process("import", "-", input=netlist).stdout == process("import", "stdin.cir").stdout


@pytest.mark.long
def test_quiet_keeps_the_reason_of_a_difference(model, capsys):
    assert run(["simulate", "-q", model, "--set", "m=3", "--set", "l=2.3", "-o", "second.h5"]) == 0
    assert run(["diff", "-q", "trace.h5", "second.h5"]) == 1
    said = capsys.readouterr()
    assert said.out == ""
    assert "differs" in said.err
    assert run(["diff", "-q", "trace.h5", "trace.h5"]) == 0
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("options", "code"),
    [
        (["--over", "formulation=lagrangian,nosuch"], 2),
        (["--over", "method=bdf,nosuch"], 2),
        (["--over", "index=2,9"], 2),
        ([*OVER, "--seed", "9" * 30], 2),
        (["--over", "l~normal(2 m, 0.1 m)", "--runs", "2", "--seed", "-5"], 2),
        ([*OVER, "--until", "1e400"], 2),
        (["--over", "l=1 kg,2 kg"], 2),
        (["--over", "nosuch=1,2"], 2),
    ],
)
@pytest.mark.one_in(5)
def test_what_a_sweep_cannot_vary_is_said_before_its_runs(model, capsys, options, code):
    assert run(["sweep", model, "-o", "new.h5", *options]) == code
    assert capsys.readouterr().err
    assert not Path("new.h5").exists()


@pytest.mark.parametrize("command", [["linearize", "--at"], ["simulate", "--until"], ["simulate", "--max-wall"]])
@pytest.mark.one_in(5)
def test_a_number_that_no_float_holds_is_refused(model, capsys, command):
    for text in ("1e400", "1e-400"):
        assert run([command[0], model, command[1], text]) == 2
        assert "E114" in capsys.readouterr().err


def test_a_stage_is_in_json_too(model, capsys):
    for stage in ("network", "program"):
        assert run(["compile", model, "--dump", stage]) == 0
        text = capsys.readouterr().out
        assert run(["compile", model, "--dump", stage, "--json"]) == 0
        found = json.loads(capsys.readouterr().out)["result"]
        assert found["stage"] == stage
        assert found["text"].rstrip("\n") == text.rstrip("\n") != ""


def test_an_interruption_within_another_error_is_one():
    wrapped = RuntimeError("Error calling __set_name__")
    wrapped.__cause__ = KeyboardInterrupt()
    assert classify(wrapped) == (130, "interrupted")
