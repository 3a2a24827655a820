"""What laws of branches say in coordinates, against the integrals that the table of the language names, and against
Tellegen: efforts times flows of a coupling add up to nothing.
"""

import itertools
import math
from types import SimpleNamespace

import pytest
from catalogue import PLACE
from networks import ELECTRICAL, TRANSLATION, Net, of
from numpy.polynomial.legendre import leggauss
from sysdyn.compiler.network.primal.bounds import WholeNumbers
from sysdyn.compiler.network.primal.coordinates import primal
from sysdyn.compiler.network.primal.incidence import Incidence
from sysdyn.compiler.network.primal.laws import laws
from sysdyn.compiler.network.primal.potentials import Potentials
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.text.diagnostics import ModelError

pytestmark = pytest.mark.usefixtures("fresh")
POINTS = (-1.3, 0.0, 0.4, 2.1)


def said(net):
    network = net.network()
    sizes = WholeNumbers(network)
    return laws(network, Incidence(network, sizes).elements, sizes)


def value(node, **own):
    """At flows and so on of branches: NAME_kind=number; rates NAME_kind_rate."""

    def lookup(n):
        name, kind, order = n.data
        return own[f"{name}_{kind}" + "_rate" * order]

    return evaluate([node], lookup)[0]


def integral(law, end):
    """By Gauss and Legendre, exact to round-off for these laws."""
    at, weight = leggauss(20)
    return 0.5 * end * float(weight @ [law(0.5 * end * (1.0 + z)) for z in at])


def cubic(v):
    return x.add(x.scale(2.0, v), x.scale(0.3, x.power(v, x.const(3.0))))


def plain(z):
    return 2.0 * z + 0.3 * z**3


ENERGIES = {
    "kinetic p(f)": ("kinetic", "p", "f", "T*"),
    "potential e(q)": ("potential", "e", "q", "V"),
    "dissipator e(f)": ("dissipator", "e", "f", "D"),
}


@pytest.mark.parametrize("case", ENERGIES)
def test_a_law_is_the_slope_of_its_energy(case):
    kind, side, own, energy = ENERGIES[case]
    net = Net()
    net.node("a", TRANSLATION)
    net.branch("b", kind, side, cubic, "a")
    found = said(net)
    (stated,) = found.energies
    assert stated.function == energy
    for z in POINTS:
        at = {f"b_b{own}": z}
        assert value(stated.expression, **at) == pytest.approx(integral(plain, z), rel=1e-13, abs=1e-15)
        slope = 2.0 + 0.9 * z**2
        if kind == "kinetic":
            assert value(found.momenta[0], **at) == pytest.approx(plain(z), rel=1e-14)
            assert value(found.efforts[0], **at, b_bf_rate=0.7) == pytest.approx(0.7 * slope, rel=1e-14)
        else:
            assert value(found.efforts[0], **at) == pytest.approx(plain(z), rel=1e-14)


def test_a_law_without_an_antiderivative_does_work():
    net = Net()
    net.node("a", TRANSLATION)
    net.branch("b", "dissipator", "e", lambda f: x.call("tanh", x.mul(f, x.call("abs", f))), "a")
    found = said(net)
    (work,) = found.works
    assert not found.energies
    assert (repr(work.on), work.account) == ("b.q", "dissipated")
    for z in POINTS:
        assert value(work.effort, b_bf=z) == pytest.approx(-math.tanh(z * abs(z)))
        assert -value(work.effort, b_bf=z) * z >= 0.0  # it takes power at every flow


def test_sources_say_a_flow_or_do_work():
    net = Net()
    net.node("a", ELECTRICAL)
    net.V("V", 5.0, "a")
    net.I("I", 0.25, "a")
    found = said(net)
    (work,), (row,) = found.works, found.constraints
    assert (value(work.effort), work.account) == (-5.0, "supplied")
    assert row.kind == "psi"
    assert [value(row.expression, I_bf=f) for f in (0.25, 1.0)] == [0.0, 0.75]


@pytest.mark.parametrize(("kind", "side"), [("transformer", "f"), ("transformer", "e"), ("gyrator", "e")])
def test_a_coupling_passes_all_power_on(kind, side):
    """Where its row holds, e1 f1 + e2 f2 = 0 whatever the multiplier; the efforts of a gyrator are by the flows."""
    net = Net()
    for name in "ab":
        net.node(name, ELECTRICAL)
    net.couple(kind, "T", 3.0, ("a", None), ("b", None), side=side)
    found = said(net)
    assert len(found.constraints) == (kind == "transformer")
    for f2, mu in itertools.product((-0.7, 2.0), (-1.5, 4.0)):
        f1 = {"f": 3.0 * f2, "e": -f2 / 3.0}[side]
        at = {"T.1_bf": f1, "T.2_bf": f2}
        if found.constraints:
            (row,) = found.constraints
            assert value(row.expression, **at) == pytest.approx(0.0, abs=1e-15)
            at[f"{row.name}_mu"] = mu
        one, two = (value(found.efforts[k], **at) for k in (0, 1))
        assert one * f1 + two * f2 == pytest.approx(0.0, abs=1e-14)
        assert side == "f" or one == pytest.approx(3.0 * (two if kind == "transformer" else f2))


def test_both_efforts_of_a_gyrator_are_works():
    net = Net()
    for name in "ab":
        net.node(name, ELECTRICAL)
    net.couple("gyrator", "G", 2.0, ("a", None), ("b", None), side="e")
    works = {repr(w.on): value(w.effort, **{"G.1_bf": 0.5, "G.2_bf": 3.0}) for w in said(net).works}
    assert works == {"G.1.q": -6.0, "G.2.q": 1.0}


def chain(n):
    """A source, n resistors 1, 2 .. n ohm between m[0] and m[n], a last one of 1 ohm to ground: one current."""
    net = Net()
    net.node("m", ELECTRICAL, (0, n))
    i = x.index("i")
    net.V("V", 10.0, ("m", 0))
    net.R("R", i, ("m", x.sub(i, x.const(1))), ("m", i), loops=[("i", 1, n)])
    net.R("S", 1.0, ("m", n))
    return net


@pytest.mark.parametrize("place", [0, 2, 5])
def test_the_effort_of_a_merged_node_is_summed_along_its_class(place):
    """With f = 10 V/(1 + 1 + .. + n): e(m[k]) = 10 V - f (1 + .. + k), whichever way the walk takes."""
    n, current = 5, 10.0 / 16.0
    watched = {"e": of("m", "ne", x.const(place)), "f": of("R", "bf", x.const(1))}
    found, _, _ = primal(chain(n).network(observe=watched))
    (coordinate,), (effort, flow) = found.coordinates, (o.expression for o in found.observations)
    sign = value(flow, **{f"{coordinate.name}_f": 1.0})
    sums = {
        node: x.add(*(x.substitute(node.args[2], {x.index(node.data[1]): x.const(k)}) for k in span(node)))
        for node in x.topological([effort])
        if node.op == "reduce"
    }
    got = value(x.substitute(effort, sums), **{f"{coordinate.name}_f": sign * current})
    assert got == pytest.approx(10.0 - current * sum(range(1, place + 1)), abs=1e-12)


def span(node):
    first, last = (int(evaluate([a], lambda n: float("nan"))[0]) for a in node.args[:2])
    return range(first, last + 1)


def test_a_node_that_touches_nothing_has_no_effort():
    with pytest.raises(ModelError) as error:
        Potentials(()).effort_of_node(SimpleNamespace(place=PLACE), "lonely", (), {})
    assert [d.code for d in error.value.diagnostics] == ["E409"]
