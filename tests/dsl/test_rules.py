"""The rules of a finished network, one by one: what each says of a network made by hand, and not of its neighbour."""

from dataclasses import replace

import pytest
from sysdyn.dsl import load
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.network import EnergyTerm, Loop, Parameter
from sysdyn.dsl.model.values import Values
from sysdyn.dsl.rules.counted_twice import counted_twice
from sysdyn.dsl.rules.dependent_stores import dependent_stores
from sysdyn.dsl.rules.heat import heat
from sysdyn.dsl.rules.letters import Diagram, letter, samples, unknowns_of
from sysdyn.dsl.rules.passivity import passivity
from sysdyn.dsl.rules.pseudo_domains import pseudo_domains
from sysdyn.dsl.rules.reciprocity import reciprocity
from sysdyn.dsl.rules.state_functions import state_functions
from sysdyn.dsl.rules.transforms import transforms
from sysdyn.dsl.text.diagnostics import Report, SourceText

TEXT = """
model parts {
  node a, b: electrical
  node x: translation
  node h: heat
  node k: thermal
  L: kinetic(p = 2 H*f) a -> ground
  M: kinetic(p = 2 H*f) b -> ground
  C: potential(q = 3 F*e) a -> b
  R: dissipator(e = 5 ohm*f) b -> ground
  G: dissipator(f = 2 W/K*e) h -> ground
  S: dissipator(f = 1 W/K^2*e) k -> ground
  T: transformer(e2 = 2*e1) a -> ground, b -> ground
  B: kinetic(p = 1 kg*f) x
}
"""


@pytest.fixture(autouse=True)
def fresh():
    with ex.fresh():
        yield


@pytest.fixture
def parts(fresh):
    """The network of TEXT, whatever its own rules say of it."""
    document = load.document(SourceText("m.sd", TEXT), Report())
    elaborator, reader = load._elaborate(document, document.models["parts"], None, Report(), (), ())
    return load._result(elaborator, reader, None)


def said(rule, network, *more):
    report = Report()
    rule(network, *more, report)
    return [(d.code, d.message, d.help) for d in report]


def of(name, kind):
    return ex.var(name, kind)


def squared(node):
    return ex.mul(node, node)


def with_energies(network, **functions):
    place = network.place
    return replace(network, energies=tuple(EnergyTerm(f.replace("_", "*"), e, (), place) for f, e in functions.items()))


def with_law(network, name, law, **more):
    changed = (replace(b, law=law, **more) if b.name == name else b for b in network.branches)
    return replace(network, branches=tuple(changed))


def only(network, *names):
    return replace(network, branches=tuple(b for b in network.branches if b.name in names), couplings=())


# -- what the rules look with ------------------------------------------------------------------------------------------


def test_letters_are_those_of_the_diagram():
    assert [letter(of("n", kind)) for kind in ("nq", "bf", "be", "ne", "bp", "s")] == ["q", "f", "e", "e", "p", "s"]


def test_unknowns_come_in_the_order_of_their_making_and_by_their_letters():
    one, other, third = of("a", "bf"), of("b", "bq"), of("c", "ne")
    root = ex.add(third, ex.mul(other, one))
    assert unknowns_of(root) == [one, other, third]
    assert unknowns_of(root, "f e") == [one, third]


def test_samples_are_finite_values_and_hold_what_is_known():
    x = of("a", "bf")
    assert list(samples(ex.mul(x, ex.param("R")), {x: 2.0, ex.param("R"): 3.0})) == [6.0, 6.0, 6.0]
    assert list(samples(ex.call("ln", ex.neg(squared(x))), {x: 2.0})) == []
    assert len({*samples(x)}) == 3


def test_a_momentum_coordinate_stands_where_it_is_read(parts):
    diagram = Diagram(parts)
    assert diagram.domain(of("x", "nf")).name == "translation"
    assert diagram.domain(of("L", "bp")).name == "electrical"
    assert diagram.domain(of("nowhere", "q")) is None
    assert [n.data[0] for n, _ in diagram.domains(ex.add(of("L", "bf"), of("nowhere", "q")))] == ["L"]


# -- one rule, one code ------------------------------------------------------------------------------------------------


def test_a_function_and_its_transform_of_one_store(parts):
    twice = with_energies(parts, T=squared(of("L", "bp")), T_=squared(of("L", "bf")))
    (found,) = said(transforms, twice)
    assert found[:2] == ("E312", "T and T* are both given for the store of 'L'")
    assert said(transforms, with_energies(parts, T=squared(of("L", "bp")), T_=squared(of("M", "bf")))) == []


def test_a_law_and_an_energy_of_one_branch(parts):
    (found,) = said(counted_twice, with_energies(parts, T_=squared(of("L", "bf"))))
    assert found[:2] == ("E311", "energy of 'L' is counted twice: a law and 'energy T*' on the same branch")
    coupled = with_energies(parts, T_=ex.mul(of("L", "bf"), of("M", "bf")))  # mutual inductance: zero without the other
    assert said(counted_twice, coupled) == []


def test_a_velocity_dependent_potential_and_functions_of_the_wrong_variable(parts):
    found = said(state_functions, with_energies(parts, V=ex.mul(of("x", "nq"), of("x", "nf"))))
    assert [code for code, *_ in found] == ["E309"]
    assert found[0][1].endswith(": a velocity-dependent potential")
    (found,) = said(state_functions, with_energies(parts, V=squared(of("C", "be"))))
    assert found[0] == "E307"
    assert found[1].startswith("V is a function of displacements (q); it contains the effort")
    assert found[2] == "'energy V* = ...' is a function of efforts"
    (found,) = said(state_functions, with_energies(parts, T_=squared(of("x", "nq"))))
    assert found[2] == "'energy V = -(...)', or one T* with the flow to which it belongs"


def test_dissipators_of_a_true_thermal_domain_lose_energy(parts):
    (found,) = said(heat, parts)
    assert found[:2] == ("E320", "'S': a dissipator in 'thermal' loses energy: the heat it absorbs goes nowhere")
    one_side = with_law(parts, "S", ex.sub(of("S", "be"), of("C", "be")))  # it reads another: may be a conductor
    assert said(heat, one_side) == []


def test_pseudo_domains_meet_no_others(parts):
    both = with_energies(parts, V_=ex.mul(of("G", "be"), of("C", "be")))
    (found,) = said(pseudo_domains, both)
    assert found[0] == "E213"
    assert found[1].startswith("pseudo domain 'heat' and domain 'electrical' meet in V*;")
    alone = with_energies(parts, V_=squared(of("G", "be")))
    assert said(pseudo_domains, alone)[0][1] == "V* is energy, but e*f of the pseudo domain 'heat' is not"
    assert said(pseudo_domains, parts) == []  # a transformer between equal products


@pytest.mark.parametrize(("back", "codes"), [(3.0, []), (2.0, ["E310"])])
def test_mutual_inductances_agree(parts, back, codes):
    """p1 = 2 f1 + 3 f2 and p2 = 2 f2 + back f1: d p1/d f2 = d p2/d f1, or no energy has them."""
    one, other = of("L", "bf"), of("M", "bf")
    coupled = with_law(parts, "L", ex.linear(0.0, [(2.0, one), (3.0, other)]))
    coupled = with_law(coupled, "M", ex.linear(0.0, [(2.0, other), (back, one)]))
    found = said(reciprocity, coupled, Values({}, ()))
    assert [code for code, *_ in found] == codes
    if codes:
        assert found[0][1].endswith("d L.p/d M.f - d M.p/d L.f = 1; no energy has them")


def test_the_law_of_a_store_reads_no_other_displacement(parts):
    read = with_law(parts, "L", ex.mul(of("L", "bf"), of("x", "nq")))
    (found,) = said(reciprocity, read, Values({}, ()))
    assert found[0] == "E304"
    assert found[2] == "energy T* = ... with ports for both"


def test_a_dissipator_that_gives_power_somewhere(parts):
    """e = f^3 - f gives power between 0 and 1; the first of the decades looked at is 1e-9."""
    f = of("R", "bf")
    active = with_law(parts, "R", ex.sub(ex.mul(f, f, f), f))
    (found,) = said(passivity, active, Values({}, ()))
    assert found[0] == "E313"
    assert found[1] == "dissipator 'R': e*f = -1e-18 W < 0 at f = 1e-09 A (active element)"
    cubic = with_law(parts, "R", ex.mul(f, f, f))
    assert said(passivity, cubic, Values({}, ())) == []
    assert said(passivity, with_law(parts, "R", ex.neg(f)), Values({}, ())) == []  # linear: judged by its slope


def test_laws_that_differ_in_names_are_judged_by_their_own_values(parts):
    """e = a f^3 + b f under three pairs of values: with b below zero power is given, whoever was judged before."""
    resistor = next(b for b in parts.branches if b.name == "R")
    branches, parameters = [], {}
    for name, values in (("R1", (1.0, 2.0)), ("R2", (1.0, -2.0)), ("R3", (3.0, 4.0))):
        a, b, f = ex.param(f"{name}.a"), ex.param(f"{name}.b"), of(name, "bf")
        branches.append(replace(resistor, name=name, law=ex.add(ex.mul(a, f, f, f), ex.mul(b, f))))
        for node, value in zip((a, b), values, strict=True):
            unit, place = resistor.domain.flow, parts.place
            parameters[node.data] = Parameter(node.data, (), unit, (ex.const(value),), (), place)
    (found,) = said(passivity, replace(parts, branches=tuple(branches)), Values(parameters, ()))
    assert found[0] == "E313"
    assert found[1].startswith("dissipator 'R2': e*f = -")


@pytest.mark.parametrize(
    ("values", "active"), [((1.0, 2.0, 3.0), False), ((1.0, 2.0, -3.0), True), ((2.0,), False), ((-2.0,), True)]
)
def test_each_element_of_an_array_is_judged_by_its_own_values(parts, values, active):
    """e = f^3 + b[i] f, i in 1..3; b of one value for all, or a list."""
    resistor = next(b for b in parts.branches if b.name == "R")
    i, three = ex.index("i"), ex.const(3.0)
    f = ex.var("R", "bf", i)
    law = ex.add(ex.mul(f, f, f), ex.mul(ex.param("b", i), f))
    array = replace(resistor, at=(i,), loops=(Loop("i", ex.const(1.0), three),), law=law)
    box = ((ex.const(1.0), three),)
    b = Parameter("b", box, resistor.domain.flow, tuple(map(ex.const, values)), (), parts.place)
    found = said(passivity, replace(parts, branches=(array,)), Values({"b": b}, ()))
    assert [code for code, *_ in found] == (["E313"] if active else [])


def test_a_law_that_rises_beside_a_pole_or_a_jump_gives_power_behind_it(parts):
    """Slopes of at least zero wherever there is one, and yet e f < 0."""
    f, one = of("R", "bf"), ex.const(1.0)
    for law in (
        ex.call("tan", f),
        ex.sub(ex.div(one, ex.sub(one, f)), one),
        ex.sub(ex.mul(f, f, f), ex.call("sign", f)),
    ):
        (found,) = said(passivity, with_law(parts, "R", law), Values({}, ()))
        assert found[0] == "E313"
    for law in (ex.call("tanh", f), ex.sub(ex.call("exp", f), one), ex.div(f, ex.add(one, ex.mul(f, f)))):
        assert said(passivity, with_law(parts, "R", law), Values({}, ())) == []


def test_loops_of_capacitors_and_sources_and_cuts_of_inductors(parts):
    """C between a and b closes a loop with V from a to the ground and W from b; L alone at the cut of a is no note."""
    by = {b.name: b for b in parts.branches}
    ends = {"plus": by["L"].plus, "minus": by["L"].minus}
    source = replace(by["R"], name="V", kind="effort", side="e", law=ex.const(1.0), **ends)
    other = replace(source, name="W", plus=by["M"].plus)
    loop = replace(only(parts), branches=(source, other, by["C"]))
    (found,) = said(dependent_stores, loop)
    drops = "the order drops by 1, the index rises"
    assert found[:2] == ("N401", f"loop of potential stores and effort sources: V, W, C: {drops}")
    flow = replace(source, name="J", kind="flow", side="f")
    (found,) = said(dependent_stores, replace(loop, branches=(by["L"], flow)))
    assert found[1] == f"cutset of kinetic stores and flow sources: L, J: {drops}"
    assert said(dependent_stores, replace(loop, branches=(source, by["C"]))) == []
