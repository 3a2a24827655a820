"""Small pieces between network and program, each by itself: what is added to what, and what is called what."""

from dataclasses import replace

import pytest
from catalogue import ONE, PLACE
from chains import blank, coordinate
from networks import ELECTRICAL, TRANSLATION, Net, of
from sysdyn.compiler.forms.assembly import Assembly
from sysdyn.compiler.forms.descriptor import EquationFamily, Unknowns
from sysdyn.compiler.forms.integration import integrate
from sysdyn.compiler.forms.lowering import total_rate, whole
from sysdyn.compiler.forms.meters.default_traces import MOST, with_coordinates_observed
from sysdyn.compiler.forms.meters.ledgers import Entry, ledgers
from sysdyn.compiler.forms.meters.observing import InitialEquation, add_initials, missing, pins_and_equations
from sysdyn.compiler.model.energies import EnergyModel, InitialTarget, Row, UnknownFamily, energies
from sysdyn.compiler.model.terms import Term
from sysdyn.compiler.network.authors import in_author_names, owner, split_finding
from sysdyn.compiler.network.primal import primal
from sysdyn.compiler.network.primal.account import Step
from sysdyn.compiler.program.formulas import canonical
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.network import EnergyTerm, InitialCondition, Loop, Observation
from sysdyn.dsl.model.rewriting import TRACED, expressions, nodes_read, rewritten
from sysdyn.dsl.text.diagnostics import Diagnostic, SourceText

pytestmark = pytest.mark.usefixtures("fresh")


def var(name, kind, order=0):
    return x.var(name, kind, order=order)


# -- assembly ----------------------------------------------------------------------------------------------------------


def test_what_is_added_to_one_row_under_one_nest_is_one_expression():
    """q + 2 q to row a, then f - f to row b, which leaves nothing; blocks come in the contract's order."""
    made, q, f = Assembly(), var("a", "q"), var("b", "f")
    for block, name in (("phi", "a"), ("dynamics", "b")):
        made.family(EquationFamily(block, name, name, block, "1", None))
    made.add("phi", "a", (), (), q)
    made.add("phi", "a", (), (), x.scale(2.0, q))
    made.add("dynamics", "b", (), (), f)
    (dynamics, phi) = made.blocks()
    assert (dynamics.name, phi.name) == ("dynamics", "phi")
    (row,) = phi.kernels[0].rows
    assert (row.row, row.expression) == (0, x.scale(3.0, q))
    made.add("dynamics", "b", (), (), x.neg(f))
    assert [block.name for block in made.blocks()] == ["phi"]


def test_nests_of_equal_bounds_are_one_kernel():
    made, k = Assembly(), x.index("#0")
    made.family(EquationFamily("dynamics", "a", "a", "dynamics", "1", None))
    three, four = ((Loop("#0", x.const(1.0), x.const(n)),) for n in (3.0, 4.0))
    for nest in (three, four, three):
        made.add("dynamics", "a", (k,), nest, x.var("a", "q", k))
    (block,) = made.blocks()
    assert [(kernel.nest, kernel.rows[0].expression) for kernel in block.kernels] == [
        (three, x.scale(2.0, x.var("a", "q", k))),
        (four, x.var("a", "q", k)),
    ]


# -- initial conditions ------------------------------------------------------------------------------------------------


def model(*initials, **parts):
    a, b = (UnknownFamily(n, (), dict.fromkeys("qfpe", "1") | {"balance": "J"}, PLACE) for n in "ab")
    return EnergyModel((a, b), initials=initials, **parts)


def target(node, value, **more):
    return InitialTarget(node, x.const(value), **{"fixed": True, "nest": (), "place": PLACE, **more})


def unknown(owner, kind):
    return Unknowns(owner, kind, owner, "1", None)


def test_an_unknown_is_pinned_and_an_expression_is_a_row():
    """a.q = 1 pins; b.q is no unknown of this form and says nothing; a.q + b.f = 2 is a row."""
    both = x.add(var("a", "q"), var("b", "f"))
    found = model(target(var("a", "q"), 1.0), target(var("b", "q"), 5.0), target(both, 2.0))
    pins, equations = pins_and_equations(found, frozenset(), [unknown("a", "q"), unknown("b", "f")])
    assert [(p.family, p.value.data, p.fixed) for p in pins] == [(0, 1.0, True)]
    assert [e.target.target for e in equations] == [both]


def test_a_guess_misses_what_its_row_does_not_meet():
    """a + b ~ 2 of the text, and a content of zero that nobody wrote: each row reads an unknown of its own."""
    both = x.add(var("a", "f"), var("b", "f"))
    written = InitialEquation("#init 0", target(both, 2.0, fixed=False))
    content = InitialEquation("#init 1", target(both, 0.0, fixed=False, said=False, store="C", unit="C"))
    held = InitialEquation("#init 2", target(both, 0.0))
    found = list(missing((written, content, held)))
    assert [(u.owner, u.kind, u.unit) for u in found] == [("#init 0", "slack", "#init 0"), ("#init 1", "unsaid", "C")]
    made = Assembly()
    add_initials(made, model(), frozenset(), (written, content, held))
    rows = [row.expression for block in made.blocks() for row in block.kernels[0].rows]
    at = {var("a", "f"): 1.0, var("b", "f"): 3.0, var("#init 0", "slack"): 2.0, var("#init 1", "unsaid"): 3.5}
    assert evaluate(rows, at.get) == [0.0, 0.5, 4.0]
    assert [(r.label, r.content) for r in made.rows] == [("initial", False), ("C", True), ("initial", False)]


# -- rates, integration, ledgers ---------------------------------------------------------------------------------------


def test_the_total_rate_takes_rates_of_multipliers_along():
    """d/dt (q f + kappa) = f f + q f' + kappa'."""
    q, f, kappa = var("a", "q"), var("a", "f"), var("rod", "kappa")
    found = total_rate(x.add(x.mul(q, f), kappa))
    at = {q: 2.0, f: 3.0, var("a", "f", 1): 5.0, var("rod", "kappa", 1): 7.0}
    assert evaluate([found], at.get) == [26.0]


def test_a_family_as_a_whole():
    shape = ((x.const(1.0), x.const(3.0)), (x.const(0.0), x.const(2.0)))
    nest, at = whole(UnknownFamily("a", shape, {}, PLACE))
    assert [(loop.index, loop.first.data, loop.last.data) for loop in nest] == [("#0", 1.0, 3.0), ("#1", 0.0, 2.0)]
    assert at == (x.index("#0"), x.index("#1"))


def constrained(expression, *, tangible):
    a, b = model().coordinates
    row = Row("psi", "gear", (), (Term(expression, (), PLACE),), (), PLACE)
    return EnergyModel((replace(a, tangible=tangible), b), rows=(row,))


def test_a_flow_constraint_of_constant_coefficients_on_a_tangible_coordinate_is_integrated():
    """a' - 2 b' + 3 = 0 becomes a - 2 b + 3 t - c = 0, c what that is at the start."""
    rate = x.linear(3.0, [(1.0, var("a", "f")), (-2.0, var("b", "f"))])
    found, (note,) = integrate(constrained(rate, tangible=True))
    (row,), (offset,) = found.rows, found.offsets
    assert (row.kind, offset.label) == ("phi", "gear")
    at = {var("a", "q"): 5.0, var("b", "q"): 1.0, x.time(): 2.0, x.param("#offset gear"): 8.0}
    assert evaluate([x.add(*(t.expression for t in row.terms))], at.get) == [1.0]
    assert note.code == "N501"


@pytest.mark.parametrize(("curved", "tangible"), [(False, False), (True, True)])
def test_other_flow_constraints_stay(curved, tangible):
    rate = x.sub(var("a", "f"), x.mul(var("b", "q"), var("b", "f")) if curved else var("b", "f"))
    before = constrained(rate, tangible=tangible)
    assert integrate(before) == (before, ())


def test_parts_that_nothing_joins_keep_ledgers_of_their_own():
    """Two oscillators: two ledgers; a dissipator between them: one.  Constants are left out."""
    a, b = var("a", "f"), var("b", "f")
    text = SourceText("m.sd", "A B C D")
    stored = [Entry("kinetic", (v.data[0],), (), x.mul(v, v), text.place(k, k + 1)) for k, v in enumerate((a, b))]
    constant = Entry("potential", ("a",), (), x.const(3.0), text.place(4, 5))
    found = ledgers(model(), (*stored, constant), ())
    assert [(one.names, one.title, len(one.entries)) for one in found] == [
        (("a",), "energy of a", 1),
        (("b",), "energy of b", 1),
    ]
    between = Entry("dissipated", ("a", "b"), (), x.power(x.sub(a, b), x.const(2.0)), text.place(6, 7))
    (one,) = ledgers(model(), (*stored, between), ())
    assert one.names == ("a", "b")


# -- what is traced where nothing is said ------------------------------------------------------------------------------


def test_every_element_is_observed_up_to_the_most():
    array = coordinate("v", ((x.const(1.0), x.const(3.0)),))
    network = blank(coordinates=(coordinate("u"), array), energies=(EnergyTerm("V", of("u", "q"), (), PLACE),))
    found, notes = with_coordinates_observed(energies(network), network)
    assert [q.name for q in found.quantities] == ["u", "v[1]", "v[2]", "v[3]"]
    assert notes == ()
    long = blank(coordinates=(coordinate("w", ((x.const(1.0), x.const(MOST + 1.0)),)),))
    found, (note,) = with_coordinates_observed(energies(long), long)
    assert (len(found.quantities), note.code) == (MOST, "N608")
    assert note.message == f"nothing is traced: of the {MOST + 1} elements of w the first {MOST} are"


# -- networks ----------------------------------------------------------------------------------------------------------


def test_what_became_of_nodes_and_branches_is_told_once():
    """A source, a resistor and a capacitor in one loop: one flow; a mass: its displacement."""
    net = Net()
    for name in "ab":
        net.node(name, ELECTRICAL)
    net.node("x", TRANSLATION)
    net.branch("V", "effort", "e", x.const(1.0), "a")
    net.R("R", 2.0, "a", "b")
    net.C("C", 3.0, "b")
    net.L("M", 1.0, "x")
    _, _, steps = primal(net.network())
    assert Step("P1", "node x", "coordinate x") in steps
    (flow,) = (s for s in steps if s.became.endswith(": one flow"))
    assert flow.became == "coordinate C: one flow"
    assert sorted(flow.what.removeprefix("branches ").replace("-", "").split(", ")) == ["C", "R", "V"]
    assert {s.what: s.became for s in steps if s.what in ("node a", "node b")} == {
        "node a": "merged: two branches, one flow",
        "node b": "merged: two branches, one flow",
    }


def statements():
    seen = Observation("seen", of("n", "ne"), ONE, "seen", PLACE)
    begin = InitialCondition(of("c", "bq"), of("m", "ne"), True, (), PLACE)
    energy = EnergyTerm("V", x.mul(of("u", "q"), of("v", "ne")), (), PLACE)
    return blank(observations=(seen,), initials=(begin,), energies=(energy,))


def test_expressions_are_those_of_the_sorts_asked_for():
    said = statements()
    assert expressions(said, "initials") == [of("c", "bq"), of("m", "ne")]
    assert expressions(said, "initials.value", "energies") == [of("m", "ne"), x.mul(of("u", "q"), of("v", "ne"))]
    assert nodes_read(said) == {"v"}  # a trace reads and binds nothing; an initial value does neither


def test_only_the_sorts_named_are_rewritten():
    changed = rewritten(statements(), lambda _: x.const(7.0), TRACED)
    assert [o.expression.data for o in changed.observations] == [7.0]
    assert changed.initials == statements().initials


def test_a_nest_is_named_from_its_outermost_loop():
    i, j = x.index("i"), x.index("j")
    nest, (found,) = canonical((Loop("i", x.const(1.0), x.const(4.0)), Loop("j", x.const(1.0), i)), [x.mul(i, j)])
    assert [(loop.index, loop.last) for loop in nest] == [("#0", x.const(4.0)), ("#1", x.index("#0"))]
    assert found == x.mul(x.index("#0"), x.index("#1"))


# -- the author's names ------------------------------------------------------------------------------------------------

OWN = {"R#": tuple((name, PLACE) for name in ("r1", "load", "r3"))}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("R#[1].multiplier", "load.multiplier"),
        ("R#.2[0]", "r1"),
        ("the branches R#[0..2], sum", "the branches r1 .. r3, sum"),
        ("Q#[1] is nobody's", "Q#[1] is nobody's"),
        ("no family", "no family"),
    ],
)
def test_elements_of_gathered_families_are_called_as_the_author_did(text, said):
    assert in_author_names(text, OWN) == said


def test_who_a_name_belongs_to():
    assert (owner("R#.2'", OWN), owner("Q#", OWN), owner("load", OWN)) == ("R#", None, None)


def test_a_finding_about_a_family_is_one_about_each_element():
    found = split_finding(Diagnostic("E313", "R#[i] follows R#[i - 1] for i in 1..2", PLACE), OWN)
    assert [d.message for d in found] == ["load follows r1", "r3 follows load"]
    plain = Diagnostic("E313", "load", PLACE)
    assert list(split_finding(plain, OWN)) == [plain]
