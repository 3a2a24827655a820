"""Modes of a linearisation: random networks against a nodal tableau, stores decades apart, long ladders."""

import os

import numpy as np
import pytest
from linearized import ALL, CLOSE, PRIMAL, RLC, linear, values
from sysdyn.runtime.linear import tangent
from sysdyn.runtime.numerics.rank import singular_decomposition
from texts import ROOT, run_json, write

NETWORKS = 200 if os.environ.get("SYSDYN_LONG") else 12
"""Random networks in each formulation."""


@pytest.mark.parametrize("formulation", ALL)
@pytest.mark.long
def test_contrasts_of_many_decades(formulation, tmp_path, capsys):
    """Each eigenvalue to 1e-10 of itself, the slow one beside one up to 1e13 times as fast; gain and zeros too."""
    path = write(tmp_path, RLC)
    random = np.random.default_rng(0)
    for _ in range(12):
        r, l_, c = (10 ** random.uniform(*decades) for decades in ((-3, 6), (-9, 0), (-12, -3)))
        values_ = (f"R={r!r}", f"L={l_!r}", f"C={c!r}")
        options = [part for v in values_ for part in ("--set", v)]
        found = linear(capsys, path, *options, "--formulation", formulation, "--outputs", "v", "--equilibrium")
        root = np.sqrt(complex((r / l_ / 2) ** 2 - 1 / (l_ * c)))
        fast = -r / l_ / 2 - root
        (t,) = found["transfer"]
        for expected in (fast, 1 / (l_ * c) / fast):
            for ours in (values(found["eigenvalues"]), values(t["poles"])):
                assert np.abs(ours - expected).min() <= CLOSE * abs(expected), (r, l_, c)
        assert t["gain"] * l_ * c == pytest.approx(1.0, rel=CLOSE)
        assert t["zeros"] == []


# -- random networks ---------------------------------------------------------------------------------------------------


def network(random):
    """Text of a connected circuit, and the pencil (E, A) of its modified nodal analysis: E x' = A x."""
    nodes = int(random.integers(3, 7))
    pairs = [(k, int(random.integers(0, k))) for k in range(1, nodes)]
    pairs += [tuple(map(int, random.choice(nodes, 2, replace=False))) for _ in range(int(random.integers(2, 6)))]
    single = [k for k in range(nodes) if sum(k in pair for pair in pairs) == 1]
    pairs += [(k, (k + 1) % nodes) for k in single]
    kinds = [str(random.choice(["R", "L", "C"])) for _ in pairs]
    kinds[: min(3, len(kinds))] = list(random.permutation(["R", "L", "C"]))
    size = 10.0 ** random.uniform(-0.5, 0.5, len(pairs))
    laws = {"R": "dissipator(e = {:.17g} ohm*f)", "L": "kinetic(p = {:.17g} H*f)", "C": "potential(q = {:.17g} F*e)"}
    name = lambda k: "ground" if k == 0 else f"n{k}"  # noqa: E731
    lines = [f"  node {', '.join(name(k) for k in range(1, nodes))}: electrical"]
    for j, ((a, b), kind, value) in enumerate(zip(pairs, kinds, size, strict=True)):
        lines.append(f"  {kind.lower()}{j}: {laws[kind].format(value)} {name(a)} -> {name(b)}")
    coils = [j for j, kind in enumerate(kinds) if kind == "L"]
    n = nodes - 1 + len(coils)
    e, a = np.zeros((n, n)), np.zeros((n, n))
    for j, ((one, two), kind, value) in enumerate(zip(pairs, kinds, size, strict=True)):
        across = np.zeros(nodes)
        across[one], across[two] = 1.0, -1.0
        across = across[1:]
        if kind == "R":
            a[: nodes - 1, : nodes - 1] -= np.outer(across, across) / value
        elif kind == "C":
            e[: nodes - 1, : nodes - 1] += np.outer(across, across) * value
        else:
            k = nodes - 1 + coils.index(j)
            e[k, k] = value
            a[k, : nodes - 1] += across
            a[: nodes - 1, k] -= across
    return "model random_network {\n" + "\n".join(lines) + "\n}\n", e, a


def finite(e, a):
    """Finite eigenvalues of a pencil, by s = shift + 1/mu: infinite ones are mu = 0."""
    shift = 0.7391
    mu = np.linalg.eigvals(np.linalg.solve(a - shift * e, e))
    return shift + 1.0 / mu[np.abs(mu) > 1e-7]


@pytest.mark.parametrize("formulation", ALL)
@pytest.mark.one_in(5)
def test_random_networks_have_the_eigenvalues_of_a_nodal_tableau(formulation, tmp_path, capsys):
    random = np.random.default_rng(11 + ALL.index(formulation))
    worst, counted = 0.0, 0
    for _ in range(NETWORKS):
        text, e, a = network(random)
        if np.linalg.cond(a - 0.7391 * e) > 1e10:
            continue
        found = linear(capsys, write(tmp_path, text), "--formulation", formulation)
        ours = values(found["eigenvalues"])
        theirs = finite(e, a)
        ours, theirs = ours[np.abs(ours) > 1e-5], theirs[np.abs(theirs) > 1e-5]  # charges and fluxes count in zeros
        assert ours.size == theirs.size, text
        for value in theirs:
            worst = max(worst, float(np.abs(ours - value).min() / max(abs(value), 1.0)))
        counted += ours.size
    assert counted > NETWORKS
    assert worst < CLOSE, worst


LOST = """
model contrasts {
  node n1, n2, n3: electrical
  l0: kinetic(p = 38103.838624862277 H*f) n1 -> ground
  r1: dissipator(e = 376797.26089776639 ohm*f) n2 -> ground
  c2: potential(q = 1.3060954446401942 F*e) n3 -> n2
  r3: dissipator(e = 1.2050549116913142e-07 ohm*f) n1 -> n3
  c4: potential(q = 31.936590008723126 F*e) n1 -> n3
}
"""


@pytest.mark.parametrize("formulation", ALL)
@pytest.mark.one_in(2)
def test_no_mode_is_lost_where_elements_are_twelve_decades_apart(formulation, tmp_path, capsys):
    """Eigenvalues of its nodal pencil in 120 digits; co_ forms add up what is at a node in doubles, and may refuse."""
    path = str(write(tmp_path, LOST))
    code, found = run_json(capsys, "linearize", path, "--formulation", formulation, "--backend", "numpy")
    if code:
        assert formulation.startswith("co_")
        assert [d["code"] for d in found["diagnostics"] if d["severity"] == "error"] == ["E607"]
        return
    expected = np.array([-259839.1696955404, -9.88869355609092, -2.0319706817345224e-06])
    ours = np.sort([v.real for v in values(found["result"]["eigenvalues"]) if v != 0])
    assert ours == pytest.approx(expected, rel=1e-7)


EXTREMES = """
model extremes {
  param n = 3
  state s[1..3]: 1 = [1, 2, 3]
  for i in 1..n { dynamic s[i]' = -i*s[i]/(1 s) }
  let low = min(i in 1..n: s[i])
  let high = max(i in 1..n: s[i]^2)
  let all = prod(i in 1..n: s[i])
  let most = sum(i in 1..n: max(j in 1..n: i*s[j]))
}

scene run of extremes {
  time 0 s to 1 s
  trace low, high, all, most
}
"""


def test_extremes_and_products_over_a_range_have_slopes(tmp_path, capsys):
    found = linear(capsys, write(tmp_path, EXTREMES), "--scene", "run")
    slopes = dict(zip(found["outputs"], np.array(found["C"]), strict=True))
    expected = {"low": [1.0, 0.0, 0.0], "high": [0.0, 0.0, 6.0], "all": [6.0, 3.0, 2.0], "most": [0.0, 0.0, 6.0]}
    assert found["states"] == ["s[1]", "s[2]", "s[3]"]
    for name, row in expected.items():
        assert np.abs(slopes[name] - row).max() <= CLOSE


VESSEL = """
model vessel {
  param Q = 12 l/min
  param R = 2e9 Pa.s/m^3
  node a, m: hydraulic
  feed: flow(f = Q) ground -> a
  gas: potential(e = 60 bar*0.6 l/(0.6 l - q)) a -> ground
  seat: effort(e = 95 bar) a -> m
  loss: dissipator(e = R*f) m -> ground
  psi one_way: seat.f >= 0 m^3/s
  init gas.q = 0.15 l
}

scene run of vessel {
  time 0 s to 1 s
  trace a.e
}
"""


@pytest.mark.parametrize("formulation", PRIMAL)
def test_a_flow_that_is_given_hides_no_balance(formulation, tmp_path, capsys):
    """The flow of a source weighs 1e10 times as much as those beside a stiff law: it hid the balance of its node."""
    path = write(tmp_path, VESSEL)
    found = linear(capsys, path, "--scene", "run", "--formulation", formulation, "--inputs", "Q", "--no-prune")
    assert np.abs(values(found["eigenvalues"])).max() <= 1e-12
    a, b, c, d = (np.array(found["reduced"][name]) for name in "ABCD")
    slope = 60e5 * 0.6e-3 / 0.45e-3**2  # of the pressure by the volume
    at = 2.0j
    assert complex((c @ np.linalg.solve(at * np.eye(len(a)) - a, b) + d)[0, 0]) == pytest.approx(slope / at, rel=CLOSE)


def test_a_long_ladder_takes_no_singular_vectors(capsys, monkeypatch):
    """Of 575 unknowns and rates: factors leave no doubt of what rows determine.  Its modes by a closed form."""
    cells, asked = 72, []
    monkeypatch.setattr(
        tangent,
        "singular_decomposition",
        lambda matrix: (asked.append(min(matrix.shape)), singular_decomposition(matrix))[1],
    )
    path = ROOT / "models" / "benchmark" / "rc_ladder.sd"
    found = values(linear(capsys, path, "--set", f"n={cells}")["eigenvalues"])
    odd = 2.0 * np.arange(1, cells + 1) - 1.0
    wanted = -4.0 * cells**2 * np.sin(odd * np.pi / (2.0 * (2 * cells + 1))) ** 2
    assert np.abs(np.sort(found.real) / np.sort(wanted) - 1.0).max() < 1e-9
    assert np.abs(found.imag).max() == 0.0
    assert max(asked) <= cells
