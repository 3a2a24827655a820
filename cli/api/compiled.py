"""A compiled model as functions of arrays: residual, Jacobian, mass matrix, outputs, consistent starts."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path, PurePath
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.cli.export.files import manifest_of
from sysdyn.cli.export.index_form import formed_of, network_of, report_impossible
from sysdyn.cli.export.index_parameters import index_parameters
from sysdyn.cli.export.naming import elements
from sysdyn.cli.export.tabulation import AUDIT, Formed, state_jacobian, tables
from sysdyn.cli.failures import UsageError
from sysdyn.cli.options import BACKENDS, FORMULATIONS, INDICES
from sysdyn.cli.run.many.reusable_model import KEPT, place_of, shortly
from sysdyn.cli.run.prepare import prepare
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.text.diagnostics import Diagnostic, ModelError, Report
from sysdyn.runtime.integrate.underlying import Underlying
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.start import consistent_start


def numbers(name: str, value: object) -> NDArray[np.float64]:
    """An array of doubles; UsageError where a value is none."""
    try:
        return np.asarray(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise UsageError(f"{name} {shortly(value)}: numbers are wanted") from None


def written(name: str, value: object) -> str:
    """A value that is a text, a path or a small number, as a text; UsageError where it is none."""
    if isinstance(value, str | int | PurePath) and not isinstance(value, bool):
        try:
            text = str(value)
            text.encode()
            if "\0" not in text:
                return text
        except ValueError:  # thousands of digits, half a character
            pass
    raise UsageError(f"{name} {shortly(value)}: a text is wanted")


def by_name(what: str, given: object) -> Mapping[str, Any]:
    """Values by name, of which there may be none; UsageError where it is another thing."""
    found = {} if given is None else given
    if not isinstance(found, Mapping) or not all(isinstance(name, str) for name in found):
        raise UsageError(f"{what} {shortly(given)}: names with their values")
    return found


class Module:
    """A compiled model in one index form, at its consistent start; all numbers in SI units.

    manifest: as `compile` writes it; unknowns, traced: names in the order of y and of `outputs`;
    t0, y0, yd0: the start; parameters: values as bound; indptr, indices: pattern of the matrices by columns.
    In index form 0, y are the differential unknowns and the residual is yd - F(t, y).  Of a model with
    events it is the piece that holds at the start, until the first of them.
    """

    def __init__(self, formed: Formed) -> None:
        self._formed = formed
        self._numbers, following_ = tables(formed)
        found = {"index_parameters": index_parameters(formed, self._numbers, following_)}
        self.manifest: dict[str, Any] = {**manifest_of(formed), **found}
        self.unknowns = elements(formed)
        self.traced = tuple(output.name for output in self._numbers.outputs)
        self.t0, self.y0, self.yd0 = self._numbers.t0, self._numbers.y0, self._numbers.yd0
        self.parameters = parameters_of_text(formed.prepared.binding.values)
        pattern = self._numbers.state or self._numbers.system
        self.indptr, self.indices = pattern.column, pattern.row
        self._systems: dict[tuple[tuple[str, bytes], ...], System] = {(): formed.system}

    def _system(self, parameters: Mapping[str, Any] | None) -> System:
        """The system with other values of parameters."""
        said = sorted((name, numbers(name, value)) for name, value in by_name("parameters", parameters).items())
        key = tuple((name, value.tobytes()) for name, value in said)
        if key not in self._systems:
            prepared, system = self._formed.prepared, self._formed.system
            fixed = prepared.network.branches or self._numbers.state is not None  # y0 says which unknowns are the state
            sizes = {p.name for p in prepared.network.parameters if p.whole} if fixed else set()
            given = {place_of(name): value for name, value in said}
            for name in sizes & given.keys():  # which elements are alike depends on where ranges meet
                where = "where elements sit between nodes" if prepared.network.branches else "in index form 0"
                message = f"the size '{name}' is part of the text {where}"
                help_ = f"a text with another {name}, compiled for itself"
                raise ModelError([Diagnostic("E805", message, None, help_)])
            arrays = prepared.arrays_of(prepared.compiled.bind(given))
            made = System(prepared.structure, arrays, prepared.carrier, system.form.name)
            if len(self._systems) > KEPT:
                self._systems.pop(next(each for each in self._systems if each))
            self._systems[key] = made.without_constraints(system.left_out) if system.left_out else made
        return self._systems[key]

    def _prepare_point(
        self, t: float, parameters: Mapping[str, Any] | None, *given: NDArray[np.float64]
    ) -> tuple[float, System, Any, Any]:
        """t, the system with these parameters, y and ydot as it takes them.  ValueError: one has another shape."""
        instant = numbers("t", t)
        if instant.ndim:
            raise UsageError(f"t {shortly(t)}: one number is wanted")
        system = self._system(parameters)
        number = system.unknowns if self._numbers.state is None else self.y0.size
        y, ydot = (np.ascontiguousarray(numbers("y and ydot", vector)) for vector in given)
        for vector in (y, ydot):
            if vector.shape != (number,):
                raise ValueError(f"y and ydot have {number} unknowns: an array of shape {vector.shape} was given")
        return float(instant), system, y, ydot

    def residual(
        self,
        t: float,
        y: NDArray[np.float64],
        ydot: NDArray[np.float64],
        parameters: Mapping[str, Any] | None = None,
    ) -> NDArray[np.float64]:
        """F(t, y, ydot) [rows]; parameters: values that replace the model's."""
        t, system, y, ydot = self._prepare_point(t, parameters, y, ydot)
        if self._numbers.state is None:
            return system.residual(t, y, ydot)
        return np.asarray(ydot - self._slopes(system, t, y)[1][self._numbers.state.places])

    def jacobian(
        self,
        t: float,
        y: NDArray[np.float64],
        ydot: NDArray[np.float64],
        cj: float,
        parameters: Mapping[str, Any] | None = None,
    ) -> NDArray[np.float64]:
        """Entries of dF/dy + cj dF/dydot on the pattern: scipy.sparse.csc_array((values, indices, indptr))."""
        t, system, y, ydot = self._prepare_point(t, parameters, y, ydot)
        if self._numbers.state is not None:
            inside, rates = self._slopes(system, t, y)
            return state_jacobian(self._numbers, system, t, inside, rates, cj)
        jy, jyd = system.jacobian(t, y, ydot)
        return jy + cj * jyd

    def mass(
        self,
        t: float,
        y: NDArray[np.float64],
        ydot: NDArray[np.float64],
        parameters: Mapping[str, Any] | None = None,
    ) -> NDArray[np.float64]:
        """Entries of dF/dydot on the pattern."""
        t, system, y, ydot = self._prepare_point(t, parameters, y, ydot)
        if self._numbers.state is not None:
            columns = np.repeat(np.arange(self.y0.size), np.diff(self.indptr))
            return np.asarray(self.indices == columns, dtype=float)
        return system.jacobian(t, y, ydot)[1]

    def outputs(
        self,
        t: float,
        y: NDArray[np.float64],
        ydot: NDArray[np.float64],
        parameters: Mapping[str, Any] | None = None,
    ) -> NDArray[np.float64]:
        """What the scene traces at a point; not a number where it reads a ledger of a whole run."""
        t, system, y, ydot = self._prepare_point(t, parameters, y, ydot)
        if self._numbers.state is not None:
            y, ydot = self._slopes(system, t, y)
        kinetic, potential = system.audit(t, y, ydot)[:2]
        known = dict.fromkeys(AUDIT, float("nan")) | {"kinetic": kinetic, "potential": potential}
        places = [output.place for output in self._numbers.outputs]
        return np.asarray(system.observe(t, y, ydot, known)[places])

    def start(self, parameters: Mapping[str, Any] | None = None) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Consistent (y, ydot) at t0 for other parameters.  Raises InconsistentStart."""
        system = self._system(parameters)
        y, yd = consistent_start(system, self.t0).for_form(system)
        if self._numbers.state is None:
            return y, yd
        places = self._numbers.state.places
        return y[places], self._slopes(system, self.t0, y[places])[1][places]

    def _slopes(
        self, system: System, t: float, state: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The full layout (y, ydot) at a state of index form 0."""
        assert self._numbers.state is not None
        y = self._numbers.full_y.copy()
        y[self._numbers.state.places] = state
        return Underlying(system, np.ones(system.unknowns)).slopes(t, y, self._numbers.full_yd)


def compile_model(
    path: str | Path,
    *,
    model: str | None = None,
    scene: str | None = None,
    formulation: str = "auto",
    index: str | int = "auto",
    backend: str = "c",
    no_prune: bool = False,
) -> Module:
    """Compile a model of a file, of a scene where one is named (without what that does not need).

    index: 3 as written, 2 stabilised, 2v, 1, 0 (yd - F(t, y)); auto: the one that `simulate` takes by radau.
    """
    index, formulation, backend = (
        written("index", index),
        written("formulation", formulation),
        written("backend", backend),
    )
    check_choices(formulation, backend, index)
    scene, model = (name if name is None else written("scene or model", name) for name in (scene, model))
    report, request = Report(), RunRequest(written("path", path), scene, model, backend=backend, no_prune=no_prune)
    # nodes of the text go with it
    with ex.fresh():
        network = network_of(request, report)
        report.raise_if_failed()
        assert network is not None
        # auto: by the statements of the model
        wanted = None if formulation == "auto" else formulation
        prepared = prepare(network, report, formulation=wanted, backend=backend, prune=not no_prune)
        if prepared is not None:
            with report_impossible(prepared, report):
                formed = formed_of(prepared, None if index == "auto" else index, report)
                if formed is not None:
                    return Module(formed)
    raise ModelError(report.diagnostics)


def check_choices(formulation: str | None, backend: str, index: str | None) -> None:
    """UsageError where there is no such formulation, backend or index form."""
    given = {"formulation": (formulation, FORMULATIONS), "backend": (backend, BACKENDS), "index": (index, INDICES)}
    for what, (said, names) in given.items():
        if said is not None and said not in names:
            raise UsageError(f"{what} {said!r}: {', '.join(names[:-1])} or {names[-1]}")


def parameters_of_text(values: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters of the text: none that the compiler made."""
    return {name: value for name, value in values.items() if not name.startswith("#")}
