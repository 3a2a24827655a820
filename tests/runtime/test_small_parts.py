"""Parts of one integration on a rod written twice, against what is known of it by hand."""

import numpy as np
import pytest
import small_models as models
from sysdyn.runtime.integrate.factors import Factors
from sysdyn.runtime.integrate.methods import Method
from sysdyn.runtime.integrate.rows.least_norm import LeastMultipliers
from sysdyn.runtime.integrate.weights.metric import kinematic_scale
from sysdyn.runtime.integrate.weights.round_off import left_open
from sysdyn.runtime.integrate.weights.unknown_roles import roles
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.failures import ContractError
from sysdyn.runtime.model.forms import FORMS, NOWHERE, nu_name, plan, unknown_name
from sysdyn.runtime.model.scales import group_maxima
from sysdyn.runtime.model.structures import c_types
from sysdyn.runtime.model.structures.linear import Linear, Order
from sysdyn.runtime.model.structures.run import Modes, Run
from sysdyn.runtime.model.structures.start import RowsOfStart
from sysdyn.runtime.model.structures.system import System as CoreSystem
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.ordering import net_order_of
from sysdyn.runtime.start.equations import Equations
from sysdyn.runtime.start.starter import EQUATIONS, Starter

ROD = {"rod": "q_1**2 + q_2**2 - 25"}
INITIAL = {"q_1": (3.0, True), "q_2": (-4.0, False), "f_1": (0.0, True), "f_2": (0.0, False)}


def system(form="3", *, phi=ROD, **more):
    """A point of 2 kg on a rod of 5 m."""
    made = models.small("1 2", "f_1**2 + f_2**2", "2*9.81*q_2", phi=phi, initial=INITIAL, **more)
    return System(made[0], made[1], load(made[2]), form)


def point(of, **values):
    y = np.zeros(of.unknowns)
    for name, value in values.items():
        y[of.unknown_names.index(name)] = value
    return y


def groups(form):
    return [name for name, _, _ in form.groups]


@pytest.mark.long
def test_an_index_form_has_the_rows_that_its_name_says():
    description = system().description
    assert groups(plan(description, "3")) == ["dynamics", "dynamics", "phi"]
    assert groups(plan(description, "2v")) == ["dynamics", "dynamics", "phi_rate"]
    assert groups(plan(description, "1")) == ["dynamics", "dynamics", "phi_acceleration"]
    assert set(groups(plan(description, "settled"))) == {"dynamics", "phi", "phi_rate", "phi_acceleration"}


def test_only_the_stabilised_form_has_multipliers_nu_behind_the_others():
    description = system().description
    as_written, stabilised = plan(description, "3"), plan(description, "2")
    assert stabilised.unknowns == as_written.unknowns + 1 == as_written.written + 1
    assert stabilised.kind[-1] == ("nu", 1)
    assert stabilised.rows == stabilised.unknowns
    assert unknown_name(description, stabilised, as_written.written) == nu_name("kappa_rod")
    assert nu_name("rod.multiplier") == "rod.nu"
    with pytest.raises(ContractError, match="no unknown"):
        unknown_name(description, stabilised, stabilised.unknowns)


def test_rows_of_displacements_stand_first_and_settled_forms_have_none():
    description = system().description
    form = plan(description, "3")
    assert form.k_row.tolist() == [0, 1]
    assert [unknown_name(description, form, int(k)) for k in (*form.k_q, *form.k_f)] == ["q_1", "q_2", "f_1", "f_2"]
    assert form.row_label(description, 0).label == "q_1' = f"
    assert form.row_label(description, form.rows - 1).label == "rod"
    assert plan(description, "settled").k_row.size == 0


def test_a_constraint_that_is_not_differentiated_stands_in_its_own_row():
    description = system().description
    family = description.rows_of("phi")[0]
    form = plan(description, f"0/{family}")
    assert form.base == "0"
    blocks = {call.block: call.to for call in form.calls}
    assert blocks["phi_rate"][family] < blocks["phi_acceleration"][family]  # the other one is read by nothing
    assert (np.delete(blocks["phi_rate"], family) == NOWHERE).all()


def test_every_form_is_made_of_blocks_that_settled_points_have():
    settled = {block for block, _ in FORMS["settled"]} | {"phi_normal"}
    assert all(block in settled for name in ("3", "2", "2v", "1", "0") for block, _ in FORMS[name])


def test_the_least_multipliers_of_a_row_written_twice_share_its_force():
    """phi and 2 phi: of kappa_1 + 2 kappa_2 = k the least are k/5 and 2 k/5."""
    settled = system("settled", phi={**ROD, "again": "2*(q_1**2 + q_2**2 - 25)"})
    written = settled.another("3")
    y, yd = point(written, q_1=3.0, q_2=-4.0, kappa_rod=7.0), np.zeros(written.unknowns)
    found = LeastMultipliers(settled).apply(0.0, y, yd)
    kappa = [found[written.unknown_names.index(name)] for name in ("kappa_rod", "kappa_again")]
    assert kappa == pytest.approx([7.0 / 5.0, 14.0 / 5.0])
    assert settled.residual(0.0, found, yd)[settled.of_groups("dynamics")] == pytest.approx(
        settled.residual(0.0, y, yd)[settled.of_groups("dynamics")]
    )


@pytest.mark.long
def test_displacements_of_one_unit_have_one_metric_and_of_two_that_of_their_inertia():
    alike = system("2")
    y = point(alike, q_1=3.0, q_2=-4.0)
    slopes = alike.jacobian(0.0, y, np.zeros_like(y))
    assert kinematic_scale(alike, np.ones(alike.unknowns), *slopes).tolist() == [1.0, 1.0]
    units = {"q_1": "m", "f_1": "m/s", "q_2": "rad", "f_2": "rad/s"}
    made = models.small("1 2", "f_1**2 + 50*f_2**2", phi={"p": "q_1 - 7*q_2"}, initial=INITIAL, units=units)
    mixed = System(made[0], made[1], load(made[2]), "2")
    y = point(mixed, q_1=3.0)
    found = kinematic_scale(mixed, np.ones(mixed.unknowns), *mixed.jacobian(0.0, y, np.zeros_like(y)))
    assert found == pytest.approx([1.0, 50.0])  # 2 kg and 100 kg m^2


@pytest.mark.long
def test_roles_of_a_point_on_a_rod():
    """Index 3: displacements are tested as they are, flows with h, the tension not at all; it weighs with h^2."""
    of = system()
    y = point(of, q_1=3.0, q_2=-4.0)
    jyd = of.jacobian(0.0, y, np.zeros_like(y))[1]
    found, three = (roles(of, 0.0, jyd, index) for index in (1, 3))
    by = of.unknown_names.index
    assert found.test[[by("q_1"), by("f_1"), by("kappa_rod")]].tolist() == [0, 0, -1]
    assert three.test[[by("q_1"), by("f_1"), by("kappa_rod")]].tolist() == [0, 1, -1]
    assert three.power[[by("q_1"), by("f_1"), by("kappa_rod")]].tolist() == [0, 1, 2]
    assert three.state.sum() == 4
    assert not three.smooth[by("kappa_rod")]


@pytest.mark.parametrize(("name", "stages", "pairs"), [("bdf", 3, 0), ("radau", 3, 1), ("radau", 7, 3)])
@pytest.mark.long
def test_a_method_steps_the_unknowns_of_its_system_with_a_complex_matrix_a_pair_of_stages(name, stages, pairs):
    of = system("1")
    order = net_order_of(of)
    factors = Factors()
    real = factors.take(of.pattern, order)
    method = Method(name, of, real.linear, factors, order, stages=stages)
    assert method.contents.n == of.unknowns
    assert len(method.complex) == pairs
    assert lib.Stepper.from_address(method.stepper).n == of.unknowns
    del method, real
    assert len(factors.at_hand) == 1 + pairs


def test_round_off_of_a_quantity_is_that_of_its_terms():
    """Of a charge of 1 that follows q' = f, p' = -q, f = p, nothing is known to less than round-off or to 1e-9."""
    made = models.small("x", "f_x**2/2", "q_x**2/2", initial={"q_x": (1.0, True)}, observe={"x": "q_x"})
    of = System(made[0], made[1], load(made[2]))
    y, yd = point(of, q_x=1.0), np.zeros(of.unknowns)
    found = left_open(of, 0.0, (y, yd, group_maxima(of, np.abs(y))), 1e-2)
    assert 1e-17 < found.quantities[0] < 1e-12
    # a rate that large leaves the charge open that the text gives: then nothing is excused
    vast = left_open(of, 0.0, (y, yd, np.full(8, 1e20)), 1e-2)
    assert not vast.quantities.any()
    assert not vast.ledgers.any()


@pytest.mark.long
def test_equations_of_a_start_are_rows_and_unknowns_of_the_settled_form():
    starter = Starter(system())
    known = starter.equations
    assert isinstance(known, Equations)
    assert starter.system.once(EQUATIONS, lambda: None) is known  # once a text
    assert known.unknowns == known.n + known.rates.size
    assert known.written == starter.settled.form.written
    assert known.rows.size == known.columns.size == known.plain + known.rated
    assert known.columns.max() < known.unknowns
    # kinds: rates are other ones than what they are rates of
    assert not set(known.alike[: known.n]) & set(known.alike[known.n :])
    assert not known.unsettled[starter.groups("phi", "phi_rate", "phi_acceleration")].any()


def test_structures_hold_numbers_and_addresses_alone():
    kinds = {c_types.D, c_types.I, c_types.L, c_types.P}
    for structure in (Order, Linear, Run, Modes, RowsOfStart, CoreSystem):
        assert structure.__doc__.startswith("sd_")
        fields = [kind for _, kind, *_ in structure._fields_]
        assert kinds & set(fields)


def test_what_a_run_learnt_of_pivots_serves_the_next():
    """A second run from one start takes its factorisations again: it pivots nothing, as the first did at first."""
    of = system("1")
    order, factors = net_order_of(of), Factors()
    taken = factors.take(of.pattern, order)
    lib.core.sd_linear_replayed(taken.linear)
    jy, jyd = of.jacobian(0.0, point(of, q_1=3.0, q_2=-4.0), np.zeros(of.unknowns))
    values, scale = jy + 100.0 * jyd, np.ones(of.unknowns)
    given = np.arange(1.0, 1.0 + of.unknowns)
    first = given.copy()
    for _ in range(8):
        assert lib.core.sd_linear_factor(taken.linear, lib.pointer(values), lib.pointer(scale)) == 0
    lib.core.sd_linear_solve(taken.linear, lib.pointer(first))
    assert taken.linear.contents.factorisations == 8
    del taken
    again = factors.take(of.pattern, order)
    assert again.linear.contents.factorisations == 0
    assert again.linear.contents.replayed == 0
    assert lib.core.sd_linear_factor(again.linear, lib.pointer(values), lib.pointer(scale)) == 0
    assert again.linear.contents.replayed == 1
    second = given.copy()
    lib.core.sd_linear_solve(again.linear, lib.pointer(second))
    assert second.tolist() == first.tolist()
    other = factors.take(of.pattern, order)  # while that one is held there is no other at hand
    assert lib.core.sd_linear_factor(other.linear, lib.pointer(values), lib.pointer(scale)) == 0
    assert other.linear.contents.replayed == 0
