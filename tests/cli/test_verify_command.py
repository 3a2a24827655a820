"""What `sysdyn verify` prints, writes and refuses."""

import re
from pathlib import Path

import pytest
from schema import EXPECT, NUMBER, STATISTICS, conforms, envelope
from sysdyn.cli.main import run
from sysdyn.cli.verify import verification
from sysdyn.runtime.trace.trace import Trace
from texts import FAILING, PENDULUM, STUCK, TWO_SCENES, run_json, write
from verified import CIRCUIT, FOUR, GAP, LONG, both, names

VERIFY = {
    "runs": list,
    "disagreements": list,
    "horizon": (*NUMBER, type(None)),
    "compared": list,
    "not_compared": list,
    "not_expressible": list,
    "backends": list,
}

RUN = {
    "formulation": str,
    "method": str,
    "index": str,
    "accuracy": NUMBER,
    "final": bool,
    "reached": NUMBER,
    "statistics": dict,
    "timings": dict,
    "error_estimate": (*NUMBER, type(None)),
    "energy": NUMBER,
    "constraints": NUMBER,
    "worst": (dict, type(None)),
    "expects": list,
    "warnings": list,
    "failure": (str, type(None)),
    "trace": (str, type(None)),
}


@pytest.mark.long
def test_an_expectation_that_fails_is_listed_and_never_decides(tmp_path, capsys):
    code, found = run_json(capsys, "verify", write(tmp_path, FAILING))
    assert code == 0
    assert not [d for d in found["diagnostics"] if d["severity"] == "error"]
    assert [e["ok"] for r in found["result"]["runs"] for e in r["expects"]] == [False] * 5
    assert found["result"]["disagreements"] == []


def test_a_solver_that_stops_is_exit_3_with_time_and_run(tmp_path, capsys):
    code, found = run_json(capsys, "verify", write(tmp_path, STUCK), "--max-wall", "20")
    assert code == 3
    failures = [d for d in found["diagnostics"] if "the solver stopped at t = " in d["message"]]
    assert any(d["message"].startswith("lagrangian bdf: ") for d in failures)
    lines = Path(found["diagnostics"][0]["file"]).read_text().splitlines()
    for d in failures:  # each names its statement
        assert re.fullmatch("E93[0-4]", d["code"])
        assert lines[d["line"] - 1][d["column"] - 1 :].strip()
    stopped = [r for r in found["result"]["runs"] if r["failure"]]
    assert {r["diagnostic"]["code"] for r in stopped} <= {d["code"] for d in failures}
    assert all(r["diagnostic"]["line"] for r in stopped)
    assert all((r["diagnostic"] is None) == (r["failure"] is None) for r in found["result"]["runs"])
    # what the runs had is compared all the same
    assert 0.9 < found["result"]["horizon"] <= 1.0
    assert found["result"]["disagreements"] == []


# --- what is compared -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("at", "shown"), [("co_lagrangian", 4), ("hamiltonian", 2), (None, 0)])
@pytest.mark.one_in(2)
def test_an_interruption_shows_the_runs_so_far(tmp_path, capsys, monkeypatch, at, shown):
    made = verification._Verification._formulation

    def interrupted(self, name):
        if name == at:
            raise KeyboardInterrupt
        made(self, name)

    monkeypatch.setattr(verification._Verification, "_formulation", interrupted)
    code = run(["verify", write(tmp_path, CIRCUIT), "--jobs", "1"])
    out, said = capsys.readouterr()
    assert code == 130
    assert "interrupted" in said
    assert len(re.findall(r"^(?:co_)?(?:lagr|hamilt)\w+ +(?:bdf|radau) ", out, re.M)) == shown + (shown > 0)
    assert (f"{shown} runs agree on" in out) == (shown > 0)


@pytest.mark.long
def test_formulation_and_method_name_the_reference(tmp_path, capsys):
    options = ("--formulation", "co_hamiltonian", "--method", "radau")
    code, found = run_json(capsys, "verify", write(tmp_path, CIRCUIT), *options)
    assert code == 0
    assert names(found["result"])[:2] == [("co_hamiltonian", "radau"), ("co_hamiltonian", "bdf")]
    assert {f for f, _ in names(found["result"])} == set(FOUR)
    finer = found["result"]["runs"][-1]
    assert (finer["formulation"], finer["method"]) == ("co_hamiltonian", "radau")
    assert finer["accuracy"] == pytest.approx(1e-5)


@pytest.mark.long
def test_the_numpy_backend_agrees(tmp_path, capsys):
    assert run(["verify", "--backend", "numpy", "--until", "0.05", write(tmp_path, PENDULUM)]) == 0
    assert "residuals of numpy and c: " in capsys.readouterr().out


# --- sizes ------------------------------------------------------------------------------------------------------------


@pytest.fixture
def sized(tmp_path):
    """A model in a folder below a ci.toml that sets its mass."""
    (tmp_path / "own").mkdir()
    (tmp_path / "ci.toml").write_text('[own.swing]\nm = 2.5\nl = "300 cm"\n')
    return write(tmp_path / "own", PENDULUM.replace("expect always: abs(audit.energy) <= 1 J", ""), "swing.sd")


@pytest.mark.parametrize(
    ("options", "mass", "length"),
    [((), 2.5, 3.0), (("--set", "m=5"), 5.0, 3.0), (("--full",), 1.13, 2.34)],
)
@pytest.mark.one_in(5)
def test_sizes_of_ci_toml_hold_unless_the_command_line_wins(sized, options, mass, length, capsys):
    assert run(["verify", sized, "-o", "kept", "--until", "0.1", *options]) == 0
    parameters = Trace.open("kept/lagrangian-bdf.h5").parameters
    assert (parameters["m"][0], parameters["l"][0]) == (mass, length)
    assert ("ci.toml: " in capsys.readouterr().err) == ("--full" not in options)


@pytest.mark.parametrize("text", ["[own.swing]\nm = ", "[own]\nswing = 3\n", "[own.swing]\nm = [1, 2]\n"])
@pytest.mark.one_in(2)
def test_sizes_that_are_none_are_wrong_usage(sized, text, tmp_path, capsys):
    (tmp_path / "ci.toml").write_text(text)
    code, found = run_json(capsys, "verify", sized)
    assert code == 2
    assert "ci.toml" in found["diagnostics"][0]["message"]


# --- the command ------------------------------------------------------------------------------------------------------


@pytest.mark.long
def test_the_object_of_json(tmp_path, capsys):
    code, found = run_json(capsys, "verify", write(tmp_path, PENDULUM))
    assert code == 0
    envelope(found, "verify", VERIFY)
    result = found["result"]
    assert names(result) == both("lagrangian", "hamiltonian")
    for item in result["runs"]:
        conforms(item, RUN)
        conforms(item["statistics"], STATISTICS)
        assert item["trace"] is None
        for claim in item["expects"]:
            conforms(claim, {key: EXPECT[key] for key in ("text", "ok")})
    assert result["runs"][0]["worst"] is None
    for item in result["runs"][1:]:
        conforms(item["worst"], GAP)
    assert result["horizon"] == 1.0
    assert sorted(result["compared"]) == ["speed", "x", "y"]
    refused = {r["formulation"]: r["code"] for r in result["not_expressible"]}
    assert (refused["co_lagrangian"], refused["co_hamiltonian"]) == ("E602", "E602")


@pytest.mark.long
def test_the_table_is_aligned_and_nothing_is_left_behind(tmp_path, capsys):
    path = write(tmp_path, PENDULUM)
    assert run(["verify", path]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "swing of pendulum: 0 s to 1 s, apart in units of 10 x 0.0001 x nominal"
    head, *rows = lines[1:7]
    for column in ("formulation", "method", "worst"):
        at = head.index(column)
        assert all(row[at] != " " and (at == 0 or row[at - 1] == " ") for row in rows), column
    for column in ("index", "accuracy", "steps", "estimate", "energy J", "constraints", "apart", "at s"):
        end = head.index(column) + len(column)
        assert all(row[end - 1] != " " and row[end : end + 1] in ("", " ") for row in rows), column
    assert lines[-1] == "4 runs agree on 3 quantities"
    assert [p.name for p in tmp_path.iterdir()] == ["model.sd"]


@pytest.mark.long
def test_no_timings_gives_the_same_table_twice(tmp_path, capsys):
    path = write(tmp_path, PENDULUM)
    shown = []
    for _ in range(2):
        assert run(["verify", "--no-timings", path]) == 0
        shown.append(capsys.readouterr().out)
    assert shown[0] == shown[1]
    assert "CPU" not in shown[0]


@pytest.mark.parametrize(
    ("text", "options", "exit_code", "said"),
    [
        (TWO_SCENES, (), 2, "several scenes"),
        (PENDULUM, ("--scene", "swig"), 2, "E901"),
        (PENDULUM, ("--method", "euler"), 2, "verify compares bdf and radau"),
        (PENDULUM, ("--accuracy", "1e-5", "--rtol", "1e-5"), 2, "--accuracy together with"),
        (PENDULUM, ("--formulation", "co_lagrangian"), 1, "not expressible in co_lagrangian"),
        (PENDULUM.replace("= l^2", "= l"), (), 1, "the two sides differ"),
    ],
)
@pytest.mark.one_in(5)
def test_wrong_usage_and_wrong_models(tmp_path, capsys, text, options, exit_code, said):
    code, found = run_json(capsys, "verify", write(tmp_path, text), *options)
    assert code == exit_code
    envelope(found, "verify")
    assert said in " ".join(d["message"] for d in found["diagnostics"])


def test_a_missing_file_is_exit_5(capsys):
    assert run(["verify", "missing.sd"]) == 5


@pytest.mark.parametrize(
    "name", ["coulomb_slide", *(["pendulum", "redundant_pendulum", "incline_friction"] if LONG else [])]
)
def test_processes_side_by_side_find_what_one_finds(name, capsys):
    """Runs, gaps, refusals, warnings and exit code, in the same order, whatever ends first."""
    model = str(Path(__file__).parents[2] / "models" / "seed" / f"{name}.sd")
    one, two = (run_json(capsys, "verify", model, "--no-timings", "--jobs", n) for n in "12")
    for _, found in (one, two):
        for item in found["result"]["runs"]:
            item.pop("trace")
    assert one == two
