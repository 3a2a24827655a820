"""Traces that are right and what can be wrong with them: every mutant is of another physics, or no trace at all."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from sysdyn.runtime.comparison.arrays import Arrays
from sysdyn.runtime.comparison.verdict import About, TraceEvent

SPAN = 10.0


@dataclass(frozen=True)
class Base:
    """A trace as plain arrays: time [n], values and rates by name, units, nominal magnitudes, events."""

    time: np.ndarray
    values: dict
    rates: dict
    units: dict
    nominal: dict
    events: tuple = ()
    time_unit: str = "s"

    def arrays(self):
        about = [About(n, self.units.get(n, "m"), self.nominal.get(n)) for n in self.values]
        return Arrays(self.time, self.values, self.rates, about, self.events, self.time_unit)

    @property
    def first(self):
        return next(iter(self.values))

    def with_value(self, values, name=None, rates=None):
        """One quantity replaced; its rates too, where they are known."""
        name = name or self.first
        kept = {n: r for n, r in self.rates.items() if n != name}
        if rates is not None:
            kept[name] = rates
        return replace(self, values={**self.values, name: values}, rates=kept)

    def rows(self, keep):
        """Some of the rows."""
        return replace(
            self,
            time=self.time[keep],
            values={n: v[keep] for n, v in self.values.items()},
            rates={n: r[keep] for n, r in self.rates.items()},
        )


def oscillator():
    """Displacement and velocity with rates, a force without; on even instants."""
    t = np.linspace(0.0, SPAN, 501)
    w = 4.0
    values = {"x": np.sin(w * t), "v": w * np.cos(w * t), "F": -16.0 * np.sin(w * t)}
    rates = {"x": w * np.cos(w * t), "v": -w * w * np.sin(w * t)}
    units = {"x": "m", "v": "m/s", "F": "N"}
    return Base(t, values, rates, units, {"x": 1.0, "v": 4.0, "F": 16.0})


def bouncing():
    """Velocity jumps at events, each with two rows at one instant."""
    hits = np.array([1.0, 3.0, 5.0, 7.0, 9.0])
    t = np.sort(np.concatenate([np.linspace(0.0, SPAN, 401), hits]))
    phase = (t + 1.0) / 2.0
    left = np.r_[np.diff(t) == 0.0, False]
    cycle = np.where(left, 1.0, phase % 1.0)
    values = {"h": cycle * (1.0 - cycle), "w": 0.5 - cycle}
    rates = {"h": (1.0 - 2.0 * cycle) / 2.0, "w": np.full(t.size, -0.5)}
    return Base(
        t,
        values,
        rates,
        {"h": "m", "w": "m/s"},
        {"h": 0.25, "w": 0.5},
        tuple(TraceEvent(float(hit), "floor") for hit in hits),
    )


def tiny():
    """A leakage current of picoamperes on a grid of no regularity, and a charge that is zero by symmetry."""
    t = np.sort(np.random.default_rng(3).uniform(0.0, SPAN, 300))
    t[0], t[-1] = 0.0, SPAN
    current = 1e-12 * np.exp(-t / 3.0)
    values = {"i": current, "q": np.zeros(t.size)}
    rates = {"i": -current / 3.0, "q": np.zeros(t.size)}
    return Base(t, values, rates, {"i": "A", "q": "C"}, {"i": 1e-12, "q": 1e-9})


BASES: dict[str, Callable[[], Base]] = {"oscillator": oscillator, "bouncing": bouncing, "tiny": tiny}

# ---- mutants: from a base to a wrong trace; None where the mutation changes nothing of this base


def _spread(b):
    return float(np.ptp(b.values[b.first]))


def _resampled(b, instants, moved):
    """All quantities at `moved` of the base, given as of `instants`."""
    inside = np.clip(moved, b.time[0], b.time[-1])
    values = {n: np.interp(inside, b.time, v) for n, v in b.values.items()}
    rates = {n: np.interp(inside, b.time, r) for n, r in b.rates.items()}
    return replace(b, time=instants, values=values, rates=rates)


def _at(b, row, value):
    changed = b.values[b.first].copy()
    changed[row] = value
    return b.with_value(changed, rates=b.rates.get(b.first))


def _wild(value, rows):
    def mutate(b):
        changed = b.values[b.first].copy()
        changed[rows(changed.size)] = value
        return b.with_value(changed, rates=b.rates.get(b.first))

    return mutate


def _shifted_event(b, by):
    events = tuple(TraceEvent(e.time + by * (k == 2), e.name) for k, e in enumerate(b.events))
    return replace(b, events=events) if b.events else None


def _shifted_jump(b, by):
    if not b.events:
        return None
    time = b.time.copy()
    pair = np.flatnonzero(np.diff(time) == 0.0)[1]
    time[[pair, pair + 1]] += by
    return replace(b, time=time)


def _names(b, change):
    return replace(
        b,
        values={change(n): v for n, v in b.values.items()},
        rates={change(n): v for n, v in b.rates.items()},
        units={change(n): u for n, u in b.units.items()},
        nominal={change(n): u for n, u in b.nominal.items()},
    )


def _swapped(b):
    one, two, *_ = b.values
    return _names(b, {one: two, two: one}.get if len(b.values) == 2 else lambda n: {one: two, two: one}.get(n, n))


def _without(b, name):
    return replace(b, values={n: v for n, v in b.values.items() if n != name})


def _duplicated(b):
    time = b.time.copy()
    k = np.flatnonzero((np.diff(time) > 0) & (np.abs(np.diff(b.values[b.first])) > 0.02 * _spread(b)))
    if not k.size:
        return None
    time[k[0] + 1] = time[k[0]]
    return replace(b, time=time)


def _noise(b):
    random = np.random.default_rng(5)
    return b.with_value(b.values[b.first] + 0.01 * _spread(b) * random.standard_normal(b.time.size))


def _quantised(b):
    step = 0.02 * _spread(b)
    return b.with_value(np.round(b.values[b.first] / step) * step)


def _held(b):
    """Zero-order hold of every fifth sample."""
    changed = b.values[b.first]
    return b.with_value(changed[(np.arange(changed.size) // 5) * 5])


def _frozen(b):
    changed = b.values[b.first].copy()
    changed[changed.size // 2 :] = changed[changed.size // 2]
    return b.with_value(changed)


def _clipped(b):
    values = b.values[b.first]
    middle, half = 0.5 * (values.max() + values.min()), 0.49 * _spread(b)
    return b.with_value(np.clip(values, middle - half, middle + half))


def _spike(b):
    """A spike narrower than any cell, told by two rows of its own."""
    k = b.time.size // 3
    width = 1e-4 * (b.time[k + 1] - b.time[k])
    extra = b.time[k] + width * np.array([1.0, 2.0, 3.0])
    new = _resampled(b, np.sort(np.append(b.time, extra)), np.sort(np.append(b.time, extra)))
    if (np.diff(b.time) == 0.0).any():
        return None
    values = new.values[b.first].copy()
    values[k + 2] += 0.1 * _spread(b)
    return new.with_value(values)


def _shuffled(b):
    order = np.random.default_rng(2).permutation(b.time.size)
    return b.with_value(b.values[b.first][order])


def _turns(b):
    """Not a slow decay, which a cubic tells across a gap."""
    return "q" not in b.values


def _chirp(b):
    if not _turns(b):
        return None
    moved = b.time + 0.05 * (b.time / SPAN) ** 2
    return _resampled(b, b.time, moved)


MUTANTS: dict[str, Callable[[Base], Base | None]] = {
    "nan": _wild(np.nan, lambda n: n // 2),
    "nan at the start": _wild(np.nan, lambda n: 0),
    "nan at the end": _wild(np.nan, lambda n: n - 1),
    "a fifth is nan": _wild(np.nan, lambda n: slice(n // 5, 2 * n // 5)),
    "all nan": _wild(np.nan, lambda n: slice(None)),
    "inf": _wild(np.inf, lambda n: n // 2),
    "-inf": _wild(-np.inf, lambda n: n // 3),
    "huge": _wild(1e308, lambda n: n // 3),
    "two points": lambda b: b.rows(np.array([0, b.time.size - 1])),
    "one point": lambda b: b.rows(np.array([0])),
    "no rows": lambda b: b.rows(np.array([], dtype=int)),
    "missed spike": lambda b: _at(b, b.time.size // 2, b.values[b.first][b.time.size // 2] + 0.05 * _spread(b)),
    "narrow spike": _spike,
    "offset": lambda b: b.with_value(b.values[b.first] + 0.01 * _spread(b), rates=b.rates[b.first]),
    "small offset": lambda b: b.with_value(b.values[b.first] + 1.2e-3 * b.nominal[b.first], rates=b.rates[b.first]),
    "frequency 2 %": lambda b: _resampled(b, b.time, 1.02 * b.time),
    "frequency 0.2 %": lambda b: _resampled(b, b.time, 0.998 * b.time) if _turns(b) else None,
    "chirp": _chirp,
    "delayed": lambda b: _resampled(b, b.time, b.time - 0.02),
    "advanced": lambda b: _resampled(b, b.time, b.time + 0.02),
    "zeros": lambda b: b.with_value(np.zeros(b.time.size)),
    "constant": lambda b: b.with_value(np.full(b.time.size, b.values[b.first].mean())),
    "sign": lambda b: b.with_value(-b.values[b.first], rates=-b.rates[b.first]),
    "scaled": lambda b: b.with_value(1.01 * b.values[b.first], rates=1.01 * b.rates[b.first]),
    "scaled a thousand times": lambda b: b.with_value(1e3 * b.values[b.first], rates=1e3 * b.rates[b.first]),
    "one sample off": lambda b: b.with_value(np.roll(b.values[b.first], 1), rates=np.roll(b.rates[b.first], 1)),
    "reversed": lambda b: b.with_value(b.values[b.first][::-1] + 1e-2 * _spread(b)),
    "shuffled": _shuffled,
    "dropped last second": lambda b: b.rows(b.time <= SPAN - 1.0),
    "dropped last row": lambda b: b.rows(np.arange(b.time.size - 1)),
    "truncated start": lambda b: b.rows(b.time >= 1.0),
    "first row lacks": lambda b: b.rows(np.arange(1, b.time.size)),
    "longer": lambda b: _resampled(b, np.append(b.time, SPAN + 1.0), np.append(b.time, SPAN)),
    "gap": lambda b: b.rows((b.time < 4.0) | (b.time > 6.5)) if _turns(b) else None,
    "time shifted": lambda b: replace(b, time=b.time + 0.5),
    "time in ms": lambda b: replace(b, time_unit="ms"),
    "time in m": lambda b: replace(b, time_unit="m"),
    "time goes back": lambda b: replace(b, time=np.where(np.arange(b.time.size) == 40, b.time - 1.0, b.time)),
    "time reversed": lambda b: replace(b, time=b.time[::-1]),
    "time is nan": lambda b: replace(b, time=np.where(np.arange(b.time.size) == 40, np.nan, b.time)),
    "time stands still": lambda b: replace(b, time=np.zeros(b.time.size)),
    "duplicated instant": _duplicated,
    "swapped": _swapped,
    "missing": lambda b: _without(b, b.first),
    "extra": lambda b: replace(b, values={**b.values, "z": b.values[b.first]}),
    "renamed": lambda b: _names(b, lambda n: n + "_new" if n == b.first else n),
    "other case": lambda b: _names(b, str.swapcase),
    "wrong unit": lambda b: replace(b, units={**b.units, b.first: "s"}),
    "unit of another scale": lambda b: replace(b, units={**b.units, b.first: "m" + b.units[b.first]}),
    "no unit": lambda b: replace(b, units={**b.units, b.first: "1"}),
    "nonsense for a unit": lambda b: replace(b, units={**b.units, b.first: "]["}),
    "quantised": _quantised,
    "noise": _noise,
    "drift": lambda b: b.with_value(b.values[b.first] + 5e-3 * _spread(b) * b.time / SPAN),
    "held samples": _held,
    "aliased": lambda b: b.rows(np.arange(0, b.time.size, 77)) if b.first == "x" else None,
    "frozen halfway": _frozen,
    "clipped": _clipped,
    "absolute value": lambda b: b.with_value(np.abs(b.values[b.first])) if b.values[b.first].min() < 0 else None,
    "rates of another": lambda b: b.with_value(b.values[b.first], rates=-3.0 * b.rates[b.first]),
    "shifted event": lambda b: _shifted_event(b, 0.01),
    "slightly shifted event": lambda b: _shifted_event(b, 1e-6),
    "shifted jump": lambda b: _shifted_jump(b, 1e-4),
    "lost event": lambda b: replace(b, events=b.events[1:]) if b.events else None,
    "no events": lambda b: replace(b, events=()) if b.events else None,
    "one event more": lambda b: replace(b, events=(*b.events, TraceEvent(9.5, "floor"))),
    "another event": lambda b: replace(b, events=(TraceEvent(1.0, "ceiling"), *b.events[1:])) if b.events else None,
    "event at nan": lambda b: replace(b, events=(TraceEvent(np.nan, "floor"), *b.events[1:])) if b.events else None,
    "1e-12 where there is nothing": lambda b: None if _turns(b) else b.with_value(np.full(b.time.size, 1.1e-12), "q"),
    "the second quantity off": lambda b: b.with_value(list(b.values.values())[1] + 0.01, list(b.values)[1]),
}


def mutants():
    """(base, mutation) of all that change something."""
    pairs = [(base, name) for base in BASES for name in MUTANTS]
    return [(base, name) for base, name in pairs if MUTANTS[name](BASES[base]()) is not None]
