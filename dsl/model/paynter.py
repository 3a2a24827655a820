"""Paynter's diagram as a value: its edges, the state functions that live on them, and its reflection.

    kinetic edge p-f      T(p) = int f dp      T*(f) = int p df      T + T* = p f
    potential edge q-e    V(q) = int e dq      V*(e) = int q de      V + V* = e q
    dissipative edge e-f  D(f) = int e df      G(e) = int f de       D + G  = e f

(language, section 5 of the checks: E307; seed, section 1).  `STATE_FUNCTIONS` is the one table of who may stand where:
the rule E307 enforces it and its page prints it.
"""

from __future__ import annotations

from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class StateFunction:
    """A state function of one variable of its edge (`own`); it may depend on the configuration (`beside`) as well.

    beside: variables by family, primal and complementary.  conjugate: the derivative by the own variable.  transform:
    its Legendre transform.  member: its name behind a store or dissipator (`K.Vstar`).
    """

    name: str
    edge: str  # kinetic potential dissipator
    own: str
    conjugate: str
    beside: tuple[str, str]
    transform: str
    member: str

    def allowed_letters(self, *, complementary: bool) -> str:
        """The letters that may occur."""
        return self.own + self.beside[complementary]


STATE_FUNCTIONS = {
    function.name: function
    for function in (
        StateFunction("T*", "kinetic", "f", "p", ("q", ""), "T", "Tstar"),
        StateFunction("T", "kinetic", "p", "f", ("q", ""), "T*", "T"),
        StateFunction("V", "potential", "q", "e", ("", "p"), "V*", "V"),
        StateFunction("V*", "potential", "e", "q", ("", "p"), "V", "Vstar"),
        StateFunction("D", "dissipator", "f", "e", ("q", ""), "G", "D"),
        StateFunction("G", "dissipator", "e", "f", ("q", "p"), "D", "G"),
    )
}
"""By name.  Time, signals and dynamic variables may stand in all of them."""

MEMBERS = {function.member: function for function in STATE_FUNCTIONS.values()}
"""By the name of the member."""

LETTERS = {"e": "effort", "f": "flow", "p": "momentum", "q": "displacement"}
"""The variables of the diagram."""

EFFORT_CLASSES = ("inertial", "potential", "dissipative", "source", "implicit", "constraint")
"""The efforts that act on a displacement coordinate; their sum is zero."""

REFLECTED = {"e": "f", "f": "e", "p": "q", "q": "p"}
"""The reflection that exchanges the families."""

REFLECTED_FUNCTIONS = {"T*": "V*", "V*": "T*", "T": "V", "V": "T", "D": "G", "G": "D"}
"""What the reflection makes of a state function."""


def table() -> str:
    """The table as E307 explains it: one line a function."""
    lines = []
    for function in STATE_FUNCTIONS.values():
        beside = [f"{names}" for names in dict.fromkeys(b for b in function.beside if b)]
        rest = f", may depend on {', '.join(beside)}" if beside else ""
        lines.append(f"{function.name} of {function.own} ({LETTERS[function.own]}){rest}")
    return "\n".join(lines)
