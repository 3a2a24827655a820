"""Models without one underlying equation, which index 0 wants: undetermined rates, contacts, laws that slide (E607)."""

from __future__ import annotations

from collections.abc import Sequence

from sysdyn.runtime.events.kinks import SLIDES
from sysdyn.runtime.events.plan import Plan
from sysdyn.runtime.integrate.underlying import underlying_form
from sysdyn.runtime.model.failures import NoSuchForm, SolverFailure
from sysdyn.runtime.model.slopes import WITH_A_SLOPE, no_slope, without_slope
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.start import ConsistentState

REMEDY = "index 2 or 3 with bdf or radau"
AT_TIMES = "there is no one underlying equation; index 2 with bdf or radau"


def refuse_undetermined(written: System, system: System, start: ConsistentState) -> None:
    """NoSuchForm where rates do not follow at the start; system: the underlying form of `written`."""
    missing = underlying_form(system, start)[1]
    flat = without_slope(written, start.t, *start.for_form(written)) if missing else ()
    # a law without slope: a turbulent valve at rest
    if flat:
        text = f"{no_slope(flat)}, and there is no underlying equation: {WITH_A_SLOPE}, or {REMEDY}"
        raise NoSuchForm(text, flat)
    # rates that nothing determines, by the names of their coordinates
    if missing:
        still = list(dict.fromkeys(name.rstrip("'") for name in missing if name.endswith("'")))[:3]
        remedy = f"inertia on {', '.join(still)}, constraints that hold it, or " if still else ""
        raise NoSuchForm(
            f"there is no underlying equation: {_list_names(missing)} not determined by the balances of efforts, the "
            "constraints and the gammas (coordinates without inertia; a balance without it would have to be "
            f"differentiated too): {remedy}{REMEDY}"
        )


def refuse_contacts(events: Plan | None) -> None:
    """NoSuchForm of constraints that hold at times."""
    if events and events.contacts:
        raise NoSuchForm(f"'{events.contacts[0].name}' holds at times: {AT_TIMES}")


def refuse_sliding(system: System, events: Plan | None, failure: SolverFailure) -> None:
    """NoSuchForm of what stopped because laws slide: no row of the underlying equation determines their sense."""
    # other failures are not of sliding laws
    if failure.cause != "newton" or not events:
        return
    # laws that slide at the end
    sliding = [k.name for k in events.kinks if system.description.p[k.branch] == SLIDES]
    if sliding:
        rows = () if failure.row is None else (failure.row,)
        text = f"from t = {failure.time:.9g} s on {_list_names(sliding)} held at zero, where a law jumps: {AT_TIMES}"
        raise NoSuchForm(text, rows) from failure


def _list_names(names: Sequence[str]) -> str:
    """The first names and how many more, with their verb."""
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return ", ".join(names[:3]) + more + (" is" if len(names) == 1 else " are")
