"""Whether a circuit can only store and lose what its sources supply."""

import pytest
from catalogue import PLACE
from chains import blank, coordinate
from networks import Net, compiled
from sysdyn.compiler.binding.certificate import certificate
from sysdyn.compiler.pipeline import compile_network
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.network import EnergyTerm

pytestmark = pytest.mark.usefixtures("fresh")


def judged(made, **values):
    model = compile_network(made, "lagrangian", "numpy") if not made.branches else compiled(made)
    return certificate(made, model.bind(**values))


def circuit(law=None):
    """A source before a coil, a capacitor and, where it is given, an element of this law."""
    net = Net()
    for name in "ab":
        net.node(name)
    net.V("V", 5.0, "a")
    net.L("L", 1e-3, "a", "b")
    net.C("C", 1e-6, "b")
    if law is not None:
        net.branch("D", "dissipator", "e", law, "b")
    return net.network(params={"r": 2.0})


def test_stores_and_sources_lose_nothing():
    found = judged(circuit())
    assert found.lines() == ["lossless (proven): stores and ports exchange energy, nothing is lost; ports: V"]


def test_a_resistor_only_loses():
    found = judged(circuit(lambda f: x.mul(x.param("r"), f)))
    assert (found.verdict, found.proven) == ("passive", True)
    assert found.lines()[1] == "  D: dissipates, intervals: e f >= 0 over all values"


def test_a_resistance_that_turns_negative_is_found_where_it_does():
    """e = f^3 - 4 f supplies up to |f| = 2, most decidedly at 1: -3 W."""
    found = judged(circuit(lambda f: x.sub(x.power(f, x.const(3)), x.mul(x.const(4), f))))
    assert found.verdict == "active"
    (one,) = (f for f in found.findings if f.role == "active")
    assert (one.name, one.how) == ("D", "sampled")
    assert "W < 0 at D.f = " in one.said


@pytest.mark.parametrize(("shared", "verdict"), [(0.0, "passive"), (2.0, "passive"), (3.0, "active")])
def test_a_content_of_two_flows_by_the_eigenvalues_of_its_matrix(shared, verdict):
    """D = x'^2 + s x' y' + y'^2: the matrix [2, s; s, 2] has 2 - s and 2 + s."""
    u, v = x.var("x", "f"), x.var("y", "f")
    content = x.add(x.power(u, x.const(2)), x.mul(x.const(shared), u, v), x.power(v, x.const(2)))
    store = x.mul(x.const(0.5), x.add(x.power(u, x.const(2)), x.power(v, x.const(2))))
    energies = EnergyTerm("D", content, (), PLACE), EnergyTerm("T*", store, (), PLACE)
    found = judged(blank(coordinates=(coordinate("x"), coordinate("y")), energies=energies))
    assert (found.verdict, found.proven) == (verdict, True)
    if verdict == "active":
        assert found.findings[0].said == "its matrix has the eigenvalue -1"
