"""The extremes: small models whose motion is known by other means, pushed to the ends of what doubles can hold.

A `Family` is a text of the language with its parameters open, and what its traced quantities are at any instants: in
closed form, by mpmath, or by SciPy in variables in which nothing is small.  `families()` lists them, each with its
cases: settings, options, what the case is about.
"""

from case import Family
from linear_cases import oscillators, ratios
from mechanism_cases import couplings, pendulums, singular
from steep_cases import others, steep


def families() -> tuple[Family, ...]:
    """All of them."""
    return (*oscillators(), *ratios(), *couplings(), *pendulums(), *singular(), *steep(), *others())
