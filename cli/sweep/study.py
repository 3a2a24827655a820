"""What a sweep runs: its axes, and the cases that they make.

Lists and grids make their product; of distributions cases are drawn, for each point of that product: `random` (Monte
Carlo), `latin` (Latin hypercube), `sobol` (Owen's scrambling; SciPy's qmc).
"""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from sysdyn.cli.failures import UsageError
from sysdyn.cli.plain_files import UnfitError, tables
from sysdyn.cli.sweep.axes import MOST, Axis, Numbers
from sysdyn.values import dataclass

SAMPLES = ("random", "latin", "sobol")
LAST_SEED = 2**63 - 1
"""What the file of a sweep can hold."""
Case = dict[str, float | str]
"""Name -> value in SI units, or a text."""


@dataclass(frozen=True, slots=True)
class SweepStudy:
    """axes: what varies; sample, runs, seed: of what is drawn (runs 0: nothing is)."""

    axes: tuple[Axis, ...]
    sample: str = "random"
    runs: int = 0
    seed: int = 0

    @property
    def number(self) -> int:
        """Of cases."""
        found = max(self.runs, 1)
        for axis in self.axes:
            found *= 1 if axis.drawn else len(axis.values)
        return found

    def cases(self) -> Iterator[Case]:
        """All cases, always in one order: the last list varies fastest, what is drawn fastest of all."""
        lists, drawn = [a for a in self.axes if not a.drawn], [a for a in self.axes if a.drawn]
        points = self._points(len(drawn))
        columns = [axis.values_at(points[:, k]) for k, axis in enumerate(drawn)]
        for chosen in itertools.product(*(a.values for a in lists)):
            fixed = {a.name: value for a, value in zip(lists, chosen, strict=True)}
            for k in range(max(self.runs, 1)):
                taken = fixed | {a.name: float(c[k]) for a, c in zip(drawn, columns, strict=True)}
                yield {axis.name: taken[axis.name] for axis in self.axes}

    def _points(self, dimension: int) -> Numbers:
        """Probabilities [runs, dimension] inside (0, 1)."""
        if not dimension:
            return np.zeros((max(self.runs, 1), 0))
        from scipy.stats import qmc

        random = np.random.default_rng(self.seed)
        if self.sample == "random":
            found = random.random((self.runs, dimension))
        elif self.sample == "latin":
            found = qmc.LatinHypercube(dimension, seed=random).random(self.runs)
        else:
            # balanced in powers of two; the first of them are still evenly spread
            found = qmc.Sobol(dimension, seed=random).random_base2(max(self.runs - 1, 1).bit_length())[: self.runs]
        tiny = np.finfo(np.float64).eps
        return np.asarray(np.clip(found, tiny, 1.0 - tiny))

    def digest(self, **beside: Any) -> str:
        """A fingerprint of the study and of what it is of."""
        text = json.dumps({"study": asdict(self), **beside}, sort_keys=True, default=str)
        return hashlib.sha256(text.encode()).hexdigest()


def study(axes: list[Axis], sample: str | None, runs: int | None, seed: int) -> SweepStudy:
    """A study; UsageError where its parts do not fit each other."""
    names = [axis.name for axis in axes]
    twice = next((n for n in names if names.count(n) > 1), None)
    if twice is not None:
        raise UsageError(f"--over {twice} twice: one list, or a grid")
    if not axes:
        raise UsageError("nothing varies: --over NAME=VALUE,VALUE,..., or a study file")
    # what is drawn needs a number of runs, and a number needs something drawn
    drawn = [axis.name for axis in axes if axis.drawn]
    if drawn and runs is None:
        raise UsageError(f"how many runs of {', '.join(drawn)}? --runs N")
    if runs is not None and not drawn:
        raise UsageError("--runs without a distribution: NAME~uniform(a, b)")
    if runs is not None and not 1 <= runs <= MOST:
        raise UsageError(f"--runs {runs}: from 1 to {MOST}")
    if not 0 <= seed <= LAST_SEED:
        raise UsageError(f"--seed {seed}: a whole number from 0 to {LAST_SEED}")
    found = SweepStudy(tuple(axes), sample or "random", runs or 0, seed)
    if found.number > MOST:
        raise UsageError(f"{found.number} runs: at most {MOST}")
    return found


@dataclass(frozen=True, slots=True)
class StudyFile:
    """A study in TOML: [study] file, scene, sample, runs, seed, output; [over] NAME = "..." as --over says it."""

    file: str
    over: tuple[str, ...]
    options: dict[str, Any]


_TEXTS, _NUMBERS = ("file", "scene", "model", "sample", "output", "keep"), ("runs", "seed", "jobs")
_KEYS: dict[str, type] = {**dict.fromkeys(_TEXTS, str), **dict.fromkeys(_NUMBERS, int)}


def read(path: str) -> StudyFile:
    """A study file; the model stands relative to it."""
    try:
        text = tables(Path(path))
    except UnfitError as error:
        raise UsageError(str(error)) from None
    said, over = text.get("study", {}), text.get("over", {})
    wrong = sorted({*text} - {"study", "over"}) + sorted({*said} - {*_KEYS})
    if wrong or not isinstance(said, dict) or not isinstance(over, dict):
        known = f"[study] {', '.join(_KEYS)}; [over]"
        raise UsageError(f"{path}: '{wrong[0] if wrong else 'study'}' is not of a study: {known}")
    for key, value in said.items():
        if type(value) is not _KEYS[key]:
            raise UsageError(f"{path}: {key} = {value!r}: a {_KEYS[key].__name__} is wanted")
    if "file" not in said:
        raise UsageError(f'{path}: [study] lacks the model: file = "model.sd"')
    lines = tuple(_line(path, name, value) for name, value in over.items())
    return StudyFile(str(Path(path).parent / said["file"]), lines, {k: v for k, v in said.items() if k != "file"})


def line(name: str, value: Any) -> str:
    """What a name takes (numbers, texts, or one text), as --over says it; UsageError where it is neither."""
    if isinstance(value, str):
        return f"{name} {value}" if value.lstrip().startswith("~") else f"{name} = {value}"
    try:
        some = np.atleast_1d(np.asarray(value, dtype=object)).tolist() if value is not None else []
        if some and all(isinstance(v, int | float | str | np.number) and not isinstance(v, bool) for v in some):
            return f"{name} = {', '.join(v if isinstance(v, str) else repr(float(v)) for v in some)}"
    except (ValueError, OverflowError):  # no list, no double
        pass
    said = f"{value!r:.60}" if value is None else type(value).__name__
    raise UsageError(f'{name} = {said}: a list, or a text as --over takes it: "1 N/m .. 2 N/m : 5"')


def _line(path: str, name: str, value: Any) -> str:
    """A line of [over] as --over takes it."""
    try:
        return line(name, value)
    except UsageError as error:
        raise UsageError(f"{path}: {error}") from None
