"""--json: one object of one shape from each command, when all is well and when not."""

import pytest
from schema import (
    CHECK,
    EQUATION,
    EQUATIONS,
    EQUILIBRIUM,
    EXPECT,
    EXPLAIN,
    FMT,
    LINEARIZE,
    MANIFEST,
    MODE,
    PARAMETER,
    PLOT,
    REST,
    ROW,
    SIMULATE,
    STATISTICS,
    TARGET,
    TIMINGS,
    UNKNOWN,
    conforms,
    envelope,
)
from sysdyn.cli.main import run
from texts import BROKEN, FAILING, PENDULUM, STUCK, TWO_SCENES, run_json, write


@pytest.mark.long
def test_check(tmp_path, capsys):
    code, found = run_json(capsys, "check", write(tmp_path, TWO_SCENES))
    assert code == 0
    envelope(found, "check", CHECK)
    (file,) = found["result"]["files"]
    assert [t["scene"] for t in file["targets"]] == ["swing", "again"]
    for target in file["targets"]:
        conforms(target, TARGET)
        assert (target["dof"], target["m1"], target["index"]) == (1, 1, 3)


@pytest.mark.long
def test_linearize(tmp_path, capsys):
    code, found = run_json(capsys, "linearize", write(tmp_path, PENDULUM))
    assert code == 0
    envelope(found, "linearize", LINEARIZE)
    result = found["result"]
    n, modes = len(result["states"]), len(result["eigenvalues"])
    assert [len(result[k]) for k in "EA"] == [n, n]
    assert all(len(row) == n for k in "EAC" for row in result[k])
    assert [len(row) for row in result["participation"]] == [n] * modes
    for mode in result["modes"]:
        conforms(mode, MODE)


@pytest.mark.long
def test_equilibrium(tmp_path, capsys):
    code, found = run_json(capsys, "equilibrium", write(tmp_path, PENDULUM))
    assert code == 0
    envelope(found, "equilibrium", EQUILIBRIUM)
    assert len(found["result"]["equilibria"]) == 2
    for rest in found["result"]["equilibria"]:
        conforms(rest, REST)


@pytest.mark.long
def test_equations(tmp_path, capsys):
    code, found = run_json(capsys, "equations", write(tmp_path, PENDULUM))
    assert code == 0
    envelope(found, "equations", EQUATIONS)
    for line in (*found["result"]["functions"], *found["result"]["equations"]):
        conforms(line, EQUATION)


def test_check_with_errors(tmp_path, capsys):
    code, found = run_json(capsys, "check", write(tmp_path, BROKEN))
    assert code == 1
    envelope(found, "check", CHECK)
    (error,) = found["diagnostics"]
    assert error["code"] == "E208"
    assert (error["line"], error["column"]) == (8, 24)
    assert error["file"].endswith("model.sd")


def test_check_of_a_missing_file_still_checks_the_others(tmp_path, capsys):
    code, found = run_json(capsys, "check", "missing.sd", write(tmp_path, BROKEN))
    assert code == 5
    envelope(found, "check", CHECK)
    assert [d["code"] for d in found["diagnostics"]] == ["E208", "input_output"]
    assert len(found["result"]["files"]) == 1


def test_fmt(tmp_path, capsys):
    path = write(tmp_path, PENDULUM.replace("  param m", "      param m"))
    code, found = run_json(capsys, "fmt", "--check", path)
    assert code == 1
    envelope(found, "fmt", FMT)
    assert found["result"]["changed"] == [path]


@pytest.mark.long
def test_compile(tmp_path, capsys):
    code, found = run_json(capsys, "compile", write(tmp_path, PENDULUM), "-o", str(tmp_path))
    assert code == 0
    envelope(found, "compile", MANIFEST)
    manifest = found["result"]
    assert (manifest["model"], manifest["scene"], manifest["index"]) == ("pendulum", None, 2)
    for schema, key in ((UNKNOWN, "unknowns"), (ROW, "rows"), (PARAMETER, "parameters")):
        assert manifest[key]
        for item in manifest[key]:
            conforms(item, schema)


@pytest.mark.long
def test_simulate(tmp_path, capsys):
    code, found = run_json(capsys, "simulate", write(tmp_path, PENDULUM))
    assert code == 0
    envelope(found, "simulate", SIMULATE)
    result = found["result"]
    conforms(result["statistics"], STATISTICS)
    conforms(result["timings"], TIMINGS)
    assert result["trace"] == "model-swing.h5"
    assert (result["final"], result["reached"], result["index"]) == (True, 1.0, "0")
    (claim,) = result["expects"]
    conforms(claim, EXPECT)
    assert claim["ok"] is True


@pytest.mark.long
def test_simulate_with_a_failed_expectation(tmp_path, capsys):
    code, found = run_json(capsys, "simulate", write(tmp_path, FAILING))
    assert code == 1
    envelope(found, "simulate", SIMULATE)
    assert [d["code"] for d in found["diagnostics"]] == ["E909"]
    (claim,) = found["result"]["expects"]
    assert claim["ok"] is False
    assert claim["time"] == 1.0
    assert found["result"]["final"] is True


def test_simulate_that_the_solver_cannot_finish(tmp_path, capsys):
    code, found = run_json(capsys, "simulate", write(tmp_path, STUCK), "--max-wall", "20")
    assert code == 3
    envelope(found, "simulate", SIMULATE)
    assert found["result"]["final"] is False
    assert found["result"]["reached"] == pytest.approx(1.0, abs=1e-3)
    (failure,) = (d for d in found["diagnostics"] if d["severity"] == "error")
    assert failure["code"] == "E930"
    assert "t = " in failure["message"]


def test_simulate_stopped_by_the_limit_of_steps_claims_nothing_about_its_end(tmp_path, capsys):
    code, found = run_json(capsys, "simulate", write(tmp_path, FAILING), "--max-steps", "5")
    assert code == 3
    envelope(found, "simulate", SIMULATE)
    assert [claim["ok"] for claim in found["result"]["expects"]] == [None]
    assert found["result"]["statistics"]["steps"] == 5


def test_plot(tmp_path, capsys):
    assert run(["simulate", "-q", write(tmp_path, PENDULUM)]) == 0
    code, found = run_json(capsys, "plot", "model-swing.h5", "x")
    assert code == 0
    envelope(found, "plot", PLOT)
    assert found["result"] == {"picture": "model-swing.png", "traces": ["model-swing.h5"], "quantities": ["x"]}


def test_explain(capsys):
    code, found = run_json(capsys, "explain", "E208")
    assert code == 0
    envelope(found, "explain", EXPLAIN)
    assert found["result"]["code"] == "E208"


@pytest.mark.parametrize(
    ("arguments", "code", "kind"),
    [
        (("explain", "E999"), 2, "usage"),
        (("simulate", "two.sd"), 2, "usage"),
        (("simulate", "two.sd", "--scene", "swig"), 2, "usage"),
        (("simulate", "two.sd", "--method", "magic"), 2, "usage"),
        (("simulate", "missing.sd"), 5, "input_output"),
        (("compile", "missing.sd"), 5, "input_output"),
        (("fmt", "missing.sd"), 5, "input_output"),
        (("plot", "missing.h5"), 5, "input_output"),
        (("plot", "two.sd"), 5, "input_output"),
        (("simulate", "two.sd", "--scene", "swing", "-o", "no/such/folder.h5"), 5, "input_output"),
        (("simulate", "two.sd", "--scene", "swing", "-o", "-"), 2, "usage"),
    ],
)
@pytest.mark.one_in(6)
def test_failures_without_a_place(tmp_path, capsys, arguments, code, kind):
    write(tmp_path, TWO_SCENES, "two.sd")
    exit_code, found = run_json(capsys, *arguments)
    assert exit_code == code
    envelope(found, arguments[0])
    (error,) = found["diagnostics"]
    assert error["code"] == kind
    assert error["file"] is None


def test_numbers_that_json_has_not_become_null():
    from sysdyn.cli.console import finite

    assert finite({"a": [float("nan"), 1.0, float("inf")], "b": (True, None, "x")}) == {
        "a": [None, 1.0, None],
        "b": [True, None, "x"],
    }


@pytest.mark.long
def test_nothing_else_reaches_standard_output(tmp_path, capsys):
    path = write(tmp_path, PENDULUM)
    for arguments in (("check", path), ("simulate", path), ("compile", path, "--dump", "network")):
        run_json(capsys, *arguments)
