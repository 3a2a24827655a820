"""Parts of what happens at an event, each asked by itself, against closed forms and linear complementarity problems."""

from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest
from start_strategies import prepared_start
from sysdyn.cli.run.events import plan
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.runtime.events.contacts import Contacts
from sysdyn.runtime.events.determined import Determined
from sysdyn.runtime.events.impacts import Impacts
from sysdyn.runtime.events.plan import Assignment, Happened
from sysdyn.runtime.events.succession import Succession
from sysdyn.runtime.integrate.integrate import Integration
from sysdyn.runtime.integrate.jumps.modes import serves, told_of
from sysdyn.runtime.integrate.request import Request

G = 9.81


class Model:
    """A text at its start, with the parts that its events have."""

    def __init__(self, text, formulation="lagrangian"):
        report = Report()
        prepared, started = prepared_start(text, formulation, report=report)
        assert started is not None, list(report)
        self.system, state = started.system, started.state
        self.plan = plan(prepared, self.system)
        description = self.system.description
        begin = description.p.copy(), description.switches.active.copy()
        request = Request(1.0, np.array([1.0]), method="bdf", events=self.plan, begin=begin)
        self.run = Integration(self.system, state, request)
        self.handler = self.run.pieces.handler
        self.contacts: Contacts = self.handler.contacts
        self.succession: Succession = self.handler.succession
        self.determined: Determined = self.handler.determined
        self.impacts: Impacts = self.succession.impacts
        self.names = [c.name for c in self.plan.contacts]
        self.y, self.yd = state.y.copy(), state.yd.copy()

    def at(self, **values):
        """The point with these unknowns, e.g. f_x."""
        y = self.y.copy()
        for name, value in values.items():
            y[self.system.unknown_names.index(name)] = value
        return y

    def struck(self, **values):
        """The point behind the impacts."""
        strike, system = self.succession._strike, self.succession._restart.instant.system
        return self.impacts.after(0.0, self.at(**values), self.yd, strike, system, blow=False)


def row_of(masses, restitution=0.5):
    """Bodies that touch, side by side; each may be pushed by the one before it."""
    names = "abcde"[: len(masses)]
    coords = "".join(f"  coord {n}: translation = {k} m\n" for k, n in enumerate(names))
    kinetic = " + ".join(f"1/2*({m!r} kg)*{n}'^2" for n, m in zip(names, masses, strict=True))
    gaps = "".join(f"  phi {p}{q}: {q} - {p} >= 1 m restitution {restitution}\n" for p, q in pairwise(names))
    still = "".join(f"  init {n}' = 0 m/s\n" for n in names)
    trace = f"scene s of row {{ time 0 s to 1 s; trace {', '.join(names)} }}"
    return f"model row {{\n{coords}  energy T* = {kinetic}\n{gaps}{still}}}\n{trace}\n"


def test_a_run_begins_as_the_text_says_whatever_the_run_before_left():
    """Magnitudes and rates at the start are those of the numbers that hold there."""
    spring = "model m { param k = 3 N/m; param m = 2 kg; coord x: translation = 1 m; energy T* = 1/2*m*x'^2"
    made = Model(
        spring
        + """; energy V = 1/2*k*x^2; phi stop: x >= 0.5 m restitution 1; init x' = 0 m/s }
        scene s of m { time 0 s to 3 s; trace x }"""
    )
    begin = made.run.request.begin
    assert begin is not None
    first = made.run.sizes.magnitude.copy(), made.run.start_rate.copy()
    made.system.description.p[:] += 50.0
    made.system.description.switches.set(~begin[1])
    again = Integration(made.system, made.run.start, made.run.request)
    assert np.array_equal(again.sizes.magnitude, first[0])
    assert np.array_equal(again.start_rate, first[1])
    assert np.array_equal(made.system.description.switches.active, begin[1])


def newton(masses, speeds, restitution):
    """Speeds behind impulses l >= 0 of the gaps of a row: w = J v - aim >= 0, l w = 0, by trying every set."""
    n = len(masses) - 1
    j = np.eye(n, n + 1, 1) - np.eye(n, n + 1)
    before = j @ speeds
    aim = np.where(before < 0.0, -restitution * before, 0.0)
    inverse = j / masses @ j.T
    for held in product((False, True), repeat=n):
        held, push = np.array(held), np.zeros(n)
        if held.any():
            push[held] = np.linalg.solve(inverse[np.ix_(held, held)], (aim - before)[held])
        after = speeds + j.T @ push / masses
        if (push >= -1e-12).all() and (j @ after - aim >= -1e-12).all():
            return after
    raise AssertionError


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.one_in(12)
def test_impulses_of_a_row_of_bodies_solve_their_complementarity_problem(seed, formulation):
    random = np.random.default_rng(seed)
    masses = 10.0 ** random.uniform(-1.0, 1.0, int(random.integers(2, 6)))
    model = Model(row_of([float(m) for m in masses]), formulation)
    for _ in range(3):
        speeds = random.standard_normal(masses.size)
        flows = [f"{n}'" for n in "abcde"[: masses.size]]
        given = dict(zip(flows, speeds, strict=True))
        if formulation == "hamiltonian":
            given |= {f"{n}.p": m * v for n, m, v in zip("abcde", masses, speeds, strict=False)}
        found = model.struck(**given)
        at = [model.system.unknown_names.index(name) for name in flows]
        struck = newton(masses, speeds, 0.5)
        if masses @ struck**2 > masses @ speeds**2:  # Newton's law of several gaps may make energy: they close then
            struck = newton(masses, speeds, 0.0)
        assert found[at] == pytest.approx(struck, abs=1e-10)
        assert masses @ found[at] ** 2 <= masses @ speeds**2 * (1.0 + 1e-12)
        assert found[at] @ masses == pytest.approx(speeds @ masses, abs=1e-10)


def test_a_cradle_hands_its_motion_on():
    """Equal masses, elastic: they exchange their speeds."""
    model = Model(row_of([2.0, 2.0], 1.0))
    found = model.struck(**{"a'": 3.0, "b'": -1.0})
    assert found[[model.system.unknown_names.index(n) for n in ("a'", "b'")]] == pytest.approx([-1.0, 3.0], abs=1e-12)


@pytest.mark.long
def test_bodies_that_part_are_not_struck():
    model = Model(row_of([1.0, 2.0, 3.0]))
    y = model.at(**{"a'": -1.0, "b'": 0.5, "c'": 0.5})
    assert (model.struck(**{"a'": -1.0, "b'": 0.5, "c'": 0.5}) == y).all()


def test_what_lies_on_the_floor_holds_and_what_is_thrown_up_does_not():
    """Conditions of one gap: closed and pressed it holds; it lets go of what would pull; above the floor it is free."""
    text = """
    model body {
      coord h: translation = 0 m
      energy T* = 1/2*(2 kg)*h'^2
      energy V = 2 kg*9.81 m/s^2*h
      phi floor: h >= 0 m restitution 0
      init h' = 0 m/s
    }
    scene s of body { time 0 s to 1 s; trace h }
    """
    model = Model(text)
    contacts, settle = model.contacts, model.succession._restart.struck
    y, yd = model.determined.fit(0.0, model.y, model.yd, settle)
    multiplier = model.system.unknown_names.index("floor.multiplier")
    assert (model.names, contacts.active.tolist(), contacts.word(0)) == (["floor"], [True], "holds")
    assert abs(y[multiplier]) == pytest.approx(2.0 * G, rel=1e-12)
    values = contacts.observer(0.0, y, yd)
    nothing = np.zeros(y.size)
    assert contacts.wrong(values, nothing) == -1
    pulls = values.copy()
    pulls[model.plan.contacts[0].multiplier] = -1.0
    assert contacts.wrong(pulls, nothing) == 0
    contacts.flip(0, values)
    contacts.apply()
    assert contacts.word(0) == "free"
    free = settle(0.0, model.at(h=1.0), model.yd)
    assert contacts.wrong(contacts.observer(0.0, *free[:2]), nothing) == -1
    assert free[1][model.system.unknown_names.index("h'")] == pytest.approx(-G, rel=1e-12)
    falls = settle(0.0, model.at(h=0.0), model.yd)  # open and closed at once, it would fall through
    assert contacts.wrong(contacts.observer(0.0, *falls[:2]), nothing) == 0


BLOCK = """
model block {
  coord x: translation = 0 m
  energy T* = 1/2*(2 kg)*x'^2
  content D = 5 N*abs(x')
  work PUSH on x
  init x' = SPEED
}
scene s of block { time 0 s to 1 s; trace x }
"""


@pytest.mark.parametrize(
    ("push", "speed", "word", "rate"),
    [
        (3.0, 0.0, "sticks", 0.0),
        (-4.9, 0.0, "sticks", 0.0),
        (7.0, 0.0, "slips +", (7.0 - 5.0) / 2.0),
        (-9.0, 0.0, "slips -", (-9.0 + 5.0) / 2.0),
        (3.0, 1.0, "slips +", (3.0 - 5.0) / 2.0),
        (3.0, -1.0, "slips -", (3.0 + 5.0) / 2.0),
    ],
)
@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.long
def test_dry_friction_holds_up_to_its_bound_and_slides_along_the_speed(push, speed, word, rate, formulation):
    model = Model(BLOCK.replace("PUSH", f"{push} N").replace("SPEED", f"{speed} m/s"), formulation)
    (y, yd), _ = model.succession.after(0.0, model.y, model.yd, [], stalled=False)
    assert model.contacts.word(0) == word
    assert y[model.system.unknown_names.index("x'")] == pytest.approx(speed, abs=1e-15)
    assert yd[model.system.unknown_names.index("x'")] == pytest.approx(rate, abs=1e-12)
    # the other sense of what slides, or sliding where it sticks, is wrong
    stood = model.contacts.state()
    model.contacts.slip(0, -np.sign(speed or rate or push))
    model.contacts.apply()
    found = model.succession._restart.struck(0.0, model.y, model.yd)
    assert found is None or not model.contacts.fits(0.0, model.y, found)
    model.contacts.become(stood)
    assert model.contacts.word(0) == word


BRIDGE = """
from std.electrical import diode, resistor, current
model bridge {
  node a, b, p, n: electrical
  I: current(i = SOURCE) b -> a
  leak: resistor(R = 1 kohm) b -> ground
  load: resistor(R = 10 ohm) p -> n
  D1: diode.complementary() a -> p
  D2: diode.complementary() b -> p
  D3: diode.complementary() n -> a
  D4: diode.complementary() n -> b
}
scene s of bridge { time 0 s to 1 s; trace load.f }
"""


@pytest.mark.parametrize(("source", "conduct"), [(2.0, {"D1", "D4"}), (-2.0, {"D2", "D3"})])
@pytest.mark.long
def test_a_bridge_conducts_by_two_of_its_diodes(source, conduct):
    """Four that conduct leave the current that circles in them open; where all block nothing tells the efforts of a,
    and of p and n together.
    """
    model = Model(BRIDGE.replace("SOURCE", f"{source} A"))
    contacts = model.contacts
    point = model.determined.fit(0.0, model.y, model.yd, model.succession._restart.struck)
    assert {name for k, name in enumerate(model.names) if not contacts.active[k]} == {f"{d}.one_way" for d in conduct}
    assert model.determined.nullity(0.0, *point) == 0
    open_ = {}
    for held in product((False, True), repeat=4):
        contacts.active[:] = held
        contacts.apply()
        open_[held] = model.determined.nullity(0.0, *point)
    assert open_[False, False, False, False] == 1
    assert open_[True, True, True, True] == 2
    assert all(open_[one] == 0 for one in ((True, False, False, True), (False, True, True, False)))


def test_what_has_happened_before_is_known():
    """A second event at which the same set stands and the same is touched is not sought again; a stalled one is."""
    text = BRIDGE.replace("SOURCE", "2 A*cos(2*pi*(50 Hz)*t)")
    model = Model(text)
    succession = model.succession
    (y, yd), sought = succession.after(0.0, model.y, model.yd, [], stalled=False)
    stood = model.contacts.state()
    assert sought
    again, sought = succession.after(0.0, y, yd, [], stalled=False)
    assert not sought
    assert model.contacts.state() == stood
    assert again[0] == pytest.approx(y, abs=1e-12)
    assert succession.after(0.0, y, yd, [], stalled=True)[1]
    # half a period later the other pair conducts: what followed before does not fit, and is sought
    (y, _), sought = succession.after(0.01, y, yd, [], stalled=False)
    assert sought
    assert y[model.system.unknown_names.index("load'")] == pytest.approx(2.0, rel=1e-9)


def test_the_core_takes_transitions_but_those_of_friction_in_the_plane():
    model = Model(BRIDGE.replace("SOURCE", "2 A"))
    assert serves(model.plan, model.run)
    assert model.run.pieces.modes is not None
    flat = tuple(replace(c, kind="planar") for c in model.plan.contacts)
    assert not serves(replace(model.plan, contacts=flat), model.run)


def test_what_the_core_tells_of_a_transition_is_what_the_handler_tells():
    assigned = Assignment("g", "discrete", 0, 0), Assignment("h", "discrete", 1, 1)
    entry, other = Happened(0.0, "when x < 0", "", "", ""), Happened(0.0, "D1", "D1.one_way", "free", "holds")
    told = told_of((assigned,), (entry, other))
    assert told.entries_at(2.5, [1.0, 2.0, 3.0, 4.0]) == [
        Happened(2.5, "when x < 0", "", "g = 1, h = 3", "g = 2, h = 4"),
        Happened(2.5, "D1", "D1.one_way", "free", "holds"),
    ]
