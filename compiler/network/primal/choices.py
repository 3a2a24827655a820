"""How one branch enters: its law explicit, inverted (language, section 6: V1 to V3) or implicit (V4).

Received: a branch in its own variables.  Returned: its law, with notes of what was done to it; what an inverse rests on
is kept by `Slopes`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from sysdyn.compiler.network.primal.integrals import Rests, antiderivative, line, polynomial
from sysdyn.compiler.network.primal.inverses import Inverse, inverse
from sysdyn.compiler.network.primal.slopes import Slopes
from sysdyn.dsl.model.expression import Node, const, is_const, mul, param, sub, substitute, topological, var, variables
from sysdyn.dsl.model.expression_text import to_text
from sysdyn.dsl.model.network import Branch, Table
from sysdyn.dsl.model.paynter import STATE_FUNCTIONS
from sysdyn.dsl.text.diagnostics import Diagnostic, ModelError
from sysdyn.values import dataclass

Notes = tuple[tuple[str, str], ...]
OWN = {"kinetic": ("bf", "p"), "potential": ("bq", "e"), "dissipator": ("bf", "e")}
"""The variable of a law that is explicit, and the side that it gives."""
ENERGY = {"kinetic": "T*", "potential": "V", "dissipator": "D"}
"""The state function of that variable."""


@dataclass(frozen=True, slots=True)
class BranchLaw:
    """How a branch enters.

    how: energy (stated), work, implicit (stated = 0 closes its effort), state (stated = 0 closes its momentum), row
    (psi stated = 0), port, field.  stated: the energy, the effort, or the equation.  tables: those made for it.
    kept: the energy (J) of a store that is implicit or has a state, where that is closed.
    """

    how: str
    stated: Node | None = None
    notes: tuple[tuple[str, str], ...] = ()
    tables: tuple[Table, ...] = ()
    kept: Node | None = None


def own(branch: Branch, kind: str) -> Node:
    """The branch's own variable at its own indices."""
    return var(branch.name, kind, *branch.at)


class Causality:
    """How one branch enters."""

    def __init__(
        self, branch: Branch, slopes: Slopes, tables: Sequence[Table], effort_read: bool, letters: Mapping[str, str]
    ) -> None:
        self.branch, self.slopes, self.tables, self.effort_read = branch, slopes, tables, effort_read
        self.letters = letters
        self.kinetic = branch.kind == "kinetic"

    def law(self) -> BranchLaw:
        """The branch's law."""
        branch = self.branch
        # of statements, or of a coupling
        if branch.kind in ("field", "port"):
            return BranchLaw(branch.kind)
        if branch.law is None or branch.side is None:
            raise ModelError([Diagnostic("E409", f"branch {branch.name} has no law", branch.place)])
        # a source of effort does work on its flow
        if branch.kind == "effort":
            return BranchLaw("work", branch.law)
        # a source of flow is a constraint, of other unknowns a gamma
        if branch.kind == "flow":
            outer = [n for n in variables(branch.law) if n.op == "var" and n.data[1] != "s"]
            return BranchLaw("implicit" if outer else "row", sub(own(branch, "bf"), branch.law))
        # given by the variable that Lagrange's form wants: as it is, unless it is solved for an implicit one
        if branch.side == OWN[branch.kind][1]:
            return self._inside_out(branch.law) or self._explicit(branch.law)
        return self._invert_law(branch.law)

    def _inside_out(self, law: Node) -> BranchLaw | None:
        """A dissipator's e(f) with a logarithm, as f(e) with an implicit effort: where the domain ends, f is nearly
        constant, and doubles no longer hold e.
        """
        branch, v, w = self.branch, own(self.branch, OWN[self.branch.kind][0]), conjugate(self.branch)
        ends = (n for n in topological([law]) if n.op == "call" and n.data in ("ln", "log10", "atanh"))
        if branch.kind != "dissipator" or not self._reads_only(law, v) or not any(v in variables(n) for n in ends):
            return None
        found = inverse(branch, law, v, w, self.slopes, self.tables)
        if found is None or not self._rest_on(found.rests):
            return None
        said = f"{self._side(branch.side)} of {branch.name} stays implicit: its law is not defined everywhere"
        return BranchLaw("implicit", sub(v, found.expression), (("N604", said),), found.tables)

    def _explicit(self, law: Node, notes: Notes = (), tables: tuple[Table, ...] = ()) -> BranchLaw:
        """A law of the branch's own variable."""
        branch, kinetic = self.branch, self.kinetic
        v, pseudo = own(branch, OWN[branch.kind][0]), branch.domain.pseudo
        stated = sub(conjugate(branch), law)
        if kinetic and (pseudo or self.effort_read or variables(law) - {v}):
            return BranchLaw("state", stated, notes, tables, self._stored_energy(law, v))
        alone = not pseudo and not variables(law) - {v}
        energy = self._energy(law, v) if alone else None
        if energy is not None:
            return BranchLaw("energy", energy, notes, tables)
        if kinetic:
            text = f"the {self._kept} of {branch.name} is kept as a state: its law has no closed integral"
            kept = self._stored_energy(law, v) if law is branch.law else None
            return BranchLaw("state", stated, (*notes, ("N604", text)), tables, kept)
        kept = self._energy(law, v, valued=True) if alone and branch.kind == "potential" else None
        if branch.kind == "potential" and kept is None and not pseudo and not branch.stated:
            notes = (*notes, ("N604", f"the energy of {branch.name} is counted as the integral of its power"))
        return BranchLaw("work", law, notes, tables, kept)

    def _energy(self, law: Node, v: Node, *, valued: bool = False) -> Node | None:
        """The integral of a law; of dissipators that of polynomials only: works say theirs as well.

        valued: only its value is wanted (`antiderivative`).
        """
        if self.branch.energy is not None and law is self.branch.law:
            return self.branch.energy
        if self.branch.kind == "dissipator" and polynomial(law, v) is None:
            return None
        rests: Rests = []
        energy = antiderivative(law, v, rests, valued=valued)
        if energy is None or not self._rest_on(rests):
            return None
        return energy if law is self.branch.law else self._from_origin(energy, v)

    def _from_origin(self, energy: Node, v: Node) -> Node:
        """The integral of an inverted law from where that of the law as written begins: its own variable is zero."""
        assert self.branch.law is not None
        origin = substitute(self.branch.law, {conjugate(self.branch): const(0.0)})
        values = self.slopes.values(self.branch, origin)
        if is_const(origin, 0.0) or values is None or not np.isfinite(values).all():
            return energy
        return sub(energy, substitute(energy, {v: origin}))

    def functions(self, law: BranchLaw) -> dict[str, Node]:
        """State functions of a store or dissipator, of both variables of its edge, as far as they are closed; each
        adds up to the product of the two with its Legendre transform.
        """
        branch = self.branch
        if branch.kind not in OWN or branch.law is None:
            return {}
        v, w = own(branch, OWN[branch.kind][0]), conjugate(branch)
        name = ENERGY[branch.kind]
        transform = STATE_FUNCTIONS[name].transform
        if law.how == "energy" and law.stated is not None:
            return {name: law.stated, transform: sub(mul(v, w), law.stated)}
        if law.kept is not None:
            kept = {"kinetic": transform, "potential": name}[branch.kind]
            return {kept: law.kept, STATE_FUNCTIONS[kept].transform: sub(mul(v, w), law.kept)}
        given, rests = (v if branch.side == OWN[branch.kind][1] else w), Rests()
        area = branch.energy or antiderivative(branch.law, given, rests, valued=True)
        if area is None or not self._rest_on(rests):
            return {}
        area = area if given is v else sub(mul(v, w), area)
        return {name: area, transform: sub(mul(v, w), area)}

    def _rest_on(self, rests: Sequence[tuple[Node, int]]) -> bool:
        """Keep what a result rests on; False where that is not so."""
        values = [(node, sign, self.slopes.values(self.branch, node)) for node, sign in rests]
        if any(x is None or not ((sign * x if sign else np.abs(x)) > 0.0).all() for _, sign, x in values):
            return False
        for node, sign in rests:
            self.slopes.rest_on(self.branch, node, sign)
        return True

    def _invert_law(self, law: Node) -> BranchLaw:
        """A law of the conjugate variable: inverted, or implicit."""
        branch, kinetic = self.branch, self.kinetic
        v, given = own(branch, OWN[branch.kind][0]), conjugate(branch)
        alone = self._reads_only(law, given)
        straight = line(law, given) if alone else None
        flat = self.slopes.flat(branch, straight.slope) if straight else alone and not kinetic and not variables(law)
        if flat:
            return self._constant_law(law if straight is None else straight.constant)
        if straight is not None and flat is not None:
            note = ("N601", f"the law of {branch.name} was inverted: it is linear")
            return self._explicit(straight.inverse(v), (note,))
        found = inverse(branch, law, given, v, self.slopes, self.tables) if alone else None
        if found is not None:
            tried = self._explicit(found.expression, (self._note_of_inverse(found, v),), found.tables)
            if tried.how != "state" and self._rest_on(found.rests):  # an unknown less, or the law as it is
                return tried
        text = f"{self._side(branch.side)}({self._side(given.data[1][1])}) of {branch.name} stays implicit"
        kept = self._stored_energy(law, given)
        return BranchLaw("state" if kinetic else "implicit", sub(v, law), (("N604", text),), kept=kept)

    def _reads_only(self, law: Node, given: Node) -> bool:
        """Whether a law reads `given` alone and nothing that events assign: values at the start decide no form then."""
        return not variables(law) - {given} and not self.slopes.reads_assigned(law)

    def _stored_energy(self, law: Node, given: Node) -> Node | None:
        """The energy of a store with a law of `given` alone, int f dp or int e dq; None where that is not closed."""
        branch, rests = self.branch, Rests()
        if branch.kind == "dissipator" or branch.domain.pseudo or variables(law) - {given}:
            return None
        written = branch.energy if law is branch.law else None
        area = written or antiderivative(law, given, rests, valued=True)
        if area is None or not self._rest_on(rests):
            return None
        return area if given is own(branch, "bp") else sub(mul(given, law), area)

    def _note_of_inverse(self, found: Inverse, v: Node) -> tuple[str, str]:
        """The note of an inverse."""
        name = self.branch.name.partition("#")[0]
        if not found.symbolic:
            return "N603", f"the law of {name} was inverted: the columns of its table change places"
        text = to_text(substitute(found.expression, {v: param(self._side(v.data[1][1]))}))
        return "N602", f"the law of {name} was inverted: {self._side(conjugate(self.branch).data[1][1])} = {text}"

    def _side(self, letter: str | None) -> str:
        return self.letters[letter or ""]

    @property
    def _kept(self) -> str:
        return {"p": "momentum", "q": "displacement"}[self._side("p")]

    def _constant_law(self, value: Node) -> BranchLaw:
        """A law without slope: v = value, a constant content has no flow."""
        branch = self.branch
        text = f"{self._side(branch.side)} of {branch.name} is held: its law has no slope"
        rate = const(0.0) if branch.kind == "potential" else value
        return BranchLaw("row", sub(own(branch, "bf"), rate), (("N604", text),))


def conjugate(branch: Branch) -> Node:
    """The conjugate of the own variable: p of a kinetic store, else e."""
    return own(branch, "bp" if branch.kind == "kinetic" else "be")
