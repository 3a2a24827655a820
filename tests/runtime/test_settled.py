"""A point settles onto its rows: by a basis where the state may stay, by the least change where it has to move."""

import chain_model as chain
import numpy as np
import pytest
import small_models as models
from sysdyn.runtime.integrate.integrate import Integration, Request
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.start import consistent_start

MANIFEST = {"structure": chain.structure()}
NEVER, REFUSALS, AGAIN = 1 << 20, 3, 16
"""Of core/system/settle.c."""


@pytest.fixture
def settler():
    """Of a chain of four links, and its consistent start (y, yd)."""
    found, integration = settler_of(4)
    found.core.contents.slack = 0.0
    n = found.system.unknowns
    return found, integration.y[:n].copy(), integration.yd[:n].copy(), integration


def settler_of(links):
    system = System(MANIFEST, chain.binding(links), load(chain.Chain), "2")
    state = consistent_start(system, 0.0)
    integration = Integration(system, state, Request(0.1, np.array([0.1]), index=2))
    return integration.settler, integration


def both(settler, y, yd):
    """Settled with the basis, and by the least change alone: (values, whether the basis did it) of each."""
    core = settler.core.contents
    found = []
    for refused in (0, NEVER):
        core.refused, core.ready = refused, 0
        a, b, fine = settler.settle(0.0, y, yd)
        assert fine
        found.append((a.copy(), b.copy()))
    core.refused = 0
    return found


@pytest.mark.long
def test_what_follows_from_the_state_is_the_same_by_both_ways(settler):
    settler, y, yd, _ = settler
    rng = np.random.default_rng(1)
    follows = ~settler._state[: y.size]
    moved = y + follows * 0.1 * settler.scale[: y.size] * rng.normal(size=y.size)
    (a, ad), (b, bd) = both(settler, moved, yd)
    size = settler.scale[: y.size]
    assert np.abs(a - b).max() <= 1e-10 * size.max()  # the least change drags the state by that
    assert np.abs((a - y)[~follows]).max() <= np.finfo(float).eps
    assert np.abs((a - y) / size).max() < 1e-11  # where it came from: the start is consistent
    assert np.abs(ad - bd)[settler.rates].max() <= 1e-8 * np.abs(bd).max()


@pytest.mark.long
def test_a_state_off_its_constraints_moves_least_unless_slack_is_given(settler):
    settler, y, yd, _ = settler
    state = settler._state[: y.size]
    off = y + state * 1e-3 * settler.scale[: y.size]
    (a, _), (b, _) = both(settler, off, yd)
    assert np.array_equal(a, b)
    assert np.abs((b - off)[state]).max() > 1e-5 * settler.scale[: y.size][state].max()
    settler.core.contents.slack, settler.core.contents.ready = 1.0, 0
    c, _, fine = settler.settle(0.0, off, yd)
    assert fine
    assert settler.core.contents.residual < 1e-12
    least, basic = (np.linalg.norm(((x - off) / settler.scale[: y.size])[state]) for x in (b, c))
    assert least <= basic * (1.0 + 1e-6)
    assert basic < 10.0 * least


@pytest.mark.long
def test_a_basis_that_was_refused_is_tried_again_later(settler):
    settler, y, yd, _ = settler
    core = settler.core.contents
    core.refused, core.ready = REFUSALS, 0
    off = y + ~settler._state[: y.size] * 1e-3 * settler.scale[: y.size]
    tried = []
    for _ in range(AGAIN):
        assert settler.settle(0.0, off, yd)[2]
        tried.append(core.refused == 0)
    assert tried[-1]
    assert not all(tried[: AGAIN // 2])


@pytest.mark.long
def test_a_draft_is_content_with_what_it_asks_for(settler):
    """A residual that a draft takes for none ends the search: no other weights, no other point, no failure."""
    settler, y, yd, _ = settler
    core = settler.core.contents
    core.basis, core.enough = None, 1e-4
    settler.settle(0.0, y, yd)
    made = settler.linear.contents.factorisations
    off = y + settler._state[: y.size] * 1e-2 * settler.scale[: y.size] * np.arange(1, y.size + 1) / y.size
    core.ready = 0
    _, _, fine = settler.settle(0.0, off, yd)
    assert fine
    assert 1e-9 < core.residual <= 1e-4
    assert settler.linear.contents.factorisations - made <= 2


def _least_change(x, u, size, length):
    """Positions and velocities [2, links] of a chain moved least, in their magnitudes, onto its rods: by the equations
    of mechanics, dense.
    """
    links = x.shape[1]
    start = np.concatenate([x.ravel(), u.ravel()])
    z = start.copy()
    difference = np.eye(links) - np.eye(links, k=-1)
    for _ in range(8):
        x, u = z.reshape(2, 2, links)
        dx, du = x @ difference.T, u @ difference.T
        rods = np.hstack([np.diag(2 * d) @ difference for d in dx] + [np.zeros((links, 2 * links))])
        rates = np.hstack([np.diag(2 * d) @ difference for d in (*du, *dx)])
        slopes = np.vstack([rods, rates])
        missing = np.concatenate([(dx**2).sum(0) - length**2, 2 * (dx * du).sum(0)])
        # nearest to the start on the rows as they are here
        z = start - size * np.linalg.lstsq(slopes * size, missing + slopes @ (start - z), rcond=None)[0]
    return z.reshape(2, 2, links)


@pytest.mark.long
def test_links_that_turn_ask_for_no_other_pivots():
    """Of a chain slopes like x_i - x_(i-1) vanish while links turn: pivots are chosen once, not at every second point,
    and the points are those of least change.
    """
    links = 60
    settler, integration = settler_of(links)
    settler.core.contents.basis = None
    n, rng = settler.system.unknowns, np.random.default_rng(5)
    turns, at_first = rng.uniform(-4.0, 4.0, size=links), rng.uniform(-1.0, 1.0, size=links)
    for t in np.linspace(0.0, 2.0, 41):
        angle = at_first + turns * t
        x = np.cumsum([np.sin(angle), -np.cos(angle)], axis=1) / links
        u = np.cumsum([np.cos(angle) * turns, np.sin(angle) * turns], axis=1) / links
        off = 1e-5 * rng.normal(size=(2, 2, links))
        y, yd = integration.y[:n].copy(), integration.yd[:n].copy()
        given = (np.stack([x, u]) + off).ravel()
        y[: 4 * links] = given
        y, yd, fine = settler.settle(t, y, yd)
        assert fine
        assert settler.core.contents.residual < 1e-12
        size = lib.reader(settler.core.contents.scale, 4 * links)
        wanted = _least_change(x + off[0], u + off[1], size, 1.0 / links).ravel()
        # slopes of the first steps serve to the end: they differ by what it moves
        assert np.abs((y[: 4 * links] - wanted) / size).max() < 1e-3 * np.abs((wanted - given) / size).max()
    made = settler.linear.contents
    assert made.factorisations >= 41
    assert made.pivotings == 1


@pytest.mark.parametrize("off", [1e-6, 0.3])
def test_a_floating_store_keeps_its_difference_and_not_what_its_ends_are_at(off):
    """A capacitor (1) from x to y, 100 and 1 S from these to 90 V and to ground: both ends at which it holds 7 V are
    known in closed form; a point whose ends are off by as much each finds back, one off in its difference has it."""
    manifest, binding, module = models.small(
        "x y",
        "(f_x - f_y)**2/2",
        content="100*(f_x - 90)**2/2 + f_y**2/2",
        initial={"f_x": (7.0 + 8300.0 / 101.0, True)},
    )
    system = System(manifest, binding, load(module), "2")
    state = consistent_start(system, 0.0)
    integration = Integration(system, state, Request(0.1, np.array([0.1]), index=2))
    found, n = integration.settler, system.form.written
    found.core.contents.slack = found.core.contents.still = 0.0
    x, y = map([system.name(k) for k in range(n)].index, ("f_x", "f_y"))
    point, rates = integration.y[:n].copy(), integration.yd[:n].copy()
    for apart, moved in ((7.0, (off, off)), (7.0 + off, (off, 0.0)), (7.0 - off, (0.0, off))):
        low = 100.0 * (90.0 - apart) / 101.0  # 100 (90 - f_x) = f_y
        at = point.copy()
        at[[x, y]] = 83.0 * 100.0 / 101.0 + np.array([7.0, 0.0]) + moved
        settled, _, fine = found.settle(0.0, at, rates)
        assert fine
        assert abs(settled[x] - settled[y] - apart) < 1e-10
        assert abs(settled[y] - low) < 1e-10
