"""Entries of a Jacobian that are written elsewhere are those of the pattern; a jump is crossed where it is, once."""

import ctypes as c

import numpy as np
import pytest
import small_models as models
from sysdyn import api
from sysdyn.runtime.integrate import integrate
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.redirected import redirect_entries
from sysdyn.runtime.model.system import System


@pytest.mark.parametrize("index", ["3", "2", "0"])
@pytest.mark.long
def test_each_entry_stands_where_it_was_sent(index):
    """A random order of places: J'[place[k]] = J[k] for both parts, and nothing else is written."""
    kinetic, potential = "f_x**2 + f_y**2 + f_x*f_y/2", "3*(q_x - q_y)**2 + q_y**4"
    made = models.small("x y", kinetic, potential, phi={"rod": "q_x**2 + q_y**2 - 25"}, form="lagrangian")
    of, random = System(made[0], made[1], load(made[2]), index), np.random.default_rng(5)
    entries, (y, yd) = of.pattern.entries, random.uniform(0.5, 1.5, (2, of.unknowns))
    places = np.stack([random.permutation(3 * entries)[:entries] for _ in range(2)]).astype(np.int32)
    elsewhere = redirect_entries(of, *places, 3 * entries)
    elsewhere.core.kinematics = 0  # rows q' - f are none of a block's
    found = np.full((2, 3 * entries + 1), 7.0)
    held = np.zeros((2, of.form.extended))
    held[:, : of.unknowns] = y, yd
    points, slopes = [lib.pointer(v) for v in held], [lib.pointer(v) for v in found]
    lib.core.sd_jacobian(c.byref(elsewhere.core), 0.3, *points, None, *slopes)
    blocks = np.setdiff1d(np.arange(entries), np.concatenate(of.slots[:2]))
    for part, wanted, place in zip(found, of.jacobian(0.3, y, yd), places, strict=True):
        assert part[place[blocks]].tolist() == wanted[blocks].tolist()
        assert not np.delete(part[:-1], place).any()


def test_a_jump_of_the_text_is_crossed_once_at_its_instant(tmp_path, monkeypatch):
    """s' = 1 until 1 s, then -2: straight lines, so that every instant is known to round-off."""
    met, own = [], integrate.cross

    def spied(run, segment):
        met.append((segment.begin, float(run.method.point()[0][0])))
        own(run, segment)

    monkeypatch.setattr(integrate, "cross", spied)
    path = tmp_path / "jump.sd"
    path.write_text(
        "model m {\n  state s: m = 0 m\n  dynamic s' = if t < 1 s then 1 m/s else -2 m/s\n}\n"
        "scene go of m {\n  time 0 s to 2 s\n  trace s every 250 ms\n}\n"
    )
    trace = api.simulate(str(path), output=str(tmp_path / "j.h5"), method="bdf", backend="numpy")
    assert met
    assert [begin for begin, _ in met] == pytest.approx([1.0] * len(met), abs=1e-15)
    assert [s for _, s in met] == pytest.approx([1.0] * len(met), abs=1e-12)
    exact = np.where(trace.time < 1.0, trace.time, 3.0 - 2.0 * trace.time)
    np.testing.assert_allclose(trace["s"].values, exact, atol=1e-9)
