"""What is kept of runs: one by one (`Kept`), or many that were met in arrays (`KeptRuns`); `Done` is all of a sweep."""

from __future__ import annotations

import base64
from collections.abc import Iterator
from dataclasses import asdict, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.values import dataclass

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Kept:
    """What is kept of a run.  exit: as `simulate` ends; reason: why it is not 0; end, least, most by traced name; time
    and traces: thinned, where the scene has an interval; finding: the reason with its code and place.
    """

    run: int
    exit: int
    met: bool
    reason: str = ""
    method: str = ""
    error_estimate: float | None = None
    steps: int = 0
    cpu_s: float = 0.0
    end: dict[str, float] | None = None
    least: dict[str, float] | None = None
    most: dict[str, float] | None = None
    time: list[float] | None = None
    traces: dict[str, list[float]] | None = None
    finding: dict[str, Any] | None = None

    def to_json(self) -> dict[str, Any]:
        """For the journal; numbers to the last bit."""
        return asdict(self)


@dataclass(frozen=True, slots=True, eq=False)
class KeptRuns:
    """What is kept of runs that were met, one after the other in the core.

    runs [k]: their numbers; names: of the traced quantities; estimate (relative), steps, cpu_s [k]; end, least, most
    [k, quantities], the latter two empty where nobody asked; time [rows] and traces [k, quantities, rows].
    """

    runs: NDArray[np.int64]
    names: tuple[str, ...]
    method: str
    estimate: Floats
    steps: NDArray[np.int64]
    cpu_s: Floats
    end: Floats
    least: Floats
    most: Floats
    time: Floats
    traces: Floats

    def one(self, k: int) -> Kept:
        """The k-th of them."""

        def named_values(table: Floats) -> dict[str, Any] | None:
            return dict(zip(self.names, table[k].tolist(), strict=True)) if table.shape[1] else None

        return Kept(
            int(self.runs[k]), 0, True, "", self.method, float(self.estimate[k]), int(self.steps[k]),
            float(self.cpu_s[k]), named_values(self.end), named_values(self.least), named_values(self.most),
            self.time.tolist() if self.time.size else None, named_values(self.traces) if self.time.size else None,
        )  # fmt: skip

    def to_json(self) -> dict[str, Any]:
        """For the journal: arrays as (kind, shape, bytes)."""
        found: dict[str, Any] = {}
        for item in fields(self):
            value = getattr(self, item.name)
            found[item.name] = _pack(value) if isinstance(value, np.ndarray) else value
        return found

    @classmethod
    def from_json(cls, line: dict[str, Any]) -> KeptRuns:
        """From a line of the journal."""
        found: dict[str, Any] = {
            name: _unpack(value) if isinstance(value, dict) else value for name, value in line.items()
        }
        found["names"] = tuple(found["names"])
        return cls(**found)


def _pack(array: NDArray[Any]) -> dict[str, Any]:
    data = base64.b64encode(np.ascontiguousarray(array).tobytes()).decode("ascii")
    return {"kind": array.dtype.str, "shape": list(array.shape), "data": data}


def _unpack(item: dict[str, Any]) -> NDArray[Any]:
    return np.frombuffer(base64.b64decode(item["data"]), dtype=item["kind"]).reshape(item["shape"]).copy()


Item = Kept | KeptRuns


@dataclass(slots=True)
class Done:
    """The runs of a sweep that are done: singles by number, and blocks."""

    singles: dict[int, Kept] = field(default_factory=dict)
    blocks: list[KeptRuns] = field(default_factory=list)
    _place: dict[int, tuple[int, int]] = field(default_factory=dict)

    def take(self, item: Item) -> None:
        """Takes a result in."""
        if isinstance(item, Kept):
            self.singles[item.run] = item
            return
        number = len(self.blocks)
        self.blocks.append(item)
        self._place.update((run, (number, k)) for k, run in enumerate(item.runs.tolist()))

    def __len__(self) -> int:
        return len(self.singles) + len(self._place)

    def __contains__(self, run: int) -> bool:
        return run in self.singles or run in self._place

    def __getitem__(self, run: int) -> Kept:
        if run in self.singles:
            return self.singles[run]
        number, k = self._place[run]
        return self.blocks[number].one(k)

    def names(self) -> tuple[str, ...]:
        """Of the traced quantities."""
        found: list[tuple[int, tuple[str, ...]]] = [(int(b.runs[0]), b.names) for b in self.blocks]
        first = next((k for _, k in sorted(self.singles.items()) if k.end), None)
        if first is not None and first.end is not None:
            found.append((first.run, tuple(first.end)))
        return min(found, default=(0, ()))[1]

    def columns(self, group: str, number: int) -> Iterator[tuple[str, Floats]]:
        """(name, values [number]) of end, least or most; NaN where there is none; nothing where nobody kept any."""
        for name in self.names():
            column, some = np.full(number, np.nan), False
            # runs by themselves
            for run, kept in self.singles.items():
                value = (getattr(kept, group) or {}).get(name)
                some |= value is not None
                column[run] = np.nan if value is None else value
            # runs of the core, a table each
            for block in self.blocks:
                table = getattr(block, group)
                if table.shape[1] and name in block.names:
                    column[block.runs] = table[:, block.names.index(name)]
                    some = True
            if some or group == "end":
                yield name, column
