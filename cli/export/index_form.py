"""What is compiled for others to call: a model of a file, and one index form of it at its start."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from sysdyn.cli.export.tabulation import Formed, choose
from sysdyn.cli.run.prepare import Prepared
from sysdyn.cli.run.request import targets
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.cli.run.start.flat_laws import impossible
from sysdyn.cli.run.start.starting import start
from sysdyn.dsl import load
from sysdyn.dsl.elaborate.scenes.stopping import drop_measuring_states
from sysdyn.dsl.model.network import Network
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.runtime.model.failures import NoSuchForm


def network_of(request: RunRequest, report: Report) -> Network | None:
    """The model that is named, whole, or under the scene that is; None where the report says why not."""
    target = targets.target_of(request, report, targets.whole)
    if target is None:
        return None
    inner, required = Report(), target.scene is not None
    asked = target.document, target.model, target.scene, inner, request.settings
    network = load.network(*asked, levels=request.levels, required=required)
    report.extend(inner if network else targets.refuse_unsupported(inner))
    return None if network is None else drop_measuring_states(network)


def formed_of(prepared: Prepared, index: str | None, report: Report) -> Formed | None:
    """The index form of the piece that holds at the consistent start; None where the report says why there is none.

    Raises NoSuchForm.
    """
    started = start(prepared, prepared.begin, report)
    return None if started is None or report.failed else choose(prepared, started, index)


@contextmanager
def report_impossible(prepared: Prepared, report: Report) -> Iterator[None]:
    """A form that does not exist is an error of the report (E607)."""
    try:
        yield
    except NoSuchForm as error:
        report.error("E607", impossible(prepared, error)[0], prepared.network.place)
