"""Linear analysis from Python: `linearize`, `equilibria`, as the commands, with objects of scipy and python-control."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from sysdyn.cli.analysis import linearisation as linear_
from sysdyn.cli.analysis.answers import Answer, answers
from sysdyn.cli.analysis.linear_files import arrays
from sysdyn.cli.analysis.linearisation import inputs_of, linearise
from sysdyn.cli.analysis.resting import Equilibrium, equilibria
from sysdyn.cli.analysis.states import state_of
from sysdyn.cli.failures import UsageError
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.text.diagnostics import ModelError, Report

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from sysdyn.runtime.linear.modes import Eigenmode, Transfer


class NoState(Exception):  # noqa: N818 (a name of the house)
    """The state that was asked for was not reached or found."""


class Linearised:
    """A model about a state: x' = A x + B u, y = C x + D u of deviations; E, A, B, C, D of the descriptor form.

    matrices: all arrays by name, as in the files of the command; states, inputs, outputs: names; modes; transfers;
    moving: the state is not at rest; energies [modes, stores]: shares of each mode's energy by element.
    """

    def __init__(self, found: linear_.Linearisation) -> None:
        self._found = found
        self.matrices: dict[str, NDArray[Any]] = arrays(found)
        self.states, self.inputs, self.outputs = found.reduced.names, found.inputs, found.outputs
        self.unknowns = found.descriptor.states
        self.modes: tuple[Eigenmode, ...] = found.modes
        self.transfers: tuple[Transfer, ...] = found.transfers
        self.moving, self.t = found.moving, found.t
        self.stores, self.energies = found.stores, found.energies

    @property
    def eigenvalues(self) -> NDArray[Any]:
        """Of the motion on the constraint manifold, 1/s."""
        return self.matrices["eigenvalues"]

    def _proper(self) -> tuple[NDArray[Any], ...]:
        if self.matrices["reduced_D1"].any() or self.matrices["reduced_D2"].any():
            raise UsageError("an output differentiates an input: there is no state space (see matrices['reduced_D1'])")
        return tuple(self.matrices[f"reduced_{n}"] for n in "ABCD")

    def state_space(self) -> Any:
        """The reduction as `scipy.signal.StateSpace`."""
        from scipy.signal import StateSpace

        return StateSpace(*self._proper())

    def transfer_function(self, output: str | int = 0, input: str | int = 0) -> Any:
        """One output by one input as `scipy.signal.ZerosPolesGain`."""
        from scipy.signal import ZerosPolesGain

        found = self._transfer(output, input)
        if any(found.improper):
            raise UsageError(f"{self.outputs[found.output]} differentiates {self.inputs[found.input]}")
        return ZerosPolesGain(found.zeros, found.poles, found.gain)

    def control(self) -> Any:
        """The reduction as `control.StateSpace`, with names (python-control takes no dots); it is to be installed."""
        try:
            import control  # type: ignore[import-not-found, unused-ignore]
        except ImportError as error:
            raise UsageError("control() needs python-control: pip install control") from error
        every = {"states": self.states, "inputs": self.inputs, "outputs": self.outputs}
        named = {what: _without_dots(names) for what, names in every.items()}
        return control.ss(*self._proper(), **named)

    def answers(self) -> tuple[Answer, ...]:
        """Bode and Nyquist curves, margins and step responses of all transfer functions."""
        return answers(self._found)

    def _transfer(self, output: str | int, input: str | int) -> Transfer:
        i = output if isinstance(output, int) else self.outputs.index(output)
        j = input if isinstance(input, int) else self.inputs.index(input)
        return next(t for t in self.transfers if (t.output, t.input) == (i, j))


def _without_dots(names: Sequence[str]) -> list[str]:
    """Names that python-control takes, each its own."""
    found: list[str] = []
    for name in names:
        plain = name.replace(".", "_").replace(":", "_")
        found.append(plain if plain not in found else f"{plain}_{len(found)}")
    return found


def linearised_at(
    request: RunRequest,
    inputs: tuple[str, ...] | None,
    outputs: tuple[str, ...] | None,
    *,
    rest: bool,
) -> Linearised:
    """The linearisation of a request; raises ModelError, UsageError, NoState, NoLinearisation."""
    report = Report()
    with ex.fresh():
        found, why = state_of(request, outputs, inputs, report, rest=rest)
        if found is None:
            if why:
                raise NoState(why)
            raise ModelError(report.diagnostics)
        return Linearised(linearise(found, inputs_of(found.target, found.prepared, inputs), request.index or "3"))


def resting(request: RunRequest, tries: int) -> tuple[Equilibrium, ...]:
    """States of rest of a request; raises ModelError."""
    report = Report()
    with ex.fresh():
        made = equilibria(request, tries, report)
    if made is None:
        raise ModelError(report.diagnostics)
    return made[1]
