"""Lists told by their stretches say the places of their entries one by one."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.lines import FEW, stretches_of, table


def _spelled(place, found):
    """Places of all entries, as the core goes through the stretches."""
    whole = []
    for stretch in found:
        first, step = table(place, stretch)
        whole += [first + i * step for i in range(stretch[1])]
    return np.concatenate(whole) if whole else np.zeros(0, dtype=np.int32)


@given(st.data())
def test_stretches_say_every_place(data):
    """Of lines whose steps change anywhere, by what is the same in each line too."""
    shapes, place, same = [], [], []
    for _ in range(data.draw(st.integers(0, 3))):
        number, width = data.draw(st.integers(1, 60)), data.draw(st.integers(1, 3))
        steps = data.draw(st.lists(st.integers(0, 2), min_size=number, max_size=number))
        lines = np.cumsum(steps)[:, None] + np.arange(width) * data.draw(st.integers(0, 5))
        shapes.append((number, width))
        place.append(lines.ravel())
        told = st.lists(st.sampled_from([0.0, -0.0, 1.0]), min_size=number, max_size=number)
        same.append(np.repeat(data.draw(told), width))
    place = np.concatenate([np.zeros(0), *place]).astype(np.int32)
    same = np.concatenate([np.zeros(0), *same])
    for told in (None, same):
        found = stretches_of([place], shapes, told)
        if found is None:
            continue
        assert (_spelled(place, found) == place).all()
        for at, number, width in found if told is not None else ():
            lines = told[at : at + number * width].view(np.int64).reshape(number, width)
            assert (lines == lines[0]).all()


def test_a_line_is_a_stretch_with_its_ends_apart():
    """A thousand lines of two, the first and the last otherwise; a list without order has none."""
    place = np.stack([3 + 2 * np.arange(1000), 7 + 5 * np.arange(1000)], axis=1).astype(np.int32)
    place[0, 0], place[-1, 1] = 0, 0
    found = stretches_of([place.ravel()], [(1000, 2)])
    assert found is not None
    assert len(found) <= 4
    assert (_spelled(place.ravel(), found) == place.ravel()).all()
    disordered = np.random.default_rng(1).permutation(1000).astype(np.int32)
    assert stretches_of([disordered], [(1000, 1)]) is None


@pytest.mark.parametrize("number", [1, 2, FEW])
def test_the_core_has_room_for_short_ones(number):
    """Fewer lines than a stretch is worth are told as well."""
    found = stretches_of([np.zeros(number, dtype=np.int32)], [(number, 1)])
    assert found == [(0, number, 1)]
    assert lib.Lines(number, 1, None, None).number == number
