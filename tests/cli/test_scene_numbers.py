"""Numbers of a scene that no run can be asked for are said by `check` and by `simulate` alike, at its words."""

import numpy as np
import pytest
from sysdyn.cli.main import run
from sysdyn.runtime.trace.trace import Trace
from texts import run_json, write

TEXT = """\
model spring {
  param k = 4 N/m
  coord x: translation = 1 m
  energy T* = 1/2*(1 kg)*x'^2
  energy V = 1/2*k*x^2
  init x' = 0 m/s
}
scene go of spring {
  time 0 s to 2 s
  trace x
}
"""
TIME, TRACE = "  time 0 s to 2 s\n", "  trace x\n"
WRONG = [
    (TRACE, "  trace x every 1e-300 s\n", "E912", "more than 2e+07 instants", "1e-300 s"),
    (TRACE, "  trace x every k*1e-300 s.m/N\n", "E912", "more than 2e+07 instants", "k*1e-300 s.m/N"),
    (TRACE, "  trace x every -k*1 s.m/N\n", "E912", "-4 s", "-k*1 s.m/N"),
    (TIME, "  time 0 s to -k*1 s.m/N\n", "E912", "from 0 s to -4 s", "time"),
    (TIME, "  time 0 s to 1 s/(k*1 m/N - 4)\n", "E912", "from 0 s to inf s", "time"),
    (TIME, "  time 0 s to 1e-295 s\n", "E912", "1e-75 s to 1e+75 s", "time"),
    (TIME, "  time 0 s to k*1e299 s.m/N\n", "E912", "1e-75 s to 1e+75 s", "time"),
    (TRACE, "  trace x\n  expect at 5*k*1 s.m/N: x <= 2 m\n", "E912", "at 20 s of a run from 0 s to 2 s", "expect at"),
    (TRACE, "  trace x\n  expect at -1 s: x <= 2 m\n", "E912", "at -1 s of a run from 0 s to 2 s", "expect at"),
    (TRACE, "  trace x\n  accuracy k*1 m/N\n", "E906", "accuracy 4", "accuracy"),
    (TRACE, "  trace x\n  limit steps 0\n", "E912", "limit steps 0", "limit"),
    (TRACE, "  trace x\n  limit events -1\n", "E912", "limit events -1", "limit"),
    (TRACE, "  trace x\n  limit steps inf\n", "E912", "limit steps inf", "limit"),
    (TRACE, "  trace x\n  solver euler\n", "E607", "needs a step", "solver"),
    (TRACE, "  trace x\n  solver euler(step = 0 s)\n", "E912", "step = 0 s", "solver"),
    (TRACE, "  trace x\n  solver bdf(step = 1 ms)\n", "E607", "bdf, which chooses its steps", "solver"),
    (TRACE, "  trace x\n  solver auto(step = 1 ms)\n", "E607", "auto, which chooses its steps", "solver"),
    (TRACE, "  trace x\n  solver euler(step = 1 ms, longest = 0.1 ms)\n", "E607", "longer than longest", "solver"),
    (TRACE, "  trace x\n  solver bdf(index = 3v)\n", "E607", "index = 3v", "3v"),
    (TRACE, "  trace x\n  solver bdf(order = 2v)\n", "E607", "order = 2v", "2v"),
    (TRACE, "  trace x\n  solver bdf(longest = -1 s)\n", "E912", "longest = -1 s", "solver"),
    (TRACE, "  trace x\n  solver bdf(index = 7)\n", "E607", "index = 7", "solver"),
    (TRACE, "  trace x\n  solver bdf(order = 6)\n", "E607", "order = 6", "solver"),
    (TRACE, "  trace x\n  solver radau(order = 7)\n", "E607", "order = 7", "solver"),
    (TRACE, "  trace x\n  solver dopri(order = 5)\n", "E607", "order = 5", "solver"),
]


@pytest.mark.parametrize("command", ["check", "simulate"])
@pytest.mark.parametrize(("old", "new", "code", "said", "at"), WRONG)
@pytest.mark.one_in(30)
def test_it_is_an_error_of_the_text(tmp_path, capsys, command, old, new, code, said, at):
    text = TEXT.replace(old, new)
    exit_code, found = run_json(capsys, command, write(tmp_path, text))
    assert exit_code == 1
    (error,) = [d for d in found["diagnostics"] if d["severity"] == "error"]
    assert error["code"] == code
    assert said in error["message"]
    assert error["help"]
    assert text.splitlines()[error["line"] - 1][error["column"] - 1 :].startswith(at)


@pytest.mark.parametrize(
    ("old", "new", "options"),
    [
        (TRACE, "  trace x every 1 us\n  time 0 s to 1000 s\n", ["--until", "1 ms"]),
        (TIME, "  time 0 s to -k*1 s.m/N\n", ["--until", "1 ms"]),
        (TIME, "  time 0 s to -k*1 s.m/N\n", ["--set", "k=-1"]),
        (TRACE, "  trace x\n  accuracy k*1 m/N\n", ["--accuracy", "1e-3"]),
        (TRACE, "  trace x\n  limit steps 2.5e3\n", []),
        (TRACE, "  trace x\n  solver euler\n", ["--method", "bdf"]),
        (TRACE, "  trace x\n  solver bdf(index = 7)\n", ["--index", "0"]),
        (TRACE, "  trace x\n  solver bdf(order = 6)\n", ["--method", "radau"]),
        (TRACE, "  trace x\n  solver bdf(step = 1 ms)\n", ["--method", "euler"]),
        (TRACE, "  trace x\n  solver euler(step = 1 ms)\n", ["--method", "radau"]),
    ],
)
@pytest.mark.long
def test_the_command_line_wins(tmp_path, old, new, options):
    text = TEXT.replace(old, new)
    text = text.replace(TIME, "") if text.count("  time ") > 1 else text
    assert run(["simulate", "-q", write(tmp_path, text), *options]) == 0


@pytest.mark.parametrize("until", ["5e-324", "1e-310", "1e-295", "1e-76", "1e76", "1e300"])
@pytest.mark.one_in(5)
def test_a_span_beyond_double_precision_is_refused_at_once(tmp_path, capsys, until):
    assert run(["simulate", write(tmp_path, TEXT), "--until", until]) == 2
    assert "1e-75 s to 1e+75 s" in capsys.readouterr().err


@pytest.mark.parametrize("method", ["auto", "bdf", "radau", "rosenbrock", "dopri", "energy"])
@pytest.mark.parametrize("until", ["1e-74", "1e-40"])
@pytest.mark.long
def test_the_shortest_spans_are_run(tmp_path, until, method):
    """x stays, and x' = -4 t: nothing overflows on the way (a warning is an error here)."""
    out = str(tmp_path / "t.h5")
    assert run(["simulate", "-q", write(tmp_path, TEXT), "--until", until, "--method", method, "-o", out]) == 0
    assert Trace.open(out)["x"].values[-1] == 1.0


@pytest.mark.parametrize("x", ["1e160", "1e300"])
def test_energies_beyond_double_precision_are_said_by_the_ledger(tmp_path, capsys, x):
    assert run(["simulate", write(tmp_path, TEXT.replace("= 1 m\n", f"= {x} m\n")), "-o", str(tmp_path / "t.h5")]) == 3
    assert "E921" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("solver", "order", "span"), [("bdf(order = 1)", 1, 2), ("bdf(order = 2)", 2, 2), ("radau(order = 5)", 5, 100)]
)
@pytest.mark.long
def test_the_order_asked_for_is_that_of_the_steps(tmp_path, solver, order, span):
    """Steps grow with the power 1/(order + 1) of the tolerance, where the longest step does not hold them."""
    text = TEXT.replace(TIME, f"  time 0 s to {span} s\n").replace(TRACE, f"  trace x\n  solver {solver}\n")
    file, steps = write(tmp_path, text), []
    for rtol in ("1e-4", "1e-7"):
        assert run(["simulate", "-q", file, "--rtol", rtol, "-o", str(tmp_path / "t.h5")]) == 0
        steps.append(Trace.open(tmp_path / "t.h5").statistics["steps"])
    assert np.log(1e3) / np.log(steps[1] / steps[0]) - 1.0 == pytest.approx(order, abs=0.5)


PENDULUM = """\
model pendulum {
  coord x: translation = 0.6 m
  coord y: translation ~ -0.8 m
  energy T* = 1/2*(1 kg)*(x'^2 + y'^2)
  phi rod: x^2 + y^2 = 1 m^2
  work -(1 kg)*g0 on y
  init x' = 0 m/s
}
scene go of pendulum {
  time 0 s to 1 s
  trace x
  solver bdf(index = 2v)
}
"""


def test_the_index_of_velocity_constraints_alone_is_that_of_the_command_line(tmp_path):
    """The same run, bit for bit, and another one than that of the stabilised form."""
    asked, plain = write(tmp_path, PENDULUM), tmp_path / "plain.sd"
    plain.write_text(PENDULUM.replace("(index = 2v)", ""))
    found = {}
    for name, file, more in [("text", asked, []), ("line", plain, ["--index", "2v"]), ("form 2", plain, [])]:
        out = str(tmp_path / f"{name}.h5")
        assert run(["simulate", "-q", str(file), *more, "--no-timings", "--rtol", "1e-5", "-o", out]) == 0
        found[name] = Trace.open(out)["x"]
    assert np.array_equal(found["text"], found["line"])
    assert not np.array_equal(found["text"], found["form 2"])
