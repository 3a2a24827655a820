"""Names and members as a model reads them: which unknown, in which unit; what is said of those that are not there."""

from dataclasses import replace
from types import SimpleNamespace

import pytest
from sysdyn import api
from sysdyn.dsl import load
from sysdyn.dsl.model import dimensions as dim
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.network import EnergyTerm
from sysdyn.dsl.model.units import NONE
from sysdyn.dsl.model.values import Values
from sysdyn.dsl.names.failures import Failed
from sysdyn.dsl.names.members import Members
from sysdyn.dsl.names.names import STATICS, NameResolver, pick
from sysdyn.dsl.names.quantities import OF_ELEMENTS
from sysdyn.dsl.names.reactions import ledger, reaction
from sysdyn.dsl.names.symbols import Typed, Vector
from sysdyn.dsl.rules import law_rules
from sysdyn.dsl.text.diagnostics import Report, SourceText

TEXT = """
component cell {
  port p, m: electrical
  param r = 2 ohm
  inner: dissipator(e = r*f) p -> m
}
model m {
  param n = 3
  param s = 2 s
  param l = 5 m
  param w[2] = [4, 7]
  coord x, y: translation = 1 m
  node a, b: electrical
  node v[1..n]: electrical
  node z: translation
  let twice = 2*n
  R: dissipator(e = 5 ohm*f) a -> b
  T: transformer(e2 = 2*e1) a -> ground, b -> ground
  X: cell() p = a, m = ground
  for i in 1..n {
    C[i]: potential(q = 3 F*i*e) v[i] -> ground
    let half[i] = i/2
  }
  phi rod: x^2 + y^2 = 4 m^2
  psi roll: x' - 2*y' = 0 m/s
}
"""


@pytest.fixture(autouse=True)
def fresh():
    with ex.fresh():
        yield


class Read:
    """Texts read where the names of TEXT are in sight."""

    def __init__(self, text=TEXT):
        document = load.document(SourceText("m.sd", text), Report())
        report = Report()
        self.model, _ = load._elaborate(document, document.models["m"], None, report, (), ())
        assert not report.failed, list(report)
        self.context = self.model.resolver

    def __call__(self, text):
        """The value as text and its unit; of a refusal its code, message and help; what else was said."""
        source = SourceText("t.sd", f"scene s of m {{\n  trace {text}\n}}\n")
        (scene,) = load.document(source, Report()).scenes.values()
        self.context.report = report = Report()
        try:
            with (
                self.model.context.entering(self.model.space),
                self.context.entering_scope(self.model.space.scope, source),
            ):
                value = self.context.resolve(scene.body[0].items[0].expr)
        except Failed:
            return next((d.code, d.message, d.help) for d in report)
        assert isinstance(value, Typed)
        self.warned = [(d.code, d.message, d.help) for d in report]
        return repr(value.node), None if value.dimension is None else dim.show(value.dimension)


def of_text(text, scene=None):
    """The network of model m, and the report."""
    report = Report()
    document = load.document(SourceText("m.sd", text), report)
    chosen = None if scene is None else document.scenes[scene]
    return load.network(document, document.models["m"], chosen, report), report


@pytest.fixture
def read(fresh):
    return Read()


@pytest.mark.parametrize(
    ("text", "value", "unit"),
    [
        ("x", "x", "m"),
        ("x.q", "x", "m"),
        ("x'", "x'", "m/s"),
        ("x.f", "x'", "m/s"),
        ("x.p", "x.p", "kg.m/s"),
        ("x.e", "x.p'", "N"),  # the rate of what moves with it
        ("z.q", "z.q", "m"),
        ("z.e", "z.p'", "N"),
        ("a.e", "a.e", "V"),
        ("R.e", "R.e", "V"),
        ("R.f", "R.f", "A"),
        ("R.power", "R.e*R.f", "W"),
        ("R.D", "R.D", "W"),
        ("C[2].q", "C[2].q", "C"),
        ("C[n].V", "C[n].V", "J"),
        ("C[2].energy", "C[2].V - C.begun[2]", "J"),
        ("T.e1", "T#1.e", "V"),
        ("T.f2", "T#2.f", "A"),
        ("X.inner.f", "X.inner.f", "A"),
        ("X.r", "X.r", "ohm"),
        ("X.p.e", "a.e", "V"),
        ("X.m.e", "0", "V"),
        ("audit.energy", "energy", "J"),
        ("rod.residual", "x^2 + y^2 - 4", "m^2"),
        ("rod.multiplier", "rod.multiplier", "kg/s^2"),
        ("roll.residual", "x' - 2*y'", "m/s"),
        ("roll.multiplier", "roll.multiplier", "N"),
        ("rod.on(x)", "-2*rod.multiplier*x", "N"),
        ("roll.on(y)", "2*roll.multiplier", "N"),
        ("twice", "2*n", "dimensionless"),
        ("half[3]", "1.5", "dimensionless"),
        ("t", "t", "s"),
        ("pi", "3.141592653589793", "dimensionless"),
    ],
)
def test_what_a_name_stands_for(read, text, value, unit):
    assert isinstance(read.context, Members)
    assert isinstance(read.context, NameResolver)
    found = read(text)
    assert found[1] == unit
    assert sorted(found[0].replace(" - ", " + -").split(" + ")) == sorted(value.replace(" - ", " + -").split(" + "))


@pytest.mark.parametrize(
    ("element", "member"),
    [
        ("t: effort(e = 1 V/s*t) a", "t.f"),
        ("t: gyrator(e1 = 1 V/A/s*t*f2) a -> ground, b -> ground", "t.f1"),
        ("t: cell(r = 3 ohm) p = a, m = b", "t.inner.f"),
        ("for i in 1..2 { t[i]: flow(f = 1 A/s*t) a }", "t[2].f"),
    ],
)
def test_the_time_is_not_hidden_by_an_element_of_its_name(fresh, element, member):
    read = Read(TEXT.replace("  R:", f"  {element}\n  R:"))
    assert read("t") == ("t", "s")
    assert read(member)[1] == "A"


@pytest.mark.parametrize(
    ("text", "code", "message", "help_"),
    [
        ("a", "E104", "node 'a' is not a value", "write a.e (potential)"),
        ("z", "E104", "node 'z' is not a value", "write z.q or z.f"),
        ("R", "E104", "element 'R' is not a value", "a member: R.e or R.f"),
        ("rod", "E104", "constraint 'rod' is not a value", "write its member: multiplier, residual, on(...)"),
        ("audit", "E104", "'audit' is not a value", "write audit.energy or another member"),
        ("a.f", "E102", "node 'a' has no member 'f'", "a common-effort node has e; flows belong to elements"),
        ("R.g", "E102", "'R' has no member 'g'", "nearest: 'G'"),
        ("R.T", "E102", "'R' has no member 'T': it is not a kinetic store", None),
        ("x.dot", "E102", "'x' has no member 'dot'", "x'"),
        ("T.e3", "E102", "'T' has no member 'e3'", "it has e1, f1, q1, p1, e2, f2, q2, p2, power, energy"),
        ("X.q3", "E102", "'X' has no member 'q3'", None),
        ("n.e", "E102", "'n' has no member 'e': it is a parameter", "elements that have members: X, R, T, C"),
        ("nope.e", "E101", "unknown name 'nope'", "declare it by param nope = ..., let, coord or node"),
        ("twise", "E101", "unknown name 'twise'", "nearest name in scope: 'twice'"),
        ("sin", "E101", "unknown name 'sin'", "a function: sin(...)"),
        ("audit.enrgy", "E102", "'audit' has no member 'enrgy'", "nearest: 'energy'"),
        ("rod.size", "E102", "'rod' has no member 'size'", "it has multiplier, residual, on(...)"),
        ("rod.off(x)", "E102", "there is no 'off(...)' here", "label.on(expr) of a phi or psi"),
        ("C.q", "E805", "'C' has 1 index, 0 given", None),
        ("C[1, 2].q", "E805", "'C' has 1 index, 2 given", None),
        ("n[1]", "E805", "'n' has no indices, 1 given", None),
        ("half[1, 2]", "E805", "'half' has 1 index, 2 given", None),
    ],
)
def test_what_is_not_there_is_told_with_what_is(read, text, code, message, help_):
    found = read(text)
    assert found[:2] == (code, message)
    assert help_ is None or found[2] == help_


def test_a_family_of_definitions_is_no_value(read):
    """By itself it would leave its own index behind."""
    assert read("half + 1") == ("E806", "'half' is an array: name the element", "half[i] in a sum or a 'for'")


@pytest.mark.parametrize("target", ["2 m", "l", "3"])
def test_no_constraint_acts_along_a_constant(read, target):
    """Its gradient is zero: the effort would be 0/0."""
    assert read(f"rod.on({target})")[:2] == ("E203", "a constant has no displacement")


def test_a_list_has_the_elements_between_its_bounds(read):
    assert read("w[1] + 2*w[2]") == ("w[1] + 2*w[2]", "dimensionless")
    vector = Vector(tuple(Typed(ex.const(v), NONE) for v in (10.0, 20.0, 30.0)), 2)
    picked = pick(vector, (ex.index("i"),)).node
    assert [evaluate([picked], lambda _, k=k: k)[0] for k in (2.0, 3.0, 4.0)] == [10.0, 20.0, 30.0]


def test_a_unit_that_looks_like_a_division_is_told(read):
    assert read("3 m/s") == ("3", "m/s")
    assert read.warned == [
        ("W201", "in '3 m/s' s is the unit; a variable s is in scope", "'3 m / s' divides by it")
    ]  # fmt: skip
    assert read("3 m/s^2") == ("3", "m/s^2")
    assert read.warned == []


def test_definitions_in_a_circle_are_told_from_end_to_end():
    _, report = of_text("model m {\n  let a = 2*b\n  let b = c + 1\n  let c = a\n  coord x: translation\n}\n")
    said = [d.message for d in report if d.code == "E105"]
    assert said == ["circular definition: a -> b -> c -> a"]


def test_static_quantities_are_a_list_of_their_own():
    text = "model m {\n  coord x: translation = 1 m\n  energy T* = 1/2*(1 kg)*x'^2\n}\n"
    _, report = of_text(text + "scene s of m {\n  time 0 s to 1 s\n  expect static: dov == 1\n}\n", "s")
    (found,) = [d for d in report if d.severity == "error"]
    assert (found.code, found.help) == ("E908", f"one of {', '.join(STATICS)}")


# -- efforts of constraints, ledgers of pseudo domains -----------------------------------------------------------------


@pytest.mark.parametrize(
    ("residual", "holonomic", "target", "expected"),
    [
        ("x^2 + y^2", True, "x", -2.0 * 3.0 * 11.0),
        ("x^2 + y^2", True, "5*x", -2.0 * 3.0 / 5.0 * 11.0),  # power is the same along 5 x
        # along x y the mean of both, by grad(x y) = (y, x)
        ("x^2 + y^2", True, "x*y", -(2.0 * 3.0 * 7.0 + 2.0 * 7.0 * 3.0) / (7.0**2 + 3.0**2) * 11.0),
        ("x' - 2*y'", False, "y", 2.0 * 11.0),
    ],
)
def test_the_effort_of_a_constraint_along_a_displacement(read, residual, holonomic, target, expected):
    """-(d residual/dq) multiplier, at x = 3, y = 7, multiplier 11."""
    source = SourceText("t.sd", f"scene s of m {{\n  trace {residual}, {target}\n}}\n")
    (scene,) = load.document(source, Report()).scenes.values()
    with read.model.context.entering(read.model.space), read.context.entering_scope(read.model.space.scope, source):
        row, along = (read.context.resolve(item.expr).node for item in scene.body[0].items)
    found = reaction(row, holonomic, along, ex.param("multiplier"))
    at = {"x": 3.0, "y": 7.0}
    value = evaluate([found], lambda n: 11.0 if n.op == "param" else at[n.data[0]])[0]
    assert value == pytest.approx(expected, rel=1e-15)


def branch(name, kind, plus, minus, domain):
    ends = (SimpleNamespace(node=node) for node in (plus, minus))
    plus, minus = ends
    return SimpleNamespace(name=name, kind=kind, at=(), loops=(), plus=plus, minus=minus, domain=domain)


@pytest.mark.parametrize(
    ("common", "store", "content", "through"), [("effort", "potential", "bq", "bf"), ("flow", "kinetic", "bp", "be")]
)
def test_what_stores_of_the_ground_hold_comes_from_all_other_branches_there(common, store, content, through):
    """At the ground the flows add up to zero: C' + f_W - f_S = 0 of a store and a wall to ground and a source from it.

    What lies between two nodes, and another domain, has no part in it.
    """
    heat, other = SimpleNamespace(name="heat", common=common), SimpleNamespace(name="other", common=common)
    branches = [
        branch("C", store, "a", None, heat),
        branch("W", "dissipator", "a", None, heat),
        branch("S", "flow", None, "a", heat),
        branch("B", store, "a", "b", heat),
        branch("X", store, "a", None, other),
    ]
    held, supplied = ledger(heat, branches)
    assert held is ex.var("C", content)
    assert supplied is ex.sub(ex.var("S", through), ex.var("W", through))


# -- the order of rules ------------------------------------------------------------------------------------------------


def test_notes_on_loops_of_stores_wait_until_laws_are_right():
    """Two capacitors in parallel are a note; beside a wrong energy (E311) the error stands alone."""
    store = "potential(q = 1 F*e) a -> ground"
    text = f"model m {{\n  node a: electrical\n  A: {store}\n  B: {store}\n  R: dissipator(e = 1 ohm*f) a -> ground\n"
    network, _ = of_text(text + "}\n")
    assert told_of(network) == ["N401"]
    twice = EnergyTerm("V", ex.div(ex.power(ex.var("A", "bq"), ex.const(2.0)), ex.const(2.0)), (), network.place)
    assert told_of(replace(network, energies=(twice,))) == ["E311"]


def told_of(network):
    report = Report()
    law_rules.run(network, Values(network.parameters, []), report)
    return [d.code for d in report]


STORES = """component box {
  port p, m: electrical
  L: kinetic(p = 1 H*f) p -> m
  C: potential(q = 1 F*e) p -> m
}
model m {
  node a: electrical
  coord x: translation = 1 m
  energy T* = 1/2*(1 kg)*x'^2
  V: effort(e = 1 V) a -> ground
  R: dissipator(e = 1 ohm*f) a -> ground
  B: box() p = a, m = ground
}
scene s of m {
  time 0 s to 1 s
  trace READ as z
}
"""


@pytest.mark.parametrize(
    ("read", "help_", "right"),
    [
        ("B.V", "of the elements inside, B.C.V", "B.C.V"),
        ("B.Tstar", "of the elements inside, B.L.Tstar", "B.L.Tstar"),
        ("B.D", "stores have T, Tstar or V, Vstar, dissipators D, G; no dissipator is inside", None),
        ("R.T", "R.D or R.G or R.power or R.energy", "R.G"),
        ("V.Tstar", "V.power or V.energy", "V.energy"),
        ("B.L.D", "B.L.Tstar or B.L.T or B.L.power or B.L.energy", "B.L.T"),
        ("x.T", f"{OF_ELEMENTS}: LABEL.T; of the whole model audit.kinetic", "audit.kinetic"),
        ("x.V", f"{OF_ELEMENTS}: LABEL.V; of the whole model audit.potential", "audit.potential"),
        ("a.D", f"{OF_ELEMENTS}: LABEL.D; the node has e", "R.D"),
        ("a.V", "write a.e", "a.e"),
    ],
)
@pytest.mark.one_in(12)
def test_who_has_no_state_function_is_told_who_has(read, help_, right):
    (error,) = _errors(STORES.replace("READ", read))
    assert (error.code, error.help) == ("E102", help_)
    assert right is None or _errors(STORES.replace("READ", right)) == []


def _errors(text):
    return [d for d in api.check(text) if d.severity == "error"]
