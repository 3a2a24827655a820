"""What a start is sought in, its rows and magnitudes, and rows that depend on each other: against closed forms."""

import numpy as np
import pytest
import small_models as models
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.inertia import with_flows
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.equilibrate import sparse_factors
from sysdyn.runtime.start.least import inertias, problem_of
from sysdyn.runtime.start.least import weights as weights_of
from sysdyn.runtime.start.settled import columns_of_rates, flows_open, inertial_rows, rates_of
from sysdyn.runtime.start.starter import Starter
from sysdyn.runtime.structure.redundancy import Reactions, combination, dependent

PENDULUM = {"q_1": (3.0, True), "q_2": (-4.0, False), "f_1": (0.0, False), "f_2": (0.0, False)}


def starter(**more):
    """A point of 2 kg on a rod of 5 m, written in Cartesian coordinates."""
    made = models.small(
        "1 2", "f_1**2 + f_2**2", "2*9.81*q_2", phi={"rod": "q_1**2 + q_2**2 - 25"}, initial=PENDULUM, **more
    )
    manifest, binding, module = made
    return Starter(System(manifest, binding, load(module)))


def by_name(found, values):
    """Values of the unknowns of y by their names."""
    return dict(zip(found.system.unknown_names, values, strict=False))


@pytest.mark.long
def test_unknowns_are_those_of_y_and_the_rates_that_rows_read():
    found = starter()
    names = found.system.unknown_names
    assert [names[k] for k in found.rates] == [names[k] for k in rates_of(found.settled)]
    assert {"f_1", "f_2"} <= {names[k] for k in found.rates}
    y = np.arange(1.0, found.n + 1.0)
    yd = np.zeros(found.n)
    yd[found.rates] = 10.0 + np.arange(found.rates.size)
    form = found.system.form
    yd[form.k_q] = y[form.k_f]  # rates of displacements are the flows
    for one, other in zip(found.expand(found.unknowns(0.0, y, yd)), (y, yd), strict=True):
        assert (one == other).all()


@pytest.mark.long
def test_rows_hold_the_constraint_and_its_derivatives():
    """At (3, -4) with flow (4, 3) the rod is met and not stretched; its acceleration asks for f'.q = -25."""
    found = starter()
    names = found.system.unknown_names
    y, yd = np.zeros(found.n), np.zeros(found.n)
    for name, value in {"q_1": 3.0, "q_2": -4.0, "f_1": 4.0, "f_2": 3.0}.items():
        y[names.index(name)] = value
    x = found.unknowns(0.0, y, yd)

    def at(group):
        return found.residual(0.0, x)[found.groups(group)]

    assert at("phi") == pytest.approx([0.0])
    assert at("phi_rate") == pytest.approx([0.0])
    still = float(at("phi_acceleration")[0])
    x[found.n + list(found.rates).index(names.index("f_1"))] = -25.0 / 3.0
    assert at("phi_acceleration") == pytest.approx([0.0], abs=1e-12)
    assert abs(still) == pytest.approx(50.0)


def test_what_carries_inertia_is_state_and_the_tension_follows():
    found = starter()
    x = found.unknowns(0.0, found.guess[: found.n], np.zeros(found.n))
    follows = by_name(found, found.following(0.0, x))
    assert {name for name, yes in follows.items() if not yes} == {"q_1", "q_2", "f_1", "f_2"}
    assert not found.hollow.any()  # all positions are said
    assert not by_name(found, found.free[: found.n])["q_1"]


@pytest.mark.long
def test_momenta_are_paired_with_their_flows_and_flows_weigh_by_them():
    found = starter(form="hamiltonian")
    momenta, flows = with_flows(found.system)
    names = found.system.unknown_names
    assert [(names[p], names[f]) for p, f in zip(momenta, flows, strict=True)] == [("p_1", "f_1"), ("p_2", "f_2")]
    x = found.unknowns(0.0, found.guess[: found.n], np.zeros(found.n))
    scale = np.ones(x.size)
    weight = by_name(found, weights_of(found, 0.0, x, scale, inertias(found, 0.0, x)))
    # of 2 kg a flow of 1 m/s holds 2 N s, twice what a momentum of 1 N s does
    assert weight["f_1"] == pytest.approx(weight["f_2"])
    measures = found.equations.measures(found.settled)
    assert measures[momenta[0]] == measures[flows[0]]
    assert inertial_rows(found.settled).any()


@pytest.mark.long
def test_magnitudes_of_what_is_zero_balance_their_rows():
    """No tension is guessed: in magnitudes of its own the weight of 19.62 N is what q_2 times it has to balance."""
    found = starter()
    x = found.unknowns(0.0, found.guess[: found.n], np.zeros(found.n))
    scale = by_name(found, found.scale(0.0, x))
    assert scale["q_1"] == 3.0
    assert scale["q_2"] == 4.0
    assert scale["kappa_rod"] == pytest.approx(2.0 * 9.81 / 8.0)


@pytest.mark.long
def test_the_written_state_moves_before_what_is_unsaid():
    """Levels: what the text says of what stores hold (momenta first), then of anything else and of positions, what it
    does not say, what holds nothing; fixed unknowns are in none.
    """
    found = starter()
    x = found.unknowns(0.0, found.guess[: found.n], np.zeros(found.n))
    free = found.free
    problem = problem_of(found, 0.0, x, x, rows=found.every, free=free, least=True)
    momenta, displacements, *others = ({k for k, yes in by_name(found, of).items() if yes} for of in problem.levels)
    assert momenta == {"f_1", "f_2"}
    assert displacements == {"q_2"}
    assert not any(others)


def reactions(matrix):
    """J as the equations give it."""
    j = np.asarray(matrix, dtype=float)
    which, row = (np.ascontiguousarray(item, dtype=np.int32) for item in np.nonzero(j))
    scale, other = sparse_factors(which, row, np.abs(j[which, row]), j.shape)
    return Reactions(which, row, scale[which] * j[which, row] * other[row], np.arange(len(j)), j.shape[1], scale)


ROWS = [[1.0, 1.0, 0.0], [0.0, 1.0, 1.0], [1.0, 0.0, -1.0], [0.0, 0.0, 0.0], [1.0, 1.0, 1.0]]
"""The third is the first less the second; the fourth is empty."""


def test_rows_that_depend_on_those_before_them_are_named():
    assert dependent(reactions(ROWS)).tolist() == [2, 3]
    assert dependent(reactions(ROWS[:2] + ROWS[4:])).tolist() == []
    assert dependent(reactions(np.zeros((0, 3)))).tolist() == []


@pytest.mark.parametrize("seed", range(4))
def test_dependent_rows_are_those_of_any_size(seed):
    """Whatever the sizes of rows and columns; one that is a sum of the others is not independent."""
    random = np.random.default_rng(seed)
    matrix = random.normal(size=(4, 7)) * 10.0 ** random.uniform(-8, 8, (4, 1)) * 10.0 ** random.uniform(-3, 3, (1, 7))
    assert dependent(reactions(matrix)).tolist() == []
    matrix[3] = matrix[0] / np.abs(matrix[0]).max() - matrix[2] / np.abs(matrix[2]).max()
    assert dependent(reactions(matrix)).tolist() == [3]
    matrix[1] = 0.0
    assert dependent(reactions(matrix)).tolist() == [1, 3]


@pytest.mark.long
def test_dependent_rows_of_a_large_matrix_are_as_many_as_its_rank_lacks():
    """Three random entries a row: no row in its turn alone stands in some column, and the rank is that of the SVD."""
    random, m, n = np.random.default_rng(0), 900, 910
    matrix = np.zeros((m, n))
    matrix[np.repeat(np.arange(m), 3), random.integers(0, n, 3 * m)] = random.normal(size=3 * m)
    found = reactions(matrix)
    left = dependent(found)
    assert left.size == m - np.linalg.matrix_rank(matrix, 1e-10) > 0
    assert np.linalg.matrix_rank(np.delete(matrix, left, axis=0), 1e-10) == m - left.size
    weights = combination(found, left)
    assert np.abs(weights @ matrix).max() < 1e-9 * np.abs(weights).max()
    assert (weights[left] != 0.0).all()


@pytest.mark.parametrize("seed", range(6))
def test_rows_fill_behind_many_that_are_left_out(seed):
    """Those that take no pivot leave all others their places: what comes behind them may fill more."""
    random = np.random.default_rng(seed)
    matrix = np.zeros((300, 300))
    matrix[:200, 0] = 1.0 + random.random(200)
    matrix[200] = random.normal(size=300)
    matrix[np.repeat(np.arange(201, 300), 4 + 2 * seed), random.integers(0, 300, 99 * (4 + 2 * seed))] = 1.0
    matrix[201:] *= random.normal(size=(99, 300))
    assert dependent(reactions(matrix)).tolist() == list(range(1, 200))


def test_the_combination_that_vanishes():
    weights = combination(reactions(ROWS), np.array([2]))
    assert weights / weights[0] == pytest.approx([1.0, -1.0, -1.0, 0.0, 0.0])
    assert combination(reactions(ROWS), np.array([3])).tolist() == [0.0, 0.0, 0.0, 1.0, 0.0]


def test_rates_stand_behind_the_unknowns():
    rates, columns = np.array([1, 3], dtype=np.int32), np.array([3, 0, 1, 3, 2])
    assert columns_of_rates(4, rates, columns).tolist() == [5, -1, 4, 5, -1]
    assert columns_of_rates(2, np.zeros(0, dtype=np.int32), np.array([0, 1])).tolist() == [-1, -1]


@pytest.mark.parametrize(("content", "left"), [("0", True), ("f_b**2/2", False), ("(f_b + f_c)**2/2", False)])
def test_flows_of_a_loop_of_stores_are_open(content, left):
    """Two capacitors in parallel carry like currents; how large these are the rate of their balance says and no row
    that is settled, unless there is a resistor.
    """
    manifest, binding, module = models.small("b c", 0, "(q_b**2 + q_c**2)/2", content, phi={"loop": "q_b - q_c"})
    settled = System(manifest, binding, load(module), "settled")
    y = np.zeros(settled.unknowns)
    assert flows_open(settled, 0.0, y, y, settled.are("q")[: settled.form.written]) == left
