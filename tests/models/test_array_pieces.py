"""Families of components that several statements declare: each index means one of them, whatever the sizes are."""

import math

import pytest
from model_runs import FOUR
from sysdyn.api import ModelError, check, load, simulate

CHAIN = """
component seg {
  param R: ohm
  port a, b: electrical
  r: dissipator(e = R*f) a -> b
}
component chain {
  param n = 4
  port a, b: electrical
  node v[1..n-1]: electrical
  s[1]: seg(R = 1 ohm) a = a, b = v[1]
  for i in 2..n-1 { s[i]: seg(R = i*1 ohm) a = v[i-1], b = v[i] }
  s[n]: seg(R = 10 ohm) a = v[n-1], b = b
  output before = s[n-1].r.e
  output second = s[2].r.e
  output whole = sum(i in 1..n: s[i].r.e)
}
model m {
  node x: electrical
  V: effort(e = 1 V) x -> ground
  A: chain() a = x, b = ground
  B: chain(n = 2) a = x, b = ground
}
scene s of m {
  time 0 s to 1 s
  trace A.before, A.second, A.whole, A.s[2].r.e as own, A.s[1..A.n].r.e as each, B.before, B.second, B.whole
}
"""


def drops(n):
    """Of the resistors of a chain under 1 V."""
    resistances = [*range(1, n), 10]
    return [r / sum(resistances) for r in resistances]


@pytest.mark.parametrize("n", [2, 3, 4, 6])
@pytest.mark.one_in(2)
def test_an_index_means_its_own_statement(tmp_path, n):
    (tmp_path / "m.sd").write_text(CHAIN)
    trace = load(tmp_path / "m.sd").run(set={"A.n": n})
    wanted, two = drops(n), drops(2)
    found = {name: trace[name].values[-1] for name in trace}
    assert found.pop("A.whole") == pytest.approx(1.0, rel=1e-12)
    assert found.pop("B.whole") == pytest.approx(1.0, rel=1e-12)
    assert found.pop("A.before") == pytest.approx(wanted[n - 2], rel=1e-12)
    assert (found.pop("A.second"), found.pop("own")) == (pytest.approx(wanted[1], rel=1e-12),) * 2
    assert (found.pop("B.before"), found.pop("B.second")) == pytest.approx((two[0], two[1]), rel=1e-12)
    assert [found.pop(f"each[{k}]") for k in range(1, n + 1)] == pytest.approx(wanted, rel=1e-12)
    assert not found


def test_a_number_means_the_last_one_where_it_is_that(tmp_path):
    (tmp_path / "m.sd").write_text(CHAIN.replace("trace A.before", "set A.s[4].R = 20 ohm; trace A.s[4].r.e, A.before"))
    trace = load(tmp_path / "m.sd").run()
    assert trace["A.s[4].r.e"].values[-1] == pytest.approx(20.0 / 26.0, rel=1e-12)
    (tmp_path / "m.sd").write_text(CHAIN.replace("trace A.before", "trace A.s[5].r.e, A.before"))
    with pytest.raises(ModelError, match=r"E805: 's' has no element \[5\]"):
        load(tmp_path / "m.sd")


def test_an_empty_range_is_checked():
    assert check(CHAIN.replace("param n = 4", "param n = 2")) == []


@pytest.mark.parametrize(("whole", "label"), [("A: chain(n = 1)", "A.s[1]"), ("A: chain()", "")])
def test_an_element_that_two_statements_make_is_named(whole, label):
    text = CHAIN.replace("A: chain()", whole).replace("node v[1..n-1]", "node v[0..n]")
    twice = [d.message for d in check(text) if d.code == "E106"]
    assert twice == [f"'{label}' is declared twice"] * bool(label)


LAGS = """
component lag {
  input u: V
  state z: V = 0 V
  dynamic z' = (u - z)/(1 s)
  output y = z
}
model m {
  param n = 4
  s[1]: lag(u = 1 V)
  for i in 2..n-1 { s[i]: lag(u = s[i-1].y) }
  s[n]: lag(u = s[n-1].y)
}
scene s of m {
  time 0 s to 2 s
  accuracy 1e-8
  trace s[1..n].z as z
}
"""


@pytest.mark.parametrize("n", [2, 3, 5])
@pytest.mark.one_in(5)
def test_what_an_input_reads_is_read_anew_in_each_part_of_a_loop(tmp_path, n):
    """A cascade of first-order lags behind a step: 1 - exp(-t) sum of t^j/j! below k (Erlang)."""
    (tmp_path / "m.sd").write_text(LAGS)
    trace = load(tmp_path / "m.sd").run(set={"n": n})
    for k in range(1, n + 1):
        erlang = 1.0 - math.exp(-2.0) * sum(2.0**j / math.factorial(j) for j in range(k))
        assert trace[f"z[{k}]"].values[-1] == pytest.approx(erlang, rel=1e-6)


FILTER = """
component cell {
  port a, b: electrical
  r: dissipator(e = 1 ohm*f) a -> b
  c: potential(q = 1 mF*e) b -> ground
}
model m {
  param n = 4
  node v[0..n]: electrical
  V: effort(e = 10 V) v[0] -> ground
  s[1]: cell() a = v[0], b = v[1]
  for i in 2..n { s[i]: cell() a = v[i-1], b = v[i] }
  for i in 1..n { init s[i].c.e = 1 V*i }
}
scene s of m {
  time 0 s to 1 ms
  trace s[1..n].c.e as e
}
"""


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.parametrize("n", [1, 4])
@pytest.mark.long
def test_a_start_that_a_loop_says_of_several_statements(tmp_path, formulation, n):
    (tmp_path / "m.sd").write_text(FILTER)
    trace = load(tmp_path / "m.sd", formulation=formulation).run(set={"n": n})
    assert [trace[f"e[{k}]"].values[0] for k in range(1, n + 1)] == pytest.approx(list(range(1, n + 1)), rel=1e-12)


FORWARD = LAGS.replace("output y = z", "output y = z\n  output w = u + z").replace(
    "accuracy 1e-8\n  trace s[1..n].z as z",
    """accuracy 1e-8
  trace whole, most, s[1..n].z as z, s[1..n].w as w, before, pulled""",
)
FORWARD = FORWARD.replace(
    "  s[n]: lag(u = s[n-1].y)\n",
    """  s[n]: lag(u = s[n-1].y)
  let whole = sum(i in 2..n: s[i].w*s[i-1].y)
  let most = max(i in 1..n: s[i].u - s[i].w)
  let before = s[n-1].w
  coord x[1..n]: translation = 0 m
  for i in 1..n-1 { work s[i+1].w*1 N/V on x[i] }
  energy T* = sum(i in 1..n: 1/2*1 kg*x[i]'^2)
  let pulled = sum(i in 1..n: i*x[i]'')
""",
)


@pytest.mark.parametrize("n", [3, 4, 6])
def test_a_loop_over_what_reads_several_statements_itself_is_cut(tmp_path, n):
    (tmp_path / "m.sd").write_text(FORWARD)
    trace = load(tmp_path / "m.sd").run(set={"n": n})
    z, w = ([trace[f"{name}[{k}]"].values[-1] for k in range(1, n + 1)] for name in "zw")
    assert w == pytest.approx([1.0 + z[0], *(z[k] + z[k - 1] for k in range(1, n))], rel=1e-9)
    assert trace["whole"].values[-1] == pytest.approx(sum(w[k] * z[k - 1] for k in range(1, n)), rel=1e-9)
    assert trace["most"].values[-1] == pytest.approx(-min(z), rel=1e-9)
    assert trace["before"].values[-1] == pytest.approx(w[n - 2], rel=1e-9)
    assert trace["pulled"].values[-1] == pytest.approx(sum(k * w[k] for k in range(1, n)), rel=1e-9)


CELLS = """
component cell {
  input left: K
  input right: K
  node c: heat = 300 K
  C: potential(q = 1 J/K*e) c -> ground
  m: flow(f = 1 W/K*(left + right - 2*c.e)) ground -> c
  output T = c.e
}
model m {
  param n = 4
  s[1]: cell() left = 300 K, right = s[2].T
  for i in 2..n-1 { s[i]: cell() left = s[i-1].T, right = s[i+1].T }
  s[n]: cell() left = s[n-1].T, right = 400 K
}
scene s of m {
  time 0 s to 200 s
  accuracy 1e-6
  trace s[1..n].T as T
}
"""


@pytest.mark.parametrize("formulation", ["lagrangian", "co_hamiltonian"])
@pytest.mark.long
def test_laws_that_read_both_neighbours_stand_in_parts(tmp_path, formulation):
    """At rest each cell is the mean of its neighbours."""
    (tmp_path / "m.sd").write_text(CELLS)
    model = load(tmp_path / "m.sd", formulation=formulation)
    for n in (2, 3, 5):
        trace = model.run(set={"n": n})
        found = [trace[f"T[{k}]"].values[-1] for k in range(1, n + 1)]
        assert found == pytest.approx([300.0 + 100.0 * k / (n + 1) for k in range(1, n + 1)], abs=1e-3)


PLATE = """
component cell {
  input near: K
  node c: heat = 300 K
  C: potential(q = 1 J/K*e) c -> ground
  m: flow(f = 1 W/K*(near - 4*c.e)) ground -> c
  output T = c.e
}
model m {
  param n = 4
  param k = 3
  for i in 2..n-1 { for j in 2..k-1 { s[i, j]: cell() near = s[i-1, j].T + s[i+1, j].T + s[i, j-1].T + s[i, j+1].T } }
  for j in 2..k-1 {
    s[1, j]: cell() near = 300 K + 20 K*j + s[2, j].T + s[1, j-1].T + s[1, j+1].T
    s[n, j]: cell() near = s[n-1, j].T + 310 K + 10 K*n + 20 K*j + s[n, j-1].T + s[n, j+1].T
  }
  for i in 2..n-1 {
    s[i, 1]: cell() near = s[i-1, 1].T + s[i+1, 1].T + 300 K + 10 K*i + s[i, 2].T
    s[i, k]: cell() near = s[i-1, k].T + s[i+1, k].T + s[i, k-1].T + 320 K + 10 K*i + 20 K*k
  }
  s[1, 1]: cell() near = 320 K + s[2, 1].T + 310 K + s[1, 2].T
  s[1, k]: cell() near = 300 K + 20 K*k + s[2, k].T + s[1, k-1].T + 330 K + 20 K*k
  s[n, 1]: cell() near = s[n-1, 1].T + 330 K + 10 K*n + 300 K + 10 K*n + s[n, 2].T
  s[n, k]: cell() near = s[n-1, k].T + 310 K + 10 K*n + 20 K*k + s[n, k-1].T + 320 K + 10 K*n + 20 K*k
  let whole = sum(i in 1..n: sum(j in 1..k: s[i, j].T))
}
scene warm of m {
  time 0 s to 100 s
  accuracy 1e-6
  trace s[1..n, 1..k].T as T, whole
}
"""


@pytest.mark.parametrize(("n", "k"), [(5, 4), (2, 4), (2, 2), (3, 3)])
@pytest.mark.one_in(2)
def test_a_grid_with_edges_and_corners_of_their_own(tmp_path, n, k):
    """What rises evenly along both indices is the mean of its neighbours everywhere."""
    (tmp_path / "m.sd").write_text(PLATE)
    trace = load(tmp_path / "m.sd").run(set={"n": n, "k": k})
    wanted = {(i, j): 300.0 + 10.0 * i + 20.0 * j for i in range(1, n + 1) for j in range(1, k + 1)}
    assert [trace[f"T[{i}, {j}]"].values[-1] for i, j in wanted] == pytest.approx(list(wanted.values()), abs=1e-3)
    assert trace["whole"].values[-1] == pytest.approx(sum(wanted.values()), abs=1e-2)


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.long
def test_a_range_that_the_sizes_leave_empty(tmp_path, formulation):
    """Its inner nodes were undetermined coordinates in the complementary formulations (E516)."""
    changes = {
        "r: dissipator(e = 1 ohm*f) a -> b": "node m: electrical; r: dissipator(e = 1 ohm*f) a -> m",
        "  c: potential": "  l: kinetic(p = 1 mH*f) m -> b\n  c: potential",
        "  for i in 2..n {": "  s[n]: cell() a = v[n-1], b = v[n]\n  for i in 2..n-1 {",
        "to 1 ms": "to 50 ms",
    }
    text = FILTER
    for old, new in changes.items():
        text = text.replace(old, new)
    (tmp_path / "m.sd").write_text(text)
    trace = load(tmp_path / "m.sd", formulation=formulation).run(set={"n": 2})
    assert [trace[f"e[{k}]"].values[-1] for k in (1, 2)] == pytest.approx([10.0, 10.0], abs=0.05)


TANKS = """
component row {
  param n = 2
  param A[1..n]: m^2
  port ps[1..n]: hydraulic
  for i in 1..n { T[i]: potential(e = 1000 kg/m^3*g0/A[i]*q) ps[i] -> ground; init T[i].e = 1 kPa*i }
  output whole = sum(i in 1..n: T[i].q)
}
model m {
  param n = 3
  param A[1..n]: m^2 = [1 m^2, 2 m^2, 3 m^2]
  node mid[1..n]: hydraulic
  for i in 1..n { R[i]: dissipator(e = 1e9 Pa.s/m^3*f) mid[i] -> ground }
  K: row(n = n, A = GIVEN) ps = mid
}
scene s of m {
  time 0 s to 1 s
  trace K.whole
}
"""


@pytest.mark.parametrize("given", ["A", "A[1..n]"])
def test_an_array_of_parameters_is_handed_on_whole(tmp_path, given):
    (tmp_path / "m.sd").write_text(TANKS.replace("GIVEN", given))
    model = load(tmp_path / "m.sd")
    for settings, areas in (({}, [1, 2, 3]), ({"A[2]": 5.0}, [1, 5, 3]), ({"n": 2, "A": [4.0, 7.0]}, [4, 7])):
        held = model.run(set=settings)["K.whole"].values[0]
        wanted = sum(1e3 * (i + 1) * area / (1e3 * 9.80665) for i, area in enumerate(areas))
        assert held == pytest.approx(wanted, rel=1e-9), settings


FALLING = """
component cell {
  port a: electrical
  C: potential(q = 1 mF*e) a -> ground
  R: dissipator(e = 100 ohm*f) a -> ground
  discrete n = 0
  when C.e < 1 V { n := n + 1 }
  output k = n
  output v = C.e
}
model m {
  param n = 4
  node v[1..n]: electrical
  s[1]: cell() a = v[1]
  for i in 2..n-1 { s[i]: cell() a = v[i] }
  s[n]: cell() a = v[n]
  for i in 1..n { init s[i].C.e = 1.5 V + 0.1 V*i }
  discrete total = 0
  for i in 1..n { when s[i].v < 0.9 V { total := total + i } }
}
scene go of m {
  time 0 s to 1 s
  trace total, s[1..n].k as k
}
"""


@pytest.mark.parametrize("n", [2, 4])
@pytest.mark.one_in(2)
def test_events_of_an_element_that_is_declared_by_itself(tmp_path, n):
    """Their targets have sizes for indices, `s[n].n[n]`: a fault before."""
    (tmp_path / "m.sd").write_text(FALLING)
    trace = load(tmp_path / "m.sd").run(set={"n": n})
    assert [trace[f"k[{i}]"].values[-1] for i in range(1, n + 1)] == [1.0] * n
    assert trace["total"].values[-1] == n * (n + 1) / 2


PACK = """
component cell {{
  param k: 1
  port a, b: electrical
  node m: electrical
  C: potential(q = 1 F*e) a -> m
  Q: dissipator(e = 1 ohm*k*f) m -> b
  init C.e = 1 V
}}
model m {{
  param n = 4
  node h: electrical
  S: dissipator(e = 1 ohm*f) h -> ground
{body}
}}
scene s of m {{ time 0 s to 3 s; trace h.e }}
"""
WRITTEN = "\n".join(f"  c{i}: cell(k = {i}) a = h, b = ground" for i in range(1, 5))
LOOPED = "  c[1]: cell(k = 1) a = h, b = ground\n  for i in 2..n { c[i]: cell(k = i) a = h, b = ground }"


@pytest.mark.parametrize("other", ["i - 1", "1"])
@pytest.mark.long
def test_elements_of_two_statements_side_by_side(tmp_path, other):
    """A loop that begins behind the first statement has no part there, which had both ends at one node (E413)."""
    looped = f"{LOOPED}\n  for i in 2..n {{ W[i]: dissipator(e = 1 ohm*f) c[i].m -> c[{other}].m }}"
    ends = [(i, i - 1 if "i" in other else 1) for i in (2, 3, 4)]
    written = "\n".join([WRITTEN, *(f"  W{i}: dissipator(e = 1 ohm*f) c{i}.m -> c{j}.m" for i, j in ends)])
    found = []
    for k, body in enumerate((looped, written)):
        path = tmp_path / f"m{k}.sd"
        path.write_text(PACK.format(body=body))
        trace = simulate(path, accuracy=1e-7, output=tmp_path / f"t{k}.h5")
        found.append(trace["h.e"].values[[0, -1]])
    assert abs(found[0] - found[1]).max() < 1e-6 * abs(found[1]).max()
