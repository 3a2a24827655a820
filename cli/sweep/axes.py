"""What one name takes in a sweep: a list, a grid, or a distribution.

k = 1 N/m, 2 N/m, 4 N/m          a list of expressions
k = 1 N/m .. 100 N/m : 5         a grid of 5, ends included;  ": 5 : log" evenly in the logarithm
k ~ normal(4 N/m, 0.1 N/m)       mean and standard deviation;  uniform(a, b);  loguniform(a, b);
lognormal(median, factor): within a factor of the median once in 1.5 times
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri
from sysdyn.cli.failures import UsageError
from sysdyn.cli.options import FORMULATIONS, INDICES, METHODS
from sysdyn.cli.run.request.run_request import separate
from sysdyn.values import dataclass

Numbers = NDArray[np.float64]
Evaluate = Callable[[str, str], float | None]
"""Name and text of a constant expression -> its value in SI units; None: the name is no number (an input, a choice)."""
Quantile = Callable[[Numbers, float, float], Numbers]

CHOICES = ("formulation", "method", "index", "accuracy", "rtol")
"""Options that vary as parameters do; so does `level PATH`."""
NAMED = {"formulation": FORMULATIONS, "method": METHODS, "index": INDICES}
"""The words that they take."""
DISTRIBUTIONS: dict[str, Quantile] = {
    "uniform": lambda u, a, b: a + (b - a) * u,
    "loguniform": lambda u, a, b: a * (b / a) ** u,
    "normal": lambda u, mean, deviation: mean + deviation * ndtri(u),
    "lognormal": lambda u, median, factor: median * factor ** ndtri(u),
}
"""Quantiles: probabilities u [k] in (0, 1) -> values [k]."""
MOST = 10_000_000
_DRAWN = re.compile(r"(\w+)\s*\((.*)\)", re.DOTALL)


@dataclass(frozen=True, slots=True)
class Axis:
    """What a name takes.  values: of a list or grid, numbers or texts; else quantile and its two parameters."""

    name: str
    values: tuple[float | str, ...] = ()
    quantile: str = ""
    first: float = math.nan
    second: float = math.nan

    @property
    def drawn(self) -> bool:
        """It is a distribution."""
        return bool(self.quantile)

    def values_at(self, u: Numbers) -> Numbers:
        """Values of a distribution at probabilities u."""
        return DISTRIBUTIONS[self.quantile](u, self.first, self.second)


def _parts(text: str) -> list[str]:
    """The parts between commas outside brackets, without the blanks around them."""
    return [part.strip() for part in separate(text)]


def axis(text: str, evaluate: Evaluate) -> Axis:
    """`NAME = ...` or `NAME ~ ...`.  UsageError where it is neither."""
    equal, tilde = text.find("="), text.find("~")
    cut = min((k for k in (equal, tilde) if k >= 0), default=-1)
    name, said = text[:cut].strip(), text[cut + 1 :].strip()
    if cut < 1 or not name or not said:
        forms = "NAME=VALUE,VALUE,..., NAME=FIRST..LAST:NUMBER or NAME~normal(MEAN, DEVIATION)"
        raise UsageError(f"--over '{text}': {forms}")
    if text[cut] == "~":
        return _distribution(name, said, evaluate)
    drawn = _DRAWN.fullmatch(said)
    if drawn is not None and drawn[1] in DISTRIBUTIONS:
        raise UsageError(f"--over {name}={said}: a distribution is written --over '{name}~{said}'")
    if ".." in said and not name.startswith("level "):
        return _grid(name, said, evaluate)
    return list_axis(name, _parts(said), evaluate)


def list_axis(name: str, texts: Sequence[str], evaluate: Evaluate) -> Axis:
    """A list of expressions."""
    if not all(texts):
        raise UsageError(f"--over {name}: an empty value")
    for text in texts:
        if name in NAMED and text not in NAMED[name]:
            raise UsageError(f"--over {name}: '{text}' is none of {', '.join(NAMED[name])}")
    if name in CHOICES or name.startswith("level "):
        return Axis(name, tuple(texts))
    found = tuple(evaluate(name, text) for text in texts)
    return Axis(name, tuple(text if value is None else value for text, value in zip(texts, found, strict=True)))


def _number(name: str, text: str, evaluate: Evaluate) -> float:
    value = evaluate(name, text)
    if value is None:
        raise UsageError(f"--over {name}: a grid is of numbers of a parameter, and '{name}' is none; give a list")
    return value


def _grid(name: str, said: str, evaluate: Evaluate) -> Axis:
    """Values of FIRST..LAST:NUMBER, linear or logarithmic."""
    ends, *more = said.split(":")
    first, last = (_number(name, text.strip(), evaluate) for text in ends.split("..", 1))
    spacing = more[1].strip() if len(more) > 1 else "linear"
    if len(more) not in (1, 2) or not more[0].strip().isdigit() or spacing not in ("linear", "log"):
        raise UsageError(f"--over {name}={said}: FIRST..LAST:NUMBER, or FIRST..LAST:NUMBER:log")
    number = int(more[0])
    if not 1 <= number <= MOST:
        raise UsageError(f"--over {name}: {number} values; from 1 to {MOST}")
    if spacing == "log" and not first * last > 0.0:
        raise UsageError(f"--over {name}: a logarithmic grid from {first:g} to {last:g} passes zero")
    make = np.linspace if spacing == "linear" else np.geomspace
    return Axis(name, tuple(float(v) for v in make(first, last, number)))


def _distribution(name: str, said: str, evaluate: Evaluate) -> Axis:
    """A distribution of two parameters; of lognormal the second is a factor."""
    found = _DRAWN.fullmatch(said)
    if found is None or found[1] not in DISTRIBUTIONS:
        raise UsageError(f"--over {name}~{said}: one of {', '.join(f'{d}(a, b)' for d in DISTRIBUTIONS)}")
    texts = _parts(found[2])
    if len(texts) != 2:
        raise UsageError(f"--over {name}: {found[1]} takes two values, not {len(texts)}")
    first = _number(name, texts[0], evaluate)
    factor = found[1] == "lognormal"
    second = _factor(name, texts[1]) if factor else _number(name, texts[1], evaluate)
    # for which numbers there is none
    wrong = {
        "uniform": not second >= first,
        "loguniform": not (second >= first > 0.0),
        "normal": not second >= 0.0,
        "lognormal": not (first > 0.0 and second >= 1.0),
    }
    if wrong[found[1]]:
        raise UsageError(f"--over {name}: {said} is no distribution")
    return Axis(name, (), found[1], first, second)


def _factor(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise UsageError(f"--over {name}: the factor '{text}' of a lognormal is a plain number") from None
