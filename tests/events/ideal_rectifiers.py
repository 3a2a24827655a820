"""Random rectifiers of ideal diodes: python tests/events/ideal_rectifiers.py [NUMBER] [--from K]

NUMBER (60) seeded circuits: one to three bridges in series, each of one to three phases behind coils, resistors or
nothing, with or without a capacitor and a way to ground; a load with or without coil and capacitor.  Each runs as a
command would, and by the bdf beside it: prints those that are refused, or whose two runs are more than APART of the
largest voltage apart, and how many are not.  Ends with 1 where two runs differ, or more than a tenth is refused.
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np
from sysdyn.api import Trace, simulate
from sysdyn.dsl.text.diagnostics import ModelError
from sysdyn.runtime.model.failures import SolverFailure

APART, PATIENCE = 1e-3, 30.0
"""Of the largest voltage; s of wall time."""
INSTANTS = np.linspace(0.0, 0.05, 101)


class Circuit:
    """The text of circuit number `seed`, the same for ever."""

    def __init__(self, seed: int) -> None:
        self._chance = random.Random(seed)
        self._nodes: list[str] = []
        self._lines: list[str] = []
        top = low = self._node()
        for _ in range(self._chance.randint(1, 3)):
            low = self._bridge(low)
        self._load(top, low)

    def _node(self) -> str:
        self._nodes.append(f"n{len(self._nodes)}")
        return self._nodes[-1]

    def _add(self, component: str, arguments: str, begin: str, end: str) -> str:
        self._lines.append(f"  E{len(self._lines)}: {component}({arguments}) {begin} -> {end}")
        return f"E{len(self._lines) - 1}"

    def _size(self, name: str, unit: str, least: float, most: float) -> str:
        return f"{name} = {10.0 ** self._chance.uniform(least, most):.3g} {unit}"

    def _phase(self, star: str, number: int, phases: int) -> str:
        """A source and what is in series with it; where it ends."""
        chance, end = self._chance, self._node()
        shift = number * 2.0 / phases
        turn = f"2*pi*{chance.choice([50, 60, 37])} Hz*t - {shift:.6g}*pi - {chance.uniform(0.0, 3.0):.3g}"
        self._add("voltage", f"v = {chance.uniform(10.0, 400.0):.4g} V*sin({turn})", end, star)
        behind = chance.choice(["inductor", "inductor", "resistor", ""])
        if not behind:
            return end
        size = self._size("L", "H", -4, -2) if behind == "inductor" else self._size("R", "ohm", -2, 0)
        begin, end = end, self._node()
        self._add(behind, size, begin, end)
        return end

    def _bridge(self, high: str) -> str:
        low, star, phases = self._node(), self._node(), self._chance.randint(1, 3)
        arms = [self._phase(star, k, phases) for k in range(phases)]
        for arm in arms if phases > 1 else [*arms, star]:
            self._add("diode.complementary", "", arm, high)
            self._add("diode.complementary", "", low, arm)
        if self._chance.random() < 0.4:
            self._add("capacitor", self._size("C", "F", -5, -3), high, low)
        if self._chance.random() < 0.5:
            self._add("resistor", "R = 1 Mohm", star, "ground")
        return low

    def _load(self, high: str, low: str) -> None:
        if self._chance.random() < 0.6:
            begin, high = high, self._node()
            self._add("inductor", self._size("L", "H", -3, -1), begin, high)
        self._out = self._add("resistor", self._size("R", "ohm", 0, 3), high, low)
        if self._chance.random() < 0.4:
            self._add("capacitor", self._size("C", "F", -5, -3), high, low)
        self._add("resistor", self._chance.choice(["R = 1 Mohm", "R = 0.1 ohm"]), low, "ground")

    @property
    def text(self) -> str:
        """Of a model with one scene, which traces the load's voltage as v."""
        head = "from std.electrical import resistor, inductor, capacitor, voltage, diode\nmodel m {\n"
        scene = f"scene s of m {{ time 0 s to 50 ms; trace {self._out}.e as v every 0.5 ms; accuracy 1e-4 }}\n"
        return f"{head}  node {', '.join(self._nodes)}: electrical\n" + "\n".join([*self._lines, "}", scene])


def voltage(trace: Trace) -> np.ndarray:
    """Of the load at INSTANTS (V)."""
    return trace["v"].values[[int(np.argmin(np.abs(trace.time - t))) for t in INSTANTS]]


def apart(folder: Path, seed: int) -> tuple[float, float]:
    """How far a run by default and one by the bdf are apart, of the largest voltage, and the CPU time of the first (s);
    ModelError, SolverFailure of the first; nan where the second is refused.
    """
    file = folder / "m.sd"
    file.write_text(Circuit(seed).text)
    began = time.process_time()
    first = voltage(simulate(file, output=folder / "a.h5", unmet="warn", max_wall=PATIENCE))
    spent = time.process_time() - began
    try:
        other = simulate(file, output=folder / "b.h5", unmet="warn", method="bdf", accuracy=1e-5, max_wall=PATIENCE)
    except (ModelError, SolverFailure):
        return np.nan, spent
    second = voltage(other)
    return float(np.abs(first - second).max() / max(np.abs(second).max(), 1e-9)), spent


def main() -> int:
    """Runs and prints."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("number", nargs="?", type=int, default=60)
    parser.add_argument("--from", dest="first", type=int, default=0)
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    refused = differ = alone = 0
    cpu = 0.0
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(given.first, given.first + given.number):
            try:
                far, spent = apart(Path(folder), seed)
            except (ModelError, SolverFailure) as failure:
                refused += 1
                print(f"{seed}: refused: {str(failure)[:160]}", flush=True)
                continue
            cpu, alone, differ = cpu + spent, alone + int(np.isnan(far)), differ + int(far > APART)
            if far > APART:
                print(f"{seed}: {far:.1e} of the largest voltage apart", flush=True)
    print(f"{given.number} circuits: {refused} refused, {differ} apart, {alone} by default alone; {cpu:.1f} s CPU")
    return int(differ > 0 or refused > 0.1 * given.number)


if __name__ == "__main__":
    sys.exit(main())
