"""E307, E309: a state function of the variables that the table of `paynter` gives it, in a domain that has it."""

from __future__ import annotations

from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import EnergyTerm, Network
from sysdyn.dsl.model.paynter import LETTERS, STATE_FUNCTIONS, StateFunction
from sysdyn.dsl.rules.letters import Diagram, unknowns_of
from sysdyn.dsl.text.diagnostics import Report

_PLURAL = {"e": "efforts", "f": "flows", "p": "momenta", "q": "displacements"}


def state_functions(network: Network, report: Report) -> None:
    """Each energy and content holds its own variable and none that the table keeps from it."""
    diagram = Diagram(network)
    moved = {d.state.data[0] for d in network.dynamics}
    for energy in network.energies:
        unknowns = unknowns_of(energy.expression)
        rates = [n for n in unknowns if n.data[2]]
        # the rate of a state is an expression, not a variable of the function
        if rates and rates[0].data[1] == "s":
            if rates[0].data[0] in moved:  # else it has no dynamic: that is told
                message = f"{energy.function} contains {rates[0]}, the rate of a state"
                help_ = f"the right side of its dynamic, or a coord {rates[0].data[0]}: what forces move"
                report.error("E518", message, energy.place, help=help_)
        # accelerations
        elif rates:
            message = f"{energy.function} contains {rates[0]}, a second derivative: accelerations are results, not data"
            report.error("E518", message, energy.place)
        elif not _report_misplaced(energy, unknowns, diagram, report):
            _own(energy, unknowns, diagram, report)
            _kinetic(energy, unknowns, diagram, report)
    # a kinetic store in a domain without momentum
    for branch in network.branches:
        if branch.kind == "kinetic" and not branch.domain.kinetic:
            name = branch.name.partition("#")[0]
            message = f"'{name}': kinetic stores do not exist in the domain '{branch.domain.name}'"
            report.error("E307", message, branch.place, help="a potential store, or a dissipator")


def _report_misplaced(energy: EnergyTerm, unknowns: list[Node], diagram: Diagram, report: Report) -> bool:
    """Whether a variable stands there that the function does not have; reported."""
    function = STATE_FUNCTIONS[energy.function]
    for node in unknowns:
        letter = diagram.letter(node)
        allowed = function.allowed_letters(complementary=node.data[0] in diagram.complementary)
        if letter == "s" or (letter in allowed and node.data[1] != "e"):
            continue
        if letter not in LETTERS or node.data[1] == "e":
            message = f"{function.name} contains {node}: a state function depends on the variables of its edge"
            report.error("E307", f"{message}, signals and time", energy.place)
        elif function.name == "V" and letter == "f":
            message = f"V contains the flow {node}: a velocity-dependent potential"
            report.error("E309", message, energy.place, help="put the part linear in the flow into T*, or use 'work'")
        else:
            message = f"{_says(function)}; it contains the {LETTERS[letter]} {node}"
            report.error("E307", message, energy.place, help=_right(function, letter))
        return True
    return False


def _says(function: StateFunction) -> str:
    return f"{function.name} is a function of {_PLURAL[function.own]} ({function.own})"


def _right(function: StateFunction, letter: str) -> str | None:
    """The function on the same edge that has this variable, else the one of this variable."""
    transform = STATE_FUNCTIONS[function.transform]
    found = [transform] if transform.own == letter else [f for f in STATE_FUNCTIONS.values() if f.own == letter]
    word = "content" if found[0].edge == "dissipator" else "energy"
    return f"'{word} {found[0].name} = ...' is a function of {_PLURAL[letter]}"


def _own(energy: EnergyTerm, unknowns: list[Node], diagram: Diagram, report: Report) -> None:
    """A function without its own variable has no slope: it would be dropped, or become another store."""
    function = STATE_FUNCTIONS[energy.function]
    if any(diagram.letter(n) == function.own for n in unknowns):
        return
    letters = {diagram.letter(n) for n in unknowns} & set(LETTERS)
    message = f"{_says(function)}; it contains none"
    help_ = _right(function, min(letters)) if letters else f"in terms of {function.own}, or left out"
    if function.name == "T*" and letters == {"q"}:
        help_ = "'energy V = -(...)', or one T* with the flow to which it belongs"
    report.error("E307", message, energy.place, help=help_)


def _kinetic(energy: EnergyTerm, unknowns: list[Node], diagram: Diagram, report: Report) -> None:
    """Kinetic energies in a domain without kinetic stores (language, section 11, 40)."""
    function = STATE_FUNCTIONS[energy.function]
    if function.edge != "kinetic":
        return
    for node in unknowns:
        domain = diagram.domain(node)
        if diagram.letter(node) == function.own and domain is not None and not domain.kinetic:
            message = f"{function.name} contains {node}: kinetic stores do not exist in the domain '{domain.name}'"
            report.error("E307", message, energy.place, help="a potential store, or a dissipator")
            return
