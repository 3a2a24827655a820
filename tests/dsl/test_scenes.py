"""What a scene says, in SI units; what its model offers to those who run it; units that instances solve for."""

from fractions import Fraction

import pytest
from sysdyn.dsl import load
from sysdyn.dsl.elaborate.instances.unit_variables import _solve_units
from sysdyn.dsl.elaborate.scenes.listing import ListedInstance, Readable, instances, readable
from sysdyn.dsl.elaborate.scenes.scenes import SceneReader
from sysdyn.dsl.model import dimensions as dim
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.units import NONE, find_unit, multiply, power_of
from sysdyn.dsl.model.values import Values
from sysdyn.dsl.text.diagnostics import Place, Report, SourceText

MODEL = """model m {
  param k = 3 N/m
  param n = 2
  param c[1..2] = [1, 2]
  input u: V = 1 V
  node x: translation
  M: kinetic(p = 1 kg*f) x
  S: potential(e = k*q) x
}
scene s of m {
"""


@pytest.fixture(autouse=True)
def fresh():
    with ex.fresh():
        yield


def read(body):
    """The scene, its reader and what is said of it (code, message, help, text)."""
    report, source = Report(), SourceText("m.sd", f"{MODEL}{body}\n}}\n")
    document = load.document(source, report)
    model, reader = load._elaborate(document, document.models["m"], document.scenes["s"], report, (), ())
    assert isinstance(reader, SceneReader)
    scene = reader.read(document.scenes["s"], Place(source, document.scenes["s"].name.span))
    said = [(d.code, d.message, d.help, source.text[d.place.span.start : d.place.span.end]) for d in report]
    return scene, (model, reader), said


def test_instants_and_steps_are_in_seconds():
    scene, _, said = read("time 500 ms to 2 min\ntrace x.q every 10 ms\nsolver bdf(order = 3, step = 1 ms)")
    assert said == []
    assert [evaluate([n], {}.__getitem__)[0] for n in (scene.start, scene.end, scene.every)] == [0.5, 120.0, 0.01]
    assert (scene.solver, [(name, n.data) for name, n in scene.solver_options]) == (
        "bdf", [("order", 3.0), ("step", 1e-3)],
    )  # fmt: skip


@pytest.mark.parametrize(
    ("body", "names"),
    [
        ("trace x.q in mm as far, x.f\naccuracy 1e-6 on far, x.f", ("far", "x.f")),
        ("trace x.q as k, k as q\naccuracy 1e-6 on k", ("q",)),  # what the model itself calls so goes first
        ("trace c[1..2] as cs\naccuracy 1e-6 on cs[2]", ("cs[2]",)),
    ],
)
def test_an_accuracy_is_of_what_the_trace_calls_so(body, names):
    scene, _, said = read(body)
    assert (said, tuple(name for name, _ in scene.accuracy_on)) == ([], names)


@pytest.mark.parametrize(
    ("body", "rest", "on", "codes"),
    [
        ("accuracy 1e-3\naccuracy 1e-6 on x.f", 1e-3, {"x.f": 1e-6}, []),
        ("accuracy 1e-6 on x.f\naccuracy 1e-5 on x.q", None, {"x.f": 1e-6, "x.q": 1e-5}, []),
        ("accuracy 1e-3\naccuracy 1e-4", 1e-3, {}, ["E106"]),
        ("accuracy 1e-3 on x.q\naccuracy 1e-4 on x.f, x.q", None, {"x.q": 1e-3}, ["E106"]),
    ],
)
def test_accuracies_of_all_and_of_some(body, rest, on, codes):
    scene, _, said = read(f"trace x.q, x.f\n{body}")
    assert ([code for code, *_ in said], {n: w.data for n, w in scene.accuracy_on}) == (codes, on)
    assert (scene.accuracy and scene.accuracy.data) == rest


def test_what_is_said_of_a_run():
    body = "formulation kane\nredundancy minimum_norm\nlimit steps 100\nlimit events 5\nsolver radau(keep_flow = true)"
    scene, _, said = read(f"{body}\ntrace x.q, x.f every 1 s\naccuracy 1e-6 on x.f")
    assert said == []
    assert (scene.formulation, scene.redundancy, scene.accuracy) == ("kane", "minimum_norm", None)
    assert [(name, n.data) for name, n in scene.limits] == [("steps", 100.0), ("events", 5.0)]
    assert [(name, n.data) for name, n in scene.accuracy_on] == [("x.f", 1e-6)]
    assert (scene.keeps("keep_flow"), scene.keeps("keep_implicit")) == (True, False)


def test_a_quantity_is_traced_in_its_unit_under_its_name():
    """At 10 m/s 36 km/h; 6 N times 10 m/s are 0.06 kW."""
    _, (_, reader), said = read("trace x.q, x.f in km/h as v, S.e*x.f in kW as power every 1 s")
    assert said == []
    at = {ex.var("x", "nq"): 2.0, ex.var("x", "nf"): 10.0, ex.var("S", "be"): 6.0}
    found = {o.name: (o.unit.text, o.expression) for o in reader.observations}
    assert {name: unit for name, (unit, _) in found.items()} == {"x.q": "m", "v": "km/h", "power": "kW"}
    shown = evaluate([node for _, node in found.values()], lambda n: at[n])
    assert shown == pytest.approx([2.0, 36.0, 0.06], rel=1e-15)


def test_settings_replace_values_elements_and_inputs():
    _, (model, reader), said = read("set k = 4 N/cm\nset n = 5\nset c[2] = 7\nset u = 2 V")
    assert said == []
    values = Values(model.parts.parameters, reader.elements)
    assert [values.number(ex.param(name)) for name in ("k", "n", "u")] == [400.0, 5.0, 2.0]
    assert [values.element("c", k) for k in (1, 2)] == [1.0, 7.0]


@pytest.mark.parametrize(
    ("body", "code", "message", "help_", "at"),
    [
        ("time 2 s to 1 s", "E912", "the time ends before it starts: 2 s to 1 s", "time 1 s to 2 s", "time 2 s to 1 s"),
        ("time 2 s to 2 s", "E912", "the time ends where it starts: 2 s to 2 s", "time 2 s to 10 s", "time 2 s to 2 s"),
        ("time 0 s to inf", "E912", "'inf' is no instant: a run begins and ends", "time 0 s to 10 s",
         "time 0 s to inf"),
        ("time 0 m to 1 s", "E208", "the start '0 m' is in m, wants s", "write '0 s'", "0 m"),
        ("accuracy 2", "E906", "accuracy 2: from 1e-13 to less than 1, what doubles can tell", "accuracy 1e-6", "2"),
        ("trace x.q every 1 s\naccuracy 1e-6 on x.f", "E906",
         "the accuracy of 'x.f' is asked for, but it is not traced", "trace x.f", "x.f"),
        ("formulation lagrange", "E607", "there is no formulation 'lagrange'", "'lagrangian'", "lagrange"),
        ("solver bfd", "E607", "there is no solver 'bfd'", "'bdf'", "bfd"),
        ("redundancy none", "E607", "there is no redundancy 'none'", "one of error, drop, minimum_norm", "none"),
        ("solver bdf(oder = 3)", "E405", "the solver has no option 'oder'",
         "order = .., index = .., step = .., longest = .., keep_implicit = .., keep_flow = ..", "oder = 3"),
        ("solver bdf(keep_flow = n > 1)", "E405",
         "keep_flow changes which unknowns there are: it does not depend on values", "true or false", "n > 1"),
        ("limit cows 3", "E113", "there is no limit 'cows'", "limit steps, limit events", "cows"),
        ("set kk = 3", "E910", "'kk' is not a parameter or input of model 'm'", "nearest: 'k'", "kk"),
        (
            "set x = 3 m",
            "E910",
            "'x' is not a parameter or input of model 'm'",
            "init x = ... sets an initial value",
            "x",
        ),
        ("set k = 3 s", "E207", "'k' is in N/m but set to s", "write '3 N/m'", "3 s"),
        ("set k = -1/3", "E207", "'k' is in N/m but set to dimensionless", "(-1/3)*(1 kg/s^2)", "-1/3"),
        ("trace x.q in s every 1 s", "E208", "'x.q' is in m, not s", "in m", "s"),
        ("trace x.q as time every 1 s", "E911", "trace name 'time' belongs to the trace itself",
         "another name with 'as'", "time"),
        ("trace x.q as a, x.f as a every 1 s", "E106", "'a' is traced twice", "another name with 'as'", "a"),
        ("set k = 3 N/m\nset k = 4 N/m", "E106", "the scene gives 'k' twice", "one of the two", "k"),
        ("set u = 3 V\nset u = 3 V", "E106", "the scene gives 'u' twice", "one of the two", "u"),
        ("set c[2] = 3\nset c[ 2 ] = 4", "E106", "the scene gives 'c[2]' twice", "one of the two", "c[ 2 ]"),
        ("limit steps 3\nlimit events 2\nlimit steps 4", "E106", "the scene says 'limit steps' twice",
         "another name for one of them, or delete it", "limit steps 4"),
        ("solver bdf(order = 3, order = 4)", "E106", "'order' of the solver is given twice",
         "another name for one of them, or delete it", "order = 4"),
        ("level S = a\nlevel S = b", "E106", "the scene gives 'S' twice", "one of the two", "S"),
        ("time 0 s to 1 s\ntime 0 s to 2 s", "E106", "the scene says 'time' twice",
         "another name for one of them, or delete it", "time 0 s to 2 s"),
    ],
)  # fmt: skip
def test_what_a_scene_cannot_say(body, code, message, help_, at):
    assert read(body)[2] == [(code, message, help_, at)]


# -- what can be read ---------------------------------------------------------------------------------------------

LISTED = """component cell {
  param C = 2 F
  port p: electrical
  level fine {
    X: potential(q = C*e) p -> ground
  }
  level none {
    X: effort(e = 0 V) p -> ground
  }
}
model m {
  param n = 3
  node a[1..n]: electrical
  for i in 1..n {
    c[i]: cell.fine() p = a[i]
    R[i]: dissipator(e = 1 ohm*f) a[i] -> ground
  }
  let total = sum(i in 1..n: R[i].f)
}
"""


def test_names_that_can_be_read_with_their_units():
    document = load.document(SourceText("m.sd", LISTED), Report())
    report = Report()
    model, _ = load._elaborate(document, document.models["m"], None, report, (), ())
    assert list(report) == []
    assert instances(model) == (ListedInstance("c", "cell", ("fine", "none"), "fine"),)
    found = readable(model, Values(model.parts.parameters, []))
    by_name = {r.name: r for r in found}
    assert by_name["c[1..3].X.V"] == Readable("c[1..3].X.V", "c[1..3].X", "element", "J")
    assert "total" in by_name
    assert {name: by_name[f"R[1..3].{name}"].unit for name in ("e", "f", "q", "p", "power")} == {
        "e": "V", "f": "A", "q": "C", "p": "Wb", "power": "W",
    }  # fmt: skip
    assert by_name["a[1..3].e"].unit == "V"
    assert "audit.energy" in by_name


# -- units that instances solve for ------------------------------------------------------------------------------


class RefusedError(Exception):
    """What a frame's resolver raises."""


class Frame:
    """What is asked of an elaboration where units contradict each other: to say so."""

    resolver = property(lambda self: self)

    def fail(self, code, message, span, help=None):
        return RefusedError(code, message)


class Statement:
    span, decl = None, type("Decl", (), {"name": "pid"})


def unit(text):
    """Dimension of a product of units with exponents: "V rad^-1"."""
    found = NONE
    for factor in text.split():
        name, _, power = factor.partition("^")
        found = multiply(found, find_unit(name)[0], int(power or 1))
    return found


def solved(*equations):
    """Units of variables from ({variable: exponent}, unit text)."""
    rows = [
        ({n: Fraction(e) for n, e in left.items()}, unit(right), f"p{k}") for k, (left, right) in enumerate(equations)
    ]
    names = {n for left, _ in equations for n in left}
    return {n: dim.show(d) for n, d in _solve_units(Frame(), Statement(), names, rows, {}).items()}


def test_units_follow_from_what_an_instance_is_given():
    """kp: $y/$u in V/rad, r: $u in rad; and where squares and products are given, roots."""
    assert solved(({"$y": 1, "$u": -1}, "V m^-1"), ({"$u": 1}, "m")) == {"$u": "m", "$y": "V"}
    assert solved(({"$y": 1, "$u": 1}, "N m"), ({"$y": 1, "$u": -1}, "N m^-1")) == {"$u": "m", "$y": "N"}
    assert solved(
        ({"$u": 2}, "m^3"),
    ) == {"$u": "m^1.5"}
    assert solved(({"$u": 1}, "s"), ({"$u": 3}, "s^3")) == {"$u": "s"}
    assert power_of(unit("m^3"), Fraction(1, 2))[0][1] == Fraction(3, 2)


def test_units_that_are_open_or_contradict_each_other():
    with pytest.raises(RefusedError) as error:
        solved(({"$y": 1, "$u": -1}, "V m^-1"))
    assert error.value.args == ("E209", "unit variable $y of 'pid' is not determined")
    with pytest.raises(RefusedError) as error:
        solved(({"$u": 1}, "m"), ({"$u": 2}, "m s"))
    assert error.value.args == ("E209", "the unit variables of 'pid' contradict each other at 'p1' (off by s/m)")
    with pytest.raises(RefusedError) as error:  # all but the second agree
        solved(({"$y": 1, "$u": -1}, "V m^-1"), ({"$y": 1, "$u": -1}, "V"), ({"$u": 1}, "m"), ({"$y": 1}, "V"))
    assert error.value.args == ("E209", "'p1' of 'pid' contradicts what the others say of its unit")


ARRAYS = """model a {
  param n = 3
  coord x[1..n]: translation
  coord z[1..2, 1..n]: translation
  energy T* = sum(i in 1..n: 1/2*1 kg*(x[i]'^2 + z[1, i]'^2 + z[2, i]'^2))
  energy V = 1/2*10 N/m*norm(x[1..2])^2
}
scene s of a { time 0 s to 1 s; TRACE }
"""


def traced(items, *settings):
    """Names of what a scene traces, what is said (code, message)."""
    report = Report()
    document = load.document(SourceText("m.sd", ARRAYS.replace("TRACE", f"trace {items}")), report)
    scene = document.scenes["s"]
    _, reader = load._elaborate(document, document.models["a"], scene, report, settings, ())
    reader.read(scene, Place(document.file.source, scene.span))
    return [o.name for o in reader.observations], [(d.code, d.message) for d in report]


def test_ranges_are_traced_element_by_element():
    assert traced("x[1..n] in mm, x[2..n]' as v") == (["x[1]", "x[2]", "x[3]", "v[2]", "v[3]"], [])
    assert traced("z[1..2, n - 1..n]") == (["z[1, 2]", "z[1, 3]", "z[2, 2]", "z[2, 3]"], [])
    assert traced("z[1..2, 1] as far") == (["far[1]", "far[2]"], [])


def test_a_range_beyond_its_array_is_said():
    _, said = traced("x[1..5]")
    assert said == []  # bounds are judged with the sizes of a run
    assert traced("x[1..n]", ("n", "5"))[0] == [f"x[{k}]" for k in range(1, 6)]
