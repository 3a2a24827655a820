"""What a level lacks and another has (language, decision 5): a note in traces and initial values, else an error."""

import pytest
from sysdyn.api import check
from sysdyn.dsl import load
from sysdyn.dsl.text.diagnostics import Report, SourceText

TEXT = """from std.transduce import dc_motor
from std.electrical import voltage

model drive {
  node a: electrical
  node s: rotation
  V: voltage(v = 1 V) a -> ground
  M: dc_motor(K = 1 V.s/rad, R = 1 ohm, L = 1 mH, J = 1e-3 kg.m^2, b = 0 N.m.s/rad) p = a, n = ground, shaft = s
%s}

scene run of drive {
  time 0 s to 1 s
%s}
"""


@pytest.fixture
def found(tmp_path):
    def read(model="", scene="", levels=()):
        report = Report()
        source = SourceText(str(tmp_path / "drive.sd"), TEXT % (model, scene))
        document = load.document(source, report)
        network = load.network(document, document.models["drive"], document.scenes["run"], report, levels=levels)
        return network, [(d.code, d.message) for d in report]

    return read


IDEAL = (("M", "ideal"),)
ARGUMENTS = [("N905", f"'M' has no parameter '{name}' at level ideal: left out") for name in "RLJb"]


def test_a_scene_may_choose_a_level_without_these_parameters(found):
    network, said = found(levels=IDEAL)
    assert said == ARGUMENTS
    assert len(network.branches) == 3  # the source and the two sides of the gyrator


def test_traces_and_initial_values_are_left_out(found):
    network, said = found("  init M.Jr.f = 2 rad/s\n", "  trace s.f, M.La.f\n  accuracy 1e-6 on M.La.f\n", IDEAL)
    left = [message for code, message in said if (code, message) not in ARGUMENTS]
    assert left == [f"'M' has no '{name}' at level ideal: left out" for name in ("Jr", "La", "La")]
    assert [o.name for o in network.observations] == ["s.f"]
    assert not network.initials
    assert found("  init M.Jr.f = 2 rad/s\n", "  trace s.f, M.La.f\n")[1] == []


def test_elsewhere_it_is_an_error_that_names_the_level(found):
    network, said = found("  let i = M.La.f\n", "  trace s.f\n", IDEAL)
    assert network is None
    assert ("E102", "'M' has no member 'La' at level ideal") in said


def test_what_no_level_has_is_an_error(found):
    assert [code for code, _ in found("", "  trace M.Lb.f\n")[1]] == ["E102"]


def test_a_part_without_levels_has_none_to_choose(tmp_path):
    report = Report()
    text = (TEXT % ("", "")).replace("scene run of drive {", "scene run of drive {\n  level V = hot")
    document = load.document(SourceText(str(tmp_path / "drive.sd"), text), report)
    load.network(document, document.models["drive"], document.scenes["run"], report)
    assert [(d.code, d.help) for d in report if d.code == "E802"] == [("E802", "leave the level out")]


def test_a_level_of_one_element_of_an_array_is_answered_with_that_of_all():
    text = """
component seg {
  port a, b: electrical
  level cold default { r: dissipator(e = 1 ohm*f) a -> b }
  level hot extends cold { r: dissipator(e = 2 ohm*f) a -> b }
}
model m {
  node v[0..2]: electrical
  V: effort(e = 1 V) v[0] -> ground
  for i in 1..2 { s[i]: seg() a = v[i-1], b = v[i] }
  R: dissipator(e = 1 ohm*f) v[2] -> ground
}
scene go of m { time 0 s to 1 s; level s[2] = hot; trace R.f }
"""
    (found,) = [d for d in check(text) if d.code == "E802"]
    assert found.help == "a level is that of all elements of a statement: level s = hot"
