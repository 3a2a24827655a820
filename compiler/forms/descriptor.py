"""DescriptorForm: one formulation of a model as blocks of rows over loops, before any program is made of it.

    Lagrange (3.34)          q' = f;  M f' + Phi_q^T kappa + Psi_f^T mu = Upsilon;  0 = Phi;  0 = Psi;  0 = Gamma;
                             s' = Lambda
    Hamilton (4.14)-(4.15)   q' = f;  p' + Phi_q^T kappa + Psi_f^T mu = U;  0 = p - dT*/df;  and the rest as above

Families are the unknowns, row families the equations; a kernel is a loop nest with local expressions that are added
to rows.  Blocks and their meaning: runtime/core/system/model.h.
"""

from __future__ import annotations

from sysdyn.compiler.model.energies import Offset, over
from sysdyn.compiler.model.mirror import family_name, letter, with_family_letters, word
from sysdyn.compiler.model.terms import Nest
from sysdyn.dsl.model.expression import Node, topological, variables
from sysdyn.dsl.model.network import Shape
from sysdyn.dsl.text.diagnostics import Place
from sysdyn.values import dataclass

KINDS = ("q", "f", "p", "s", "e", "kappa", "mu", "start", "slack", "unsaid", "audit")
START = ("start", "slack", "unsaid")
"""Kinds of the start alone: positions; what guesses miss, of the text and of zero where the text says nothing."""
BESIDE = (*START, "audit")
"""Kinds behind the unknowns as written."""
AUDIT = ("energy", "kinetic", "potential", "dissipated", "supplied", "constraints")
BLOCKS = (
    "dynamics", "dynamics_rate", "phi_reaction", "phi_normal", "psi_reaction", "momentum", "momentum_rate", "phi",
    "phi_rate", "phi_acceleration", "psi", "psi_rate", "gamma", "gamma_rate", "gamma_acceleration", "lambda", "observe",
    "observe_rate", "observe_scale", "audit", "ledger", "initial",
)  # fmt: skip
# the blocks that Newton sees: those of steep rows have a block `<name>_scale` (steepness.py)
SCALED = (
    "dynamics", "phi_reaction", "psi_reaction", "momentum", "momentum_rate", "phi", "phi_rate", "phi_acceleration",
    "psi", "psi_rate", "gamma", "lambda",
)  # fmt: skip
# the block whose row families a block shares
HOME = {
    "dynamics_rate": "dynamics", "phi_reaction": "dynamics", "psi_reaction": "dynamics",
    "momentum_rate": "momentum", "phi_rate": "phi",
    "phi_acceleration": "phi", "psi_rate": "psi", "gamma_rate": "gamma", "gamma_acceleration": "gamma",
    "observe_rate": "observe", "observe_scale": "observe",
}  # fmt: skip
HOME |= {f"{name}_scale": HOME.get(name, name) for name in SCALED}
# rows without Jacobian entries: Newton never sees them, or only to judge others
WITHOUT_ENTRIES = frozenset(
    (
        "observe",
        "observe_rate",
        "observe_scale",
        "audit",
        "ledger",
        *(f"{n}_scale" for n in SCALED),
    )
)


@dataclass(frozen=True, slots=True)
class Unknowns:
    """A family of unknowns: one of KINDS, of its owner; one shape for all kinds of an owner."""

    name: str
    kind: str
    owner: str
    unit: str
    place: Place | None


@dataclass(frozen=True, slots=True)
class EquationFamily:
    """A family of rows."""

    block: str
    label: str
    owner: str
    kind: str
    unit: str
    place: Place | None
    rate: bool = True  # whether every row of it has its time derivative as a block
    stored: bool = False  # a traced quantity (of block observe)
    content: bool = False  # of block initial: what a store holds


@dataclass(frozen=True, slots=True)
class Summand:
    """`expression` is added to the row `at` of a row family (by its number)."""

    row: int
    at: tuple[Node, ...]
    expression: Node


@dataclass(frozen=True, slots=True)
class LoopKernel:
    """Local expressions under one loop nest."""

    nest: Nest
    rows: tuple[Summand, ...]


@dataclass(frozen=True, slots=True)
class Block:
    """A group of rows that the runtime places as a whole."""

    name: str
    kernels: tuple[LoopKernel, ...]


@dataclass(frozen=True, slots=True)
class Pin:
    """An initial value of an unknown: family (by its number) at indices, for all iterations of the nest."""

    family: int
    at: tuple[Node, ...]
    value: Node
    fixed: bool
    nest: Nest
    place: Place


@dataclass(frozen=True, slots=True)
class Frozen:
    """A switching function whose branch events set (frozen.py): the parameter that holds it, its text, the row that it
    stands in; rows of block observe: value, rate, 1 - sense and 1 + sense (() where it does not slide); jumps: whether
    a row does at its zero; inner: whether coordinates, rates or momenta move it, so that stores gain nothing there;
    passage: of a peak (peaks.py).
    """

    branch: str
    text: str
    label: str
    place: Place | None
    value: str
    rate: str | None
    slide: tuple[str, ...]
    jumps: bool
    inner: bool
    passage: float = 0.0


@dataclass(frozen=True, slots=True)
class DescriptorForm:
    """One formulation: unknowns in the order of `at`, rows in the order of `to`."""

    formulation: str
    families: tuple[Unknowns, ...]
    rows: tuple[EquationFamily, ...]
    blocks: tuple[Block, ...]
    pins: tuple[Pin, ...]
    offsets: tuple[Offset, ...]
    shapes: tuple[tuple[str, Shape], ...]  # of coordinates, unknowns, states, rows `initial` and `ledger`, by owner
    hulls: tuple[tuple[str, tuple[tuple[tuple[Node, ...], Nest, Place], ...]], ...]  # where each label is declared
    covers: tuple[tuple[str, tuple[tuple[Nest, Node], ...]], ...] = ()  # families that momenta cover in part
    kinks: tuple[Frozen, ...] = ()

    @staticmethod
    def is_speed(family: Unknowns) -> bool:
        """Whether a family is an unknown speed of Kane's form, a flow without a displacement of its own."""
        return family.kind == "f" and family.name == family.owner

    def block(self, name: str) -> Block | None:
        """The block of that name; None where it has no rows."""
        return next((b for b in self.blocks if b.name == name), None)


def verify_descriptor(form: DescriptorForm) -> None:
    """AssertionError where a kernel names an unknown, a row or a loop variable that does not exist."""
    known = {(f.owner, f.kind) for f in form.families}
    assert len(known) == len(form.families), "two families of one owner and kind"
    for block in form.blocks:
        assert block.name in BLOCKS or block.name.removesuffix("_scale") in SCALED, block.name
        home = HOME.get(block.name, block.name)
        for kernel in block.kernels:
            bound = {f"#{k}" for k in range(len(kernel.nest))}
            assert [loop.index for loop in kernel.nest] == sorted(bound), kernel.nest
            for summand in kernel.rows:
                assert form.rows[summand.row].block == home, (block.name, summand.row)
                _verify_summand(block.name, summand, bound, known)


def _verify_summand(block: str, summand: Summand, bound: set[str], known: set[tuple[str, str]]) -> None:
    """Assert what the contract says of a summand: known unknowns, bound indices, rates only where they may stand."""
    for node in topological((*summand.at, summand.expression)):
        if node.op == "index":
            assert node.data in bound or node.data.startswith("#r"), (block, node)
        if node.op == "var":
            owner, kind, order = node.data
            assert (owner, kind) in known, (block, node)
            assert not (kind == "q" and order), f"{block} reads the derivative of a displacement"
            rated = ("f", "p", "s", "e", "kappa", "mu") if block == "dynamics_rate" else ("f", "p", "s", "e")
            assert order == 0 or kind in rated, (block, node)
    if block in ("phi", "phi_rate", "phi_reaction", "phi_normal", "psi_reaction", "psi", "gamma"):
        late = [n for n in variables(summand.expression) if n.op == "var" and n.data[2] and n.data[1] != "s"]
        assert not late, (block, late)


def show(form: DescriptorForm) -> str:
    """The form as text, for --dump descriptor, in the letters of its family."""
    f = form.formulation
    lines = [f"formulation {f}"]
    # unknowns, rows, blocks, initial values
    for k, u in enumerate(form.families):
        lines.append(f"unknown {k}: {family_name(f, u.name, u.kind)} ({letter(f, u.kind)}, {u.unit})")
    for k, r in enumerate(form.rows):
        line = f" line {r.place.start[0]}" if r.place else ""
        lines.append(f"row {k}: {word(f, r.kind)} of {r.label}{line}")
    for block in form.blocks:
        lines.append(f"block {word(f, block.name)}")
        for kernel in block.kernels:
            for s in kernel.rows:
                at = f"[{', '.join(map(repr, s.at))}]" if s.at else ""
                own = with_family_letters(f, s.expression)
                lines.append(f"  {over(kernel.nest)}{form.rows[s.row].label}{at} += {own!r}")
    for pin in form.pins:
        sign = "=" if pin.fixed else "~"
        at = f"[{', '.join(map(repr, pin.at))}]" if pin.at else ""
        of = form.families[pin.family]
        lines.append(f"init {over(pin.nest)}{family_name(f, of.name, of.kind)}{at} {sign} {pin.value!r}")
    return "\n".join(lines) + "\n"
