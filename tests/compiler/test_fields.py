"""A branch without a law takes the effort that what is written over it absorbs."""

import pytest
from catalogue import ONE, PLACE
from networks import TRANSLATION, Net, of
from sysdyn.compiler.network.primal.bounds import WholeNumbers
from sysdyn.compiler.network.primal.fields import field_quantities
from sysdyn.compiler.network.primal.incidence import Incidence
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.network import Constraint, EnergyTerm, Loop, VirtualWork

pytestmark = pytest.mark.usefixtures("fresh")


def quantities(net, **written):
    network = net.network(**written)
    efforts, momenta = field_quantities(network, Incidence(network, WholeNumbers(network)).elements)
    return efforts[0], momenta.get(0)


def at(node, values):
    return evaluate([node], lambda n: values[n])[0]


def test_an_oscillator_written_as_energies():
    """e = k q + c f + m f' - E + kappa, p = m f."""
    net = Net()
    net.node("a", TRANSLATION)
    net.branch("b", "field", None, None, "a")
    q, f = of("b", "bq"), of("b", "bf")
    square = [x.mul(x.const(0.5), x.const(c), x.power(v, x.const(2))) for c, v in ((3.0, q), (0.5, f), (2.0, f))]
    effort, momentum = quantities(
        net,
        energies=tuple(EnergyTerm(name, e, (), PLACE) for name, e in zip(("V", "D", "T*"), square, strict=True)),
        works=(VirtualWork(x.const(7.0), q, (), PLACE),),
        constraints=(Constraint("phi", "wall", (), q, (), ONE, PLACE),),
    )
    values = {q: 1.5, f: 4.0, x.var("b", "bf", order=1): 10.0, x.var("wall", "kappa"): 0.25}
    assert at(momentum, values) == 2.0 * 4.0
    assert at(effort, values) == 3.0 * 1.5 + 0.5 * 4.0 + 2.0 * 10.0 - 7.0 + 0.25


def test_every_iteration_that_reads_an_element_counts():
    """V = sum over k = 1..3 of (q[k+1] - q[k])^2/2: the effort of q[2] is -(q[3] - q[2]) + (q[2] - q[1])."""
    net = Net()
    net.node("a", TRANSLATION, (1, 4))
    net.branch("b", "field", None, None, ("a", x.index("i")), loops=[("i", 1, 4)])
    k = x.index("k")
    apart = x.sub(of("b", "bq", x.add(k, x.const(1))), of("b", "bq", k))
    energy = EnergyTerm(
        "V", x.mul(x.const(0.5), x.power(apart, x.const(2))), (Loop("k", x.const(1), x.const(3)),), PLACE
    )
    effort, _ = quantities(net, energies=(energy,))
    held = {1: 0.0, 2: 1.0, 3: 5.0, 4: 7.0}

    def own(i):
        root = x.substitute(effort, {x.index("i"): x.const(i)})
        sums = {
            n: x.add(*(x.substitute(n.args[2], {x.index(n.data[1]): x.const(k)}) for k in (1, 2, 3)))
            for n in x.topological([root])
            if n.op == "reduce"
        }
        return evaluate([x.substitute(root, sums)], lambda n: held.get(n.args[0].data, 0.0))[0]

    assert [own(i) for i in range(1, 5)] == [-1.0, 1.0 - 4.0, 4.0 - 2.0, 2.0]
