"""Families of components that several statements declare: each index means one of them, whatever the sizes are."""

import pytest
from sysdyn.api import ModelError, check, load

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
