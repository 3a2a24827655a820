"""What follows from a form's structure alone, by hand; where entries stand, against the matrix by differences."""

import numpy as np
import pytest
import small_models as models
from sysdyn.runtime.many.mass_matrix import mass_matrix
from sysdyn.runtime.model import system as systems
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.inertia import inertia
from sysdyn.runtime.model.layout import entries_of, laid_out
from sysdyn.runtime.model.scales import alike, group_maxima, group_maximum
from sysdyn.runtime.model.system import System


def system(index="3", family="lagrangian"):
    """Two masses, coupled by inertia and a spring, on a rod."""
    kinetic, potential = "f_x**2 + f_y**2 + f_x*f_y/2", "3*(q_x - q_y)**2 + q_y**4"
    made = models.small("x y", kinetic, potential, phi={"rod": "q_x**2 + q_y**2 - 25"}, form=family)
    return System(made[0], made[1], load(made[2]), index)


@pytest.mark.long
def test_kinds_groups_and_names_of_a_rod():
    of = system()
    assert (of.unknowns, of.rows) == (5, 5)
    assert of.kinds.tolist() == ["q", "q", "f", "f", "kappa"]
    assert of.are("q", "kappa").tolist() == [True, True, False, False, True]
    assert of.unknown_names == ("q_x", "q_y", "f_x", "f_y", "kappa_rod")
    assert int(of.of_groups("dynamics").sum()) == 2
    assert of.row_label(int(np.flatnonzero(of.of_groups("phi"))[0])).label == "rod"


@pytest.mark.long
def test_the_stabilised_form_has_its_multipliers_behind_those_as_written():
    of = system("2")
    assert of.are("nu").tolist() == [False] * 5 + [True]
    assert of.family_of[-1] == -1
    assert not of.are("kappa")[-1]


@pytest.mark.long
def test_families_are_those_of_which_some_unknown_is_asked_for():
    """By where they begin, against the family of each unknown; nu is of none, and the largest is asked of it too."""
    of = system("2")
    for mask in np.eye(of.form.written, dtype=bool):
        assert of.families_in(mask) == frozenset(of.family_of[: mask.size][mask].tolist())
    assert of.families_in(np.zeros(of.form.written, dtype=bool)) == frozenset()
    values = np.arange(1.0, 1.0 + of.unknowns) ** 2
    assert group_maxima(of, values)[alike(of)].tolist() == group_maximum(of, values).tolist() == [4, 4, 16, 16, 25, 36]


def test_what_is_made_once_is_made_again_once_it_was_let_go():
    of, made = system(), []
    for _ in range(2):
        of.once("told", lambda: made.append(1))
    assert len(made) == 1
    of.forget_once("told")
    of.once("told", lambda: made.append(1))
    assert len(made) == (2 if of.description.systems is None else 1)


@pytest.mark.parametrize("family", ["lagrangian", "hamiltonian"])
@pytest.mark.parametrize("index", ["3", "2", "0", "settled"])
@pytest.mark.long
def test_every_slope_stands_in_the_pattern(index, family):
    """Entries of the pattern are the slopes by central differences, and there is none beside them."""
    of, random = system(index, family), np.random.default_rng(3)
    y, yd = random.uniform(0.5, 1.5, (2, of.unknowns))
    by_y, by_rate = (of.dense(values) for values in of.jacobian(0.3, y, yd))
    step = 1e-6
    for k in range(of.unknowns):
        e = step * (np.arange(of.unknowns) == k)
        slope = (of.residual(0.3, y + e, yd) - of.residual(0.3, y - e, yd)) / (2.0 * step)
        rate = (of.residual(0.3, y, yd + e) - of.residual(0.3, y, yd - e)) / (2.0 * step)
        assert by_y[:, k] == pytest.approx(slope, abs=1e-7)
        assert by_rate[:, k] == pytest.approx(rate, abs=1e-7)


@pytest.mark.parametrize("index", ["3", "settled", "start"])
@pytest.mark.long
def test_a_layout_is_that_of_its_blocks(index):
    """All entries of all calls, and nothing else but rows q' - f and such as may read "multiplier = 0"."""
    of = system(index)
    layout = laid_out(of.description, of.form, ())
    there = set(zip(layout.pattern.row.tolist(), layout.pattern.columns_of().tolist(), strict=True))
    own = {(int(r), int(c)) for k in (of.form.k_q, of.form.k_f) for r, c in zip(of.form.k_row, k, strict=True)}
    for call in of.form.calls:
        for part in entries_of(of.description, call):
            own |= set(zip(part.row.tolist(), part.column.tolist(), strict=True))
    assert there == {(r, c) for r, c in own if 0 <= r < of.rows and 0 <= c < of.unknowns}
    assert sum(map(len, layout.slots[2:-1])) == sum(
        p.row.size for call in of.form.calls for p in entries_of(of.description, call)
    )


@pytest.mark.parametrize("family", ["lagrangian", "hamiltonian"])
@pytest.mark.long
def test_the_mass_matrix_by_its_entries(family):
    """T* = f_x^2 + f_y^2 + f_x f_y/2: M = [2, 1/2; 1/2, 2], from f' in dynamics or from p - M f."""
    settled = system("settled", family)
    y = np.linspace(0.4, 1.2, settled.unknowns)
    slopes = settled.jacobian(0.0, y, y)
    found, full = mass_matrix(settled), np.zeros((2, 2))
    values = np.where(found.rate == 1, slopes[1][found.entry], slopes[0][found.entry])
    np.add.at(full, (found.row, found.column), found.sign * values)
    assert full == pytest.approx(np.array([[2.0, 0.5], [0.5, 2.0]]), rel=1e-14)
    assert full == pytest.approx(inertia(settled, *slopes), rel=1e-14)


@pytest.mark.parametrize("index", ["3", "2", "1"])
@pytest.mark.one_in(2)
def test_a_large_system_has_no_room_for_entries_that_stands_idle(monkeypatch, index):
    """The core finds it for each Jacobian, of both sides and of one alone; the numbers are those of a small one."""
    small = system(index)
    y, yd = (np.random.default_rng(k).normal(size=small.unknowns) for k in (1, 2))
    monkeypatch.setattr(systems, "LARGE", 0)
    large = system(index)
    assert small.work is not None
    assert large.work is None
    for k, (one, other) in enumerate(zip(small.jacobian(0.3, y, yd), large.jacobian(0.3, y, yd), strict=True)):
        assert one.tobytes() == other.tobytes()
        assert other.tobytes() == large.slopes(0.3, y, yd, rate=bool(k)).tobytes()
