"""What a --form consists of."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from sysdyn.cli.analysis.linearisation import inputs_of, linearise
from sysdyn.cli.analysis.operating_point import model_at_start
from sysdyn.cli.run.prepare import Prepared
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.cli.run.request.targets import Target
from sysdyn.compiler.equations.book import (
    CO_WORDS,
    WORDS,
    Equation,
    Function,
    Summed,
    algebra_of,
    classes,
    equations,
    functions,
)
from sysdyn.compiler.equations.elements import elements
from sysdyn.compiler.equations.matrices import Matrix, NoSuchEquations, canonical, matrices, underlying, variation
from sysdyn.compiler.equations.offsets import offsets
from sysdyn.compiler.equations.port_hamiltonian import port_hamiltonian, written
from sysdyn.compiler.forms.descriptor import DescriptorForm
from sysdyn.compiler.forms.legendre import legendre_transform
from sysdyn.compiler.model.mirror import letter
from sysdyn.dsl.model.expression import Node, const, scale, var
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.runtime.linear.tangent import NoLinearisation
from sysdyn.runtime.model.system import System
from sysdyn.values import dataclass

ROUND_OFF = 1e-13
"""Of its terms: what is left of a slope that cancels."""
MOST = 400
"""Row families that are printed."""


@dataclass(frozen=True, slots=True)
class FormContent:
    """What a form consists of; more: row families that were left out; counted: degrees of freedom and index."""

    functions: tuple[Function, ...] = ()
    equations: tuple[Equation, ...] = ()
    matrices: tuple[Matrix, ...] = ()
    more: int = 0
    counted: tuple[str, ...] = ()


OF_COORDINATES = ("matrices", "underlying", "port_hamiltonian", "efforts")
"""Forms that a model of dynamic variables alone does not have."""


def content_of(
    target: Target, prepared: Prepared, form: str, request: RunRequest, report: Report
) -> FormContent | None:
    """The content of a --form; None where the report says why there is none.  Raises NoSuchEquations."""
    if form in OF_COORDINATES and not any(f.kind == "f" for f in prepared.compiled.form.families):
        raise NoSuchEquations("the model has no coordinates: see --form descriptor")
    found = _content(target, prepared, form, request, report)
    if found is not None and not (found.functions or found.equations or found.matrices):
        linear = "nothing moves freely: the model has no states"
        raise NoSuchEquations(linear if form == "linear" else "nothing is unknown in the model")
    return found


def _content(target: Target, prepared: Prepared, form: str, request: RunRequest, report: Report) -> FormContent | None:
    """Functions, equations and matrices of one form; NoSuchEquations where the model does not have it."""
    compiled = prepared.compiled
    algebra = algebra_of(compiled.form, [p.name for p in compiled.network.parameters if not p.shape])
    match form:
        case "matrices":
            return FormContent(matrices=matrices(algebra, compiled.form), counted=tuple(_count_lines(compiled.form)))
        case "canonical":
            function, rates = canonical(algebra, compiled.functions, compiled.form)
            return FormContent((function, variation(algebra, function, compiled.form)), tuple(rates))
        case "underlying":
            found_ = tuple(underlying(algebra, compiled.form))
            return FormContent(equations=found_, counted=tuple(_count_lines(compiled.form)))
        case "port_hamiltonian":
            function, view = written(algebra, port_hamiltonian(compiled.energies, compiled.form))
            return FormContent((function,), matrices=view)
        # by class, with the transforms of T* and V beside
        case "efforts":
            found = tuple(classes(algebra, compiled.energies, compiled.form))
            beside, _ = legendre_transform(compiled.energies, compiled.network.parameters)
            own = {"W", *compiled.energies.functions}
            more = (f for f in functions(algebra, beside) if f.name not in own)
            return FormContent((*functions(algebra, compiled.energies), *more), found)
        case "elements":
            shown = tuple(elements(algebra, prepared.network))
            if not shown:
                raise NoSuchEquations("the text has no stores and dissipators between nodes: see --form efforts")
            return FormContent(equations=shown)
        case "linear":
            return _linear(target, prepared, request, report)
        # the descriptor form, up to a number of rows
        case _:
            rows = sum(r.block in WORDS for r in compiled.form.rows) - MOST
            return FormContent(
                tuple(functions(algebra, compiled.functions)),
                tuple(equations(algebra, compiled.functions, compiled.form, MOST)),
                more=max(rows, 0),
            )


def _count_lines(form: DescriptorForm) -> Iterator[str]:
    """Degrees of freedom as the book counts them, and which rows are differentiated for the index."""
    words = WORDS | CO_WORDS if form.formulation.startswith("co_") else WORDS
    n, m1, m2 = (sum(f.kind == kind for f in form.families) for kind in ("f", "kappa", "mu"))
    yield f"degrees of freedom: n - m1 - m2 = {n} - {m1} - {m2} = {n - m1 - m2}, where the constraints are independent"
    found = offsets(form)
    if found is None:
        return
    yield f"index by structure: {found.index}"
    for kind, owner, times in found.differentiated:
        often = {1: "once", 2: "twice"}.get(times, f"{times} times")
        yield f"  {words.get(kind, 'rate of')} {owner}: differentiated {often}"
    if found.once_more:
        greek = {"kappa": "κ", "mu": "μ"}
        kinds = ((owner, letter(form.formulation, kind)) for owner, kind in found.once_more)
        last = ", ".join(f"{greek.get(kind, kind)} of {owner}" for owner, kind in kinds)
        yield f"  all once more for the rates of what has none yet: {last}"


def _linear(target: Target, prepared: Prepared, request: RunRequest, report: Report) -> FormContent | None:
    """The equations x' = A x + B u about the start, in numbers; x and u are deviations.

    A state of the reduction may be x - D u - D1 u' (runtime/linear/tangent.py): of x itself it is
    x' = A x + (B - A D) u + (D - A D1) u' + D1 u''.
    """
    found = model_at_start(target, prepared, request, report)
    if found is None:
        return None
    inputs = inputs_of(target, prepared, None)
    try:
        # where the reduced states are unknowns, these are outputs too: their own D and D1 tell them from the states
        places = linearise(found, inputs).reduced.places
        watched = places[places >= 0]
        small = linearise(found, inputs, watched=watched.tolist()).reduced
    except NoLinearisation as error:
        raise NoSuchEquations(str(error)) from error
    system, count_ = found.system, watched.size
    d, d1 = (np.zeros((places.size, len(inputs))) for _ in range(2))
    # x of the state z = x - D u - D1 u'
    d[places >= 0], d1[places >= 0] = (m[m.shape[0] - count_ :] for m in (small.d, small.d1))
    nodes = [
        unknown_node(system, int(k)) if k >= 0 else var(name, "s") for k, name in zip(places, small.names, strict=True)
    ]
    own = [tuple(map(const, map(float, at))) for _, at in inputs]
    # inputs and their rates, as far as they occur
    controls = [var(name, "s", *at, order=k) for k in range(3) for (name, _), at in zip(inputs, own, strict=True)]
    slopes = np.hstack([small.a, small.b - small.a @ d, d - small.a @ d1, d1])
    a, b, c, c1 = (np.abs(part) for part in (small.a, small.b, d, d1))
    # what cancels to round-off is no term
    sizes = np.hstack([a, b + a @ c, c + a @ c1, c1])
    slopes = np.where(np.abs(slopes) > ROUND_OFF * sizes, slopes, 0.0)
    lines = []
    for row, node, name in zip(slopes, nodes, small.names, strict=True):
        terms = [scale(float(v), n) for v, n in zip(row, (*nodes, *controls), strict=True) if v != 0.0]
        rate = var(node.data[0], node.data[1], *node.args, order=1)
        right = tuple(Summed((), term) for term in terms)
        lines.append(Equation("linear", name, None, (Summed((), rate),), right))
    return FormContent(equations=tuple(lines))


def unknown_node(system: System, place: int) -> Node:
    """The unknown at a place as a node."""
    family = system.description.families[int(system.family_of[place])]
    position = place - int(system.form.at[int(system.family_of[place])])
    index: list[Node] = []
    for first, last in reversed(family.shape):
        position, rest = divmod(position, last - first + 1)
        index.insert(0, const(float(first + rest)))
    return var(family.owner, family.kind, *index)
