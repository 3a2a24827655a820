"""Of several initial values of one element, the one that goes before the others is left."""

import pytest
from sysdyn.compiler.network.primal import overlaps, primal
from sysdyn.compiler.network.primal.precedence import outermost
from sysdyn.compiler.network.reflection import reflect
from sysdyn.dsl import load
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.text.diagnostics import Report, SourceText

HEAD = """
from std.electrical import capacitor, inductor, resistor
model net {
  param n = 6
  node v[1..n]: electrical
  for i in 1..n { C[i]: capacitor(C = 1 F) v[i] -> ground }
  for i in 1..n { L[i]: inductor(L = 2 H) v[i] -> ground }
  for i in 1..n { R[i]: resistor(R = 1 ohm) v[i] -> ground }
"""


def left(*said, head=HEAD):
    """(kind, value, fixed, range) of each statement left."""
    text = head + "\n".join(f"  {line}" for line in said) + "\n}\nscene run of net { time 0 s to 1 s; trace C[1].e }\n"
    found = []
    with ex.fresh():
        report = Report()
        document = load.document(SourceText("text.sd", text), report)
        network = load.network(document, document.models["net"], document.scenes["run"], report)
        assert network is not None, report.diagnostics
        for i in outermost(network).initials:
            (target,) = i.target.args
            span = [repr(b) for loop in i.loops for b in (loop.first, loop.last)] or [repr(target)]
            found.append((i.target.data[1], repr(i.value), i.fixed, "..".join(dict.fromkeys(span))))
    return found


def test_a_fixed_element_leaves_the_range_of_a_guess():
    assert left("for i in 1..5 { init C[i].e ~ 1 V }", "init C[3].e = 2 V") == [
        ("be", "1", False, "1..2"),
        ("be", "1", False, "4..5"),
        ("be", "2", True, "3"),
    ]


def test_a_later_guess_counts_before_an_earlier_one_and_content_is_effort():
    found = left("for i in 1..4 { init L[i].f ~ 1 A }", "for i in 3..6 { init L[i].p ~ 5 Wb }")
    assert found == [("bf", "1", False, "1..2"), ("bp", "5", False, "3..6")]


def test_two_fixed_values_both_stay():
    """Whether they contradict each other is judged where the start is sought."""
    assert len(left("init C[1].e = 1 V", "for i in 1..2 { init C[i].e = 2 V }")) == 2


def test_a_resistors_charge_is_not_its_effort():
    assert len(left("init R[1].e ~ 1 V", "init R[1].q ~ 2 C")) == 2


def test_ranges_are_held_against_what_may_be_about_their_elements_alone(monkeypatch):
    """60 ranges of two elements and 60 elements beside them: 60 meetings, not 3600."""
    asked = []
    meeting = overlaps.meeting
    monkeypatch.setattr(overlaps, "meeting", lambda *of: asked.append(of) or meeting(*of))
    ranges = [f"for i in {4 * k + 1}..{4 * k + 2} {{ init C[i].e ~ 1 V }}" for k in range(60)]
    single = [f"init C[{4 * k + 2 + k % 2}].e ~ 2 V" for k in range(60)]
    found = left(*ranges, *single, head=HEAD.replace("n = 6", "n = 240"))
    assert len(found) == 120
    assert sum(not at.loops for at, *_ in asked) <= 60


def rings(number):
    """A ladder of inductors side by side, each second one said."""
    nodes = ", ".join(f"n{k}" for k in range(number))
    lines = ["from std.electrical import capacitor, inductor", "model net {", f"  node {nodes}: electrical"]
    for k in range(number):
        end = f"n{k + 1}" if k + 1 < number else "ground"
        lines += [f"  L{k}: inductor(L = 2 H) n{k} -> {end}", f"  M{k}: inductor(L = 3 H) n{k} -> {end}"]
        lines += [f"  C{k}: capacitor(C = 1 F) n{k} -> ground", f"  init L{k}.f = {k} A"]
    report = Report()
    text = "\n".join([*lines, "}", "scene run of net { time 0 s to 1 s; trace C0.e }\n"])
    document = load.document(SourceText("text.sd", text), report)
    network = load.network(document, document.models["net"], document.scenes["run"], report)
    assert network is not None, report.diagnostics
    return network


@pytest.mark.long
def test_constants_of_rings_cost_what_the_text_is_long(effort):
    """Three times as many inductors in loops: three times the lines of Python run, not more."""
    with ex.fresh():
        counts = [effort(lambda net=net: primal(reflect(net), reflected=True))[1] for net in (rings(12), rings(36))]
    assert counts[1] <= 3.1 * counts[0], counts
