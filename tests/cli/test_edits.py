"""Changes of an author's text, to the letter: what is left out, joined, renamed, and what goes with it."""

from dataclasses import replace
from types import SimpleNamespace

import pytest
from sysdyn.cli.reduce import edits
from sysdyn.cli.reduce.activity import Activity
from sysdyn.dsl import load
from sysdyn.dsl.text.diagnostics import Report, SourceText

TEXT = """from std.electrical import resistor, capacitor, voltage

model m {
  param R0 = 1 kohm # of the first
  param C = 1 uF
  node a, b, c: electrical
  V: voltage(v = 1 V) a -> ground
  R1: resistor(R = R0) a -> b # in the way
  C1: capacitor(C = C) b -> ground
  R2: resistor(R = 2 ohm) b -> c
  C2: capacitor(C = 2*C) c -> ground
  init C1.e = 0 V
  init C2.e = 0 V
}

scene s of m {
  time 0 s to 1 s
  init C2.f = 1 A
  trace b.e
}
"""


def opened(text):
    report = Report()
    document = load.document(SourceText("m.sd", text), report)
    scene = document.scenes["s"]
    network = load.network(document, document.models["m"], scene, report)
    target = SimpleNamespace(document=document, model=document.models["m"], scene=scene)
    return target, network


def candidate(text, name, joined=""):
    target, _ = opened(text)
    (s,) = [s for s in target.model.body if getattr(getattr(s, "decl", None), "name", None) == name]
    return target, edits.Candidate(name, 0.0, 0.0, (s.span.start, s.span.end), name, joined)


def lines(text):
    """Lines of a text that are not of the other."""
    return lambda other: [line for line in text.splitlines() if line not in other.splitlines()]


def test_an_element_goes_with_its_comment_and_its_initial_values():
    target, one = candidate(TEXT, "C2")
    left = edits.remove_statement(target, TEXT, one)
    assert lines(TEXT)(left) == [
        "  C2: capacitor(C = 2*C) c -> ground", "  init C2.e = 0 V", "  init C2.f = 1 A",
    ]  # fmt: skip
    assert lines(left)(TEXT) == []
    target, one = candidate(TEXT, "R1")
    assert lines(TEXT)(edits.remove_statement(target, TEXT, one)) == ["  R1: resistor(R = R0) a -> b # in the way"]


def test_a_source_of_zero_takes_its_place():
    target, one = candidate(TEXT, "C1", "C1: effort(e = 0 V) b -> ground")
    found = edits.replace_by_zero_source(target, TEXT, one)
    assert lines(found)(TEXT) == ["  C1: effort(e = 0 V) b -> ground"]
    assert lines(TEXT)(found) == ["  C1: capacitor(C = C) b -> ground", "  init C1.e = 0 V"]


def test_parameters_that_nothing_reads_any_more_go():
    target, one = candidate(TEXT, "R1")
    left = edits.remove_statement(target, TEXT, one)
    after, _ = opened(left)
    assert lines(left)(edits.unread(after, left, TEXT)) == ["  param R0 = 1 kohm # of the first"]
    twice = TEXT.replace("R = 2 ohm", "R = 2*R0")  # that another element reads stays too
    target, one = candidate(twice, "R1")
    left = edits.remove_statement(target, twice, one)
    assert edits.unread(opened(left)[0], left, twice) == left
    unread = TEXT.replace("R = R0)", "R = 5 ohm)")  # that nobody read before either stays
    assert edits.unread(opened(unread)[0], unread, unread) == unread


def test_ends_of_an_element_become_one_node_and_what_lies_between_goes():
    """c is spoken of by no one: b stays.  A second resistor beside the first has both ends there."""
    text = TEXT.replace("  C2:", "  R3: resistor(R = 3 ohm) c -> b\n  C2:")
    target, one = candidate(text, "R2", "R2: effort(e = 0 V) b -> c")
    found = edits.merge_nodes(target, text, one)
    assert lines(found)(text) == ["  node a, b: electrical", "  C2: capacitor(C = 2*C) b -> ground"]
    assert [line.split(":")[0].strip() for line in lines(text)(found)] == ["node a, b, c", "R2", "R3", "C2"]


def test_a_node_that_something_speaks_of_is_not_renamed():
    both = TEXT.replace("trace b.e", "trace b.e, c.e")
    target, one = candidate(both, "R2", "R2: effort(e = 0 V) b -> c")
    assert edits.merge_nodes(target, both, one) is None
    other = TEXT.replace("trace b.e", "trace c.e")  # then the other one goes
    target, one = candidate(other, "R2", "R2: effort(e = 0 V) b -> c")
    found = edits.merge_nodes(target, other, one)
    assert "  node a, c: electrical" in found
    assert "R1: resistor(R = R0) a -> c # in the way" in found


@pytest.mark.parametrize(
    ("text", "cut", "left"),
    [
        ("a\n  b # told\nc\n", (4, 5), "a\nc\n"),
        ("a; b; c\n", (3, 4), "a; ; c\n"),
        ("a # b\n", (0, 1), ""),
        ("ab", (0, 1), "b"),
        ("a", (0, 1), ""),
    ],
)
def test_a_line_of_which_nothing_is_left_goes(text, cut, left):
    assert edits.apply_cuts(text, [(*cut, "")]) == left


def test_cuts_do_not_move_each_other():
    assert edits.apply_cuts("one two three", [(0, 3, "1"), (4, 7, "2222"), (8, 13, "3")]) == "1 2222 3"


def test_statements_that_share_a_line_are_still_a_model():
    text = TEXT.replace("\n  C2: capacitor", "; C2: capacitor").replace("\n  init C2.e", "; init C2.e")
    target, one = candidate(text, "C2")
    left = edits.remove_statement(target, text, one)
    report = Report()
    load.document(SourceText("m.sd", left), report)
    assert not [d for d in report if d.severity == "error"], left
    assert "C2" not in left


# --- which statements may go ------------------------------------------------------------------------------------------


def made(found):
    target, network = opened(TEXT)
    return {c.label: (c.activity, c.share, c.joined) for c in edits.candidates(target, network, found)}


def activity(name, value, role="out"):
    target, _ = opened(TEXT)
    place = target.document.file.source.place(0, 1)
    fields = Activity.__dataclass_fields__
    given = {"name": name, "label": name, "role": role, "activity": value, "share": value / 10.0, "place": place}
    return Activity(**{k: given.get(k) for k in fields})


@pytest.mark.long
def test_candidates_are_statements_the_least_active_first_and_no_sources():
    found = [activity("R2", 3.0), activity("C1", 1.0, "held"), activity("V", 0.5, "in"), activity("R1", 2.0)]
    assert list(made(found)) == ["C1", "R1", "R2"]
    assert made(found)["R2"] == (3.0, 0.3, "R2: effort(e = 0 V) b -> c")
    assert made(found)["C1"][2] == "C1: effort(e = 0 V) b -> ground"


def test_an_element_may_be_called_as_an_energy_is():
    """V is the author's source, and Valve might be a component; a statement is found by its place."""
    held = made([activity("V", 0.5, "held")])  # as if it were a store
    assert held["V"][2] == "V: effort(e = 0 V) a -> ground"
    target, _ = opened(TEXT)
    place = target.model.body[2].span
    stated = replace(
        activity("", 1.0), label="D (line 6)", place=target.document.file.source.place(place.start, place.end)
    )
    (only,) = edits.candidates(target, opened(TEXT)[1], [stated])
    assert (only.name, only.span) == ("", (place.start, place.end))


def test_parts_of_a_component_count_together():
    assert made([activity("R2.one", 1.0), activity("R2.two", 2.0)])["R2"][:2] == (3.0, pytest.approx(0.3))
