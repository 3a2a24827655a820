"""What constant sums define leaves the system: results are those of the equations, every unknown is there again."""

import ctypes
import json

import numpy as np
import pytest
from model_runs import FOUR, trace_of
from scipy.interpolate import CubicSpline
from scipy.linalg import expm
from sysdyn.api import load, simulate
from sysdyn.cli.main import run
from sysdyn.runtime.condense import condenser as condensing
from sysdyn.runtime.integrate import integrate
from sysdyn.runtime.integrate.rows import settlers
from sysdyn.runtime.model import core_library as lib

N = 30
LINE = """
from std.electrical import resistor, inductor, capacitor, voltage
model line {
  param n = %d
  node v[0..n]: electrical
%s  source: voltage(v = 1 V*sin(5 rad/s*t)) v[0] -> ground
  for i in 1..n {
    %s
    C[i]: capacitor(C = (1 F + 0.5 F*i/n)/n) v[i] -> ground
    init C[i].e = 0 V
  }
}
scene go of line {
  time 0 s to 1 s
  accuracy 1e-7
  trace v[n].e as end, v[n/2].e as middle, %s as current, audit.energy, audit.constraints
}
"""
LADDER = LINE % (N, "", "R[i]: resistor(R = (1 ohm + 1 ohm*i/n)/n) v[i - 1] -> v[i]", "R[n/2].f")
WAVES = LINE % (
    N,
    "  node w[1..n]: electrical\n",
    "L[i]: inductor(L = 1 H / n) v[i - 1] -> w[i]\n"
    "    R[i]: resistor(R = 0.1 ohm / n) w[i] -> v[i]\n"
    "    init L[i].f = 0 A",
    "L[n/2].f",
)


def _capacitors():
    return (1.0 + 0.5 * np.arange(1, N + 1) / N) / N


def _driven(matrix, drive):
    """x(1) of x' = A x + b sin 5t from rest, by the exponential of the system with its source."""
    n = len(matrix)
    whole = np.zeros((n + 2, n + 2))
    whole[:n, :n], whole[:n, n] = matrix, drive
    whole[n, n + 1], whole[n + 1, n] = 5.0, -5.0
    return expm(whole) @ np.eye(n + 2)[n + 1]


def ladder():
    """Voltages of the ladder at 1 s, and the current through its middle resistor."""
    c, r = _capacitors(), (1.0 + np.arange(1, N + 1) / N) / N
    flow = np.diag(1.0 / r) @ (np.eye(N, k=-1) - np.eye(N))
    balance = np.eye(N) - np.eye(N, k=1)
    found = _driven(np.diag(1.0 / c) @ balance @ flow, np.diag(1.0 / c) @ balance[:, 0] / r[0])
    current = (found[N // 2 - 2] - found[N // 2 - 1]) / r[N // 2 - 1]
    return found[N - 1], found[N // 2 - 1], current


def waves():
    """The same of the line of inductors."""
    c = _capacitors()
    matrix = np.zeros((2 * N, 2 * N))
    matrix[:N, :N] = -0.1 * np.eye(N)
    matrix[:N, N:] = N * (np.eye(N, k=-1) - np.eye(N))
    matrix[N:, :N] = np.diag(1.0 / c) @ (np.eye(N) - np.eye(N, k=1))
    found = _driven(matrix, N * np.eye(2 * N)[0])
    return found[2 * N - 1], found[N + N // 2 - 1], found[N // 2 - 1]


@pytest.mark.parametrize("method", ["bdf", "radau"])
@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.parametrize(("text", "exact"), [(LADDER, ladder), (WAVES, waves)], ids=["ladder", "waves"])
@pytest.mark.long
def test_a_line_meets_its_exponential(tmp_path, text, exact, formulation, method):
    trace = trace_of(tmp_path, text, formulation=formulation, method=method)
    for name, value in zip(("end", "middle", "current"), exact(), strict=True):
        assert trace[name].values[-1] == pytest.approx(value, abs=3e-7 * trace[name].nominal), name
    assert np.abs(trace["audit.constraints"].values).max() < 1e-12


@pytest.mark.parametrize(("text", "left"), [(LADDER, 1.2), (WAVES, 2.2)], ids=["ladder", "waves"])
@pytest.mark.parametrize("formulation", FOUR[:2])
@pytest.mark.long
def test_what_is_left_of_a_node(tmp_path, monkeypatch, text, left, formulation):
    """One unknown a node of a ladder, two of a line of inductors; rows and matrix are those of all unknowns."""
    met = []

    def watched(system, t, y, yd):
        found = condensing.condense_model(system, t, y, yd)
        met.append((found, t, y.copy(), yd.copy()))
        return found

    monkeypatch.setattr(integrate, "condense_model", watched)
    trace_of(tmp_path, text, formulation=formulation, method="radau")
    forms, t, y, yd = met[-1]
    assert forms.stepped.unknowns < left * N
    _same_rows(forms.stepped, t, y.size, yd.size)


LUMPED = """
from std.electrical import resistor, inductor, capacitor, voltage
model lumped {
  node v, %s: electrical
  source: voltage(v = 1 V*sin(5 rad/s*t)) v -> ground
%s}
scene go of lumped {
  time 0 s to 1 s
  trace a1.e, a5.e
}
"""
CELL = """
  R{k}: resistor(R = {k} ohm) {before} -> a{k}
  S{k}: resistor(R = 2 ohm + {k} ohm) a{k} -> b{k}
  L{k}: inductor(L = {k} H) a{k} -> c{k}
  U{k}: resistor(R = 3 ohm*{k}) c{k} -> b{k}
  C{k}: capacitor(C = 1 F/{k}) b{k} -> ground
  bend{k}: dissipator(e = 1 V*(f/(1 A))^3) a{k} -> ground
"""


@pytest.mark.long
def test_the_matrix_of_a_circuit_is_the_slope_of_its_rows(tmp_path, monkeypatch):
    """At a random point."""
    met = []

    def watched(system, t, y, yd):
        met.append((condensing.condense_model(system, t, y, yd), t))
        return met[-1][0]

    monkeypatch.setattr(integrate, "condense_model", watched)
    nodes = ", ".join(f"{letter}{k}" for k in range(1, 6) for letter in "abc")
    cells = "".join(CELL.format(k=k, before=f"b{k - 1}" if k > 1 else "v") for k in range(1, 6))
    trace_of(tmp_path, LUMPED % (nodes, cells), formulation="lagrangian", method="bdf")
    (forms, t), random = met[-1], np.random.default_rng(0)
    left = forms.stepped
    forms.bind()
    z, zd, moved = random.normal(size=(3, left.unknowns))

    def rows(z):
        r = np.zeros(left.rows + 8)
        arrays = (np.append(z, np.zeros(8)), np.append(zd, np.zeros(8)), r)
        lib.core.sd_residual(ctypes.byref(left.core), t, *map(lib.pointer, arrays))
        return r[: left.rows]

    slopes, rates = np.zeros((2, left.pattern.entries + 1))
    point = [np.append(item, np.zeros(8)) for item in (z, zd)]
    arrays = *map(lib.pointer, point), None, lib.pointer(slopes), lib.pointer(rates)
    lib.core.sd_jacobian(ctypes.byref(left.core), t, *arrays)
    along = np.bincount(left.pattern.row, slopes[:-1] * moved[left.pattern.columns_of()], left.rows)
    change = (rows(z + 1e-4 * moved) - rows(z - 1e-4 * moved)) / 2e-4
    np.testing.assert_allclose(along, change, rtol=0.0, atol=1e-6 * np.abs(change).max())


def _same_rows(left, t, n, _):
    """Residual and matrix at any point of the kept unknowns against those of the whole system there."""
    random = np.random.default_rng(0)
    z, zd = random.normal(size=left.unknowns), random.normal(size=left.unknowns)
    whole, found = left.whole, left.sums
    y, yd = np.zeros(n), np.zeros(n)
    y[left.kept], yd[left.kept] = z, zd
    for k, place in enumerate(found.place):  # in order: each reads those before it
        terms = slice(found.start[k], found.start[k + 1])
        y[place] = found.constant[k] + found.factor[terms] @ y[found.source[terms]]
    r = whole.residual(t, y, yd)
    defining = np.setdiff1d(np.arange(whole.rows), left.kept_rows)
    gone = whole.form.k_row[np.isin(whole.form.k_q, found.unread)]
    scale = np.abs(r).max()
    assert np.abs(r[np.setdiff1d(defining, gone)]).max() < 1e-13 * scale
    dense = np.zeros((left.rows, left.unknowns))
    slopes, rates = np.zeros((2, left.pattern.entries + 1))
    points = (lib.pointer(np.append(item, np.zeros(8))) for item in (z, zd))
    lib.core.sd_jacobian(ctypes.byref(left.core), t, *points, None, lib.pointer(slopes), lib.pointer(rates))
    dense[left.pattern.row, left.pattern.columns_of()] = slopes[:-1]
    moved = random.normal(size=left.unknowns)
    y2 = y.copy()
    y2[left.kept] += moved
    for k, place in enumerate(found.place):
        terms = slice(found.start[k], found.start[k + 1])
        y2[place] = found.constant[k] + found.factor[terms] @ y2[found.source[terms]]
    change = (whole.residual(t, y2, yd) - r)[left.kept_rows]  # the models are linear
    assert dense @ moved == pytest.approx(change, abs=1e-12 * np.abs(change).max())


def test_a_charge_that_is_traced_is_integrated(tmp_path):
    """The charge through a resistor: the integral of its current."""
    text = LADDER.replace("audit.energy, audit.constraints", "R[n/2].q as charge every 2 ms")
    trace = trace_of(tmp_path, text, method="radau")
    t, at = np.unique(np.asarray(trace.time), return_index=True)
    current, charge = (trace[name].values[at] for name in ("current", "charge"))
    assert charge[-1] - charge[0] == pytest.approx(CubicSpline(t, current).integrate(t[0], t[-1]), rel=1e-4)


def test_explain_says_what_left(tmp_path, capsys):
    path = tmp_path / "ladder.sd"
    path.write_text(LADDER)
    assert run(["compile", str(path), "--scene", "go", "--explain", "-o", str(tmp_path)]) == 0
    said = capsys.readouterr()
    text = said.out + said.err
    assert f"v.multiplier ({N - 1} of {N - 1})  leaves runs: a constant sum of others" in " ".join(text.split(" "))
    assert "leaves runs: nothing reads it" in text


GRID = """
from std.electrical import resistor, capacitor, voltage
model grid {
  param n = 15
  node v[1..n, 1..n]: electrical
  node feed: electrical
  source: voltage(v = 1 V*sin(5 rad/s*t)) feed -> ground
  Rin: resistor(R = 0.1 ohm) feed -> v[1, 1]
  for i in 1..n { for j in 1..n {
    C[i, j]: capacitor(C = 1 F / n / n) v[i, j] -> ground
    init C[i, j].e = 0 V
  } }
  for i in 2..n { for j in 1..n { Rx[i, j]: resistor(R = 1 ohm) v[i - 1, j] -> v[i, j] } }
  for i in 1..n { for j in 2..n { Ry[i, j]: resistor(R = 1 ohm) v[i, j - 1] -> v[i, j] } }
}
scene go of grid {
  time 0 s to 1 s
  accuracy 1e-7
  trace v[n, n].e as far, v[1, 1].e as near
}
"""


def _grid(n):
    """Voltages of the grid at 1 s."""
    chain = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    chain[0, 0] = chain[-1, -1] = 1.0
    matrix = -(np.kron(chain, np.eye(n)) + np.kron(np.eye(n), chain))
    matrix[0, 0] -= 10.0
    return _driven(n * n * matrix, 10.0 * n * n * np.eye(n * n)[0])


@pytest.mark.parametrize("method", ["bdf", "radau"])
@pytest.mark.one_in(2)
def test_a_grid_meets_its_exponential(tmp_path, method):
    """One unknown a node; rows pivot with the unknowns they belong to."""
    n = 15
    exact = _grid(n)
    trace = trace_of(tmp_path, GRID, method=method)
    assert trace["far"].values[-1] == pytest.approx(exact[n * n - 1], abs=3e-7 * trace["far"].nominal)
    assert trace["near"].values[-1] == pytest.approx(exact[0], abs=3e-7)


@pytest.mark.parametrize("small", [1e-9, 0.0])
def test_a_resistor_of_a_row_may_vanish(tmp_path, small):
    """Its law defines no current then: it stays, the others leave; runs of one loaded text follow each other."""
    text = LADDER.replace("param n", "param r[1..n] = 1 ohm\n  param n").replace("(1 ohm + 1 ohm*i/n)/n", "r[i] / n")
    text = text.replace("(1 F + 0.5 F*i/n)/n", "1 F / n").replace("R[n/2].f as current, ", "")
    text = text.replace("resistor(R = r[i] / n)", "dissipator(e = r[i] / n*f)")  # the library's asks for R > 0
    assert "dissipator" in text
    path = tmp_path / "ladder.sd"
    path.write_text(text)
    model = load(str(path), scene="go")
    ends = [float(model.run(set={"r[7]": f"{r!r} ohm"})["end"].values[-1]) for r in (1.0, small, 1e-6, 1.0)]
    assert ends[0] == ends[3]
    assert ends[1] == pytest.approx(ends[2], abs=1e-6)
    assert abs(ends[1] - ends[0]) > 1e-4


KINKED, JUMPING = "1 V*min(t/(0.3 s), 1)", "1 V*step(t - 0.3 s)"


def _after_ramp(matrix, drive):
    """x(1) of x' = A x + b min(t / 0.3, 1) from rest."""
    n = len(matrix)
    whole = np.zeros((n + 2, n + 2))
    whole[:n, :n], whole[:n, n], whole[n, n + 1] = matrix, drive, 1.0 / 0.3
    at = expm(0.3 * whole) @ np.eye(n + 2)[n + 1]
    whole[n, n + 1] = 0.0
    return expm(0.7 * whole) @ at


def _after_jump(matrix, drive):
    """x(1) of x' = A x + b (t > 0.3) from rest."""
    n = len(matrix)
    whole = np.zeros((n + 1, n + 1))
    whole[:n, :n], whole[:n, n] = matrix, drive
    return expm(0.7 * whole) @ np.eye(n + 1)[n]


@pytest.mark.parametrize("method", ["bdf", "radau"])
@pytest.mark.parametrize(("source", "exact"), [(KINKED, _after_ramp), (JUMPING, _after_jump)], ids=["kink", "jump"])
@pytest.mark.long
def test_pieces_between_kinks_and_jumps_are_condensed(tmp_path, monkeypatch, source, exact, method):
    """One unknown a node on both sides of it; no structure of all unknowns is made where no state jumps."""
    seen, whole = [], []
    made, settled = integrate.Integration._condense, settlers.Settlers.settler_of

    def watched(self):
        found = made(self)
        seen.append((len(self.segments), found.stepped.unknowns))
        return found

    def counted(self, *rows, **asked):
        whole.append(asked.get("whole"))
        return settled(self, *rows, **asked)

    monkeypatch.setattr(integrate.Integration, "_condense", watched)
    monkeypatch.setattr(settlers.Settlers, "settler_of", counted)
    trace = trace_of(tmp_path, LADDER.replace("1 V*sin(5 rad/s*t)", source), method=method)
    c, r = _capacitors(), (1.0 + np.arange(1, N + 1) / N) / N
    flow = np.diag(1.0 / r) @ (np.eye(N, k=-1) - np.eye(N))
    balance = np.diag(1.0 / c) @ (np.eye(N) - np.eye(N, k=1))
    found = exact(balance @ flow, balance[:, 0] / r[0])
    for name, value in (("end", found[N - 1]), ("middle", found[N // 2 - 1])):
        assert trace[name].values[-1] == pytest.approx(value, abs=3e-7 * trace[name].nominal), name
    assert all(pieces == 2 and unknowns < 1.2 * N for pieces, unknowns in seen)
    assert not any(whole)
    assert np.abs(trace["audit.constraints"].values).max() < 1e-12


JUMPING = """from std.electrical import capacitor, resistor, voltage
model ladder {
  node a, b, c, d: electrical
  V: voltage(v = if t < 1 ms then 1 V*t/(1 ms) else 5 V) a -> ground
  C1: capacitor(C = 1 uF) a -> b
  C2: capacitor(C = 2 uF) b -> ground
  R1: resistor(R = 1 kohm) a -> b
  R2: resistor(R = 2 kohm) b -> ground
  R3: resistor(R = 500 ohm) b -> c
  C3: capacitor(C = 1 uF) c -> ground
  R4: resistor(R = 700 ohm) c -> d
  C4: capacitor(C = 3 uF) d -> ground
  init C1.e = 0 V; init C2.e = 0 V; init C3.e = 0 V; init C4.e = 0 V
}
scene s of ladder {
  time 0 s to 2 ms
  trace b.e, c.e, d.e every 0.25 ms
  accuracy 1e-8
}
"""


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.long
def test_charge_jumps_where_resistors_have_passed_charge_that_nothing_reads(tmp_path, formulation):
    (tmp_path / "ladder.sd").write_text(JUMPING)
    trace = simulate(tmp_path / "ladder.sd", formulation=formulation, output=tmp_path / "out.h5")
    store = np.diag([3e-6, 1e-6, 3e-6])
    leak = np.array([[1e-3 + 5e-4 + 2e-3, -2e-3, 0], [-2e-3, 2e-3 + 1 / 700, -1 / 700], [0, -1 / 700, 1 / 700]])
    grow = np.zeros((5, 5))  # of b, c, d, the source and its rate
    grow[:3, :3], grow[:3, 3], grow[0, 4], grow[3, 4] = np.linalg.solve(store, -leak), [1e-3 / 3e-6, 0, 0], 1 / 3, 1
    before = expm(1e-3 * grow) @ [0, 0, 0, 0, 1e3]
    after = expm(0.75e-3 * grow) @ (before * [1, 1, 1, 0, 0] + [4.0 / 3.0, 0, 0, 5, 0])
    for k, name in enumerate(["b.e", "c.e", "d.e"]):
        assert trace[name].values[4] == pytest.approx(before[k], abs=1e-8)  # the instant of the jump stands twice
        assert trace[name].values[5] - before[k] == pytest.approx(4.0 / 3.0 if k == 0 else 0.0, abs=1e-8)
        assert trace[name].values[8] == pytest.approx(after[k], abs=2e-8)


APART = """\
model apart {
  node v, a, b, c: electrical
  src: effort(e = 10 V*sin(2*pi*0.01 Hz*t)) v -> ground
  R1: dissipator(e = 1 kohm*f) v -> a
  C1: potential(e = q/(1 pF)) a -> ground
  R2: dissipator(e = 1 Gohm*f) a -> b
  C2: potential(e = q/(1 kF)) b -> ground
  R3: dissipator(e = 0.1 ohm*f) b -> c
  C3: potential(e = q/(1 uF)) c -> ground
  init C1.e = 0 V
  init C2.e = 1 V
  init C3.e = 5 V
}
scene s of apart {
  time 0 s to 200 s
  trace b.e, R2.f, R3.f every 1 s
}
"""


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.parametrize("method", ["bdf", "radau"])
@pytest.mark.long
def test_no_unknown_leaves_as_the_small_difference_of_large_ones(tmp_path, method, formulation):
    """1 nA through 1 Gohm was the sum of -40 A and 40 A: the node was 3.5 uV off at the start, alike in all runs."""
    (tmp_path / "apart.sd").write_text(APART)
    asked = {"method": method, "formulation": formulation, "accuracy": 1e-3, "output": tmp_path / "out.h5"}
    trace = simulate(tmp_path / "apart.sd", **asked)
    first = {name: float(trace[name].values[0]) for name in trace.names}
    assert first == pytest.approx({"b.e": 1.0, "R2.f": -1e-9, "R3.f": -40.0}, rel=1e-9, abs=0.0)


@pytest.mark.parametrize(("rtol", "error"), [(1e-4, 1e-3), (1e-6, 3e-5)])
def test_factors_of_a_net_serve_at_other_steps(tmp_path, rtol, error):
    """They cost ten solutions: made anew for each length of a step (13 and 20 times) they took half of a run."""
    n = 24
    exact = _grid(n)
    text = GRID.replace("param n = 15", f"param n = {n}").replace("  accuracy 1e-7\n", "")
    trace = trace_of(tmp_path, text, method="bdf", rtol=rtol)
    statistics = json.loads(trace.attributes["statistics"])
    assert trace["far"].values[-1] == pytest.approx(exact[n * n - 1], abs=error * trace["far"].nominal)
    assert trace["near"].values[-1] == pytest.approx(exact[0], abs=error)
    assert statistics["factorisations"] < statistics["steps"] / 7
