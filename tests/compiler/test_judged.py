"""What is judged and measured of energies, and what branches read: each against what can be seen by hand."""

from dataclasses import replace

import pytest
from catalogue import ONE, PLACE
from chains import blank, coordinate, parameter
from networks import ELECTRICAL, TRANSLATION, Net, of
from sysdyn.compiler.binding.binding import bind
from sysdyn.compiler.binding.checks import check_energies
from sysdyn.compiler.binding.following import following
from sysdyn.compiler.forms.assembly import Assembly
from sysdyn.compiler.forms.efforts import efforts
from sysdyn.compiler.forms.hamiltonian import hamiltonian
from sysdyn.compiler.forms.lagrangian import lagrangian
from sysdyn.compiler.forms.meters.audit import add_audit
from sysdyn.compiler.model.energies import energies
from sysdyn.compiler.network.primal.bounds import WholeNumbers
from sysdyn.compiler.network.primal.contents import Contents
from sysdyn.compiler.network.primal.incidence import Incidence
from sysdyn.compiler.network.primal.reading import EliminationTable, IndexBox, Rewriter, touches_network
from sysdyn.compiler.network.primal.store_guesses import guess_contents
from sysdyn.compiler.pipeline import compile_network
from sysdyn.compiler.program.rerolling import skeleton
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.network import Constraint, EnergyTerm, InitialCondition, Loop, Unknown, VirtualWork
from sysdyn.dsl.text.diagnostics import ModelError, SourceText

pytestmark = pytest.mark.usefixtures("fresh")


def var(name, kind, *at, order=0):
    return x.var(name, kind, *at, order=order)


def squared(node):
    return x.mul(node, node)


# -- the audit ---------------------------------------------------------------------------------------------------------


def oscillator(**more):
    """T* = 1/2 3 f^2, V = 1/2 5 q^2, D = 1/2 7 f^2 and a force of 2 on one coordinate."""
    q, f = var("a", "q"), var("a", "q", order=1)
    text = SourceText("m.sd", "T V D W")
    said = (("T*", 1.5, f), ("V", 2.5, q), ("D", 3.5, f))
    functions = tuple(
        EnergyTerm(name, x.scale(c, squared(v)), (), text.place(2 * k, 2 * k + 1))
        for k, (name, c, v) in enumerate(said)
    )
    work = VirtualWork(x.const(2.0), q, (), text.place(6, 7))
    return blank(**{"coordinates": (coordinate("a"),), "energies": functions, "works": (work,), **more})


def test_the_audit_of_an_oscillator_is_its_energies_and_powers():
    """At q = 2, f = 4: 24 J kinetic, 10 J potential, 112 W dissipated and 8 W supplied; in the ledger 34 J stored, and
    120 W that go round.
    """
    made, model = Assembly(), energies(oscillator())
    joules = tuple(replace(c, units={**c.units, "balance": "J"}) for c in model.coordinates)
    model = replace(model, coordinates=joules)
    shapes = add_audit(made, model, tuple(efforts(model)))
    at = {var("a", "q"): 2.0, var("a", "f"): 4.0}
    found = {}
    for row in (row for block in made.blocks() for kernel in block.kernels for row in kernel.rows):
        found[made.rows[row.row].owner] = evaluate([row.expression], at.get)[0]
    assert {name: found[name] for name in ("kinetic", "potential", "dissipated", "supplied")} == {
        "kinetic": 24.0,
        "potential": 10.0,
        "dissipated": 112.0,
        "supplied": 8.0,
    }
    assert (found["#ledger 0 stored"], found["#ledger 0 gross"]) == (34.0, 120.0)
    assert [found[owner] for owner, _ in shapes] == pytest.approx([24.0, 10.0], rel=1e-14)


# -- the forms of an oscillator ----------------------------------------------------------------------------------------


def rows_of(form, at):
    """Values of all rows as written, by block: blocks that stand in one row are added."""
    found = {}
    for block in form.blocks:
        if block.name in ("dynamics", "momentum"):
            for row in (row for kernel in block.kernels for row in kernel.rows):
                found[block.name] = found.get(block.name, 0.0) + evaluate([row.expression], at.get)[0]
    return found


def test_hamiltons_equations_of_an_oscillator():
    """p' + 5 q + 7 f - 2 = 0 and 0 = p - 3 f, at q = 2, f = 4, p = 13, p' = 1."""
    form = hamiltonian(energies(oscillator()))
    assert [(f.kind, f.owner) for f in form.families if f.kind != "audit"] == [("q", "a"), ("f", "a"), ("p", "a")]
    at = {var("a", "q"): 2.0, var("a", "f"): 4.0, var("a", "p"): 13.0, var("a", "p", order=1): 1.0}
    assert rows_of(form, at) == {"dynamics": 1.0 + 10.0 + 28.0 - 2.0, "momentum": 1.0}


def test_lagranges_equation_of_an_oscillator():
    """3 f' + 5 q + 7 f - 2 = 0."""
    form = lagrangian(energies(oscillator()))
    at = {var("a", "q"): 2.0, var("a", "f"): 4.0, var("a", "f", order=1): 0.5}
    assert rows_of(form, at) == {"dynamics": 1.5 + 10.0 + 28.0 - 2.0}


# -- numbers -----------------------------------------------------------------------------------------------------------


def weighted():
    """An oscillator whose stiffness k = 2 m follows from its mass and whose start is q0."""
    q, f, m = var("a", "q"), var("a", "q", order=1), x.param("m")
    energies_ = (
        EnergyTerm("T*", x.product(0.5, [(1.0, m), (2.0, f)]), (), PLACE),
        EnergyTerm("V", x.product(0.5, [(1.0, x.param("k")), (2.0, q)]), (), PLACE),
    )
    begin = InitialCondition(q, x.scale(3.0, x.param("q0")), True, (), PLACE)
    numbers = (parameter("m", 3.0), parameter("k", x.scale(2.0, m)), parameter("q0", 0.5))
    return blank(coordinates=(coordinate("a"),), energies=energies_, initials=(begin,), parameters=numbers)


def test_a_binding_holds_the_numbers_that_the_text_gives_and_those_given_anew():
    made = compile_network(weighted(), backend="numpy")
    for given, p, start in (({}, [3.0, 6.0, 0.5], 1.5), ({"m": 5.0, "q0": 2.0}, [5.0, 10.0, 2.0], 6.0)):
        found = bind(made.network, made.energies, made.form, made.program, given)
        assert found.p.tolist() == p
        assert [(s.values.tolist(), s.fixed) for s in found.initial] == [([start], True)]


def test_what_follows_is_told_with_what_it_follows_from():
    """k by m; the start by q0; nothing decides about sizes."""
    made = compile_network(weighted(), backend="numpy")
    found = following(made.network, made.form, made.program, made.bind())
    assert found.follows == {"k": ("m",)}
    assert sorted(group.kind for group in found.groups) == ["initial", "parameter"]
    assert found.structural == ()


# -- rules that need energies ------------------------------------------------------------------------------------------


def codes(network):
    return [(d.code, d.message) for d in check_energies(energies(network), network)]


def test_a_model_that_says_enough_is_not_refused():
    assert codes(oscillator()) == []


def test_a_coordinate_that_nothing_holds_or_moves():
    ((code, message),) = codes(oscillator(coordinates=(coordinate("a"), coordinate("loose"))))
    assert code == "E516"
    assert message == "coordinate loose has no inertia, stiffness, dissipation or constraint: it is undetermined"
    held = Constraint("psi", "gear", (), x.sub(var("a", "q", order=1), var("loose", "q", order=1)), (), ONE, PLACE)
    assert codes(oscillator(coordinates=(coordinate("a"), coordinate("loose")), constraints=(held,))) == []


def test_an_implicit_effort_that_does_nothing():
    idle = oscillator(unknowns=(Unknown("R", (), ONE, PLACE),))
    assert codes(idle) == [("E506", "implicit effort 'R' appears in no work and in no gamma")]
    assert codes(replace(idle, works=(*idle.works, VirtualWork(var("R", "e"), var("a", "q"), (), PLACE)))) == []


@pytest.mark.parametrize(("asserted", "potential"), [(False, True), (True, False)])
def test_what_is_declared_of_a_displacement_holds(asserted, potential):
    network = oscillator(coordinates=(coordinate("a", asserted=asserted),))
    kept = tuple(e for e in network.energies if potential or e.function != "V")
    ((code, message),) = codes(replace(network, energies=kept))
    assert code == "E513"
    assert message.startswith(f"a is declared {'tangible' if asserted else 'intangible'} but")
    assert codes(replace(network, energies=network.energies if asserted else network.energies[:1])) == []


def test_a_momentum_that_no_store_makes():
    text = replace(oscillator(), coordinates=(coordinate("a"), coordinate("b")))
    spring = EnergyTerm("V", squared(var("b", "q")), (), PLACE)
    begin = InitialCondition(var("b", "p"), x.const(1.0), True, (), PLACE)
    ((code, message),) = codes(replace(text, energies=(*text.energies, spring), initials=(begin,)))
    assert (code, message) == ("E606", "b has no momentum variable: T* has no second derivative in b'")


# -- what branches read ------------------------------------------------------------------------------------------------


def two_pieces():
    """Who reads resistors R[1..3] and R[4..5], of which each of the first has an effort of 2, of the others of 7."""
    net = Net()
    net.node("a", ELECTRICAL, (1, 5))
    for ohms, first, last in ((2.0, 1, 3), (7.0, 4, 5)):
        net.R("R", ohms, ("a", x.index("i")), loops=(("i", first, last),))
    network = net.network()
    sizes = WholeNumbers(network)
    elements = Incidence(network, sizes).elements
    pieces = {"R": [IndexBox(e.named, e) for e in elements]}
    assert len(elements) == 2
    efforts = {e.number: x.const(ohms) for e, ohms in zip(elements, (2.0, 7.0), strict=True)}
    return Rewriter(sizes, EliminationTable(pieces, efforts, {}, lambda *_: x.const(0.0)))


def test_a_statement_is_cut_where_what_it_reads_changes():
    """An index over both: 1..3 reads one law, 4..5 the other; one within a piece is left whole."""
    reader, i = two_pieces(), x.index("k")
    cut = reader.cut((Loop("k", x.const(1.0), x.const(5.0)),), PLACE, lambda ranges: reader.piece("R", (i,), ranges))
    found = [(loops[0].first, loops[0].last, piece.box[0].first.value) for loops, piece in cut]
    ends = [(evaluate([a, b], lambda n: n), first) for a, b, first in found]
    assert ends == [([1.0, 3.0], 1), ([4.0, 5.0], 4)]
    whole = list(reader.cut((Loop("k", x.const(1.0), x.const(2.0)),), PLACE, lambda r: reader.piece("R", (i,), r).box))
    assert len(whole) == 1


def test_a_sum_over_pieces_is_a_sum_of_sums():
    """sum(i in 2..5: R[i].e) = 2 + 2 + 7 + 7."""
    i = x.index("i")
    total = x.reduction("sum", "i", x.const(2.0), x.const(5.0), var("R", "be", i))
    assert touches_network(total)
    found = two_pieces().scalar(total, PLACE)
    assert not touches_network(found)
    assert evaluate([found], lambda n: n) == [18.0]


def test_an_index_outside_all_pieces_is_said():
    reader = two_pieces()
    with pytest.raises(ModelError) as found:
        reader.scalar(var("R", "be", x.const(6.0)), PLACE)
    assert found.value.diagnostics[0].message == "R[6] is outside its range"


# -- guesses of what stores hold ---------------------------------------------------------------------------------------


def guesses(net, *initials):
    """Guesses of contents: (store, whether the text says it, value)."""
    network = replace(net.network(), initials=initials)
    sizes = WholeNumbers(network)
    elements = Incidence(network, sizes).elements
    pieces = {e.name: [IndexBox(e.named, e)] for e in elements}
    momenta = {e.number: e.branch.law for e in elements if e.branch.kind == "kinetic"}
    reader = Rewriter(sizes, EliminationTable(pieces, {}, momenta, lambda *_: x.const(0.0)))
    assert Contents(reader, (), initials, elements, reflected=False).parameters == []
    found, stores = guess_contents(network, set(), initials, sizes, reader, reflected=False)
    return {i.store: (i.said, i.value.data) for i in found}, stores


def masses(*springs):
    net = Net()
    for name in "ab":
        net.node(name, TRANSLATION)
    for name, value, *ends in springs:
        net.L(name, value, *ends)
    return net


def test_a_store_on_a_coordinate_of_its_own_is_guessed_by_it():
    assert guesses(masses(("M", 2.0, "a"), ("N", 3.0, "b"))) == ({}, frozenset())


def test_stores_that_share_coordinates_are_measured_by_what_they_hold():
    """A mass between a and b reads both flows: all three are guessed by their momenta, M as the text says, 2*4."""
    net = masses(("M", 2.0, "a"), ("N", 3.0, "b"), ("J", 1.0, "a", "b"))
    said = InitialCondition(of("M", "bf"), x.const(4.0), False, (), PLACE)
    assert guesses(net, said) == (
        {"M": (True, 8.0), "N": (False, 0.0), "J": (False, 0.0)},
        frozenset({"M"}),
    )


# -- texts that are alike ----------------------------------------------------------------------------------------------


def test_numbers_are_what_texts_that_are_alike_differ_by():
    one, other = (skeleton(text) for text in ("a1 = 2.5*y[3] - (-1e-3)", "a1 = 7.25*y[41] - (-2)"))
    assert one[0] == other[0]
    assert (one[1], other[1]) == (("2.5", "3", "(-1e-3)"), ("7.25", "41", "(-2)"))
    assert skeleton("y[3] + p[12]", whole=True) == ("y[@] + p[@]", ("3", "12"))
