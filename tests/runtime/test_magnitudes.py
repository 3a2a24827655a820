"""How large unknowns count as, what round-off leaves of them, and what a method and a driver are told: by hand."""

from types import SimpleNamespace

import numpy as np
import pytest
import small_models as models
from sysdyn.runtime.integrate.integrate import Integration
from sysdyn.runtime.integrate.request import Request
from sysdyn.runtime.integrate.weights.told import UNPULLED, Told
from sysdyn.runtime.integrate.weights.unknown_roles import roles
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.scales import (
    ROUND_OFF,
    confirm_magnitudes,
    group_maximum,
    largest_of_group,
    noise,
    unresolved_sizes,
)
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.start import consistent_start

EPS = np.finfo(float).eps
ROD = {"rod": "q_x**2 + q_y**2 - 25"}


def system_of(made, form="3"):
    return System(made[0], made[1], load(made[2]), form)


def place(system, name):
    return system.unknown_names.index(name)


def values(system, **named):
    y = np.zeros(system.unknowns)
    for name, value in named.items():
        y[place(system, name)] = value
    return y


# --- groups of one kind and unit --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("group", "given", "found"),
    [
        ([], [], []),
        ([0], [3.0], [3.0]),
        ([0, 0, 1], [1.0, 2.0, 0.5], [2.0, 2.0, 0.5]),
        ([1, 0, 0, 1], [1.0, 2.0, 5.0, 4.0], [4.0, 5.0, 5.0, 4.0]),  # in two stretches
        ([2], [-1.0], [0.0]),
    ],
)
def test_the_largest_of_a_group(group, given, found):
    assert largest_of_group(np.array(group, dtype=int), np.array(given, dtype=float)).tolist() == found


@pytest.mark.long
def test_unknowns_are_alike_by_kind_and_unit():
    units = {"q_x": "m", "q_y": "rad", "q_z": "m", "f_x": "m/s", "f_y": "rad/s", "f_z": "m/s"}
    system = system_of(models.small("x y z", "f_x**2 + f_y**2 + f_z**2", units=units))
    y = values(system, q_x=1.0, q_y=7.0, q_z=3.0, f_x=0.5, f_z=0.25)
    assert group_maximum(system, y).tolist() == [3.0, 7.0, 3.0, 0.5, 0.0, 0.5]


# --- round-off --------------------------------------------------------------------------------------------------------


def rod(**more):
    """2 kg at (3, -4) m, with dampers of 0.5 and 2 N s/m."""
    system = system_of(models.small("x y", "f_x**2 + f_y**2", 0, "f_x**2/4 + f_y**2", phi=ROD, **more))
    y = values(system, q_x=3.0, q_y=-4.0)
    return system, y, system.jacobian(0.0, y, np.zeros_like(y))[0]


@pytest.mark.long
def test_round_off_of_a_constraint_is_that_of_its_largest_term():
    """Slopes are 6 and -8, the terms 18 and 32: of x nothing is known below 32 eps/6, of y below 32 eps/8."""
    system, y, jy = rod()
    assert unresolved_sizes(system, y, jy) == pytest.approx(
        values(system, q_x=32 / 6 * EPS, q_y=4 * EPS), rel=1e-14, abs=0.0
    )


def test_what_stands_in_no_constraint_is_known():
    system = system_of(models.mass_spring())
    y = values(system, q_x=0.5, f_x=1.0)
    assert (unresolved_sizes(system, y, system.jacobian(0.0, y, y)[0]) == 0.0).all()


@pytest.mark.long
def test_noise_of_flows_is_that_of_displacements_over_a_step_and_multipliers_balance_it():
    """Steps of 0.1 s: dampers make forces of 0.5 and 2 N s/m of it, kappa balances the larger by its slopes 6, 8."""
    system, y, jy = rod()
    flows = 10.0 * EPS * np.array([32 / 6, 4.0])
    kappa = max(0.5 * flows[0] / 6.0, 2.0 * flows[1] / 8.0)
    expected = values(system, q_x=32 / 6 * EPS, q_y=4 * EPS, f_x=flows[0], f_y=flows[1], kappa_rod=kappa)
    assert noise(system, system.pattern, y, jy, 0.1) == pytest.approx(expected, rel=1e-14, abs=0.0)


# --- after a run ------------------------------------------------------------------------------------------------------

UNITS = {"q_x": "m", "q_y": "m", "f_x": "m/s", "f_y": "m/s"}


def after(met, magnitude, *, nominal=None, span=10.0):
    """Magnitudes after a run by name."""
    made = models.small("x y", "f_x**2 + f_y**2", phi=ROD, units=UNITS)
    for family in made[0]["structure"]["families"]:
        family["nominal"] = (nominal or {}).get(family["name"])
    system = system_of(made)
    found = confirm_magnitudes(system, span, values(system, **met), values(system, **magnitude))
    return dict(zip(system.unknown_names, found, strict=True))


WENT_BY = {"q_x": 5.0, "q_y": 5.0, "f_x": 1.0, "f_y": 1.0, "kappa_rod": 7.0}


@pytest.mark.long
def test_magnitudes_shrink_to_what_was_met_and_never_grow():
    found = after({"q_x": 2.0, "q_y": 9.0, "f_x": 0.5, "f_y": 0.25, "kappa_rod": 1e-20}, WENT_BY)
    assert found == {"q_x": 2.0, "q_y": 5.0, "f_x": 0.5, "f_y": 0.25, "kappa_rod": 7.0}  # kappa keeps its own


@pytest.mark.long
def test_a_thousandth_of_its_like_is_the_least_and_a_millionth_of_what_it_went_by():
    found = after({"q_x": 2.0, "q_y": 1e-9, "f_x": 0.5, "f_y": 0.0}, WENT_BY)
    assert (found["q_y"], found["f_y"]) == pytest.approx((2e-3, 5e-4), rel=1e-14)
    still = after({"q_x": 1e-12}, {**WENT_BY, "f_x": 0.0, "f_y": 0.0})
    assert (still["q_x"], still["q_y"]) == pytest.approx((5e-6, 5e-6), rel=1e-14, abs=0.0)


@pytest.mark.long
def test_flows_that_are_round_off_count_by_their_displacements_over_the_span():
    """q of 2 m in 10 s: a tenth of 0.2 m/s, and of that a thousandth."""
    found = after({"q_x": 2.0, "q_y": 1.0, "f_x": 1e-9, "f_y": 1e-10}, WENT_BY)
    assert (found["f_x"], found["f_y"]) == pytest.approx((2e-5, 1e-5), rel=1e-12, abs=0.0)


def test_what_the_text_names_is_kept():
    assert after({"q_x": 2.0, "q_y": 1.0}, WENT_BY, nominal={"q_x": 5.0})["q_x"] == 5.0


# --- what a method is told --------------------------------------------------------------------------------------------


class Given:
    """Sizes of one run, of the unknowns that are stepped."""

    def __init__(self, magnitude):
        self.magnitude, self.met = magnitude, np.zeros_like(magnitude)

    def stepped(self, kept):
        return (self.magnitude, self.met) if kept is None else (self.magnitude[kept], self.met[kept])


def told(request, kept=None, index=2):
    system, y, _ = rod()
    found = roles(system, 0.0, system.jacobian(0.0, y, np.zeros_like(y))[1], index)
    found = found if kept is None else found.select(kept)
    return system, found, Told(system, request, Given(np.array([5.0, 5.0, 1.0, 1.0, 1e6])), found, kept)


@pytest.mark.long
def test_an_absolute_tolerance_asks_nothing_below_the_round_off_of_a_magnitude():
    atol = told(Request(1.0, np.zeros(0), atol=1e-8))[2].atol
    assert atol.tolist() == [1e-8] * 4 + [1e6 * ROUND_OFF]
    assert told(Request(1.0, np.zeros(0), atol=0.0))[2].atol == pytest.approx(
        ROUND_OFF * np.array([5.0, 5.0, 1.0, 1.0, 1e6]), rel=1e-14, abs=0.0
    )
    assert told(Request(1.0, np.zeros(0)))[2].atol is None


@pytest.mark.long
def test_of_fewer_unknowns_their_own_are_told_and_nothing_pulls_at_their_displacements():
    kept = np.array([1, 3, 4], dtype=np.int32)  # q_y, f_y, kappa_rod
    _, found, made = told(Request(1.0, np.zeros(0), atol=1e-8), kept)
    assert (made.atol.tolist(), made.magnitude.tolist()) == ([1e-8, 1e-8, 1e-6], [5.0, 1.0, 1e6])
    assert made.smooth.tolist() == [UNPULLED, int(found.smooth[1]), 0]
    whole = told(Request(1.0, np.zeros(0)))
    assert whole[2].smooth.tolist() == whole[1].smooth.astype(int).tolist()
    assert UNPULLED not in whole[2].smooth


@pytest.mark.parametrize(("method", "groups"), [("bdf", True), ("radau", False)])
@pytest.mark.long
def test_flows_of_which_differences_alone_are_states_are_told_to_the_bdf_as_groups(method, groups):
    """Inertia of a difference of two flows, beside one of its own."""
    system = system_of(models.small("a b c", "(f_a - f_b)**2/2 + f_c**2/2", 0, "f_a**2"))
    zero = np.zeros(system.unknowns)
    found = roles(system, 0.0, system.jacobian(0.0, zero, zero)[1], 1)
    request = Request(1.0, np.zeros(0), method=method)
    made = Told(system, request, Given(np.ones(system.unknowns)), found, None)
    if not groups:
        assert made.groups is None
        return
    begin, members = made.groups
    assert begin.tolist() == [0, 2]
    assert [system.name(k) for k in members] == ["f_a", "f_b"]
    core = SimpleNamespace(name="bdf", contents=SimpleNamespace())
    made.tell(core)
    assert core.contents.commons == 1
    assert not hasattr(core.contents, "smooth")  # radau's alone


# --- what a driver is told --------------------------------------------------------------------------------------------


def driver(observe, *, reads, rates=(), **asked):
    """Of the pendulum on a rod, with what its block observe reads."""
    made = models.small(
        "x y", "f_x**2 + f_y**2", "2*9.81*q_y", phi=ROD, observe=observe,
        initial={"q_x": (3.0, True), "q_y": (-4.0, False), "f_x": (0.0, True)},
    )  # fmt: skip
    structure = made[0]["structure"]
    names = [family["name"] for family in structure["families"]]
    for block in ("observe", "observe_scale"):
        for kernel in structure["blocks"][block]["kernels"]:
            kernel["reads"], kernel["rates"] = ([names.index(n) for n in found] for found in (reads, rates))
    system = system_of(made, "2")
    request = Request(1.0, np.array([0.0, 0.5, 1.0]), index=2, every_step=False, **asked)
    return Integration(system, consistent_start(system, 0.0), request)


@pytest.mark.parametrize(
    ("observe", "reads", "rates", "more", "bare"),
    [
        ("q_x", ["q_x"], [], {}, 1),
        ("kappa_rod", ["kappa_rod"], [], {}, 0),  # it follows from the state: rows have to be settled for it
        ("f_x_dot", [], ["f_x"], {}, 0),
        ("q_x", ["q_x"], [], {"audited": True}, 0),
    ],
)
@pytest.mark.long
def test_rows_of_the_state_alone_need_not_be_settled(observe, reads, rates, more, bare):
    assert driver({"z": observe}, reads=reads, rates=rates, **more).driver.run.bare == bare


@pytest.mark.parametrize(
    ("reads", "more", "unsummed"),
    [
        (["q_x"], {}, 1),
        (["q_x"], {"draft": True}, 2),
        (["audit.energy"], {}, 0),
        (["q_x"], {"audited": True}, 0),
    ],
)
@pytest.mark.long
def test_the_audit_is_left_to_the_run_that_is_kept_where_nothing_reads_it(reads, more, unsummed):
    assert driver({"z": "q_x"}, reads=reads, **more).driver.run.unsummed == unsummed


@pytest.mark.long
def test_rows_are_handed_over_once_and_the_largest_is_remembered():
    """From rest at (3, -4) it sinks for more than a second."""
    run, rows = driver({"z": "q_y"}, reads=["q_y"]), []
    run.run(rows.append)
    found = np.concatenate(rows)
    assert found[:, 0].tolist() == [0.0, 0.5, 1.0]
    run.driver.drain(rows.append)
    assert sum(len(block) for block in rows) == 3
    assert found.shape[1] == lib.ROW_HEAD + 2
    height = found[:, lib.ROW_HEAD]
    assert height[0] == pytest.approx(-4.0, abs=1e-12)
    assert (np.diff(height) < 0.0).all()
    assert run.driver.largest() == pytest.approx([-height[-1]], rel=1e-14)
