"""A model that is read and compiled once, and run often: only numbers change between its runs.

A setting that the binding takes (a parameter or its element, by a number or a constant) changes numbers alone; another
one (an input, a text with names, a level) is elaborated and compiled once and then kept.
"""

from __future__ import annotations

import copy
import re
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.cli.failures import UsageError
from sysdyn.cli.run.many.in_core import InCore
from sysdyn.cli.run.prepare import Prepared
from sysdyn.cli.run.request import targets
from sysdyn.cli.run.request.run_request import RunRequest, check_tolerances, options_of, parameters_of
from sysdyn.cli.run.request.targets import Target
from sysdyn.cli.run.running import Ran, integrate, ready
from sysdyn.compiler.binding.binding import Binding
from sysdyn.compiler.binding.rebinding import Consequences, rebind
from sysdyn.dsl import load
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.rules.text_conditions import TextConditions
from sysdyn.dsl.text.diagnostics import Diagnostic, ModelError, Report
from sysdyn.runtime.many.asked import ROWS, NotApplicableError
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.trace.trace import Trace
from sysdyn.values import dataclass

KEPT = 64
"""Texts that are kept compiled."""
SHORT, LONGER = 1000, 5
"""Steps of the text's own run up to which runs are made in the core, where nobody can interrupt them; times those that
one of them may take there."""
_ELEMENT = re.compile(r"([^\[\]]+)\[(-?\d+(?:,-?\d+)*)\]")

Settings = Mapping[str, Any]
"""Names of parameters (`m`, `m[2]`, `M1.R`) and inputs -> numbers in SI units, arrays, or texts of the language."""


class CorePool:
    """A text's structures in the core that no run uses just now: runs side by side (threads) have one each.

    refused: why it has none; moving: what changes where parameters change together, None where the options do.
    """

    def __init__(self) -> None:
        self._free: list[InCore] = []
        self.refused: str | None = None
        self._moving: dict[frozenset[str], frozenset[str] | None] = {}

    def take(self, make: Callable[[], InCore]) -> InCore | None:
        """One to run with, made if there is none; None where there can be none."""
        try:
            return self._free.pop()
        except IndexError:
            pass
        if self.refused is None:
            try:
                return make()
            except NotApplicableError as error:
                self.refused = str(error)
        return None

    def give(self, core: InCore) -> None:
        """Takes one back."""
        self._free.append(core)

    def moving(self, core: InCore, names: frozenset[str]) -> frozenset[str] | None:
        """Parameters that change where these do; None where the scene's options are among them."""
        if names not in self._moving:
            if len(self._moving) >= KEPT:
                self._moving.clear()
            try:
                self._moving[names] = core.moving(names)
            except NotApplicableError:
                self._moving[names] = None
        return self._moving[names]


@dataclass(frozen=True, slots=True)
class Compiled:
    """A text under settings that are part of it, with the space of its expressions."""

    prepared: Prepared
    nodes: dict[Any, ex.Node]
    checked: list[bool] = field(default_factory=list)
    """Its module was compared with its text."""
    lone: threading.Lock = field(default_factory=threading.Lock)
    """Of the run whose structures the next one takes."""
    ways: dict[frozenset[str], Consequences | None] = field(default_factory=dict)
    """What follows from parameters that were set together."""
    cores: CorePool = field(default_factory=CorePool)

    def bound(self, numbers: Mapping[Any, Any]) -> Binding:
        """The text's binding with these numbers: by what follows from them, or anew."""
        compiled, binding = self.prepared.compiled, self.prepared.binding
        # numbers of scalar parameters alone: what follows from their names is found once
        if all(isinstance(name, str) and np.ndim(value) == 0 for name, value in numbers.items()):
            names = frozenset(numbers)
            if names not in self.ways:
                if len(self.ways) >= KEPT:
                    self.ways.clear()
                self.ways[names] = compiled.way(binding, names)
            way = self.ways[names]
            found = None if way is None else rebind(binding, way, {name: float(v) for name, v in numbers.items()})
            if found is not None:
                return found
        # arrays, sizes, or numbers that turn a decision: bound from the beginning
        return compiled.bind(numbers)


def place_of(name: str) -> str | tuple[str | int, ...]:
    """A parameter as a binding has it: `m[2]` is ("m", 2)."""
    element = _ELEMENT.fullmatch(name)
    return (element[1], *map(int, element[2].split(","))) if element else name


def text_of(value: Any) -> str:
    """A value as --set takes it; UsageError where it is neither a number that is a double, nor some, nor a text."""
    try:
        # a lone surrogate is no text
        if isinstance(value, str):
            value.encode()
            return value
        if np.iscomplexobj(value):
            raise TypeError
        # a list or an array
        if np.ndim(value):
            return f"[{', '.join(repr(float(v)) for v in value)}]"
        return repr(float(value))
    except (TypeError, ValueError, OverflowError):
        raise UsageError(f"{shortly(value)}: a number, a list of numbers or a text is wanted") from None


def shortly(value: object) -> str:
    """A value for a message: those of thousands of digits are not written."""
    try:
        text = ascii(value)
    except Exception:  # whatever a class of somebody's own does
        text = type(value).__name__
    return text if len(text) <= 60 else f"{text[:57]}..."


class Loaded:
    """A target of a file: `run` it with other numbers.  ModelError, UsageError where text or options are wrong."""

    def __init__(self, request: RunRequest) -> None:
        check_tolerances(request)
        self.request = request
        report = Report()
        target = targets.target_of(request, report)
        if target is None or report.failed:
            raise ModelError(report.diagnostics)
        self.target: Target = target
        self._compiled: dict[tuple[tuple[str, str], ...], Compiled] = {}
        self.first = self._text(())
        made = self.first.prepared.network.parameters
        self.parameters = {p.name: p for p in made if not p.name.startswith("#")}  # those are the compiler's own
        report.raise_if_failed()

    def keeping(self, *, extrema: bool) -> Loaded:
        """The loaded text, and what is compiled of it, for runs that keep least and largest values, or do not."""
        other = copy.copy(self)
        other.request = replace(self.request, extrema=extrema)
        return other

    @cached_property
    def sizes(self) -> frozenset[str]:
        """Sizes that are part of the text, and what they follow from: where elements sit between nodes (which of them
        are alike depends on where ranges meet), where events, inequalities or corners stand for each element, or a
        nonlinear function of a sum, and those of components in arrays.
        """
        network = self.first.prepared.network
        kinks = self.first.prepared.compiled.form.kinks
        written = network.literal or network.branches or network.events or network.switches or kinks
        found = {p.name for p in network.parameters if p.whole and (written or p.shape)}
        waiting = list(found)
        while waiting:
            values = self.parameters[waiting.pop()].values
            more = {n.data for n in ex.topological(values) if n.op == "param"} - found
            found |= more
            waiting += more
        return frozenset(found)

    @cached_property
    def _conditions(self) -> tuple[TextConditions, dict[Any, ex.Node]]:
        """What the text asks of its numbers, with the space of its expressions."""
        nodes, request = dict[Any, ex.Node](), self.request
        with ex.fresh(nodes):
            model, scene = self.target.model, self.target.scene
            return load.conditions_on_numbers(
                self.target.document, model, scene, request.settings, request.levels
            ), nodes

    def allowed_rows(self, keys: Sequence[Any], values: Floats) -> NDArray[np.bool_]:
        """Which rows of numbers [k, keys] the text does not refuse."""
        asked, nodes = self._conditions
        fine = np.ones(len(values), dtype=bool)
        with ex.fresh(nodes):
            mine = asked.conditions_of(frozenset(key if isinstance(key, str) else str(key[0]) for key in keys))
            column = {key: values[:, j] for j, key in enumerate(keys)}
            if not mine.plain or not all(isinstance(key, str) for key in keys):
                rows = (dict(zip(keys, row, strict=True)) for row in values.tolist())
                return np.fromiter(map(asked.holds, rows), dtype=bool, count=len(values))
            for bound in mine.bounds:
                fine &= np.asarray(bound.compared(column[bound.name], bound.limit))  # type: ignore[arg-type]
        return fine

    def _elements(self, name: str, value: Any) -> Iterator[tuple[str, tuple[int, ...], Any]]:
        """What one setting says: a parameter, the indices of an element of it (() of one number), its value."""
        if np.ndim(value) == 0:
            yield name, (), value
            return
        evaluate = self.first.prepared.binding.evaluate
        first = [int(evaluate(low)) for low, _ in self.parameters[name].shape]
        for at, number in np.ndenumerate(np.asarray(value, dtype=float)):
            yield name, tuple(f + k for f, k in zip(first, at, strict=False)), number

    def _is_refused(self, numbers: Mapping[Any, Any]) -> bool:
        """Whether the text refuses these numbers."""
        keys, values = list[Any](), list[float]()
        for key, value in numbers.items():
            for name, at, number in self._elements(key, value):
                keys.append((name, *at) if at else name)
                values.append(float(number))
        return not self.allowed_rows(keys, np.array([values]))[0]

    def _text(self, settings: tuple[tuple[str, str], ...]) -> Compiled:
        """The text under settings that its numbers cannot take."""
        if settings not in self._compiled:
            report, nodes = Report(), dict[Any, ex.Node]()
            with ex.fresh(nodes):
                whole = (*self.request.settings, *settings)
                prepared = ready(replace(self.request, settings=whole), self.target, report)
            if prepared is None:
                raise ModelError(report.diagnostics)
            # the oldest goes
            if len(self._compiled) >= KEPT:
                self._compiled.pop(next(iter(self._compiled)))
            self._compiled[settings] = Compiled(prepared, nodes)
        return self._compiled[settings]

    def _split(self, settings: Settings) -> tuple[dict[Any, Any], tuple[tuple[str, str], ...]]:
        """Numbers for the binding by name or (name, index, ...); the rest as texts."""
        known = self.parameters
        numbers, texts = dict[Any, Any](), list[tuple[str, str]]()
        for name, value in settings.items():
            key = place_of(name)
            plain = key if isinstance(key, str) else str(key[0])
            parameter = known.get(plain)
            number = value
            # an array for a name that is none
            if parameter is None and np.ndim(value):
                raise ModelError([Diagnostic("E405", f"there is no parameter '{plain}'", None)])
            # a text with units, as on the command line
            if isinstance(value, str) and parameter is not None:
                silent = Report()
                with ex.fresh():
                    number = load.constant(self.target.document, value, parameter.unit.dimension, name, silent)
            # names of levels and inputs, and sizes: the text is read again with them
            if parameter is None or number is None or isinstance(number, str) or plain in self.sizes:
                texts.append((name, text_of(value)))
            else:
                try:
                    numbers[key] = np.asarray(number, dtype=float)
                except (TypeError, ValueError, OverflowError):
                    raise UsageError(f"{name} {shortly(value)}: numbers or a text are wanted") from None
        if texts:  # a list fits the sizes that are set with it, not those of the text
            whole = [name for name in numbers if np.ndim(numbers[name])]
            texts += [(name, text_of(numbers.pop(name).tolist())) for name in whole]
        return numbers, tuple(texts)

    def bound(self, settings: Settings) -> tuple[Prepared, Compiled]:
        """The model with these numbers."""
        numbers, texts = self._split(settings)
        compiled = self._text(texts)
        if not numbers:
            return compiled.prepared, compiled
        if self._is_refused(numbers):  # the rules say what is wrong with them
            each = [one for name, value in settings.items() for one in self._elements(name, value)]
            shown = ((f"{name}[{','.join(map(str, at))}]" if at else name, text_of(value)) for name, at, value in each)
            compiled = self._text(tuple(shown))
            return compiled.prepared, compiled
        try:
            with ex.fresh(compiled.nodes):
                binding = compiled.bound(numbers)
        except ModelError as error:
            scalar = all(isinstance(value, str) or np.ndim(value) == 0 for value in settings.values())
            if not scalar or not {d.code for d in error.diagnostics} <= {"E605", "E805"}:
                raise
            # a value that asks for another form: a mass that is zero, an array without an inside
            compiled = self._text(tuple((name, text_of(value)) for name, value in settings.items()))
            return compiled.prepared, compiled
        return replace(compiled.prepared, binding=binding, cpu_compile_s=0.0), compiled

    def run(self, settings: Settings, report: Report, *, alone: bool = False, **changes: Any) -> Ran | None:
        """One run; changes: options of the request that differ (`until`, `at`, `output`, ...), output None: in memory.

        alone: nobody looks at more of it than at its trace once the next one begins.
        None where the report says why not.
        """
        request = replace(self.request, **changes) if changes else self.request
        check_tolerances(request)
        prepared, compiled = self.bound(settings)
        return (self._run_alone if alone else self._run)(request, prepared, compiled, report)

    def _run_alone(self, request: RunRequest, prepared: Prepared, compiled: Compiled, report: Report) -> Ran | None:
        """A run of which nobody looks at more than its trace once the next one begins."""
        network = prepared.network
        eventful = network.events or network.switches or prepared.compiled.form.kinks
        # a run beside another one (threads) has structures of its own
        if eventful or not compiled.lone.acquire(blocking=False):
            return self._run(request, prepared, compiled, report)
        try:
            return self._run(request, replace(prepared, alone=True), compiled, report)
        finally:
            compiled.lone.release()

    def trace(self, settings: Settings, report: Report) -> Trace | Ran | None:
        """The trace of one run in memory: of a run in the core, whose text differs from another one's in numbers alone;
        else what `run` hands back.
        """
        prepared, compiled = self.bound(settings)
        found = self._in_core(settings, prepared, compiled)
        return found if found is not None else self._run_alone(self.request, prepared, compiled, report)

    def _in_core(self, settings: Settings, prepared: Prepared, compiled: Compiled) -> Trace | None:
        """The trace of a run in the core; None where there is none."""
        with ex.fresh(compiled.nodes):
            core = compiled.cores.take(lambda: self._set_up(compiled))
            if core is None:
                return None
            try:
                names = frozenset(name.partition("[")[0] for name in settings).intersection(self.parameters)
                moving = compiled.cores.moving(core, names)
                numbers = None if moving is None else core.numbers_of_run(prepared.binding, moving)
                return None if numbers is None else core.batch.trace(*numbers, tuple(parameters_of(prepared)))
            finally:
                compiled.cores.give(core)

    def _set_up(self, compiled: Compiled) -> InCore:
        """The text in the core.  Only where its own run is short: of a long one the rest of a call costs little."""
        short = replace(self.request, max_steps=min(self.request.max_steps or SHORT, SHORT))

        def nominal() -> Ran | None:
            return self._run(short, compiled.prepared, compiled, Report())

        core = InCore(replace(self.request, max_steps=LONGER * SHORT), self.target, compiled.prepared, nominal, ROWS)
        if self.request.max_steps is not None:
            raise NotApplicableError("the steps of a run are limited")
        core.set_up()
        return core

    def _run(self, request: RunRequest, prepared: Prepared, compiled: Compiled, report: Report) -> Ran | None:
        with ex.fresh(compiled.nodes):
            options = options_of(request, self.target, prepared, report, time.monotonic(), None, held=True)
            if options is None:
                return None
            ran = integrate(self.target, prepared, options, report, checked=bool(compiled.checked))
            compiled.checked.extend([True] if ran is not None else [])
            return ran
