"""Which unknowns the starts of many runs take from the text: by hand, for springs and points on rods."""

import numpy as np
import pytest
import small_models as models
from sysdyn.runtime.accuracy.options import Options
from sysdyn.runtime.integrate.integrate import Integration
from sysdyn.runtime.integrate.request import Request
from sysdyn.runtime.many import anchors as module
from sysdyn.runtime.many.anchors import anchors
from sysdyn.runtime.many.asked import WHY, way_of
from sysdyn.runtime.many.batch import Batch
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.start import consistent_start
from sysdyn.runtime.structure.structure import structure

ROD = {"rod": "q_x**2 + q_y**2 - 25"}


def anchored(*parts, **more):
    """Names of the anchors; None where the rows leave something open beside them."""
    manifest, binding, code = models.small(*parts, **more)
    system = System(manifest, binding, load(code), "2")
    start = consistent_start(system, 0.0)
    made = Integration(system, start, Request(1.0, np.array([0.0, 1.0]), index=2, condense=False))
    n = system.form.written
    found = anchors(made.settler, system, 0.0, (start.y[:n], start.yd[:n]), made.sizes.magnitude)
    return None if found is None else {system.name(k) for k in np.flatnonzero(found)}


@pytest.mark.parametrize("fixed", [True, False])
@pytest.mark.long
def test_what_is_written_and_does_not_move_is_an_anchor(fixed):
    written = {"q_x": (0.5, fixed), "f_x": (1.0, fixed)}
    assert anchored("x", "f_x**2", "4*q_x**2", initial=written) == {"q_x", "f_x"}


@pytest.mark.long
def test_what_nobody_wrote_stays_where_it_was_guessed_if_nothing_determines_it():
    assert anchored("x", "f_x**2", "4*q_x**2") == {"q_x", "f_x"}
    assert anchored("x", "f_x**2", "4*q_x**2", initial={"q_x": (0.5, True)}) == {"q_x", "f_x"}


@pytest.mark.long
def test_what_moved_for_the_sake_of_a_constraint_is_none():
    """On the rod of 5 m y goes from -2 to -4; as its flow then follows, it is none either."""
    written = {"q_x": (3.0, True), "q_y": (-2.0, False), "f_x": (1.0, True)}
    assert anchored("x y", "f_x**2 + f_y**2", "2*9.81*q_y", phi=ROD, initial=written) == {"q_x", "f_x"}


def test_where_everything_written_had_to_move_the_start_is_not_unique():
    """From (2, -2) to the nearest point of the rod: another run would begin on another point of it."""
    written = {"q_x": (2.0, False), "q_y": (-2.0, False)}
    assert anchored("x y", "f_x**2 + f_y**2", "2*9.81*q_y", phi=ROD, initial=written) is None
    assert anchored("x y", "f_x**2 + f_y**2", phi={"sum": "q_x + q_y - 2"}) is None  # nor if nothing is written


def test_multipliers_of_a_constraint_that_stands_twice_are_open():
    written = {"q_x": (3.0, True), "q_y": (-4.0, False), "f_x": (0.0, True)}
    twice = {**ROD, "again": "2*(q_x**2 + q_y**2 - 25)"}
    assert anchored("x y", "f_x**2 + f_y**2", "2*9.81*q_y", phi=twice, initial=written) is None


def test_a_guess_that_happens_to_be_right_is_an_anchor_and_a_run_in_which_it_is_not_has_no_result():
    """A damper pulled by a spring, f = -4 q, with f guessed at -4: from q = 2 the core must not move q instead."""
    written = {"q_x": (1.0, True), "f_x": (-4.0, False)}
    assert anchored("x", 0, "4*q_x**2/2", "f_x**2/2", initial=written) == {"q_x", "f_x"}
    manifest, binding, code = models.small("x", 0, "4*q_x**2/2", "f_x**2/2", initial=written)
    system = System(manifest, binding, load(code))
    start, options = consistent_start(system, 0.0), Options(None, 0.0, 1.0, accuracy=1e-6)
    way, start = way_of(system, start, structure(system, start), options, "radau")
    made = Batch(way, start, options)
    found = made.run(np.zeros((2, 0)), np.array([[1.0, -4.0], [2.0, -4.0]]))
    assert [WHY[k] for k in found.state] == ["", "start"]
    assert found.end[0, made.columns.index("q_x")] == pytest.approx(np.exp(-4.0), abs=2e-6)


def test_large_systems_are_not_looked_at(monkeypatch):
    monkeypatch.setattr(module, "LARGEST", 2)
    assert anchored("x", "f_x**2", "4*q_x**2") is None
