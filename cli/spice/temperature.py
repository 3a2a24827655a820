"""What temperature does to devices, as in SPICE: kT/q, saturation currents, thresholds, resistances.

Sources: SPICE 3f5's diotemp.c, bjttemp.c, mos1temp.c, restemp.c; CODATA constants.
"""

from __future__ import annotations

import math

from sysdyn.cli.spice.circuit import USUAL
from sysdyn.cli.spice.netlist import UnreadableCard
from sysdyn.values import dataclass

BOLTZMANN = 1.380649e-23 / 1.602176634e-19
"""k/q, V/K."""
MOST = 2000.0
"""K, beyond which no device is one: exponents of saturation currents stay finite below."""


@dataclass(frozen=True, slots=True)
class Heat:
    """now, nominal: K of a device, and of the measurement of its model."""

    now: float = USUAL
    nominal: float = USUAL

    def __post_init__(self) -> None:
        if not (1.0 <= self.now <= MOST and 1.0 <= self.nominal <= MOST):
            raise UnreadableCard(f"{self.now:g} K with a model of {self.nominal:g} K is no temperature of a device")

    @property
    def ratio(self) -> float:
        """Of the temperature to that of the model."""
        return self.now / self.nominal

    @property
    def volt(self) -> float:
        """kT/q, V."""
        return BOLTZMANN * self.now

    def saturation(self, gap: float, power: float, emission: float = 1.0) -> float:
        """The factor of a saturation current; gap: EG, V; power: XTI; emission: N."""
        exponent = (self.ratio - 1.0) * gap / self.volt + power * math.log(self.ratio)
        return math.exp(min(exponent / emission, 700.0))

    def resistance(self, linear: float, square: float) -> float:
        """The factor of a value with TC1 (1/K) and TC2 (1/K^2)."""
        above = self.now - self.nominal
        return 1.0 + linear * above + square * above**2

    def threshold(self, volts: float, surface: float, sign: float) -> float:
        """VTO at this temperature; surface: PHI, V; sign: of the channel.  Without bulk effect."""
        if self.now == self.nominal:
            return volts
        gaps = _gap(self.nominal) - _gap(self.now)
        now = self.now / USUAL * (surface - _barrier(self.nominal)) * USUAL / self.nominal + _barrier(self.now)
        return volts + 0.5 * gaps + sign * 0.5 * (now - surface)


def _gap(kelvin: float) -> float:
    """Of silicon, V."""
    return 1.16 - 7.02e-4 * kelvin**2 / (kelvin + 1108.0)


def _barrier(kelvin: float) -> float:
    """What SPICE adds to a potential that is proportional to the temperature, V."""
    away = -_gap(kelvin) / (2.0 * BOLTZMANN * kelvin) + 1.1150877 / (2.0 * BOLTZMANN * USUAL)
    return -2.0 * BOLTZMANN * kelvin * (1.5 * math.log(kelvin / USUAL) + away)
