"""What the last good state of a run that stopped says of the cause: sentences by hand at states in closed form."""

import numpy as np
import pytest
from sysdyn.cli.run.prepare import prepare
from sysdyn.cli.run.verdict.last_state import LastState
from sysdyn.dsl import load
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.dsl.text.source import SourceText
from sysdyn.runtime.model.system import System

ROD = """model m {
  coord x, y: translation = 0 m
  energy T* = 1/2*(1 kg)*x'^2 + 1/2*(1 kg)*y'^2
  energy V = 3 N/m*x^2 + 1 N.m*ln(x/(1 m))
  work (8 N)*y/(1 m) on y
  phi rod: x^2 + y^2 = 4 m^2
}
"""
START = {"x": 2.0, "y": 0.0, "x'": 0.0, "y'": 1.0}


@pytest.fixture(autouse=True)
def nodes():
    """Expressions of their own for each test."""
    with ex.fresh():
        yield


def last(text, **values):
    """At these values of the unknowns, zero else; what makes the vector of another point."""
    report = Report()
    document = load.document(SourceText("m.sd", text), report)
    network = load.network(document, document.models["m"], None, report)
    assert network is not None, [d.message for d in report]
    made = prepare(network, report, formulation="lagrangian", backend="numpy")
    system = System(made.structure, made.arrays, made.carrier)

    def point(known):
        return np.array([known.get(name, 0.0) for name in system.unknown_names])

    return LastState(made, system, 1.5, point(values)), point


def test_unknowns_are_told_in_the_author_s_names_and_units():
    of, _ = last(ROD, **{**START, "y'": -4.0})
    assert of.some_values() == "x = 2 m, y = 0 m, x' = 0 m/s, y' = -4 m/s"


def test_what_has_grown_most_beyond_all_bounds_is_told():
    """A millionfold of where it was, or of one where it was less."""
    of, point = last(ROD, **{"x": 1e5, "y": 1e7, "x'": 5e6, "y'": 0.0})
    assert of.unbounded_growth(point(START)) == "y = 1e+07 m grows without bound"
    of, point = last(ROD, **{"x": 1e5, "y": 1e5, "x'": 1e5, "y'": 0.0})
    assert of.unbounded_growth(point(START)) is None


@pytest.mark.parametrize(("x", "told"), [(1e-7, True), (1e-3, False)])
def test_a_logarithm_whose_argument_vanishes_is_told(x, told):
    of, point = last(ROD, x=x, y=2.0)
    found = of.vanishing(point(START))
    assert (found is not None) == told
    if told:
        assert found.startswith("the argument of a logarithm goes to zero: ")
        assert found.endswith("x = 1e-07 m")


@pytest.mark.parametrize(("places", "names"), [({"x": 1e-4, "y": 1e-4}, []), ({"x": 0.0, "y": 0.0}, ["rod"])])
def test_constraints_whose_gradients_vanish_are_told(places, names):
    """Gradients count by their direction: (2 x, 2 y) has one however short it is, but where it is zero."""
    of, _ = last(ROD, **places)
    assert [c.name for c in of.dependent()] == names


def test_two_constraints_that_have_become_one_are_told():
    """At x = 0 the circle and the line y = 2 m touch."""
    line = ROD.replace("}\n", "  phi line: y = 2 m\n}\n")
    apart, together = last(line, x=1.0, y=np.sqrt(3.0)), last(line, x=1e-6, y=2.0)
    assert apart[0].dependent() == []
    assert {c.name for c in together[0].dependent()} == {"rod", "line"}
    assert together[0].dependent(start=together[1]({"x": 1e-6, "y": 2.0})) == []  # they were so at the start


@pytest.mark.parametrize(("y", "line"), [(1.0, 5), (0.0, None)])
def test_the_statement_that_drives_an_unknown_most(y, line):
    """8 N/m y pushes y, which no potential holds; at y = 0 nothing does."""
    of, _ = last(ROD, x=1.0, y=y)
    found = of.statement("y'")
    assert (None if found is None else found.start[0]) == line


def test_the_stiffest_of_several_statements():
    """x is pulled by 6 N/m x + 1/x: one energy, in line 4."""
    of, _ = last(ROD, x=1.0)
    assert of.statement("x").start[0] == 4


def test_a_divisor_that_a_loop_counts_tells_nothing():
    """`i` is no unknown: a run that stopped ended with E807 where its finding should stand."""
    of, point = last(
        "model m {\n  for i in 1..2 {\n    state s[i] = 1\n    dynamic s[i]' = -1/(s[i]*i*(2 s))\n  }\n}\n",
        **{"s[1]": 1e-9},
    )
    assert of.vanishing(point({"s[1]": 1.0})) is None
