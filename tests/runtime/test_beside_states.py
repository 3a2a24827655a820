"""Instants within steps, motions beside a state, what a start says of guesses: by hand, and against closed forms."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
import small_models as models
from sysdyn.runtime.events.locate import Edges, crossing
from sysdyn.runtime.linear.pencil import motions, reduce_pencil, surely_parted, widely_parted
from sysdyn.runtime.linear.stability import EnergyTest, energy_at, verdict
from sysdyn.runtime.linear.states import pivots, rank_of, unseen
from sysdyn.runtime.linear.tangent import NoLinearisation, Reduced
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.description import statements
from sysdyn.runtime.model.held_rows import held_rows, switch_rows
from sysdyn.runtime.model.switches import Switches
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.moved import moved_guesses
from sysdyn.runtime.start.start import consistent_start
from sysdyn.runtime.start.starter import Starter

G = 9.81


def system_of(made, form="3"):
    manifest, binding, module = made
    return System(manifest, binding, load(module), form)


# -- the first instant at which something watched falls ----------------------------------------------------------------


def edges(*watches):
    """Of (row, side, tolerance, row of its rate, level, tolerance of its rate)."""
    row, side, small, rate, level, still = (np.array(column) for column in zip(*watches, strict=True))
    return Edges(row, side, rate, small, level, still)


def thrown(height, speed):
    """Height above the floor, and its rate."""
    return lambda t: np.array([height + speed * t - G * t * t / 2.0, speed - G * t])


def test_a_stone_falls_on_the_floor():
    """From 2 m at 3 m/s upwards."""
    found, which = crossing(thrown(2.0, 3.0), edges((0, 1, 1e-9, 1, 0.0, 0.0)), 0.0, 2.0)
    assert found == pytest.approx((3.0 + math.sqrt(9.0 + 4.0 * G)) / G, rel=1e-15)
    assert which == [0]


def test_what_begins_at_zero_and_rises_falls_from_its_crest():
    """A bounce: at the floor when it begins, there again after 2 v/g, not at once."""
    for speed in (1.0, 1e-4):
        found, _ = crossing(thrown(0.0, speed), edges((0, 1, 1e-12, 1, 0.0, 0.0)), 0.0, 3.0 * speed / G)
        assert found == pytest.approx(2.0 * speed / G, rel=1e-9)


def test_of_two_sides_each_falls_its_own_way():
    """sin t leaves -0.5 upwards at once it is above 0.5: a watch of side -1 and level -0.5."""
    found, which = crossing(lambda t: np.array([math.sin(t)]), edges((0, -1, 1e-12, -1, -0.5, 0.0)), 0.0, 1.5)
    assert found == pytest.approx(math.pi / 6.0, rel=1e-14)
    assert which == [0]


def test_the_first_comes_first_and_what_falls_together_is_told_together():
    dense = lambda t: np.array([0.7 - t, 0.3 - t, 0.6 - 2.0 * t])  # noqa: E731
    found, which = crossing(dense, edges(*((k, 1, 1e-12, -1, 0.0, 0.0) for k in range(3))), 0.0, 1.0)
    assert found == pytest.approx(0.3, rel=1e-15)
    assert which == [1, 2]


def test_what_dips_by_less_than_its_tolerance_does_not_fall():
    dense = lambda t: np.array([(t - 0.5) ** 2 - 1e-7])  # noqa: E731
    assert crossing(dense, edges((0, 1, 1e-6, -1, 0.0, 0.0)), 0.0, 1.0) is None
    found, _ = crossing(dense, edges((0, 1, 1e-8, -1, 0.0, 0.0)), 0.0, 1.0)
    assert found == pytest.approx(0.5 - math.sqrt(1e-7), rel=1e-12)


# -- the motions of a pencil -------------------------------------------------------------------------------------------

R, C = 3.0, 0.25


def capacitor(resistance):
    """C v' = i, 0 = -v - R i + u; of v and i the current is traced."""
    e = np.array([[C, 0.0], [0.0, 0.0]])
    a = np.array([[0.0, 1.0], [-1.0, -resistance]])
    return e, a, np.array([[0.0], [1.0]]), np.array([[0.0, 1.0]]), np.zeros((1, 2)), np.zeros((1, 1))


def test_a_capacitor_behind_a_resistor_has_one_motion():
    """v' = (u - v)/(R C), i = (u - v)/R."""
    matrices = capacitor(R)
    spaces = motions(*matrices[:2])
    found = reduce_pencil(matrices, np.array([0]), spaces, ("v",))
    assert spaces[0].shape == (2, 1)
    for part, expected in (
        (found.a, -1.0 / (R * C)),
        (found.b, 1.0 / (R * C)),
        (found.c, -1.0 / R),
        (found.d, 1.0 / R),
    ):
        assert part.item() == pytest.approx(expected, rel=1e-14)
    assert not found.d1.any()
    assert not found.d2.any()


def test_a_capacitor_across_a_source_follows_its_rate():
    """i = C u': index 2, no motion."""
    matrices = capacitor(0.0)
    spaces = motions(*matrices[:2])
    found = reduce_pencil(matrices, np.zeros(0, dtype=np.int64), spaces, ())
    assert spaces[0].shape == (2, 0)
    assert found.d1.item() == pytest.approx(C, rel=1e-14)
    assert abs(found.d.item()) < 1e-14


def two_stores(stiff, leak):
    """x' = k (y - x), y' = x - y - d y, u into y; the currents are unknowns of their own, so that no sum of entries
    hides d.
    """
    e = np.diag([1.0, 1.0, 0.0, 0.0])
    a = np.array([[0.0, 0.0, -stiff, 0.0], [0.0, 0.0, 1.0, -1.0], [1.0, -1.0, -1.0, 0.0], [0.0, leak, 0.0, -1.0]])
    b, c = np.array([[0.0], [1.0], [0.0], [0.0]]), np.array([[1.0, 0.0, 0.0, 0.0]])
    return e, a, b, c, np.zeros((1, 4)), np.zeros((1, 1))


@pytest.mark.parametrize(("stiff", "leak", "wide"), [(2.0, 0.5, False), (1e9, 1e-9, True), (1e12, 1e-12, True)])
@pytest.mark.one_in(2)
def test_a_slow_motion_beside_a_fast_one_keeps_its_digits(stiff, leak, wide):
    """s^2 + (k + 1 + d) s + k d = 0: of -(k + 1) and about -d."""
    matrices, chosen, names = two_stores(stiff, leak), np.array([0, 1]), ("x", "y")
    found = surely_parted(matrices, chosen, motions(*matrices[:2]), names)
    half = (stiff + 1.0 + leak) / 2.0
    fast = half + np.sqrt(half**2 - stiff * leak)
    values = np.linalg.eigvals(found.a) if found.decomposed is None else found.decomposed.values
    assert np.sort(values.real) == pytest.approx([-fast, -stiff * leak / fast], rel=1e-11, abs=0.0)
    assert ((found.decomposed is not None), found.names) == (wide, names)
    assert found.b[:, 0] == pytest.approx([0.0, 1.0], abs=1e-12)
    if wide:
        alone = widely_parted(matrices, (np.array([1]), np.array([0])), 2)
        assert alone.places.tolist() == [1, 0]  # the first group first
        assert np.sort(alone.decomposed.values.real) == pytest.approx(np.sort(values.real), rel=1e-12, abs=0.0)
        assert widely_parted(matrices, (np.array([1]),), 2) is None  # fewer than there are states


def test_equations_that_leave_something_open_have_no_motions():
    with pytest.raises(NoLinearisation, match="every unknown"):
        motions(np.array([[1.0, 1.0], [0.0, 0.0]]), np.array([[1.0, 1.0], [2.0, 2.0]]))


# -- which unknowns are states, and whether they stay ------------------------------------------------------------------


def test_states_are_the_rows_farthest_from_each_other():
    matrix = np.array([[1.0, 0.0], [0.9, 1e-3], [0.0, 0.5]])
    assert pivots(matrix, 2).tolist() == [0, 2]
    assert pivots(matrix, 1).tolist() == [0]
    assert rank_of(np.array([[1.0, 0.0], [1.0, 1e-9]])) == 2  # close potentials are two
    assert rank_of(np.array([[1.0, 0.0], [1.0, 1e-14]])) == 1
    left = unseen(np.array([[0.6, 0.8, 0.0]]))
    np.testing.assert_allclose(left.T @ left, np.eye(2), atol=1e-15)
    np.testing.assert_allclose(np.array([0.6, 0.8, 0.0]) @ left, 0.0, atol=1e-15)


MINIMUM, SADDLE = EnergyTest("minimum", (1.0,), True), EnergyTest("saddle", (-1.0, 1.0), True)


@pytest.mark.parametrize(
    ("stiffness", "damping", "energy", "expected"),
    [
        (1.0, 0.1, None, ("asymptotically stable", "linearisation")),
        (1.0, -0.1, MINIMUM, ("unstable", "linearisation")),
        (-1.0, 0.1, SADDLE, ("unstable", "linearisation")),
        (1.0, 0.0, MINIMUM, ("stable", "energy")),
        (1.0, 0.0, None, ("undecided", "linearisation")),
        (0.0, 0.0, SADDLE, ("unstable", "energy")),
        (0.0, 0.0, EnergyTest("saddle", (-1.0, 1.0), False), ("undecided", "linearisation")),
    ],
)
@pytest.mark.one_in(5)
def test_what_both_methods_say_of_an_oscillator(stiffness, damping, energy, expected):
    """x'' + d x' + k x = 0."""
    a, none = np.array([[0.0, 1.0], [-stiffness, -damping]]), np.zeros((2, 0))
    small = Reduced(a, none, none.T, *(np.zeros((0, 0)),) * 3, np.arange(2), ("x", "v"))
    found = verdict(small, np.zeros(2, dtype=bool), energy)
    assert (found.stability, found.by) == expected


def test_directions_that_nothing_feels_say_nothing():
    """A body that rolls freely beside a damped oscillator: two eigenvalues at zero, one of which is its place's."""
    a = np.zeros((3, 3))
    a[:2, :2] = [[0.0, 1.0], [-1.0, -0.1]]
    none = np.zeros((3, 0))
    small = Reduced(a, none, none.T, *(np.zeros((0, 0)),) * 3, np.arange(3), ("x", "v", "s"))
    assert verdict(small, np.zeros(3, dtype=bool), None).stability == "undecided"
    assert verdict(small, np.zeros(3, dtype=bool), None, 1).stability == "asymptotically stable"
    assert verdict(small, np.array([False, False, True]), None).stability == "asymptotically stable"


@pytest.mark.parametrize(
    ("angle", "content", "kind", "stiffness", "conservative"),
    [
        (0.0, "0", "minimum", 2.0 * G, True),
        (math.pi, "0", "maximum", -2.0 * G, True),
        (0.0, "f_a**2", "minimum", 2.0 * G, False),
    ],
)
@pytest.mark.one_in(2)
def test_the_energy_of_a_pendulum_at_rest(angle, content, kind, stiffness, conservative):
    """V = -2 g cos a of 2 kg on 1 m."""
    made = models.small("a", "f_a**2", f"-2*{G}*cos(q_a)", content, initial={"q_a": (angle, True), "f_a": (0, True)})
    system = system_of(made)
    found = energy_at(system, consistent_start(system, 0.0))
    assert (found.kind, found.conservative) == (kind, conservative)
    assert found.stiffness == (pytest.approx(stiffness, rel=1e-12),)


# -- constraints that do not hold --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("form", "expected"),
    [
        ("3", [("phi rod", "kappa_rod")]),
        ("2", [("phi_rate rod", "kappa_rod"), ("phi rod", "nu rod")]),
        ("2v", [("phi_rate rod", "kappa_rod")]),
        ("1", [("phi_acceleration rod", "kappa_rod")]),
    ],
)
@pytest.mark.long
def test_where_a_constraint_does_not_hold_its_multiplier_is_zero(form, expected):
    system = system_of(models.pendulum(), form)
    (family,) = system.description.families_of("kappa")
    rows, unknowns = held_rows(system.description, system.form, ((family, 0),))
    labels = [system.row_label(int(k)) for k in rows]
    found = [(f"{label.kind} {label.label}", int(k)) for label, k in zip(labels, unknowns, strict=True)]
    assert [name for name, _ in found] == [name for name, _ in expected]
    places = {"kappa_rod": int(system.form.at[family]), "nu rod": system.form.written}
    assert [k for _, k in found] == [places[name] for _, name in expected]


@pytest.mark.long
def test_no_switches_switch_no_rows():
    system = system_of(models.pendulum())
    assert [part.size for part in switch_rows(system.description, system.form)] == [0, 0, 0, 0]


def test_switches_tell_their_systems_what_changes_and_nothing_else():
    calls = []

    class Follower:
        def switch(self):
            calls.append(switches.active.tolist())

    switches, system = Switches(((3, 0), (3, 1))), Follower()
    switches.join(system)
    switches.set(np.array([True, True]))
    assert calls == []
    given = np.array([True, False])
    switches.set(given)
    given[0] = False  # whoever set them may go on
    assert calls == [[True, False]]
    assert switches.active.tolist() == [True, False]


# -- initial values ----------------------------------------------------------------------------------------------------


def test_a_fixed_value_goes_before_a_guess_of_the_same():
    said = [([0, 1], [1.0, 2.0], True), ([1, 2], [5.0, 6.0], False)]
    initial = tuple(SimpleNamespace(family=1, positions=np.array(p), values=np.array(v), fixed=f) for p, v, f in said)
    for order in (initial, initial[::-1]):
        values, _, written = statements(np.array([0, 2], dtype=np.int32), 6, order)
        assert values.tolist() == [0.0, 0.0, 1.0, 2.0, 6.0, 0.0]
        assert written.tolist() == [False, False, True, True, True, False]


@pytest.mark.long
def test_a_guess_that_moved_is_told_with_what_asked_for_it():
    """A point on a rod of 5 m, fixed at x = 3, guessed at y = -3.9: it starts at -4."""
    made = models.small(
        "1 2",
        "f_1**2 + f_2**2",
        f"2*{G}*q_2",
        phi={"rod": "q_1**2 + q_2**2 - 25"},
        initial={"q_1": (3.0, True), "q_2": (-3.9, False), "f_1": (0.0, True), "f_2": (0.0, False)},
    )
    system = system_of(made)
    state = consistent_start(system, 0.0)
    starter = Starter(system)
    x = starter.unknowns(0.0, state.y, state.yd)
    ((name, guess, value, asked),) = moved_guesses(starter, 0.0, x, starter.scale(0.0, x))
    assert (name, guess, value) == ("q_2", -3.9, pytest.approx(-4.0, rel=1e-12))
    assert "phi rod" in asked
    assert [m[0] for m in state.moved] == ["q_2"]
