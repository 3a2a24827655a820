"""Branches frozen between events: what a row reads on either side of a surface, and while it slides along it."""

import pytest
from networks import TRANSLATION, Net, of
from sysdyn.compiler.forms.corners.frozen import ABOVE, BELOW, LIVE, SLIDES, frozen
from sysdyn.compiler.forms.lagrangian import lagrangian
from sysdyn.compiler.model.energies import energies
from sysdyn.compiler.network.primal import primal
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.evaluation import evaluate

pytestmark = pytest.mark.usefixtures("fresh")
FRICTION = 3.0


def lowered(law):
    """A mass of 2 kg, a force of 5 N, and a resistance by the law of its flow."""
    net = Net()
    net.node("a", TRANSLATION)
    net.L("M", 2.0, "a")
    net.branch("D", "dissipator", "e", law, "a")
    network, _, _ = primal(net.network(observe={"f": of("a", "nf")}))
    return lagrangian(energies(network)), network


def rows(form, block):
    """The expressions of a block's rows, summed up a row."""
    found = {}
    for kernel in form.block(block).kernels:
        for summand in kernel.rows:
            found[summand.row] = x.add(found.get(summand.row, x.const(0.0)), summand.expression)
    return list(found.values())


def read(row, *, branch=LIVE, f=0.0, rate=0.0, sense=0.0):
    values = {("a", "f", 0): f, ("a", "f", 1): rate, ("#sense 0", "e", 0): sense, "#branch 0": branch}
    return evaluate([row], lambda n: values[n.data])[0]


def sign_of(f):
    return x.scale(FRICTION, x.call("sign", f))


def test_dry_friction_reads_its_branch_and_lies_between_while_it_slides():
    form, parameters, _ = frozen(*lowered(sign_of))
    assert [(p.name, evaluate(list(p.values), {}.get)) for p in parameters] == [("#branch 0", [LIVE])]
    (row,) = rows(form, "dynamics")
    inertia = read(row, rate=1.0, branch=ABOVE) - read(row, branch=ABOVE)
    assert abs(inertia) == 2.0
    for f in (-0.7, 0.2):
        branches = LIVE, ABOVE, BELOW, SLIDES
        felt = {branch: read(row, branch=branch, f=f, sense=0.3) * 2.0 / inertia for branch in branches}
        assert felt[LIVE] == (FRICTION if f > 0 else -FRICTION)
        assert (felt[ABOVE], felt[BELOW]) == (FRICTION, -FRICTION)  # wherever the flow is
        assert felt[SLIDES] == pytest.approx(0.3 * FRICTION)


def test_the_sense_is_the_branch_or_what_holds_the_surface():
    form, _, _ = frozen(*lowered(sign_of))
    (row,) = rows(form, "gamma")
    for branch in (ABOVE, BELOW):
        assert read(row, branch=branch, f=0.4, sense=branch) == 0.0
        assert read(row, branch=branch, f=0.4, sense=0.5) == 0.5 - branch
    assert [read(row, branch=SLIDES, f=f, sense=0.5) for f in (-0.4, 0.0, 0.4)] == [-0.4, 0.0, 0.4]


def test_a_law_that_bends_has_branches_and_no_sense():
    form, parameters, _ = frozen(*lowered(lambda f: x.add(f, x.call("abs", f))))
    (row,) = rows(form, "dynamics")
    assert len(parameters) == 1
    assert form.block("gamma") is None
    for f in (-0.5, 0.5):
        felt = [abs(read(row, branch=branch, f=f)) for branch in (LIVE, ABOVE, BELOW)]
        assert felt == [2.0 * max(f, 0.0), abs(2.0 * f), 0.0]


def test_what_has_no_corner_is_handed_on():
    form, network = lowered(lambda f: x.scale(4.0, f))
    same, parameters, _ = frozen(form, network)
    assert same is form
    assert parameters == ()
