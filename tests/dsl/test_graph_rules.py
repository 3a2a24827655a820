"""Rules on the network's graph and on laws with their numbers: what each says, where, and not of its neighbour."""

import pytest
from sysdyn.dsl import load
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.rewriting import nodes_read
from sysdyn.dsl.model.values import Values
from sysdyn.dsl.rules import bound_values, checks, graph_checks
from sysdyn.dsl.text.diagnostics import Report, SourceText


@pytest.fixture(autouse=True)
def fresh():
    with ex.fresh():
        yield


def elaborated(body, before=""):
    source = SourceText("m.sd", f"{before}model m {{\n{body}\n}}\n")
    report = Report()
    document = load.document(source, report)
    model, _ = load._elaborate(document, document.models["m"], None, report, (), ())
    assert not list(report), list(report)
    return model, source


def told(report, source):
    return [(d.code, d.message, source.text[d.place.span.start : d.place.span.end]) for d in report]


def said(body, before=""):
    """What the rules on the graph say: code, message, the text that they point at."""
    model, source = elaborated(body, before)
    report = Report()
    graph_checks.run(model, Values(model.parts.parameters, []), nodes_read(model.parts), report)
    return told(report, source)


R = "dissipator(e = 5 ohm*f)"


def test_a_node_needs_two_elements_where_flows_balance():
    assert said(f"node a, b: electrical\nR: {R} a -> ground") == [
        ("E409", "node 'a' touches one element only", "a"),
        ("E409", "node 'b' touches no element", "b"),
    ]
    assert said(f"node a: electrical\nR: {R} a -> ground\nS: {R} a -> ground") == []


def test_a_node_needs_one_element_where_efforts_balance():
    assert said("node x, y: translation\nM: kinetic(p = 1 kg*f) x") == [("E409", "node 'y' touches no element", "y")]


def test_a_family_is_touched_as_a_whole():
    """Three nodes, two chains of one element between neighbours: four ends; one chain over three of five: four too."""
    body = "param n = {}\nnode a[1..n]: electrical\nfor i in 1..2 {{ R[i]: " + R + " a[i] -> a[i + 1] }}"
    assert said(body.format(3)) == []
    assert [message for _, message, _ in said("node a[1..5]: electrical")] == ["node 'a' touches no element"]
    # a range that ends before it begins has no element, not less than none: 2..n of n = 0
    ladder = f"param n = 0\nnode a: electrical\nR: {R} a -> ground\nS: {R} a -> ground\n"
    assert said(ladder + "for i in 2..n { P[i]: " + R + " a -> ground }") == []


@pytest.mark.parametrize(
    ("declared", "elements", "left"),
    [
        ("a[1..5]: electrical", "for i in 1..2 { R[i]: R a[i] -> a[i + 1] }", "a[4..5]"),
        ("a[0..5]: electrical", "for i in 1..2 { R[i]: R a[2*1 + 1] -> a[i + 3] }", "a[0..2]"),
        ("a[1..5]: translation", "R: R a[1]\nS: R a[3]\nT: R a[4] -> a[5]", "a[2]"),
        ("a[1..3]: translation", "for i in 1..0 { R[i]: R a[i] }\nS: R a[3]", "a[1..2]"),
        ("a[1..3, 1..4]: translation", "for i in 1..3 { for j in 2..4 { R[i, j]: R a[i, j] } }", "a[1..3, 1]"),
        ("a[1..2, 1..2]: translation", "R: R a[1, 1]\nS: R a[2, 2]\nT: R a[2, 1]", "a[1, 2]"),
        ("a[1..3]: electrical", "for i in 1..2 { R[i]: R a[i] -> a[i + 1] }", None),
        ("a[1..3]: translation", "R: R a[1] -> a[3]\nwork 1 N on a[2].q", None),
        ("a[1..2, 1..3]: translation", "for i in 1..2 { R[i]: R a[i, 1] -> a[i, 3]\nS[i]: R a[i, 2] }", None),
    ],
)
def test_each_node_of_a_family_is_touched(declared, elements, left):
    law = "dissipator(e = 5 ohm*f)" if "electrical" in declared else "dissipator(e = 5 N.s/m*f)"
    found = [message for _, message, _ in said(f"node {declared}\n{elements.replace(': R ', f': {law} ')}")]
    assert found == ([] if left is None else [f"node '{left}' touches no element"])


@pytest.mark.parametrize(
    ("domain", "kind", "unit"), [("electrical", "effort(e", "V"), ("translation", "flow(f", "m/s")]
)
def test_sources_in_a_loop_are_named_and_no_others(domain, kind, unit):
    """Of five sources three close a loop of a, b and the ground; one hangs on it, one stands apart."""
    what = kind.partition("(")[0]
    ends = {"u": "a -> ground", "apart": "d -> c", "v": "b -> a", "beside": "f -> a", "w": "ground -> b"}
    listed = [f"{name}: {kind} = 1 {unit}) {at}" for name, at in ends.items()]
    ((_, message, at),) = [
        found for found in said("\n".join([f"node a, b, c, d, f: {domain}", *listed])) if found[0] == "E411"
    ]
    assert message == f"loop of {what} sources: u, v, w fix the {what} between two nodes twice"
    assert at == listed[-1]


def test_sources_side_by_side_are_a_loop_and_in_a_row_none():
    two = "node a, b: electrical\nu: effort(e = 1 V) a -> ground\nv: effort(e = 2 V) {} -> {}\nR: " + R + " b -> ground"
    assert [m for c, m, _ in said(two.format("a", "ground")) if c == "E411"] == [
        "loop of effort sources: u, v fix the effort between two nodes twice"
    ]
    assert said(two.format("b", "a")) == []


def test_currents_that_nothing_can_take_up():
    cut = "node a: electrical\nu: flow(f = 1 A) a -> ground\nv: flow(f = 2 A) a -> ground"
    assert said(cut) == [("E412", "cutset of flow sources: the flows of u, v at node a must vanish in sum", "a")]
    assert said(f"{cut}\nR: {R} a -> ground") == []


@pytest.mark.parametrize(
    ("law", "code", "message"),
    [
        ("kinetic(p = k*(-1 kg)*f)", "E321",
         "'X': the inertia is negative (-k = -2): the motion is not determined forward in time"),
        ("kinetic(p = -2 kg*f)", "E321",
         "'X': the inertia is negative (-2): the motion is not determined forward in time"),
        ("potential(e = -k*(3 N/m)*q)", "E325", "'X': negative stiffness or capacitance (-3*k = -6)"),
        ("dissipator(e = -3 N.s/m*f)", "E325", "'X': negative resistance or damping (-3)"),
        ("dissipator(f = (1 - k)*e*(1 m/s/N))", "E325", "'X': negative resistance or damping (-k + 1 = -1)"),
    ],
)  # fmt: skip
def test_a_modulus_below_zero(law, code, message):
    assert said(f"param k = 2\nnode x: translation\nX: {law} x") == [(code, message, f"X: {law} x")]


@pytest.mark.parametrize(
    "law",
    ["kinetic(p = k*(1 kg)*f)", "potential(e = 0 N/m*q)", "dissipator(e = (k - 2)*(1 N.s/m)*f)", "effort(e = -3 N)"],
)
def test_a_modulus_from_zero_on_is_no_fault(law):
    assert said(f"param k = 2\nnode x: translation\nX: {law} x") == []


@pytest.mark.parametrize(
    ("law", "values", "code", "shown"),
    [
        ("dissipator(e = k[i]*f*(1 N.s/m))", "1, 2, 3", None, ""),
        ("dissipator(e = k[i]*f*(1 N.s/m))", "1, -2, 3", "E325", "(k[2] = -2)"),
        ("kinetic(p = k[i]*f*(1 kg))", "1, 2, -3", "E321", "(k[3] = -3)"),
        ("potential(e = (2 - i)*q*(1 N/m))", "1, 1, 1", "E325", "(-1)"),
    ],
)
def test_a_modulus_below_zero_of_one_element_of_an_array(law, values, code, shown):
    body = f"param k[1..3] = [{values}]\nnode x: translation\nfor i in 1..3 {{ X[i]: {law} x }}"
    found = said(body)
    assert [c for c, _, _ in found] == ([code] if code else [])
    assert all(shown in message for _, message, _ in found)


@pytest.mark.parametrize(
    ("law", "code", "shown"),
    [
        ("dissipator(e = -k*(1 + 0.5*sin(t/(1 s)))*f*(1 N.s/m))", "E325", "damping (-3 to -1)"),
        ("dissipator(f = (if y.q > 0 m then -1 else -k)*e*(1 m/s/N))", "E325", "damping (-2 to -1)"),
        ("potential(e = (step(t/(1 s) - 1) - k)*q*(1 N/m))", "E325", "capacitance (-2 to -1)"),
        ("kinetic(p = -exp(y.q/(1 m))*f*(1 kg))", "E321", "negative (-inf to "),
        ("dissipator(e = -k*(1 + sin(t/(1 s)))*f*(1 N.s/m))", None, ""),
        ("dissipator(e = -k*(1 + y.q/(1 m))*f*(1 N.s/m))", None, ""),
        ("dissipator(e = (k - 1)*(2 + cos(t/(1 s)))*f*(1 N.s/m))", None, ""),
    ],
)
def test_a_modulus_that_moves_is_refused_where_it_is_negative_whatever_moves_it(law, code, shown):
    found = said(f"param k = 2\nnode x, y: translation\nM: kinetic(p = 1 kg*f) y\nN: kinetic(p = 1 kg*f) x\nX: {law} x")
    assert [c for c, _, _ in found] == ([code] if code else [])
    assert all(shown in message for _, message, _ in found)


COUPLED = """component machine {{
  branch coil: electrical
  branch shaft: rotation
  g: gyrator(e1 = 2 V.s*f2) on coil.q, on shaft.q
  {}
  lossless
}}
"""
INSIDE = """node a: electrical
node s: rotation
M: machine() coil = a -> ground, shaft = s -> ground
J: kinetic(p = 1 kg.m^2*f) s
R: dissipator(e = 1 ohm*f) a -> ground"""


def test_what_loses_power_is_not_lossless():
    assert said(INSIDE, COUPLED.format("")) == []
    lossy = COUPLED.format("D: dissipator(e = 1 N.m.s*f) on shaft.q")
    assert said(INSIDE, lossy) == [("E314", "'lossless' fails: 'M.D' is a dissipator", "lossless")]
    driven = COUPLED.format("U: effort(e = 1 N.m) on shaft.q")
    assert said(INSIDE, driven) == [("E314", "'lossless' fails: 'M.U' is an effort source", "lossless")]


ENDS = """component part {{
  branch coil: electrical
  port shaft: rotation
  port hot, cold: thermal
  param k = 2 V.s
  let Q = (3 W/K)*(hot.e - cold.e)
  {}
  lossless
}}
"""
AROUND = """node a: electrical
node s: rotation
node h, c: thermal
M: part() coil = a -> ground, shaft = s, hot = h, cold = c
U: effort(e = 1 V) a -> ground
J: kinetic(p = 1 kg.m^2*f) s
H: potential(e = 300 K*exp(q/(1 J/K))) h -> ground
C: potential(e = 400 K*exp(q/(1 J/K))) c -> ground
HC: flow(f = 0 W/K) h -> c"""


@pytest.mark.parametrize(
    ("inside", "fails"),
    [
        ("A: flow(f = Q/hot.e) hot -> ground\nB: flow(f = -Q/cold.e) cold -> ground", ""),
        ("A: flow(f = Q/hot.e) hot -> ground\nB: flow(f = -Q/hot.e) cold -> ground", "'M.A' is a flow source"),
        ("work k*coil.f on shaft.q\nwork -k*shaft.f on coil.q", ""),
        ("work k*coil.f on shaft.q\nwork k*shaft.f on coil.q", "a work"),
        ("content D = 1/2*(1 N.m.s)*shaft.f^2", "a content"),
        ("energy T* = 1/2*(1 kg.m^2)*shaft.f^2", "an energy T* stores energy"),
        ("K: potential(e = 1 N.m*q) shaft -> ground", "'M.K' stores energy"),
        ("phi turns: shaft.q = 1 Hz*t", "'M.turns' moves with time"),
        ("phi stands: shaft.q = 0", ""),
    ],
)
def test_lossless_adds_up_the_powers_inside(inside, fails):
    """A conductor of heat, a machine written as two works: each absorbs what the other gives."""
    tied = inside if "coil" in inside else f"{inside}\nR: gyrator(e1 = k*f2) on coil.q, on shaft.q"
    expected = [("E314", f"'lossless' fails: {fails}", "lossless")] if fails else []
    assert said(AROUND, ENDS.format(tied)) == expected


def test_a_branch_that_stands_in_nothing():
    idle = "component c {\n  branch one: electrical\n  branch two: electrical\n  energy V = one.q^2/(2*(1 F))\n}\n"
    body = f"node a: electrical\nX: c() one = a -> ground, two = a -> ground\nR: {R} a -> ground"
    ((code, message, _),) = said(body, idle)
    assert (code, message) == (
        "E306", "branch 'X.two' has no law and occurs in no energy, content, work or constraint",
    )  # fmt: skip


# -- with the numbers -------------------------------------------------------------------------------------------------


def judged(body, before="", *, required=True):
    """What the checks before and after the values are known say."""
    model, source = elaborated(body, before)
    report = Report()
    checks.run(model, report, required=required)
    bound_values.run(model, Values(model.parts.parameters, []), report)
    return told(report, source)


SPRING = "node x: translation\nM: kinetic(p = 1 kg*f) x\nS: potential(e = {}*q) x"


def test_a_parameter_without_value_is_asked_for_where_one_is_needed():
    body = "param k: N/m\n" + SPRING.format("k")
    assert judged(body) == [("E406", "parameter 'k' has no value", "k")]
    assert judged(body, required=False) == []


def test_a_division_by_a_parameter_that_is_zero():
    """In laws, ratios and energies; not where a condition keeps it away."""
    body = "param c = {} m/N\n" + SPRING.format("1/c")
    assert judged(body.format(2)) == []
    assert judged(body.format(0)) == [
        ("E324", "division by zero with the values bound: S.q/c, c = 0 m/N", "S: potential(e = 1/c*q) x")
    ]
    energy = "param c = 0 m\nnode x: translation\nM: kinetic(p = 1 kg*f) x\nenergy V = {}"
    assert [m for _, m, _ in judged(energy.format("1 N*x.q^2/c"))] == [
        "division by zero with the values bound: x.q^2/c, c = 0 m"
    ]
    assert judged(energy.format("if c > 0 m then 1 N*x.q^2/c else 0 J")) == []
    ratio = "param r = 0\nnode a, b: electrical\nT: transformer(e2 = 1/r*e1) a -> ground, b -> ground"
    assert [(c, at) for c, _, at in judged(ratio)] == [("E324", "T: transformer(e2 = 1/r*e1) a -> ground, b -> ground")]


def test_an_element_of_an_array_that_is_zero_where_it_divides():
    """Of elements, under sums, by the index itself, and of parameters that follow others; not where none is."""
    body = "param n = 3\nparam c[1..n] = [1 s, {} s, 3 s]\nstate x[1..n]: 1 = 1\n"
    each = body + "for i in 1..n {{ dynamic x[i]' = -x[i]/c[i] }}"
    assert judged(each.format(2)) == []
    assert [m for _, m, _ in judged(each.format(0))] == [
        "division by zero with the values bound: x[2]/c[2], c[2] = 0 s"
    ]
    summed = "param n = 3\nnode x[1..n]: translation\nfor i in 1..n {{ M[i]: kinetic(p = 1 kg*f) x[i] }}\n{}"
    told = [
        ("energy V = sum(i in 1..n: 1 N/m*x[i].q^2/(i - 2))", "x[i].q^2/(i - 2), i - 2 = 0"),
        ("energy V = sum(i in 1..n: if i == 2 then 0 J else 1 N/m*x[i].q^2/(i - 2))", None),
        ("energy V = sum(i in 1..n: 1 N/m*x[i].q^2/(i - 4))", None),
        ("for i in 0..n { param k[i] = 1 N/m / i }\nenergy V = k[1]*x[1].q^2", "1/i, i = 0"),
    ]
    for line, found in told:
        wanted = [] if found is None else [f"division by zero with the values bound: {found}"]
        assert [m for _, m, _ in judged(summed.format(line))] == wanted


@pytest.mark.parametrize("constant", ["sqrt(-1)", "ln(0)", "(-8)^(1/3)", "asin(2)", "mod(3, 0)", "0*inf"])
def test_a_constant_that_is_no_number(constant):
    for factor in ("2", "t/(1 s)"):
        law = f"dynamic s' = {factor}*({constant})/(1 s)"
        assert judged(f"state s: 1 = 0\n{law}") == [("E324", "a constant here is no number", law)]


def test_a_constant_that_is_too_large():
    body = "state s: 1 = 0\ndynamic s' = (s + 10^400)/(1 s)"
    assert judged(body) == [("E324", "a constant here is too large for a number", "dynamic s' = (s + 10^400)/(1 s)")]
    assert judged("state s: 1 = 0\ndynamic s' = clip(s, -inf, inf)/(1 s)") == []


def test_what_is_required_is_told_with_its_values():
    body = SPRING.format("k") + "\nparam k = 3 kN/m\nparam limit = 2 N/mm\nrequire k < limit"
    assert judged(body) == [("E322", "require k < limit fails: k = 3 kN/m, limit = 2 N/mm", "require k < limit")]
    assert judged(body.replace("3 kN", "1 kN")) == []


LEAKS = """node a: electrical
C: potential(q = 1 F*e) a
param r[1..3] = [{}]
{}
for i in 1..3 {{ R[i]: dissipator(e = r[i]*f) a }}"""


@pytest.mark.parametrize(
    ("resistances", "said", "found"),
    [
        ("1 ohm, 2 ohm, 3 ohm", "for i in 1..3 { require r[i] > 0 ohm }", None),
        ("1 ohm, 2 ohm, -3 ohm", "for i in 1..3 { require r[i] > 0 ohm }", "require r[i] > 0 ohm fails: r[3] = -3 ohm"),
        ("1 ohm, 2 ohm, 1 ohm", "for i in 2..3 { require r[i] >= r[i - 1] }",
         "require r[i] >= r[i - 1] fails: r[3] = 1 ohm, r[2] = 2 ohm"),
        ("1 ohm, 2 ohm, 3 ohm", "for i in 1..3 { for j in i..3 { require i <= j } }", None),
        ("1 ohm, 2 ohm, 3 ohm", "for i in 1..3 { for j in i..3 { require i < j } }",
         "require i < j fails: i = 1, j = 1"),
        ("-1 ohm, -2 ohm, -3 ohm", "for i in 1..0 { require r[i] > 0 ohm }", None),
    ],
)  # fmt: skip
def test_what_is_required_in_a_loop_is_required_of_every_element(resistances, said, found):
    assert [(c, m) for c, m, _ in judged(LEAKS.format(resistances, said))] == ([("E322", found)] if found else [])


def test_what_a_component_requires_holds_for_every_element_of_an_array_of_it():
    part = "component leak { param R: ohm; require R > 0 ohm; branch: electrical; law e = R*f }\n"
    body = "node a: electrical\nC: potential(q = 1 F*e) a\nfor i in 1..3 {{ X[i]: leak(R = (1 ohm)*({})) a -> ground }}"
    assert [(c, m) for c, m, _ in judged(body.format("i - 1/2"), part)] == []
    assert [(c, m) for c, m, _ in judged(body.format("2.5 - i"), part)] == [
        ("E322", "require R > 0 ohm fails: X.R[3] = -0.5 ohm")
    ]


STATES = "state y[1..2, 1..2]: 1 = 0\n"
LOWER = "for i in 1..2 { for j in 1..i { dynamic y[i, j]' = 1/(1 s) } }\n"


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("for i in 1..2 { for j in 1..2 { dynamic y[i, j]' = 1/(1 s) } }", None),
        (LOWER + "dynamic y[1, 2]' = 2/(1 s)", None),
        (LOWER, "state y[1, 2] has no dynamic"),
        (LOWER + "dynamic y[1, 2]' = 2/(1 s)\ndynamic y[2, 1]' = 2/(1 s)", "state y[2, 1] has 2 dynamics"),
        ("for i in 1..2 { for j in 1..2 { dynamic y[j, i]' = 1/(1 s) } }", None),
        ("for i in 1..2 { dynamic y[i, i]' = 1/(1 s) }", "state y[1, 2] has no dynamic"),
    ],
)
def test_every_element_of_a_state_has_one_dynamic(body, said):
    """Rows of two would be added up: of 1 and 2 a rate of 1.5 was made."""
    assert [(c, m) for c, m, _ in judged(STATES + body)] == ([("E507", said)] if said else [])


RC = "node a: electrical\nC: potential(q = 1 F*e) a\n"
PAIR = "component pair { port a: electrical; R: dissipator(e = 1 ohm*f) a; S: dissipator(e = 1 ohm*f) a }\n"


@pytest.mark.parametrize(
    ("body", "twice"),
    [
        ("for i in 1..2 { R[i]: dissipator(e = 1 ohm*f) a }\nR[3]: dissipator(e = 1 ohm*f) a", None),
        ("for i in 1..2 { R[i]: dissipator(e = 1 ohm*f) a }\nR[2]: dissipator(e = 3 ohm*f) a", "R[2]"),
        ("R[1]: dissipator(e = 1 ohm*f) a\nR[1]: dissipator(e = 1 ohm*f) a", "R[1]"),
        ("X[1]: pair() a\nX[2]: pair() a", None),
        ("X[1]: pair() a\nX[2]: pair() a\nX[1]: pair() a", "X[1]"),
    ],
)
def test_an_element_of_an_array_is_made_once(body, twice):
    """Two resistors under one name both carried a current, of which the trace had one."""
    assert [(c, m) for c, m, _ in judged(RC + body, PAIR)] == (
        [("E106", f"'{twice}' is declared twice")] if twice else []
    )


def test_a_constraint_is_declared_once():
    """Two rows under one name were added up: of x' = 1 m/s and x' = 2 m/s came 1.5 m/s."""
    report = Report()
    text = (
        "model m {\ncoord x: translation = 0 m\nenergy T* = 1/2*(1 kg)*x'^2\npsi a: x' = 1 m/s\npsi a: x' = 2 m/s\n}\n"
    )
    document = load.document(SourceText("m.sd", text), report)
    assert load.network(document, document.models["m"], None, report) is None
    assert [(d.code, d.message) for d in report] == [("E106", "'a' is declared twice")]


def test_an_index_outside_its_family():
    body = "param n = {}\nnode x[1..n]: translation\nfor i in 1..3 {{ M[i]: kinetic(p = 1 kg*f) x[i] }}"
    assert judged(body.format(3)) == []
    assert judged(body.format(2)) == [("E805", "index 3 of 'x' is outside 1..2: x[i]", "i")]
    assert [(c, m) for c, m, _ in judged(body.format(3.5))] == [
        ("E805", "'n' is a size or an index, so it must be a whole number: 3.5")
    ]
