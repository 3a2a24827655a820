"""What followed in one part of a model is known whatever the others do."""

import re
from types import SimpleNamespace

import numpy as np
import pytest
from sysdyn.api import simulate
from sysdyn.runtime.events import determined
from sysdyn.runtime.events.memory import Memory


def _of_two_parts():
    """Four unknowns, two in each part; contacts 0 and 2 are of the first, 1 of the other; four senses behind them."""
    pattern = SimpleNamespace(row=np.array([0, 0, 1, 1]), columns_of=lambda: np.array([0, 2, 1, 3]))
    system = SimpleNamespace(pattern=pattern, unknowns=4)
    return Memory(SimpleNamespace(system=system, contacts=[None] * 3, multiplier=[0, 1, 2]))


def test_parts_are_remembered_apart():
    memory = _of_two_parts()
    off, first, both = (0, 0, 0, 0, 0, 0), (1, 0, 0, 0, 0, 1), (1, 1, 0, 0, 0, 1)
    memory.learn(off, [0], first)
    assert memory.recall(off, [0]) == first
    assert memory.recall(off, [1]) is None
    memory.learn(first, [1], both)
    assert memory.recall(off, [0, 1]) == both
    assert memory.recall((0, 1, 0, 0, 0, 0), [0]) is None  # with that part untouched, as it stands
    memory.learn((0, 1, 0, 0, 0, 0), [], (0, 1, 0, 0, 0, 0))
    assert memory.recall((0, 1, 0, 0, 0, 0), [0]) == both


BUCKS = """
from std.electrical import resistor, inductor, capacitor, voltage, diode, switch
model bucks {
  node a[1..5], b[1..5], c[1..5]: electrical
  for i in 1..5 {
    V[i]: voltage(v = 24 V) a[i] -> ground
    S[i]: switch(gate = if frac(t*(10 kHz + 0.3 kHz*i)) < 0.5 then 1 else 0) a[i] -> b[i]
    D[i]: diode.complementary() ground -> b[i]
    L[i]: inductor(L = 1 mH) b[i] -> c[i]
    C[i]: capacitor(C = 100 uF) c[i] -> ground
    R[i]: resistor(R = 5 ohm) c[i] -> ground
  }
}
scene s of bucks { time 0 s to 1 ms; trace C[1].e, C[3].e, C[5].e every 50 us; accuracy 1e-6 }
"""


def test_converters_on_one_ground_are_sought_once_each(tmp_path, monkeypatch):
    """Five that switch 10 to 11 times each, at frequencies of their own: 106 events a run, of which each beside others
    that stand as never before; sets are sought at fewer than twenty of them.  Voltages are those of each alone.
    """
    sought, fit = [], determined.Determined.fit
    monkeypatch.setattr(determined.Determined, "fit", lambda *args: sought.append(1) or fit(*args))
    (tmp_path / "all.sd").write_text(BUCKS)
    found = simulate(tmp_path / "all.sd", output=tmp_path / "all.h5")
    assert len(sought) < 2 * 20
    for k in (1, 3, 5):
        alone = re.sub(r"if frac\(t\*\(10 kHz \+ 0.3 kHz\*i\)\)", f"if frac(t*{10 + 0.3 * k} kHz)", BUCKS)
        alone = re.sub("C.1..e, C.3..e, C.5..e", "C[1].e", alone.replace("1..5", "1..1"))
        (tmp_path / "one.sd").write_text(alone)
        one = simulate(tmp_path / "one.sd", output=tmp_path / "one.h5")
        assert found[f"C[{k}].e"].values[-1] == pytest.approx(one["C[1].e"].values[-1], rel=1e-7)
