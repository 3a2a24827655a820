"""What every command has in common: exit codes, usage, --quiet, colours, standard input."""

import io
import sys

import pytest
from sysdyn.cli.main import COMMANDS, run
from texts import BROKEN, FAILING, PENDULUM, STUCK, TWO_SCENES, write


@pytest.fixture
def typed(monkeypatch):
    """Give a text on standard input."""

    def give(text):
        data = text if isinstance(text, bytes) else text.encode()
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(data), encoding="utf-8"))

    return give


def test_help_lists_every_command(capsys):
    assert run(["--help"]) == 0
    out = capsys.readouterr().out
    assert all(name in out for name in COMMANDS)
    for code in ("0 done", "1 the model", "2 wrong usage", "3 the solver", "4 a fault", "5 input", "130 interrupted"):
        assert code in " ".join(out.split())


@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_each_command(command, capsys):
    assert run([command, "--help"]) == 0
    out = capsys.readouterr().out
    assert out.startswith(f"Usage: sysdyn {command} [OPTIONS]")
    assert "--json" in out
    assert "--quiet" in out
    assert "--color" in out


def test_version(capsys):
    assert run(["--version"]) == 0
    assert capsys.readouterr().out.startswith("sysdyn, version ")


def test_without_arguments_the_help_is_shown(capsys):
    assert run([]) == 2
    assert capsys.readouterr().err.startswith("Usage: sysdyn")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["simulat"], "Did you mean 'simulate'?"),
        (["frobnicate"], "There are animate, check, compile"),
        (["simulate"], "Missing argument 'FILE'"),
        (["simulate", "two.sd", "--wrong"], "No such option"),
        (["simulate", "two.sd"], "--scene swing | again"),
        (["simulate", "two.sd", "--scene", "swin"], "nearest: 'swing'"),
        (["simulate", "two.sd", "--model", "pend"], "has no model 'pend'"),
        (["simulate", "bare.sd"], "--until is needed"),
        (["simulate", "empty.sd"], "has no model"),
        (
            ["simulate", "two.sd", "--scene", "swing", "--accuracy", "1e-3", "--rtol", "1e-3"],
            "--accuracy together with",
        ),
        (
            ["simulate", "two.sd", "--scene", "swing", "--accuracy", "1e-3", "--atol", "1e-3"],
            "--accuracy together with",
        ),
        (["simulate", "two.sd", "--scene", "swing", "--accuracy", "0"], "from 1e-13"),
        (["simulate", "two.sd", "--scene", "swing", "--accuracy", "2"], "less than 1"),
        (["simulate", "two.sd", "--scene", "swing", "--rtol", "-1"], "--rtol -1"),
        (["simulate", "two.sd", "--scene", "swing", "--atol", "-1"], "--atol -1"),
        (["simulate", "two.sd", "--scene", "swing", "--set", "l"], "is not NAME=VALUE"),
        (["simulate", "two.sd", "--scene", "swing", "--max-steps", "0"], "--max-steps"),
        (["simulate", "two.sd", "--scene", "swing", "--until", "-1"], "the run ends at -1 s"),
        (["simulate", "two.sd", "--scene", "swing", "--at", "7"], "lies outside"),
        (["simulate", "two.sd", "--scene", "swing", "-o", "two.sd"], "is the model itself"),
        (["simulate", "two.sd", "--scene", "swing", "--until", "1e9"], "more than 2e+07 instants"),
        (["simulate", "two.sd", "--scene", "swing", "--max-wall", "0"], "--max-wall 0 s: it must be positive"),
        (["simulate", "two.sd", "--scene", "swing", "--method", "euler"], "euler(step = 1 ms)"),
        (["explain", "E20"], "there is no code 'E20'; near: E"),
        (["plot"], "Missing argument 'TRACE'"),
    ],
)
@pytest.mark.one_in(2)
def test_wrong_usage(tmp_path, capsys, arguments, said):
    write(tmp_path, TWO_SCENES, "two.sd")
    write(tmp_path, PENDULUM.partition("scene")[0], "bare.sd")
    write(tmp_path, "# nothing\n", "empty.sd")
    assert run(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert said in captured.err
    assert "--help" in captured.err
    assert (tmp_path / "two.sd").read_text() == TWO_SCENES


def test_several_models_without_scenes_are_listed(tmp_path, capsys):
    bare = PENDULUM.partition("scene")[0]
    path = write(tmp_path, bare + bare.replace("model pendulum", "model other"))
    assert run(["simulate", path, "--until", "1"]) == 2
    assert "--model pendulum | other" in capsys.readouterr().err
    assert run(["simulate", path, "--model", "other", "--until", "0.1", "-q"]) == 0
    assert (tmp_path / "model.h5").is_file()


@pytest.mark.long
def test_exit_codes(tmp_path, capsys):
    assert run(["simulate", write(tmp_path, PENDULUM)]) == 0
    assert run(["simulate", write(tmp_path, BROKEN)]) == 1
    assert run(["simulate", write(tmp_path, FAILING)]) == 1
    assert run(["simulate", write(tmp_path, STUCK), "--max-wall", "20"]) == 3
    assert "model.sd:3" in capsys.readouterr().err  # the dynamic that drives the unknown
    assert run(["simulate", "missing.sd"]) == 5
    assert "missing.sd: No such file or directory" in capsys.readouterr().err


def test_a_fault_is_told_from_the_users_mistakes(tmp_path, capsys, monkeypatch):
    from sysdyn.cli.run.request import targets

    def broken(*_):
        raise ZeroDivisionError("inside")

    monkeypatch.setattr(targets, "read", broken)
    assert run(["check", write(tmp_path, PENDULUM)]) == 4
    assert "a fault in sysdyn: ZeroDivisionError" in capsys.readouterr().err


def test_interruption(tmp_path, capsys, monkeypatch):
    from sysdyn.cli.run.request import targets

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(targets, "read", interrupted)
    assert run(["check", write(tmp_path, PENDULUM)]) == 130
    assert "interrupted" in capsys.readouterr().err


def test_strict_counts_warnings(tmp_path, capsys, monkeypatch):
    from sysdyn.cli.run.check import checking
    from sysdyn.dsl import load

    path = write(tmp_path, PENDULUM)
    network = load.network

    def warned(document, model, scene, report, *rest, **options):
        report.warning("W201", "a warning", None)
        return network(document, model, scene, report, *rest, **options)

    monkeypatch.setattr(checking.load, "network", warned)
    assert run(["check", path]) == 0
    assert run(["check", "--strict", path]) == 1
    assert "W201" in capsys.readouterr().err


@pytest.mark.long
def test_quiet_leaves_errors_only(tmp_path, capsys):
    path = write(tmp_path, PENDULUM)
    commands = ["check", "simulate", "verify", "trade", "linearize", "equilibrium", "reduce"]
    for arguments in (*([name, path] for name in commands), ["compile", path, "-o", "out"], ["plot", "model-swing.h5"]):
        assert run([*arguments, "--quiet"]) == 0
        assert capsys.readouterr() == ("", "")
    assert run(["check", "-q", write(tmp_path, BROKEN)]) == 1
    assert "E208" in capsys.readouterr().err


@pytest.mark.long
def test_messages_go_to_standard_error(tmp_path, capsys):
    path = write(tmp_path, PENDULUM)
    for arguments in (["check", path], ["simulate", path], ["compile", path]):
        assert run(arguments) == 0
        captured = capsys.readouterr()
        assert captured.out == ""
        assert captured.err


@pytest.mark.long
def test_colours(tmp_path, capsys, monkeypatch):
    path = write(tmp_path, BROKEN)

    def coloured(*arguments):
        assert run(["check", path, *arguments]) == 1
        return "\x1b[" in capsys.readouterr().err

    assert not coloured()  # not a terminal
    assert coloured("--color", "always")
    assert not coloured("--color", "never")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    assert coloured()
    assert not coloured("--color", "never")
    monkeypatch.setenv("NO_COLOR", "1")
    assert not coloured()
    assert coloured("--color", "always")


def test_standard_input(tmp_path, capsys, typed):
    typed(PENDULUM)
    assert run(["check", "-"]) == 0
    assert "swing of pendulum" in capsys.readouterr().err
    typed(PENDULUM)
    assert run(["simulate", "-", "-q"]) == 0
    assert (tmp_path / "model-swing.h5").is_file()
    typed(BROKEN)
    assert run(["check", "-"]) == 1
    assert "<stdin>:8:24" in capsys.readouterr().err
    typed(PENDULUM)
    assert run(["compile", "-", "-q", "-o", "out"]) == 0
    assert (tmp_path / "out" / "residual.c").is_file()


def test_fmt_from_standard_input_to_standard_output(capsys, typed):
    typed(PENDULUM.replace("  param m", "param   m"))
    assert run(["fmt", "-"]) == 0
    assert capsys.readouterr().out == PENDULUM


def test_every_problem_of_every_file_at_once(tmp_path, capsys):
    one = write(tmp_path, BROKEN, "one.sd")
    two = write(tmp_path, PENDULUM.replace("1.13 kg", "1.13kg").replace("init x'", "init z'"), "two.sd")
    assert run(["check", one, two]) == 1
    err = capsys.readouterr().err
    assert "E208" in err
    assert "E114" in err
    assert "E101" in err
    assert "one.sd:8:24" in err
    assert "two.sd:2:" in err


def test_explain(capsys):
    assert run(["explain", "e208"]) == 0
    out = capsys.readouterr().out
    assert "E208" in out
    assert len(out.splitlines()) > 5


def test_every_code_has_a_page(capsys):
    from sysdyn.dsl.text import codes

    for code in codes.codes():
        assert run(["explain", code]) == 0
    assert capsys.readouterr().err == ""
