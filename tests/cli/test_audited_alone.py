"""Between rows a run looks at what powers and energies read, and at nothing else."""

import numpy as np
import pytest
from sysdyn.cli.main import run
from sysdyn.runtime.condense.sums import Straights
from sysdyn.runtime.trace.trace import Trace

GRID = """from std.electrical import resistor, capacitor, voltage

model grid {
  param n = 6
  node v[1..n, 1..n]: electrical
  source: voltage(v = 1 V*sin(2*pi*2 Hz*t)) v[1, 1] -> ground
  for i in 1..n {
    for j in 1..n - 1 {
      across[i, j]: resistor(R = 1 ohm) v[i, j] -> v[i, j + 1]
      down[j, i]: resistor(R = 1 ohm) v[j, i] -> v[j + 1, i]
    }
    for j in 1..n {
      C[i, j]: capacitor(C = 1 F / n^2) v[i, j] -> ground
      init C[i, j].e = 0 V
    }
  }
}

scene s of grid {
  time 0 s to 1 s
  trace v[n, n].e
}
"""


@pytest.mark.long
def test_energies_are_those_of_all_unknowns_bit_by_bit(tmp_path, monkeypatch):
    (tmp_path / "grid.sd").write_text(GRID)
    mark = Straights.mark

    def ran(how):
        seen = []

        def marked(own, name, read):
            if how == "marked":
                mark(own, name, read)
            seen.extend(own.array[k].number for k in range(own.number) if own.array[k].audited)

        monkeypatch.setattr(Straights, "mark", marked)
        assert run(["simulate", "grid.sd", "--quiet", "--method", "bdf", "--rtol", "1e-4", "-o", f"{how}.h5"]) == 0
        return Trace.open(tmp_path / f"{how}.h5"), sum(seen)

    (one, some), (other, every) = ran("marked"), ran("all")
    assert some < 0.8 * every
    assert np.array_equal(one.time, other.time)
    for quantity in (*one.names, "audit.energy", "audit.constraints"):
        assert np.array_equal(one[quantity].values, other[quantity].values), quantity
