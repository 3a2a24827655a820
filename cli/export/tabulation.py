"""From a model at its start to the tables of one index form."""

from __future__ import annotations

import numpy as np
from sysdyn.cli.export.starts import start_tables
from sysdyn.cli.export.tables import (
    NOTHING,
    BlockCall,
    ExportTables,
    FollowingGroup,
    StateSelection,
    TracedOutput,
    assembly_tables,
)
from sysdyn.cli.run.prepare import Prepared
from sysdyn.cli.run.start.starting import Started
from sysdyn.compiler.binding.following import Following, following
from sysdyn.compiler.binding.following import FormulaGroup as Formulas
from sysdyn.compiler.forms import descriptor
from sysdyn.runtime.accuracy.options import Options
from sysdyn.runtime.integrate.underlying import Accelerations, Selection, Underlying, underlying_form
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.failures import NoSuchForm
from sysdyn.runtime.model.system import System
from sysdyn.runtime.simulate import form_system, without_redundant
from sysdyn.runtime.start.start import ConsistentState
from sysdyn.runtime.start.starter import Starter
from sysdyn.runtime.structure.structure import Structure
from sysdyn.runtime.trace.trace_store import columns_of
from sysdyn.values import dataclass

STATE = ("q", "f", "p", "s")
LARGEST = 4_000_000
"""Entries of dF/dy of the underlying equation beyond which it is not written: it is full where inertia couples all."""
AUDIT = (*descriptor.AUDIT, "drift")


@dataclass(frozen=True, slots=True)
class Formed:
    """A model in the index form that was asked for, at its start."""

    prepared: Prepared
    written: System
    system: System
    state: ConsistentState
    facts: Structure
    warnings: tuple[str, ...]

    @property
    def index(self) -> int | str:
        """The index of the form, as `simulate` names it: 2 where it is stabilised, 2v for velocities alone."""
        form = self.system.form.name
        if form == "3" and self.facts.index is not None:
            return self.facts.index
        return form if form == "2v" else int(form)


def choose(prepared: Prepared, started: Started, index: str | None) -> Formed:
    """The form of --index, else the scene's, else the one `simulate` takes by radau and bdf.  Raises NoSuchForm."""
    scene = prepared.network.scene
    wanted = index or (scene.index(prepared.binding.evaluate) if scene else None) or "auto"
    policy = (scene.redundancy if scene else None) or "error"
    t0 = started.state.t
    options = Options(output="", t_start=t0, t_end=t0 + 1.0, index=wanted, redundancy=policy)
    written, state, facts = without_redundant(started.system, started.state, started.facts, options)
    system, _, warnings = form_system(written, state, facts, options)
    if system.form.name == "0":
        _refuse_massless(system, state)
    return Formed(prepared, written, system, state, facts, warnings)


def tables(formed_: Formed) -> tuple[ExportTables, Following]:
    """All numbers of the export, and the formulas that belong to them."""
    prepared, system, state = formed_.prepared, formed_.system, formed_.state
    compiled = prepared.compiled
    found = following(compiled.network, compiled.form, compiled.program, prepared.binding)
    y, yd = state.for_form(system)
    # the form without implicit rates has a state of its own
    inner = _state(system, state) if system.form.name == "0" else None
    places = np.arange(system.unknowns) if inner is None else inner.places
    _, jyd = system.jacobian(state.t, y, yd)
    differential = np.isin(system.kinds, STATE) & (system.differential(jyd) | (system.kinds == "q"))
    # y' - F: every unknown is differential
    if inner is not None:
        differential[:] = True
        yd = _slopes(system, state, yd)
    # magnitudes of the start, 1 of what is beside
    scale = np.ones(system.unknowns)
    scale[: state.y.size] = _scale(formed_.written, state)
    observe, observed = _observer(system, "observe")
    audit, audited = _observer(system, "audit")
    names = [p.name for p in compiled.network.parameters if not p.shape]
    return ExportTables(
        form=system.form.name,
        t0=state.t,
        p=prepared.binding.p,
        ix=prepared.binding.ix,
        following_ix=found.ix,
        y0=y[places],
        yd0=yd[places],
        full_y=y,
        full_yd=yd,
        scale=scale[places],
        differential=differential[places].astype(np.int32),
        written=system.form.written,
        followed=system.another("start").unknowns,
        at=system.form.at,
        system=assembly_tables(system),
        state=inner,
        start=start_tables(formed_.written, state),
        groups=tuple(_group(group, system) for group in found.groups),
        structural=np.array([names.index(n) for n in found.structural if n in names], dtype=np.int32),
        outputs=_outputs(system),
        observe=observe,
        observed=observed,
        audit=audit,
        audited=audited,
        audit_at=_audit_at(system),
    ), found


def _slopes(system: System, state: ConsistentState, yd: Floats) -> Floats:
    """The slopes of all differential unknowns, those of momenta and their flows too."""
    return Underlying(system, np.ones(system.unknowns)).slopes(state.t, state.for_form(system)[0], yd)[1]


def _refuse_massless(system: System, state: ConsistentState) -> None:
    """NoSuchForm where flows without inertia are solved for: what is written out has every flow in its state."""
    solved, _ = underlying_form(system, state)
    flows = np.flatnonzero(Accelerations(solved).without_rate)
    if flows.size:
        names = ", ".join(system.name(int(k)) for k in flows[:3])
        raise NoSuchForm(
            f"{names} without inertia follow from balances and constraints, and the equation that is written out has "
            "every flow in its state: index 1 or 2 (simulate takes index 0)"
        )


def _state(system: System, state: ConsistentState) -> StateSelection:
    """The tables of the underlying equation.  NoSuchForm where its Jacobian is too large to be written."""
    selection = Underlying(system, np.ones(system.unknowns)).selection
    places = np.flatnonzero(np.isin(system.kinds, STATE)).astype(np.int32)
    return StateSelection(places, selection, *_pattern(system, selection, places))


def _pattern(system: System, selection: Selection, places: Ints) -> tuple[Ints, Ints]:
    """Compressed columns of d(yd - F)/dy: a slope depends on what stands in the rows of its component of the matrix."""
    from scipy.sparse import coo_array, csc_array
    from scipy.sparse.csgraph import connected_components

    solved, first = selection.unknown.size, system.form.kinematics
    matrix = selection.pattern
    # rows and unknowns of the matrix in connected components: each slope of a component reads all its rows
    joined = coo_array(
        (np.ones(matrix.entries), (matrix.row, solved + matrix.columns_of())), shape=(2 * solved, 2 * solved)
    )
    _, component = connected_components(joined, directed=False)
    number = np.full(system.unknowns, -1, dtype=np.int64)
    number[places] = np.arange(places.size)
    every, of_row, of_column = np.arange(places.size), system.pattern.row, number[system.pattern.columns_of()]
    # which unknowns the rows of a component read
    reads = (of_row >= first) & (of_column >= 0)
    some = int(component.max(initial=-1)) + 1
    size = (some, places.size)
    ones = np.ones(int(reads.sum()))
    read = csc_array((ones, (component[of_row[reads] - first], of_column[reads])), shape=size)
    slopes = selection.rate > 0
    gives = (number[selection.unknown[slopes]], component[solved + np.flatnonzero(slopes)])
    # which rates a component gives
    give = csc_array((np.ones(gives[0].size), gives), shape=(places.size, some))
    flows = (number[system.form.k_q], number[system.form.k_f])
    own = csc_array((np.ones(places.size), (every, every)), shape=(places.size, places.size))
    kinematic = csc_array((np.ones(flows[0].size), flows), shape=(places.size, places.size))
    slopes_of, read_by = np.diff(give.indptr), np.bincount(read.indices, minlength=some)
    # nearly full: other forms keep it sparse
    if float((slopes_of.astype(float) * read_by).sum()) > LARGEST:
        raise NoSuchForm(
            f"the Jacobian of the underlying equation has more than {LARGEST} entries: inertia or constraints couple "
            "all unknowns (index 1 or 2 keeps them apart)"
        )
    full = csc_array(give @ read + own + kinematic)
    full.sort_indices()
    return full.indptr.astype(np.int32), full.indices.astype(np.int32)


def state_jacobian(tables_: ExportTables, system: System, t: float, y: Floats, yd: Floats, cj: float) -> Floats:
    """Entries of dF/dy + cj dF/dyd of r = yd - F(t, y); y, yd: the full layout with everything solved for.

    A column of dF/dy is -A^-1 times the derivatives of the rows by that unknown.
    """
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import splu

    assert tables_.state is not None
    chosen, places = tables_.state.selection, tables_.state.places
    jy, jyd = system.jacobian(t, y, yd)
    # entries of the matrix by rates, or by multipliers
    values = np.where(chosen.from_rate > 0, jyd[chosen.source], jy[chosen.source])
    solved, first, n = chosen.unknown.size, system.form.kinematics, places.size
    number = np.full(system.unknowns, -1, dtype=np.int64)
    number[places] = np.arange(n)
    columns = system.pattern.columns_of()
    take = (system.pattern.row >= first) & (number[columns] >= 0)
    # derivatives of the rows by the state
    reads = np.zeros((solved, n))
    np.add.at(reads, (system.pattern.row[take] - first, number[columns[take]]), jy[take])
    matrix = csc_array((values, chosen.pattern.row, chosen.pattern.column), shape=(solved, solved))
    slopes = splu(matrix).solve(reads)
    # cj of each state, the slopes of its rate, and q' = f
    full = cj * np.eye(n)
    moved = chosen.rate > 0
    full[number[chosen.unknown[moved]]] += slopes[moved]
    full[number[system.form.k_q], number[system.form.k_f]] -= 1.0
    return np.asarray(full[tables_.state.row, np.repeat(np.arange(n), np.diff(tables_.state.column))])


def _scale(written: System, state: ConsistentState) -> Floats:
    """Magnitudes of the unknowns as written at the start."""
    starter = Starter(written)
    return starter.scale(state.t, starter.unknowns(state.t, state.y, state.yd))[: written.form.written]


def _observer(system: System, block: str) -> tuple[BlockCall | None, int]:
    """An observing block whose rows begin at 0, and their number."""
    if block not in system.description.blocks:
        return None, 0
    to, number = system.observed_rows(block)
    return BlockCall(block, system.form.at, to, NOTHING, NOTHING), number


def _audit_at(system: System) -> Ints:
    """Places behind y of energy, kinetic, potential, dissipated, supplied, constraints, drift; -1: nothing reads it."""
    found = np.full(len(AUDIT), -1, dtype=np.int32)
    for k in system.description.families_of("audit"):
        name = system.description.families[k].name.removeprefix("audit.")
        if name in AUDIT:
            found[AUDIT.index(name)] = system.form.at[k]
    return found


def _outputs(system: System) -> tuple[TracedOutput, ...]:
    return tuple(TracedOutput(c.name, c.unit, c.place) for c in columns_of(system.description))


def _group(group: Formulas, system: System) -> FollowingGroup:
    """A group of formulas with its places in y."""
    target = group.target
    if group.kind == "initial":
        target = target + system.another("start").form.at[group.family]
    return FollowingGroup(group.block, group.kind, group.entries, group.source, target)
