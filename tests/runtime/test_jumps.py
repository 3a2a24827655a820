"""States across a jump of the text against closed forms: collisions, sums of inertia, charges that pass at once."""

import numpy as np
import pytest
import small_models as models
from sysdyn.runtime.events.conditions import with_momenta
from sysdyn.runtime.integrate.integrate import Integration
from sysdyn.runtime.integrate.request import Request
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.instant import Instant
from sysdyn.runtime.start.restart import Restart
from sysdyn.runtime.start.start import consistent_start


def settled_of(*parts, **more):
    manifest, binding, module = models.small(*parts, **more)
    return System(manifest, binding, load(module), "settled")


def values(system, **named):
    """Y [unknowns] with these values, the others zero."""
    y = np.zeros(system.unknowns)
    for name, value in named.items():
        y[place(system, name)] = value
    return y


def place(system, name):
    return [system.name(k) for k in range(system.unknowns)].index(name)


def read(system, y, *names):
    return [float(y[place(system, name)]) for name in names]


FORMS = ["lagrangian", "hamiltonian"]


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("scale", [1.0, 1e-6, 1e6])
@pytest.mark.one_in(12)
def test_two_masses_that_are_coupled_go_on_with_their_common_momentum(form, scale):
    """m1 = 1, m2 = 3, at 4 and 0: both go on at 1, by an impulse of 3; whatever the magnitudes."""
    system = settled_of("a b", "f_a**2/2 + 3*f_b**2/2", psi={"clutch": "f_a - f_b"}, form=form)
    momenta = {"p_a": 4.0} if form == "hamiltonian" else {}
    y = values(system, f_a=4.0, **momenta)
    rates, size = np.zeros(y.size), np.full(y.size, scale)
    instant = Instant(system)
    assert instant.broken(0.0, y, rates, size)
    after, impulse = instant.flows(0.0, y, rates, size)
    assert read(system, after, "f_a", "f_b") == pytest.approx([1.0, 1.0], rel=1e-12)
    if momenta:
        assert read(system, after, "p_a", "p_b") == pytest.approx([1.0, 3.0], rel=1e-12)
    assert read(system, impulse, "mu_clutch") == pytest.approx([3.0], rel=1e-12)
    assert not instant.broken(0.0, after, rates, size)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.long
def test_a_rod_takes_away_the_speed_along_itself(form):
    """(x, y) = (3, 4), |r| = 5: of the speed (1, 2) what is along the rod goes, what is along (-4, 3) stays."""
    system = settled_of("x y", "7*(f_x**2 + f_y**2)/2", phi={"rod": "(q_x**2 + q_y**2 - 25)/2"}, form=form)
    momenta = {"p_x": 7.0, "p_y": 14.0} if form == "hamiltonian" else {}
    y = values(system, q_x=3.0, q_y=4.0, f_x=1.0, f_y=2.0, **momenta)
    after, impulse = Instant(system).flows(0.0, y, np.zeros(y.size), np.ones(y.size))
    along = (-4.0 * 1.0 + 3.0 * 2.0) / 25.0
    assert read(system, after, "q_x", "q_y") == [3.0, 4.0]
    assert read(system, after, "f_x", "f_y") == pytest.approx([-4.0 * along, 3.0 * along], rel=1e-12)
    # M (f+ - f-) + r Lambda = 0
    assert read(system, impulse, "kappa_rod") == pytest.approx([7.0 * (3.0 + 8.0) / 25.0], rel=1e-12)


@pytest.mark.long
def test_what_has_no_inertia_takes_no_impulse():
    """A damper between two masses, its flow the difference of theirs, takes all of the jump."""
    system = settled_of("a b d", "f_a**2/2 + 3*f_b**2/2", content="f_d**2/2", psi={"across": "f_a - f_b - f_d"})
    y = values(system, f_a=4.0)
    after, impulse = Instant(system).flows(0.0, y, np.zeros(y.size), np.ones(y.size))
    assert read(system, after, "f_a", "f_b", "f_d") == pytest.approx([4.0, 0.0, 4.0], abs=1e-12)
    assert read(system, impulse, "mu_across") == pytest.approx([0.0], abs=1e-12)


@pytest.mark.long
def test_a_collision_that_gives_back_a_part():
    """Newton's law of restitution, e = 1/2: v+ = -v-/2 in a contact of 1 and 3 at 4 and 0 (aims)."""
    system = settled_of("a b", "f_a**2/2 + 3*f_b**2/2", psi={"contact": "f_a - f_b"})
    aims = np.where(system.of_groups("psi"), -0.5 * 4.0, 0.0)
    y = values(system, f_a=4.0)
    after, impulse = Instant(system).flows(0.0, y, np.zeros(y.size), np.ones(y.size), aims)
    assert read(system, after, "f_a", "f_b") == pytest.approx([-0.5, 1.5], rel=1e-12)
    assert read(system, impulse, "mu_contact") == pytest.approx([4.5], rel=1e-12)


@pytest.mark.parametrize(("ratio", "expected"), [(1.0, (2.0, 1.0)), (2.0, (1.0, 1.0))])
def test_flows_that_inertia_ties_together_share_by_their_balances(ratio, expected):
    """One coil for a + n b = 3, resistors 1 and 2: the drop across the second is n times that across the first."""
    system = settled_of("a b", f"(f_a + {ratio}*f_b)**2/2", content="f_a**2/2 + 2*f_b**2/2")
    y = values(system, f_a=3.0)
    found, _ = Instant(system).flows(0.0, y, np.zeros(y.size), np.ones(y.size))
    assert read(system, found, "f_a", "f_b") == pytest.approx(expected, rel=1e-12)


@pytest.mark.long
def test_charge_jumps_at_once_where_no_resistor_stands():
    """5 V across capacitors of 1 F and 2 F in series: 10/3 C pass at once, none through the resistor at the second."""
    system = settled_of("a b", 0, "q_a**2/2 + (q_a - q_b)**2/4", "3*f_b**2/2", work={"a": "5"})
    y = values(system, q_a=0.0, q_b=0.5)
    found, _ = Instant(system).displacements(0.0, y, np.zeros(y.size), np.ones(y.size))
    # q_a + (q_a - 1/2)/2 = 5
    assert read(system, found, "q_a", "q_b") == pytest.approx([3.5, 0.5], rel=1e-12)


def test_a_mass_takes_no_displacement_at_once():
    """A spring between a point that is pushed and a mass: the point goes where the spring carries the push."""
    system = settled_of("a b", "f_b**2/2", "4*(q_a - q_b)**2/2 + f_a*0", work={"a": "2"})
    y = values(system, q_a=1.0, q_b=1.0)
    found, _ = Instant(system).displacements(0.0, y, np.zeros(y.size), np.ones(y.size))
    assert read(system, found, "q_a", "q_b") == pytest.approx([1.5, 1.0], rel=1e-12)


@pytest.mark.long
def test_impulses_of_a_constraint_share_a_displacement():
    """Capacitors of 1 F and 3 F at 4 V and 0 V, joined: the common voltage is 1 V (charge stays)."""
    system = settled_of("a b", 0, "q_a**2/2 + q_b**2/6", psi={"joint": "f_a + f_b"}, phi={"charge": "q_a + q_b - 4"})
    y = values(system, q_a=4.0)
    found, _ = Instant(system).displacements(0.0, y, np.zeros(y.size), np.ones(y.size))
    assert read(system, found, "q_a", "q_b") == pytest.approx([1.0, 3.0], rel=1e-12)


@pytest.mark.long
def test_dampers_share_a_displacement_by_their_resistance():
    """s + s^3/10 = 2.8 of s = a + b asks for s = 2 at once; dampers of 1 and 3 give way: a = 3 b."""
    constraint = "(q_a + q_b) + (q_a + q_b)**3/10 - 2.8"
    system = settled_of("a b", 0, content="f_a**2/2 + 3*f_b**2/2", phi={"push": constraint})
    y = values(system)
    found, _ = Instant(system).displacements(0.0, y, np.zeros(y.size), np.ones(y.size))
    a, b = read(system, found, "q_a", "q_b")
    assert a == pytest.approx(3.0 * b, rel=1e-10)
    assert a + b == pytest.approx(2.0, rel=0.01)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.long
def test_a_displaced_damper_gives_its_impulse_to_a_mass(form):
    """One end goes 3 m at once, 2 N.s/m to a mass of 4 kg: c dq = 6 N.s, and 1.5 m/s more."""
    system = settled_of("a b", "4*f_b**2/2", content="2*(f_a - f_b)**2/2", phi={"drive": "q_a - 3"}, form=form)
    momenta = {"p_b": 4.0} if form == "hamiltonian" else {}
    y = values(system, f_b=1.0, **momenta)
    point = np.zeros(y.size), np.ones(y.size)
    there, push = Instant(system).displacements(0.0, y, *point)
    assert read(system, there, "q_a", "q_b", "f_b") == pytest.approx([3.0, 0.0, 1.0], abs=1e-12)
    assert np.abs(push).max() == pytest.approx(6.0, rel=1e-12)
    found, _ = Instant(system).flows(0.0, there, *point, push=push)
    assert read(system, found, "f_b") == pytest.approx([2.5], rel=1e-12)


@pytest.mark.long
def test_across_a_jump_the_state_stays_and_the_rest_follows():
    """A charge of 2 C in 4 F behind 0.25 ohm, 3 V from now on: q stays, the current is (3 - 1/2)/0.25 = 10 A."""
    manifest, binding, module = models.small(
        "c", 0, "q_c**2/8", "0.25*f_c**2/2", work={"c": "e_1"}, implicit=("1",), gamma={"source": "e_1 - 3*t"},
        initial={"q_c": (2.0, True)},
    )  # fmt: skip
    system = System(manifest, binding, load(module), "2")
    state = consistent_start(system, 0.0)
    settler = Integration(system, state, Request(1.0, np.array([1.0]), index=2)).settler
    y, yd = state.y.copy(), state.yd.copy()
    assert read(system, y, "f_c") == pytest.approx([-2.0])
    y, yd, impulse = Restart(settler, system.are("q")[: y.size]).struck(1.0, y, yd)
    assert read(system, y, "q_c", "f_c", "e_1") == pytest.approx([2.0, 10.0, 3.0], rel=1e-10)
    assert yd[place(system, "q_c")] == pytest.approx(10.0, rel=1e-10)
    assert not impulse.any()


@pytest.mark.long
def test_across_a_jump_a_charge_without_resistor_follows_the_source():
    """3 V at once across 4 F and, beside it, 0.25 ohm: 12 C pass into the one, none through the other."""
    manifest, binding, module = models.small(
        "c r", 0, "q_c**2/8", "0.25*f_r**2/2", work={"c": "e_1", "r": "e_1"}, implicit=("1",),
        gamma={"source": "e_1 - 3*t"}, initial={"q_r": (1.0, True)},
    )  # fmt: skip
    system = System(manifest, binding, load(module), "2")
    state = consistent_start(system, 0.0)
    settler = Integration(system, state, Request(1.0, np.array([1.0]), index=2)).settler
    y, _, _ = Restart(settler, system.are("q")[: state.y.size]).struck(1.0, state.y.copy(), state.yd.copy())
    assert read(system, y, "q_c", "q_r", "f_r") == pytest.approx([12.0, 1.0, 12.0], rel=1e-9)


@pytest.mark.long
def test_across_a_jump_of_a_speed_the_impulse_is_told():
    """2 kg taken to 3 m/s at once: M (f+ - f-) + Lambda = 0."""
    manifest, binding, module = models.small("x", "f_x**2", psi={"source": "f_x - 3*t"}, initial={"q_x": (1.0, True)})
    system = System(manifest, binding, load(module), "2")
    state = consistent_start(system, 0.0)
    settler = Integration(system, state, Request(1.0, np.array([1.0]), index=2)).settler
    kept = system.are("q", "f")[: state.y.size]
    y, yd, impulse = Restart(settler, kept).struck(1.0, state.y.copy(), state.yd.copy())
    assert read(system, y, "q_x", "f_x", "mu_source") == pytest.approx([1.0, 3.0, -6.0], rel=1e-9)
    assert read(system, yd, "f_x") == pytest.approx([3.0], rel=1e-9)
    assert read(system, impulse, "mu_source") == pytest.approx([-6.0], rel=1e-9)


@pytest.mark.parametrize(
    ("kinetic", "momenta"), [("f_x**2 + f_x*f_y/2 + 3*f_y**2", (4.5, 7.0)), ("f_x**4 + f_y**2/2", (32.0, 1.0))]
)
def test_momenta_follow_from_flows_that_were_assigned(kinetic, momenta):
    """dT*/df at f = (2, 1), whatever they were before; displacements and flows stay."""
    settled = settled_of("x y", kinetic, "q_x**2", form="hamiltonian")
    y = values(settled, q_x=5.0, f_x=2.0, f_y=1.0, p_x=-1.0, p_y=100.0)
    found = with_momenta(settled, 0.0, y, np.zeros_like(y))
    assert read(settled, found, "p_x", "p_y") == pytest.approx(momenta, rel=1e-14)
    assert read(settled, found, "q_x", "f_x", "f_y") == [5.0, 2.0, 1.0]
    assert read(settled, y, "p_x", "p_y") == [-1.0, 100.0]  # the caller's own stay
    plain = settled_of("x y", kinetic, "q_x**2")  # without momenta there is nothing to do
    y = values(plain, f_x=2.0)
    assert with_momenta(plain, 0.0, y, y) is y
