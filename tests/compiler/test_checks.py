"""Rules of the compiler: one valid and one invalid example each."""

from dataclasses import replace

import pytest
from catalogue import ONE, PLACE
from chains import blank, coordinate, parameter
from sysdyn.compiler.pipeline import compile_network
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.network import Constraint, EnergyTerm, Loop, Observation, Scene, Unknown, VirtualWork
from sysdyn.dsl.text.diagnostics import ModelError

pytestmark = pytest.mark.usefixtures("fresh")


def q(name, *at):
    return x.var(name, "q", *at)


def f(name, *at):
    return x.var(name, "f", *at)


def e(name, *at):
    return x.var(name, "e", *at)


def square(node):
    return x.power(node, x.const(2))


def simple(**more):
    base = {
        "coordinates": (coordinate("a"), coordinate("b")),
        "energies": (EnergyTerm("T*", x.add(square(f("a")), square(f("b"))), (), PLACE),),
    }
    return blank(**base | more)


def findings(net, formulation="lagrangian"):
    try:
        compile_network(net, formulation).bind()
    except ModelError as error:
        return [(d.code, d.message) for d in error.diagnostics]
    return []


def constraint(kind, name, node, at=(), loops=()):
    return Constraint(kind, name, at, node, loops, ONE, PLACE)


def test_a_valid_model():
    assert findings(simple()) == []


def closed(*gammas, unknowns=("g", "h")):
    return simple(
        unknowns=tuple(Unknown(n, (), ONE, PLACE) for n in unknowns),
        works=tuple(VirtualWork(e(n), q("a"), (), PLACE) for n in unknowns),
        constraints=tuple(constraint("gamma", f"law{k}", g) for k, g in enumerate(gammas)),
    )


def test_e504_counts_and_names():
    good = closed(x.sub(e("g"), f("a")), x.sub(e("h"), f("b")))
    assert findings(good) == []
    few = closed(x.sub(e("g"), f("a")))
    assert findings(few) == [("E504", "2 implicit unknowns and 1 gamma equations: nothing closes h")]
    many = closed(x.sub(e("g"), f("a")), x.sub(e("h"), f("b")), x.sub(e("h"), f("a")))
    ((code, message),) = findings(many)
    assert code == "E504"
    assert message == "2 implicit unknowns and 3 gamma equations: no unknown is left for law2"


def test_e504_counts_elements():
    i, one, n = x.index("i"), x.const(1), x.param("n")
    loops = (Loop("i", x.const(2), n),)
    net = simple(
        parameters=(parameter("n", 4.0, whole=True),),
        unknowns=(Unknown("g", ((one, n),), ONE, PLACE),),
        works=(VirtualWork(e("g", i), q("a"), loops, PLACE),),
        constraints=(constraint("gamma", "law", x.sub(e("g", i), f("a")), (i,), loops),),
    )
    assert findings(net) == [("E504", "4 implicit unknowns and 3 gamma equations: nothing closes g[1]")]


def test_a_gamma_need_not_contain_its_own_effort():
    """The transactor: f2 - al f1 = 0 closes an effort that it does not contain."""
    assert findings(closed(x.sub(f("b"), f("a")), unknowns=("g",))) == []


def test_e506_an_idle_effort():
    net = closed(x.sub(e("g"), f("a")), unknowns=("g",))
    idle = replace(net, unknowns=(*net.unknowns, Unknown("idle", (), ONE, PLACE)))
    assert [c for c, _ in findings(idle)] == ["E506"]


@pytest.mark.parametrize(
    ("asserted", "touched", "codes"),
    [(False, True, ["E513"]), (False, False, []), (True, False, ["E513"]), (True, True, [])],
)
def test_e513_assertions(asserted, touched, codes):
    net = simple(coordinates=(coordinate("a", asserted=asserted), coordinate("b")))
    if touched:
        net = replace(net, energies=(*net.energies, EnergyTerm("V", square(q("a")), (), PLACE)))
    assert [c for c, _ in findings(net)] == codes


def test_e516_undetermined():
    net = simple(coordinates=(coordinate("a"), coordinate("b"), coordinate("c")))
    pushed = replace(net, works=(VirtualWork(x.const(3), q("c"), (), PLACE),))
    assert [c for c, _ in findings(pushed)] == ["E516"]
    for node in (x.neg(q("c")), x.neg(f("c"))):
        assert findings(replace(net, works=(VirtualWork(node, q("c"), (), PLACE),))) == []
    assert findings(replace(net, constraints=(constraint("psi", "tie", x.sub(f("c"), f("a"))),))) == []


def test_e517_more_constraints_than_coordinates():
    ties = tuple(constraint("phi", f"tie{k}", x.sub(square(q("a")), x.mul(x.const(k), q("b")))) for k in range(1, 4))
    ((code, message),) = findings(simple(constraints=ties))
    assert code == "E517"
    assert message == "more constraints than coordinates in block {a, b}: 2 freedoms, 3 constraints (tie1, tie2, tie3)"
    assert findings(simple(constraints=ties[:2])) == []
    assert findings(simple(constraints=ties, scene=Scene("s", PLACE, redundancy="minimum_norm"))) == []


def test_e606_no_momentum():
    def traced(name):
        massless = (EnergyTerm("T*", square(f("a")), (), PLACE), EnergyTerm("D", square(f("b")), (), PLACE))
        return simple(energies=massless, observations=(Observation("o", x.var(name, "p"), ONE, "o", PLACE),))

    for formulation in ("lagrangian", "hamiltonian"):
        assert findings(traced("a"), formulation) == []
        assert [c for c, _ in findings(traced("b"), formulation)] == ["E606"]


def test_e806_an_index_that_is_not_affine():
    i, one, n = x.index("i"), x.const(1), x.param("n")
    net = simple(
        parameters=(parameter("n", 4.0, whole=True),),
        coordinates=(coordinate("a", ((one, x.const(16)),)), coordinate("b")),
        energies=(
            EnergyTerm("T*", square(f("a", x.mul(i, i))), (Loop("i", one, n),), PLACE),
            EnergyTerm("T*", square(f("b")), (), PLACE),
        ),
    )
    assert findings(net) == [("E806", "index i^2 is not affine: i + c with whole c is meant")]


@pytest.mark.parametrize(("literal", "codes"), [(False, ["N608"]), (True, [])])
def test_n608_a_sum_inside_a_nonlinear_energy(literal, codes):
    i, one = x.index("i"), x.const(1)
    n = x.const(4) if literal else x.param("n")
    root = x.sqrt(x.reduction("sum", "i", one, n, square(q("a", i))))
    net = simple(
        parameters=(parameter("n", 4.0, whole=True),),
        coordinates=(coordinate("a", ((one, n),)),),
        energies=(EnergyTerm("V", root, (), PLACE),),
    )
    assert [c for c, _ in findings(net)] == codes


def test_e805_a_constraint_that_is_given_twice():
    """Its rows would be added up to one."""
    q = x.var("x", "q")
    twice = [Constraint("phi", "tie", (), x.sub(q, x.const(value)), (), ONE, PLACE) for value in (1.0, 2.0)]
    network = blank(
        coordinates=(coordinate("x"),),
        energies=(EnergyTerm("T*", x.power(x.var("x", "f"), x.const(2)), (), PLACE),),
        constraints=tuple(twice),
    )
    with pytest.raises(ModelError) as caught:
        compile_network(network, "lagrangian", "numpy").bind()
    assert [(d.code, d.message) for d in caught.value.diagnostics] == [("E805", "constraint tie is given twice")]
