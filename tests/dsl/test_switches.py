"""Events and inequalities of arrays, one by one: which elements there are, their names, what they watch; by hand."""

import pytest
from sysdyn.dsl import load
from sysdyn.dsl.model import budget
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.expression_text import to_text
from sysdyn.dsl.model.network import Loop
from sysdyn.dsl.model.values import Values
from sysdyn.dsl.text.diagnostics import Report, SourceText

MODEL = """model m {{
  param n = 3
  coord x[1..n]: translation
  energy T* = sum(i in 1..n: 1/2*(1 kg)*x[i]'^2)
  discrete hits = 0
  {}
}}
scene s of m {{ time 0 s to 1 s; trace hits }}
"""


def network(body):
    report = Report()
    document = load.document(SourceText("m.sd", MODEL.format(body)), report)
    found = load.network(document, document.models["m"], document.scenes["s"], report)
    assert found is not None, [d.message for d in report]
    return found


def conditions(body):
    """Of each event the expression that it watches."""
    found = network(body)
    watched = {o.name: o for o in found.observations}
    names = [next(n for n in ex.topological([e.condition]) if n.op == "var").data[0] for e in found.events]
    return [to_text(watched[name].expression) for name in names]


def test_an_event_in_a_loop_is_one_of_each_element():
    found = conditions("for i in 1..n { when x[i] > 1 m { hits := hits + 1 } }")
    assert found == [f"x[{k}] - 1" for k in (1, 2, 3)]


def test_bounds_may_follow_an_outer_loop():
    """Every pair once: (1, 2), (1, 3), (2, 3)."""
    found = conditions("for i in 1..n { for j in i + 1..n { when x[i] > x[j] { hits := hits + 1 } } }")
    assert found == ["x[1] - x[2]", "x[1] - x[3]", "x[2] - x[3]"]


def test_an_inequality_of_an_array_is_one_of_each_element_with_its_multiplier_and_rates():
    found = network("for i in 1..n { phi floor[i]: x[i] >= i*(1 m) }")
    assert [(s.name, s.label, s.at, s.kind) for s in found.switches] == [
        (f"floor[{k}]", "floor", (k,), "phi") for k in (1, 2, 3)
    ]
    text = {o.name: to_text(o.expression) for o in found.observations}
    last = found.switches[-1]
    seen = [text[name] for name in (last.value, last.rate, last.acceleration, last.multiplier)]
    assert seen == ["x[3] - 3", "x[3]'", "x[3]''", "floor[3].multiplier"]
    assert (last.bound, last.upper, last.lower, last.guard) == (None,) * 4


def test_what_is_no_array_has_its_plain_name():
    (found,) = network("phi floor: x[1] >= 0 m").switches
    assert (found.name, found.at) == ("floor", ())


def test_friction_watches_what_it_lacks_to_its_bound_on_both_sides():
    found = network("content D = 2 N*abs(x[1]')")
    (stick,) = [s for s in found.switches if s.kind == "friction"]
    text = {o.name: to_text(o.expression) for o in found.observations}
    bound, upper, lower, own = (text[name] for name in (stick.bound, stick.upper, stick.lower, stick.multiplier))
    assert (bound, upper, lower) == ("2", f"-{own} + 2", f"{own} + 2")


# --- iterations -------------------------------------------------------------------------------------------------------


def over(name, first, last):
    bounds = (ex.const(k) if isinstance(k, int) else k for k in (first, last))
    return Loop(name, *bounds)


@pytest.mark.parametrize(
    ("loops", "found"),
    [
        ([], [()]),
        ([("i", 1, 3)], [(1,), (2,), (3,)]),
        ([("i", 1, 0)], []),
        ([("i", 1, 2), ("j", 5, 6)], [(1, 5), (1, 6), (2, 5), (2, 6)]),
        ([("i", 1, 3), ("j", "i", 2)], [(1, 1), (1, 2), (2, 2)]),
        ([("i", 1, 2), ("j", 3, 2)], []),
    ],
)
def test_the_values_of_loop_variables(loops, found):
    with ex.fresh():
        nest = [over(n, ex.index(a) if isinstance(a, str) else a, b) for n, a, b in loops]
        rows = [tuple(at[ex.index(loop.index)] for loop in nest) for at in Values({}).iterations(nest)]
        assert rows == found


def test_bounds_that_nobody_knows_have_no_values():
    with ex.fresh():
        assert list(Values({}).iterations([over("i", 1, ex.param("n"))])) == []
        given = list(Values({}).iterations([over("i", ex.index("o"), 4)], {ex.index("o"): 3.0}))
        assert [at[ex.index("i")] for at in given] == [3.0, 4.0]


def test_more_events_than_there_is_room_for_are_refused_before_they_are_made(monkeypatch):
    text = MODEL.format("for i in 1..n { for j in 1..2000000000 { when x[i] > j*(1 m) { hits := hits + 1 } } }")
    report = Report()
    document = load.document(SourceText("m.sd", text), report)
    monkeypatch.setattr(budget, "GRANTED", 4 << 20)
    assert load.network(document, document.models["m"], document.scenes["s"], report) is None
    assert [d.code for d in report if d.severity == "error"] == ["E119"]
