"""Which form and method a simulation takes and in which order method auto tries them: by the rules, on small models."""

from dataclasses import replace
from types import SimpleNamespace

import pytest
import small_models as models
from sysdyn.cli.run.prepare import prepare
from sysdyn.dsl import load as text
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.dsl.text.source import SourceText
from sysdyn.runtime.accuracy import controlled
from sysdyn.runtime.accuracy.alternatives import NOT_STIFF, SMALL, alternatives
from sysdyn.runtime.accuracy.options import Options, choose_index, choose_method, own_tolerances
from sysdyn.runtime.accuracy.way import Way
from sysdyn.runtime.integrate.underlying import obstacle, rateless, underlying_form
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.description import describe
from sysdyn.runtime.model.failures import NoSuchForm, SolverFailure, WrongOption
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.start import consistent_start

AUTO = Options(None, 0.0, 1.0)
STEEP = """
from std.electrical import resistor, capacitor, diode, voltage
model m {
  node a, b: electrical
  Vs: voltage(v = 5 V*sin(2*pi*(50 Hz)*t)) a -> ground
  D: diode() a -> b
  C: capacitor(C = 100 uF) b -> ground
  R: resistor(R = 1 kohm) b -> ground
  init C.e = 0 V
}
scene s of m { time 0 s to 1 s; trace C.e }
"""


def written(made):
    system = System(made[0], made[1], load(made[2]), "3")
    return system, consistent_start(system, 0.0)


def tried(made, form, index, options=AUTO, method="radau"):
    """Methods with the names of their forms, in their order; why the first is taken."""
    system, start = made
    taken = system if form == "3" else system.another(form)
    ways = alternatives(Way(method, taken, index, form), system, start, options)
    return [f"{way.method} {way.name}" for way in ways], ways[0].reason


def facts(index):
    return SimpleNamespace(index=index)


@pytest.mark.long
def test_the_explicit_method_is_first_where_rates_follow_and_of_index_1_one_without_newtons_iteration():
    spring = written(models.mass_spring())
    assert tried(spring, "3", 1) == (["dopri 0", "rosenbrock 3", "radau 3", "bdf 3"], NOT_STIFF)
    assert tried(written(models.pendulum()), "2", 2) == (["dopri 0", "radau 2", "bdf 2"], NOT_STIFF)


@pytest.mark.parametrize(
    ("more", "tried_too"),
    [
        ({"accuracy": 1e-6}, True),
        ({"accuracy": 9e-7}, False),
        ({"accuracy": 1e-2, "accuracy_on": (("q_x", 1e-8),)}, False),  # the finest counts
        ({"accuracy": None, "accuracy_on": (("q_x", 1e-3),)}, True),
        ({"accuracy": None}, True),
    ],
)
@pytest.mark.one_in(3)
def test_fine_accuracies_ask_for_more_stages(more, tried_too):
    found, _ = tried(written(models.mass_spring()), "3", 1, replace(AUTO, **more))
    assert ("rosenbrock 3" in found) == tried_too


def test_what_was_asked_for_is_kept_and_only_another_implicit_method_may_take_over():
    pendulum = written(models.pendulum())
    for method, other in (("radau", "bdf"), ("bdf", "radau")):
        assert tried(pendulum, "2v", 2, replace(AUTO, rtol=1e-6), method) == ([f"{method} 2v", f"{other} 2v"], "")
    assert tried(pendulum, "2v", 2, replace(AUTO, index="2v")) == (["radau 2v", "bdf 2v"], "index 2v was asked for")
    happen = replace(AUTO, events=SimpleNamespace(bends=(), of_laws=()))
    assert tried(pendulum, "2", 2, happen) == (["radau 2", "bdf 2"], "events")
    # kinks of laws, that no event changes, are integrated by the explicit method as well
    assert tried(pendulum, "2", 2, replace(AUTO, events=SimpleNamespace(bends=(1,))))[0][0] == "dopri 0"


def test_where_the_underlying_equation_was_asked_for_the_implicit_methods_take_over_on_it():
    found = tried(written(models.pendulum()), "0", 1, replace(AUTO, index="0"), "dopri")
    assert found == (["dopri 0", "radau 0", "bdf 0"], NOT_STIFF)


@pytest.mark.long
def test_without_an_explicit_equation_the_reason_names_what_has_no_rate():
    """A node of springs without a mass, and a torque that follows from a current through algebra alone."""
    found, why = tried(written(models.springs()), "3", 1)
    assert (found, why) == (["rosenbrock 3", "radau 3", "bdf 3"], "no explicit equation for f_y")


def said(model):
    """As `written`, of a text."""
    report = Report()
    document = text.document(SourceText("m.sd", model), report)
    network = text.network(document, document.models["m"], document.scenes["s"], report)
    made = prepare(network, report, backend="numpy")
    system = System.from_description(describe(made.manifest, made.arrays), made.carrier, "3")
    return system, consistent_start(system, 0.0)


@pytest.mark.long
def test_steep_laws_are_the_bdfs_before_radaus_of_many_unknowns_too():
    many = said(STEEP.replace("  C:", "  for k in 1..60 { E[k]: diode() b -> ground }\n  C:"))
    assert many[0].unknowns > SMALL
    assert tried(many, "3", 1) == (["bdf 3", "radau 3"], "steep laws")
    system, start = said(STEEP)
    assert tried((system, start), "3", 1) == (["rosenbrock 3", "bdf 3", "radau 3"], "steep laws")
    # of index 2 there is no method without iteration, but radau where constraints hold by their derivatives
    assert tried((system, start), "3", 2) == (["bdf 3", "radau 3", "radau 1"], "steep laws")
    happen = replace(AUTO, events=SimpleNamespace(bends=(1,)))
    assert tried((system, start), "3", 2, happen)[0] == ["bdf 3", "radau 3"]


PIPES = """
model m {{
  node v[1..8]: hydraulic
  vessel: potential(e = 49 Pa/m^3*q) v[8] -> ground
  P1: dissipator({law}) v[1] -> ground
  for k in 2..8 {{ P[k]: dissipator({law}) v[k] -> v[k-1] }}
  for k in 1..8 {{ L[k]: kinetic(p = 1e6 kg/m^4*f) v[k] -> ground }}
  init vessel.e = 2 Pa
}}
scene s of m {{ time 0 s to 3600 s; trace vessel.e }}
"""


@pytest.mark.parametrize(
    ("law", "first"),
    [
        ("e = (if abs(f) > 1e-3 m^3/s then 3 Pa.s/m^3 else 2 Pa.s/m^3)*f", "rosenbrock 1"),
        ("f = 1e-9 m^3/s*(exp(e/(0.01 Pa)) - 1)", "bdf 2"),
    ],
)
@pytest.mark.long
def test_steep_laws_that_do_not_turn_need_no_newton_iteration(law, first):
    made = said(PIPES.format(law=law))
    assert tried(made, "2", 2)[0][0] == first


# --- the form and the first method ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("wanted", "index", "method", "found"),
    [
        ("auto", 1, "auto", ("3", 1)),
        ("auto", 2, "auto", ("3", 2)),
        ("auto", 3, "auto", ("2", 2)),  # stabilised
        ("auto", None, "auto", ("3", 2)),
        ("auto", 3, "dopri", ("0", 1)),
        ("0", 3, "auto", ("0", 1)),
        ("auto", 1, "rosenbrock", ("3", 1)),
        ("auto", 3, "rosenbrock", ("1", 1)),
        ("1", 3, "rosenbrock", ("1", 1)),
        ("3", 3, "auto", ("3", 3)),
        ("2", 3, "auto", ("2", 2)),
        ("2", 2, "auto", ("3", 2)),
        ("2v", 3, "auto", ("2v", 2)),
        ("2v", 1, "auto", ("2v", 1)),
        ("1", 3, "auto", ("1", 1)),
    ],
)
@pytest.mark.one_in(12)
def test_the_form_and_its_index(wanted, index, method, found):
    assert choose_index(wanted, facts(index), method)[:2] == found


def test_forms_that_a_method_cannot_step_are_refused_and_doubtful_ones_are_said():
    with pytest.raises(NoSuchForm, match="dopri integrates the underlying equation, index 0, and index 2 was asked"):
        choose_index("2", facts(3), "dopri")
    with pytest.raises(NoSuchForm, match="rosenbrock integrates equations of index 1, and index 2 was asked"):
        choose_index("2", facts(3), "rosenbrock")
    assert choose_index("2", facts(1), "rosenbrock")[:2] == ("3", 1)  # of index 1 as it is written
    with pytest.raises(WrongOption, match="index 7"):
        choose_index("7", facts(3))
    notes = {(w, i): choose_index(w, facts(i))[2] for w, i in (("3", 3), ("3", 2), ("auto", None))}
    assert [len(note) for note in notes.values()] == [1, 0, 1]
    assert "100 times less accurate" in notes["3", 3][0]
    for wanted, method in (("auto", "auto"), ("3", "bdf"), ("2", "radau"), ("1", "rosenbrock")):
        with pytest.raises(NoSuchForm, match="the index is 4, and nothing above 3 is integrated"):
            choose_index(wanted, facts(4), method)


def test_the_first_method():
    assert choose_method(AUTO) == "radau"
    assert choose_method(replace(AUTO, rtol=1e-6)) == choose_method(replace(AUTO, atol=1e-6)) == "bdf"
    assert choose_method(replace(AUTO, index="0", rtol=1e-6)) == "dopri"
    assert choose_method(replace(AUTO, method="energy", rtol=1e-6)) == "energy"
    with pytest.raises(WrongOption, match="method rk4"):
        choose_method(replace(AUTO, method="rk4"))
    assert [own_tolerances(replace(AUTO, **more)) for more in ({}, {"rtol": 0.0}, {"atol": 0.0})] == [False, True, True]


# --- whether there is an underlying equation --------------------------------------------------------------------------


def unknown(made):
    """What of form 0 has no rate; what leaves it undetermined, before and after constraints stand as they are."""
    system, start = written(made)
    other = system.another("0")
    found, left = underlying_form(other, start)
    return list(rateless(other, start)), list(obstacle(other, start)), found.form.name, list(left)


@pytest.mark.long
def test_masses_have_rates_and_what_springs_alone_hold_has_none():
    assert unknown(models.mass_spring()) == ([], [], "0", [])
    assert unknown(models.pendulum()) == ([], [], "0", [])
    assert unknown(models.springs())[0] == ["f_y"]


@pytest.mark.long
def test_a_massless_coordinate_that_a_constraint_determines_is_solved_for():
    """y = 2 x without inertia: the constraint itself, not its second derivative, gives y."""
    made = models.small(
        "x y", "f_x**2/2", "q_x**2/2", phi={"gear": "q_y - 2*q_x"}, initial={"q_x": (1, True), "f_x": (0, True)}
    )
    assert unknown(made)[0] == []


@pytest.mark.long
def test_the_current_of_a_capacitor_is_solved_for_from_kirchhoffs_law_as_it_is():
    """Of three coordinates without inertia no constraint that is differentiated gives a rate; the node gives a flow."""
    made = models.lead_filter()
    found, missing, form, left = unknown(made)
    assert found == missing == ["f_1'", "f_2'", "f_3'"]
    node = written(made)[0].description.rows_of("phi")[0]
    assert (form, left) == (f"0/{node}", [])


@pytest.mark.long
def test_two_capacitors_in_parallel_have_no_underlying_equation():
    tied = models.small("a b", 0, "q_a**2/2 + q_b**2/2", phi={"tie": "q_a - q_b - 1"})
    found, missing, form, left = unknown(tied)
    assert found == missing == left != []
    assert form == "0"


class Taken:
    """What `_chosen` asks of runs: ways as they are taken, with the steps that a draft may take."""

    def __init__(self, way):
        self.way, self.system, self.options = way, way.system, AUTO
        self.patience = self.patience_with_draft = None
        self.seen = []

    @property
    def method(self):
        return self.way.method

    @property
    def most_steps(self):
        return self.patience_with_draft

    def take(self, way):
        self.way = way


@pytest.mark.parametrize("ends", ["dopri", "radau"])
def test_the_explicit_method_goes_on_once_where_radau_takes_more_steps(monkeypatch, ends):
    """Its steps of 2 ms leave it 500 in a second, which a draft of radau may take; behind that nobody has a limit."""

    def achieved(runs, options, **_):
        runs.seen.append((runs.method, runs.way.lasting, runs.most_steps))
        if runs.method == "dopri" and (ends == "radau" or not runs.way.lasting):
            raise SolverFailure("stiff", 0.1, 2e-3)
        if runs.method == "radau" and runs.most_steps is not None:
            raise SolverFailure("max_steps", 0.5, 1e-3)
        return SimpleNamespace(met=True)

    monkeypatch.setattr(controlled, "_run_one_method", achieved)
    plain = SimpleNamespace(form=SimpleNamespace(scales=()))
    ways = [Way(method, plain, 1, "0") for method in ("dopri", "radau", "bdf")]
    runs = Taken(ways[0])
    assert controlled._chosen(runs, AUTO, tuple(ways[1:])).met
    expected = [("dopri", False, None), ("radau", False, 500), ("dopri", True, None), ("radau", False, None)]
    assert runs.seen == (expected if ends == "radau" else expected[:3])
