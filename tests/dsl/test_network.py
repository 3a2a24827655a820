"""From text to the checked network: scopes, instances, units, signs, families."""

import pytest
from sysdyn.dsl import load
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.text.diagnostics import Report, SourceText


def network(text, scene=None, settings=()):
    report = Report()
    document = load.document(SourceText("m.sd", text), report)
    chosen = document.scenes.get(scene) if scene else next(iter(document.scenes.values()), None)
    model = load.model_of(document, chosen, report) if chosen else next(iter(document.models.values()))
    with ex.fresh():
        return load.network(document, model, chosen, report, settings, required=chosen is not None), report


def codes_of(text, **more):
    return [d.code for d in network(text, **more)[1]]


RC = """
from std.electrical import resistor, capacitor, voltage
model rc {
  param R = 1 kohm
  node a, b: electrical
  V: voltage(v = 5 V) a -> ground
  r: resistor(R = R) a -> b
  c: capacitor(C = 1 uF) b -> ground
  init c.e = 1 V
}
scene s of rc {
  time 0 s to 1 ms
  trace b.e as v
}
"""


def test_instances_become_branches_between_nodes():
    n, report = network(RC)
    assert not len(report)
    assert [(b.name, b.kind, b.side) for b in n.branches] == [
        ("V", "effort", "e"),
        ("r", "dissipator", "e"),
        ("c", "potential", "q"),
    ]
    assert [(b.plus.node, b.minus.node) for b in n.branches] == [("a", None), ("a", "b"), ("b", None)]


def test_parameters_of_instances_are_run_time_values_under_their_path():
    n, _ = network(RC, settings=[("r.R", "2 kohm")])
    values = {p.name: p.values for p in n.parameters}
    assert values["r.R"][0].data == 2000.0
    assert str(network(RC)[0].parameters[1].values[0]) == "R"


def test_a_component_sees_nothing_of_its_user():
    text = RC.replace("model rc {", "component inner {\n  branch: electrical\n  law e = R*f\n}\nmodel rc {")
    text = text.replace("r: resistor(R = R) a -> b", "r: inner() a -> b")
    assert codes_of(text) == ["E101"]


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("r: resistr(R = R) a -> b", "E101"),
        ("r: resistor(r = R) a -> b", "E405"),
        ("r: resistor(1 kohm) a -> b", "E404"),
        ("r: resistor() a -> b", "E406"),
        ("r: resistor(R = 3 H) a -> b", "E214"),
        ("r: resistor(R = -3 ohm) a -> b", "E322"),
        ("r: resistor(R = R) a -> a", "E413"),
        ("r: resistor(R = R) a -> x", "E101"),
        ("r: resistor.full(R = R) a -> b", "E802"),
        ("r: dissipator(e = R*f*f) a -> b", "E208"),
        ("r: dissipator(e = q/(1 uF)) a -> b", "E323"),
        ("r: effort(e = R*f) a -> b", "E315"),
        ("r: dissipator(e = -R*f) a -> b", "E325"),
        ("r: kinetic(p = -1 H*f) a -> b", "E321"),
        ("r: resistor(R = R) a -> b, b -> a", "E402"),
        ("r: resistor(R = R) foo = a", "E407"),
        ("r: transformer(e1 = R*f2) a -> b, b -> ground", "E316"),
    ],
)
@pytest.mark.one_in(2)
def test_mistakes_in_an_instance(line, code):
    text = RC.replace("r: resistor(R = R) a -> b", line)
    assert code in codes_of(text)


def test_a_port_among_the_arguments_is_told_as_one():
    pad = "component pad {\n  port p: electrical\n  R: resistor(R = 1 ohm) p -> ground\n}\nmodel rc {"
    text = RC.replace("model rc {", pad).replace("r: resistor(R = R) a -> b", "r: pad(p = a)")
    assert ("E405", "pad(...) p = a") in [(d.code, d.help) for d in network(text)[1].diagnostics]


def test_domains_do_not_mix():
    text = RC.replace("node a, b: electrical", "node a: electrical\n  node b: rotation")
    assert "E401" in codes_of(text)


def test_a_lonely_node_is_named():
    assert codes_of(RC.replace("node a, b:", "node a, b, out:")) == ["E409"]


def test_two_voltage_sources_in_a_loop():
    text = RC.replace("init c.e", "W: voltage(v = 3 V) a -> ground\n  init c.e")
    assert codes_of(text) == ["E411"]


UNITS = """
from std.control import pid
model m {
  param k = 4 N/m
  coord x: translation = 1 m
  energy T* = 1/2*1 kg*x'^2
  energy V = 1/2*k*x^2
  ctl: pid(kp = 20 N/m, ki = 4 N/m/s, lo = -12 N, hi = 12 N) r = 0.5 m, y = x
  work ctl.u on x
}
"""


def test_unit_variables_are_solved_from_arguments_and_inputs():
    n, report = network(UNITS)
    assert not [d for d in report if d.severity == "error"]
    assert {s.name: s.unit.text for s in n.states} == {"ctl.I": "m.s", "ctl.d": "m"}


def test_contradicting_unit_variables():
    assert codes_of(UNITS.replace("kp = 20 N/m", "kp = 20 V/m")) == ["E209"]


ARRAY = """
from std.electrical import resistor
component section {
  param R: ohm
  port a, b: electrical
  node m: electrical
  one: resistor(R = R) a -> m
  two: resistor(R = 2*R) m -> b
}
model line {
  param n = 3
  node v[0..n]: electrical
  Vs: effort(e = 1 V) v[0] -> ground
  for i in 1..n {
    S[i]: section(R = i*1 ohm) a = v[i - 1], b = v[i]
  }
  Rt: resistor(R = 1 ohm) v[n] -> ground
}
scene s of line {
  time 0 s to 1 s
  trace S[2].two.f as f, S[n].m.e as e
}
"""


def test_an_array_of_components_is_one_family_of_each_thing():
    n, report = network(ARRAY)
    assert not [d for d in report if d.severity != "note"]
    branch = {b.name: b for b in n.branches}
    one = branch["S.one"]
    assert str(one.plus.at[0]) == "i - 1"
    assert one.loops[0].index == "i"
    assert [str(o.expression) for o in n.observations] == ["S.two[2].f", "S.m[n].e"]
    assert {p.name: str(p.values[0]) for p in n.parameters}["S.two.R"] == "2*S.R[i]"


def test_an_index_outside_an_array_of_components():
    assert codes_of(ARRAY.replace("S[2].two.f", "S[4].two.f")) == ["E805"]


LEVELS = """
component part {
  param R = 1 ohm
  port a, b: electrical
  level simple default {
    r: dissipator(e = R*f) a -> b
  }
  level fine extends simple {
    node m: electrical
    r: dissipator(e = R*f) a -> m
    l: kinetic(p = 1 mH*f) m -> b
  }
}
model m {
  node s: electrical
  V: effort(e = 1 V) s -> ground
  P: part() a = s, b = ground
}
scene plain of m {
  time 0 s to 1 s
  trace P.r.f
}
scene detailed of m {
  level P = fine
  time 0 s to 1 s
  trace P.l.f
}
"""


def test_levels_are_chosen_by_the_scene():
    assert [b.name for b in network(LEVELS, "plain")[0].branches] == ["V", "P.r"]
    assert sorted(b.name for b in network(LEVELS, "detailed")[0].branches) == ["P.l", "P.r", "V"]


def test_a_member_that_the_level_lacks():
    report = network(LEVELS.replace("trace P.r.f", "trace P.l.f"), "plain")[1]
    assert [(d.code, "simple" in d.message) for d in report] == [("N905", True)]


def test_self_containing_component():
    text = (
        "component a {\n  port p: electrical\n  x: a() p = p\n}\nmodel m {\n  node n: electrical\n  x: a() p = n\n}\n"
    )
    assert "E801" in codes_of(text)


def test_circular_lets_are_reported_once():
    text = "model m {\n  coord x: translation = 0 m\n"
    text += "  let a = b\n  let b = a\n  energy V = a*1 J\n  energy T* = 1/2*1 kg*x'^2\n}\n"
    assert codes_of(text) == ["E105"]


def test_a_label_is_an_element_or_an_array_of_elements():
    text = (
        "model m {\n  node a, b[1..3]: translation = 1 m\n  k: potential(e = 9 N/m*q) a -> b[1]\n"
        "  for i in 1..3 { w[i]: kinetic(p = 1 kg*f) b[i] }\n"
        "  for i in 1..2 { k[i]: potential(e = 9 N/m*q) b[i] -> b[i+1] }\n}\n"
    )
    assert codes_of(text) == ["E106"]
