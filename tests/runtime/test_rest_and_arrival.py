"""Where a motion begins, where it comes to without a trace, and where it would rest, against closed forms."""

import numpy as np
import pytest
import small_models as models
from sysdyn.runtime.accuracy.options import Options
from sysdyn.runtime.arrival import arrival
from sysdyn.runtime.events.plan import Plan
from sysdyn.runtime.events.start import eventful_start
from sysdyn.runtime.integrate.origin import UNRESOLVED, Origin
from sysdyn.runtime.linear.rest import Resting, rests
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.system import System
from sysdyn.runtime.structure.structure import structure

SWINGING = {"q_x": (1.0, True), "f_x": (0.0, True)}


def system(*text, **more):
    made = models.small(*text, **more)
    return System(made[0], made[1], load(made[2]))


def oscillator():
    """q'' = -9 q from q = 1."""
    return system("x", "f_x**2/2", "9*q_x**2/2", initial=SWINGING)


def by_name(of, y):
    return dict(zip(of.unknown_names, y, strict=False))


def test_without_contacts_a_start_is_the_consistent_one():
    of = oscillator()
    found = eventful_start(of, 0.0, Plan())
    assert by_name(of, found.y) == {"q_x": 1.0, "f_x": 0.0}
    assert found.yd[of.unknown_names.index("f_x")] == pytest.approx(-9.0)


@pytest.mark.parametrize("method", ["auto", "radau"])
def test_an_oscillator_comes_to_the_cosine(method):
    of = oscillator()
    start = eventful_start(of, 0.0, Plan())
    end, found = arrival(of, start, structure(of, start), Options(None, 0.0, 2.0, method=method))
    assert found.t == 2.0
    assert by_name(end, found.y)["q_x"] == pytest.approx(np.cos(6.0), abs=1e-8)
    assert by_name(end, found.y)["f_x"] == pytest.approx(-3.0 * np.sin(6.0), abs=3e-8)
    assert found.yd[end.unknown_names.index("f_x")] == pytest.approx(-9.0 * np.cos(6.0), abs=1e-7)


def test_a_run_that_ends_where_it_begins_is_its_start():
    of = oscillator()
    start = eventful_start(of, 0.0, Plan())
    assert arrival(of, start, structure(of, start), Options(None, 0.0, 0.0))[1] is start


@pytest.mark.long
def test_an_arrival_lies_on_the_constraint():
    """A point on a rod of 1 m, let go at 1 rad: the rod is as long as it was, its tension what the point needs."""
    of = system(
        "1 2", "(f_1**2 + f_2**2)/2", "9.81*q_2", phi={"rod": "q_1**2 + q_2**2 - 1"},
        initial={"q_1": (np.sin(1.0), True), "q_2": (-np.cos(1.0), False), "f_1": (0.0, True), "f_2": (0.0, False)},
    )  # fmt: skip
    start = eventful_start(of, 0.0, Plan())
    end, found = arrival(of, start, structure(of, start), Options(None, 0.0, 1.0))
    at = by_name(end, found.y)
    assert at["q_1"] ** 2 + at["q_2"] ** 2 == pytest.approx(1.0, abs=1e-13)
    assert at["q_1"] * at["f_1"] + at["q_2"] * at["f_2"] == pytest.approx(0.0, abs=1e-12)
    speed2 = at["f_1"] ** 2 + at["f_2"] ** 2
    assert 0.5 * speed2 + 9.81 * at["q_2"] == pytest.approx(-9.81 * np.cos(1.0), abs=1e-7)
    # -2 kappa is the tension over the length: v^2 - g q_2
    assert abs(2.0 * at["kappa_rod"]) == pytest.approx(speed2 - 9.81 * at["q_2"], abs=1e-6)


def test_an_origin_has_rates_of_what_is_differentiated_and_magnitudes():
    of = oscillator()
    found = Origin(of, eventful_start(of, 0.0, Plan()), 0)
    y, yd, rate = found.point(own=False)
    assert y is not found.y
    assert by_name(of, yd)["f_x"] == by_name(of, rate)["f_x"] == pytest.approx(-9.0)
    magnitude, tau = found.initial_sizes(10.0)
    assert by_name(of, magnitude)["q_x"] == pytest.approx(1.0)
    assert 0.0 < tau < 10.0
    assert found.initial_sizes(10.0)[0] is magnitude  # once a span
    before = found.jy
    found.let_go()
    assert found.jy is not before
    assert np.array_equal(found.jy, before)


@pytest.mark.long
def test_what_round_off_leaves_open_is_that_of_the_terms_of_constraints():
    """q_x = 1e8 - q_y: what is left of one is known to the round-off of 1e8."""
    of = system(
        "x y", "(f_x**2 + f_y**2)/2", "q_x**2/2", phi={"sum": "q_x + q_y - 100000000"},
        initial={"q_x": (1.0, True), "q_y": (1e8, False), "f_x": (0.0, True), "f_y": (0.0, False)},
    )  # fmt: skip
    found = by_name(of, Origin(of, eventful_start(of, 0.0, Plan()), 3).least)
    assert found["q_x"] == pytest.approx(UNRESOLVED * 2.2e-16 * 1e8, rel=1.0)
    assert found["kappa_sum"] == 0.0


def resting(of, tangible=("x",), **first):
    guess = np.zeros(of.form.written)
    for name, value in first.items():
        guess[of.unknown_names.index(name)] = value
    return Resting(of, set(tangible), 0.0, guess)


@pytest.mark.parametrize(
    ("potential", "states", "sought"),
    [
        ("3*(q_x - 1)**2", [1.0], range(1, 2)),
        ("Piecewise((3*(q_x + 2)**2, q_x < 0), (3*(q_x - 1)**2, True))", [-2.0, 1.0], range(2, 20)),
    ],
)
@pytest.mark.one_in(2)
def test_points_of_the_piece_that_was_searched_are_not_searched_again(potential, states, sought):
    """Straight rows lead from anywhere to one state; two pieces of one slope are told apart by their values."""
    of = resting(system("x", "f_x**2/2", potential, initial=SWINGING), q_x=1.7)
    found, begun = of.found, []
    of.found = lambda guess: begun.append(guess) or found(guess)
    assert sorted(by_name(of.system, r.state.y)["q_x"] for r in rests(of, 40)) == pytest.approx(states, abs=1e-12)
    assert len(begun) in sought


@pytest.mark.long
def test_a_double_well_rests_in_both_and_between_them():
    """V = (q^2 - 4)^2: 0 and -+2."""
    of = system("x", "f_x**2/2", "(q_x**2 - 4)**2", initial=SWINGING)
    found = rests(resting(of, q_x=1.7), 40)
    assert sorted(by_name(of, r.state.y)["q_x"] for r in found) == pytest.approx([-2.0, 0.0, 2.0], abs=1e-9)
    assert all(r.free == () and by_name(of, r.state.y)["f_x"] == 0.0 for r in found)
    assert len(rests(resting(of, q_x=1.7), 40, 1)) == 1


@pytest.mark.long
def test_an_angle_of_rest_lies_within_a_turn_and_half_a_turn_is_one_whatever_its_sign():
    of = system("x", "f_x**2/2", "-9.81*cos(q_x)", initial=SWINGING, units={"q_x": "rad", "f_x": "rad/s"})
    found = rests(resting(of, q_x=6.0), 20)
    angles = sorted(by_name(of, r.state.y)["q_x"] for r in found)
    assert angles == pytest.approx([0.0, np.pi], abs=1e-9)


def test_what_may_lie_anywhere_stays_where_it_was_guessed():
    """Only the distance of two points is held by a spring of 3 m."""
    of = system("x y", "(f_x**2 + f_y**2)/2", "(q_x - q_y - 3)**2", initial=SWINGING)
    (found, *_) = rests(resting(of, ("x", "y"), q_x=10.0, q_y=6.0), 0)
    at = by_name(of, found.state.y)
    assert at["q_x"] - at["q_y"] == pytest.approx(3.0)
    assert 9.0 < at["q_x"] < 10.0  # both give way, relative to their size
    assert 6.0 < at["q_y"] < 7.0
    assert set(found.free) >= {"q_x", "q_y"}


def test_what_nothing_holds_falls_at_a_steady_speed():
    """5 N pull, f^3/25 resists: no displacement counts, -5 m/s is the state that stays."""
    of = system("x", "f_x**2/2", "5*q_x", content="f_x**4/100", initial=SWINGING)
    (found,) = rests(resting(of), 5)
    assert by_name(of, found.state.y)["f_x"] == pytest.approx(-5.0)
    assert found.together == 1
    assert found.free == ("q_x",)
