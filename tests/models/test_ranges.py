"""A table with `stop`: the run ends where its argument leaves the data, and says so, in every formulation."""

import re

import h5py
import numpy as np
import pytest
from model_runs import FOUR
from sysdyn.cli.main import run

RAMP = """table Rv(x: A) -> V pchip stop [ (-3, -40), (0, 0), (0.05, 5), (3, 30) ]
table Ov(x: 1) -> 1 linear stop [ (0, 1), (40, 3) ]
model ramp {
  node a, b: electrical
  Vs: effort(e = 10 V*Ov(t/(1 s))*t/(1 s)) a
  R: dissipator(e = Rv(f)) a -> b
  R2: dissipator(e = 5 ohm*f) b
  C: potential(q = 2 uF*e) b
}
scene up of ramp { time 0 s to 5 s; trace R.f, R.e, C.e every 0.1 s; accuracy 1e-6 }
"""


def left():
    """The instant at which the source passes the 45 V that 3 A need (5 V of the capacitor's slope are 20 uA)."""
    t = np.roots([10.0 * 2.0 / 40.0, 10.0, -45.0])
    return float(t[t > 0][0])


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.one_in(2)
def test_the_run_ends_where_the_argument_leaves_the_data(tmp_path, capsys, formulation):
    path, out = tmp_path / "ramp.sd", tmp_path / "t.h5"
    path.write_text(RAMP, encoding="utf-8")
    assert run(["simulate", str(path), "--formulation", formulation, "-o", str(out)]) == 3
    said = capsys.readouterr().err
    assert "error E932" in said
    assert "table Rv left its range" in said
    assert "ramp.sd:6" in said  # the element that reads the table
    assert float(re.search(r"stopped at t = (\S+) s", said)[1]) == pytest.approx(left(), abs=2e-3)
    with h5py.File(out) as trace:
        assert trace.attrs["final"] == 0
        assert trace["time"].size == int(left() / 0.1) + 1
        t = trace["time"][()]
        source = 10.0 * t * (1.0 + t / 20.0)
        assert trace["R.e"][()] + trace["C.e"][()] == pytest.approx(source, abs=1e-3)
    assert run(["diff", "-q", str(out), str(out)]) == 1
    assert "did not end as asked" in capsys.readouterr().err


READ = """table give(x: m) -> V pchip stop [ (-1, 0), (0, 1), (1, 3) ]
table pull(x: m, s: 1) -> V linear stop [ (-9, 0, 1), (9, 0, 2), (-9, 1, 3), (9, 1, 5) ]
model m {
  node x: translation
  M: kinetic(p = 2 kg*f) x
  S: potential(e = 8 N/m*q) x
  init x.q = 0 m
  init M.f = 3 m/s
}
scene s of m {
  time 0 s to 4 s
  trace x.q
  SAID
}
"""


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.parametrize(
    ("said", "table", "end"),
    [
        ("trace give(x.q) as u every 10 ms", "give", np.arcsin(1.0 / 1.5) / 2.0),
        ("trace 2*give(x.q + 0.2 m)^2 as u", "give", np.arcsin(0.8 / 1.5) / 2.0),
        ("expect always: give(x.q) <= 9 V", "give", np.arcsin(1.0 / 1.5) / 2.0),
        ("trace pull(x.q, t/(3 s)) as u", "pull", 3.0),
    ],
)
@pytest.mark.long
def test_a_table_that_only_a_trace_reads_ends_the_run_there_too(tmp_path, capsys, formulation, said, table, end):
    """x = 1.5 m sin(2 t/s)."""
    path, out = tmp_path / "m.sd", tmp_path / "t.h5"
    path.write_text(READ.replace("SAID", said), encoding="utf-8")
    assert run(["simulate", str(path), "--formulation", formulation, "-o", str(out)]) == 3
    heard = capsys.readouterr().err
    assert "error E932" in heard
    assert f"table {table} left its range" in heard
    assert said.partition("(")[2] in heard
    assert "range" not in heard.partition("last good state")[2]
    with h5py.File(out) as trace:
        assert trace.attrs["final"] == 0
        assert float(re.search(r"stopped at t = (\S+) s", heard)[1]) == pytest.approx(end, abs=2e-3)
        assert trace["time"][-1] <= end + 2e-3
        assert all(np.isfinite(trace[name]).all() for name in trace if isinstance(trace[name], h5py.Dataset))


@pytest.mark.parametrize("command", ["equations", "linearize"])
@pytest.mark.one_in(2)
def test_what_watches_a_table_is_no_part_of_the_model(tmp_path, capsys, command):
    path = tmp_path / "m.sd"
    path.write_text(READ.replace("SAID", "trace give(x.q) as u"), encoding="utf-8")
    assert run([command, str(path)]) == 0
    with_table = capsys.readouterr().out
    path.write_text(READ.replace("SAID", ""), encoding="utf-8")
    assert run([command, str(path)]) == 0
    assert capsys.readouterr().out == with_table


def test_a_table_that_only_a_condition_reads_ends_the_run_there_too(tmp_path, capsys):
    """Beyond its data the condition held no number: it never became true, and nobody said so."""
    path, out = tmp_path / "m.sd", tmp_path / "t.h5"
    event = "discrete n = 0; when give(x.q) > 5 V { n := 1 }; init x.q"
    path.write_text(READ.replace("init x.q", event).replace("SAID", "trace n"), encoding="utf-8")
    assert run(["simulate", str(path), "-o", str(out)]) == 3
    said = capsys.readouterr().err
    assert "table give left its range" in said
    assert float(re.search(r"stopped at t = (\S+) s", said)[1]) == pytest.approx(np.arcsin(1.0 / 1.5) / 2.0, abs=2e-3)
    with h5py.File(out) as trace:
        assert trace.attrs["final"] == 0


def test_what_watches_a_range_is_no_part_of_the_order(tmp_path, capsys):
    (tmp_path / "m.sd").write_text("""table k(x: m) -> N linear stop [ (0, 0), (1, 5) ]
model m {
  coord x: translation = 0 m
  energy T* = 1/2*1 kg*x'^2
  energy V = 1/2*1 N/m*x^2
  init x' = 0.5 m/s
  expect static: order == 2
}
scene s of m { time 0 s to 0.3 s; trace x, k(x) every 0.1 s }
""")
    assert run(["check", str(tmp_path / "m.sd")]) == 0, capsys.readouterr().err


def test_what_a_trace_measures_and_the_formulation_are_no_part_of_the_order(tmp_path, capsys):
    (tmp_path / "m.sd").write_text("""model m {
  node a, b: electrical
  node x: translation
  V: effort(e = 1 V) a -> ground
  L: kinetic(p = 1 mH*f) a -> b
  G: gyrator(e1 = 1 N/A*f2) b -> ground, x -> ground
  M: kinetic(p = 1 kg*f) x
  S: potential(e = 1 N/m*q + 1 N/m^3*q^3) x
  D: dissipator(e = 1 N.s/m*f) x
  init L.f = 0 A; init M.f = 0 m/s; init S.q = 0 m
  expect static: order == 3
}
scene s of m { time 0 s to 1 s; trace S.energy, D.energy, L.energy, V.p }
scene c of m { time 0 s to 1 s; trace S.energy, x.q; formulation co_hamiltonian }
""")
    assert run(["check", str(tmp_path / "m.sd")]) == 0, capsys.readouterr().err


@pytest.mark.parametrize("ohm", ["0.1 mohm", "1e-12 ohm", "1 Gohm"])
@pytest.mark.one_in(2)
def test_the_order_of_a_stiff_model(ohm, tmp_path, capsys):
    (tmp_path / "m.sd").write_text(f"""model m {{
  node a, b: electrical
  V: effort(e = 5 V*sin(100 Hz*t)) a -> ground
  R: dissipator(e = {ohm}*f) a -> b
  C: potential(q = 100 uF*e) b -> ground
  W: dissipator(e = 1 ohm*f) b -> ground
  init C.e = 0 V
  expect static: order == 1
}}
scene s of m {{ time 0 s to 1 s; trace b.e }}
""")
    assert run(["check", str(tmp_path / "m.sd")]) == 0, capsys.readouterr().err
