"""Constraints stated twice, and more: found by name, left out, least multipliers; singular configurations apart."""

import functools
import tempfile
from pathlib import Path

import numpy as np
import pytest
import small_models as models
from scipy.integrate import solve_ivp
from sysdyn import api
from sysdyn.runtime.accuracy.options import Options
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.failures import WrongOption
from sysdyn.runtime.model.system import System
from sysdyn.runtime.simulate import simulate
from sysdyn.runtime.start.start import consistent_start
from sysdyn.runtime.structure.structure import structure
from sysdyn.runtime.trace.trace import Trace

# references.json, redundant_pendulum (m = l = 1, from th = 1 at rest)
T = [0.0, 0.4, 1.0, 1.6, 2.4, 3.2, 4.0]
Q1 = [
    0.8414709848078965, 0.38292717471839827, -0.8305346852026649, -0.013072796467212065, 0.6654970164466453,
    -0.8413019081966436, 0.6382076790944643,
]  # fmt: skip


def pendulum(**more):
    return models.small(
        "1 2",
        "(f_1**2 + f_2**2)/2",
        "9.81*q_2",
        phi={"rod": "q_1**2 + q_2**2 - 1", "again": "2*(q_1**2 + q_2**2 - 1)", **more},
        initial={
            "q_1": (np.sin(1.0), True),
            "q_2": (-np.cos(1.0), False),
            "f_1": (0.0, True),
            "f_2": (0.0, False),
        },
        observe={"q1": "q_1", "k1": "kappa_rod", "k2": "kappa_again"},
    )


def facts_of(made):
    system = System(made[0], made[1], load(made[2]))
    return structure(system, consistent_start(system, 0.0))


def run(made, path, redundancy, **options):
    given = {"at": tuple(T), "accuracy": 1e-8, **options}
    outcome = simulate(made[0], made[1], load(made[2]), Options(path, 0.0, 4.0, redundancy=redundancy, **given))
    trace = Trace.open(path)
    at = [int(np.argmin(np.abs(trace.time - t))) for t in T]
    return outcome, {name: np.asarray(trace[name])[at] for name in trace.names}


@pytest.mark.long
def test_a_constraint_stated_twice_is_redundant_and_named():
    facts = facts_of(pendulum())
    assert (facts.redundant, facts.rank, facts.dof, facts.singular) == (1, 1, 1, 0)
    assert [label.label for label, _ in facts.dependent] == ["rod", "again"]
    assert facts.dependent[0][1] == pytest.approx(-2.0 * facts.dependent[1][1])
    assert len(facts.left_out) == 1


@functools.cache
def single():
    """The reaction of the one rod, with the other left out."""
    with tempfile.TemporaryDirectory() as folder:
        return run(pendulum(), Path(folder) / "s.h5", "drop", method="radau", accuracy=1e-9)[1]["k1"]


@pytest.mark.parametrize("index", ["auto", "3", "2v", "1"])
@pytest.mark.parametrize("redundancy", ["drop", "minimum_norm"])
@pytest.mark.parametrize("method", ["radau", "bdf"])
@pytest.mark.long
def test_the_motion_is_that_of_one_rod(tmp_path, redundancy, index, method):
    accuracy = 1e-6 if index == "3" or method == "bdf" else 1e-8
    _, found = run(pendulum(), tmp_path / "t.h5", redundancy, index=index, method=method, accuracy=accuracy)
    assert np.abs(found["q1"] - Q1).max() < 10.0 * accuracy
    # the reaction is one; its parts follow the policy
    whole = found["k1"] + 2 * found["k2"]
    assert whole == pytest.approx(single(), abs=100.0 * accuracy)
    if redundancy == "drop":
        assert np.abs(found["k2"]).max() < 1e-12
    else:
        assert found["k2"] == pytest.approx(2 * found["k1"], abs=1e-9)


@pytest.mark.long
def test_several_dependent_groups():
    made = pendulum(third="3*(q_1**2 + q_2**2 - 1)")
    facts = facts_of(made)
    assert (facts.redundant, facts.rank) == (2, 1)


def at_rest(phi, **values):
    names = " ".join(name.removeprefix("q_") for name in values)
    return models.small(
        names,
        " + ".join(f"f_{name}**2/2" for name in names.split()),
        "0",
        phi=phi,
        initial={name: (value, True) for name, value in values.items()}
        | {f"f_{name}": (0.0, True) for name in names.split()},
    )


def test_a_singular_configuration_is_not_redundant():
    # q_1 q_2 = 0 beside q_2 = 0 is redundant wherever both hold
    facts = facts_of(at_rest({"a": "q_1*q_2", "b": "q_2"}, q_1=1.0, q_2=0.0))
    assert (facts.redundant, facts.singular) == (1, 0)
    # two lines that cross: the gradient vanishes at the crossing alone
    facts = facts_of(at_rest({"a": "sin(q_1)**2 - sin(q_2)**2"}, q_1=0.0, q_2=0.0))
    assert (facts.redundant, facts.singular) == (0, 1)
    # both at once
    facts = facts_of(at_rest({"a": "q_1**2 - q_2**2", "b": "3*q_1**2 - 3*q_2**2"}, q_1=0.0, q_2=0.0))
    assert (facts.redundant, facts.singular) == (1, 1)
    facts = facts_of(at_rest({"a": "q_1 - 2*q_2", "b": "q_2*1e-9 - q_3"}, q_1=0.0, q_2=0.0, q_3=0.0))
    assert (facts.redundant, facts.singular) == (0, 0)


def test_what_does_not_hold_now_counts_for_no_rank():
    """An open contact stands before a row whose gradient vanishes at the start alone: one rank is lost, not two."""
    made = models.small(
        "1 2",
        "(f_1**2 + f_2**2)/2",
        psi={"contact": "f_1 - f_2", "crossing": "q_1*f_1 - q_2*f_2"},
        initial=dict.fromkeys(("q_1", "q_2", "f_1", "f_2"), (0.0, True)),
    )
    made[0]["structure"]["switches"] = [{"owner": "contact", "at": []}]
    system = System(made[0], made[1], load(made[2]))
    system.description.switches.set(np.array([False]))
    facts = structure(system, consistent_start(system, 0.0))
    assert (facts.m2, facts.redundant, facts.singular) == (1, 0, 1)


def test_what_is_no_policy(tmp_path):
    with pytest.raises(WrongOption, match="redundancy"):
        run(pendulum(), tmp_path / "t.h5", "maybe")


RODS = """
model rods {
  coord x: translation = 1.2 m
  coord y: translation ~ -1.7 m
  coord th: rotation ~ 0.01
  energy T* = 1/2*(3 kg)*(x'^2 + y'^2) + 1/2*(1 kg.m^2)*th'^2
  energy V = (3 kg)*g0*y
  phi left: (x - (1 m)*cos(th) + 1 m)^2 + (y - (1 m)*sin(th))^2 = (2 m)^2
  phi right: (x + (1 m)*cos(th) - 1 m)^2 + (y + (1 m)*sin(th))^2 = (2 m)^2
  phi mid: x^2 + y^2 = (2 m)^2
  init x' = 0 m/s
}
scene s of rods { time 0 s to 1 s; redundancy minimum_norm; trace x }
"""


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "kane"])
@pytest.mark.one_in(2)
def test_three_parallel_rods_are_one_too_many_in_every_formulation(formulation, tmp_path):
    """Points nearby were 1e11 rad away in Hamilton's form, where the balance of a turning that is nothing made the size
    of its angle (E512): the beam swings as a pendulum does.
    """
    path = tmp_path / "rods.sd"
    path.write_text(RODS, encoding="utf-8")
    trace = api.simulate(path, formulation=formulation, accuracy=1e-6, output=tmp_path / "rods.h5")
    swing = solve_ivp(lambda _, y: [y[1], -9.80665 / 2 * np.sin(y[0])], (0, 1), [np.arcsin(0.6), 0], rtol=1e-11)
    assert trace["x"].values[-1] == pytest.approx(2 * np.sin(swing.y[0, -1]), abs=1e-5)
