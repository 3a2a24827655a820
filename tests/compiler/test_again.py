"""A binding made again is the one that is made anew, bit for bit; where more than numbers follows there is none."""

from pathlib import Path

import numpy as np
import pytest
from sysdyn.cli.run.many.reusable_model import Loaded
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.compiler.binding.rebinding import rebind
from sysdyn.dsl.model import expression as ex

MODELS = Path(__file__).parents[2] / "models"


NAMES = (
    "seed/pendulum", "seed/dc_motor", "seed/knife_edge", "seed/co_circuit", "seed/lc_ladder", "gallery/ev_powertrain",
)  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.long
def test_equals_a_binding_made_anew(name):
    loaded = Loaded(RunRequest(str(MODELS / f"{name}.sd"), scene="reference" if "seed" in name else "launch")).first
    compiled, binding = loaded.prepared.compiled, loaded.prepared.binding
    scalars = [k for k, v in binding.values.items() if np.ndim(v) == 0]
    ways = 0
    for names in [[k] for k in scalars] + [scalars]:
        numbers = {k: 1.03 * float(binding.values[k]) for k in names}
        with ex.fresh(loaded.nodes):
            way = compiled.way(binding, frozenset(names))
            if way is None:
                continue
            ways += 1
            one, other = rebind(binding, way, numbers), compiled.bind(numbers)
        assert one is not None
        assert np.array_equal(one.p, other.p)
        assert one.values.keys() == other.values.keys()
        assert all(np.array_equal(one.values[k], other.values[k]) for k in other.values)
        assert [s.values.tolist() for s in one.initial] == [s.values.tolist() for s in other.initial]
    assert ways


@pytest.mark.long
def test_sizes_have_no_way():
    loaded = Loaded(RunRequest(str(MODELS / "benchmark" / "rc_ladder.sd"), scene="reference")).first
    with ex.fresh(loaded.nodes):
        assert loaded.prepared.compiled.way(loaded.prepared.binding, frozenset(["n"])) is None


def test_values_that_make_no_sense_are_left_to_the_binding():
    loaded = Loaded(RunRequest(str(MODELS / "seed" / "pendulum.sd"), scene="reference")).first
    with ex.fresh(loaded.nodes):
        way = loaded.prepared.compiled.way(loaded.prepared.binding, frozenset(["l"]))
        assert way is not None
        assert rebind(loaded.prepared.binding, way, {"l": float("nan")}) is None
