"""Nets of ideal switches that float, and say the same twice, in four formulations (switched_nets.py)."""

import numpy as np
import pytest
import switched_nets as nets
from sysdyn import api

FORMULATIONS = ["lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian"]
NONE = (52,)
"""Seeds with a current that is none: it is held to the accuracy as if its round-off were one (E920)."""
NEAR = 0.3
"""ms beside a gate's edge, where a row may be either side."""


@pytest.mark.filterwarnings("ignore:at times")
@pytest.mark.parametrize("seed", sorted({*range(120)} - {*NONE}))
@pytest.mark.long
def test_switched_nets_are_those_of_nodal_analysis_in_four_formulations(tmp_path, seed):
    """Currents as with small leaks; with a capacitor alike in all."""
    parts = nets.net(seed)
    (tmp_path / "m.sd").write_text(nets.text(parts))
    at = np.arange(0.25, 60.0, 0.5)
    edges = [edge for p in parts if p.kind == "S" for edge in p.value]
    at = at[[min(abs(t % nets.PERIOD - edge) for edge in edges) > NEAR for t in at]]
    found = []
    for formulation in FORMULATIONS:
        trace = api.simulate(tmp_path / "m.sd", formulation=formulation, output=tmp_path / "t.h5")
        found.append([np.interp(1e-3 * at, trace.time, trace[f"E{k}"].values) for k in nets.traced(parts)])
    size = [max(np.abs(row).max(), 1e-6) for row in found[0]]
    if all(p.kind != "C" for p in parts):
        now = [nets.currents(parts, t % nets.PERIOD) for t in at]
        size = [parts[0].value / parts[k].value for k in nets.traced(parts)]
        found.append([np.array([one[k] for one in now]) for k in nets.traced(parts)])
    for other in found[:-1]:
        assert max(np.abs(a - b).max() / s for a, b, s in zip(other, found[-1], size, strict=True)) < 3e-5
