"""Expressions of parameters that inverses of laws rest on: slopes that are divided by, factors whose sign decides.

A law v = c + s w with s = 0 has no inverse: it holds v at c, whatever w is.  Which of the two a law is, and the signs
that prove a nonlinear one monotone, the values of the text decide once; a binding with others must agree.

Received: expressions over the loops of a branch.  Returned: what they are; `decided` is kept with the network.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from sysdyn.compiler.model.interpret import over
from sysdyn.compiler.model.parameters import Parameters
from sysdyn.dsl.model.expression import Node, is_const, reads, variables
from sysdyn.dsl.model.expression_text import to_text
from sysdyn.dsl.model.network import Branch, Coupling, Network, Slope
from sysdyn.dsl.text.diagnostics import Diagnostic, ModelError


class Slopes:
    """The slopes of one network."""

    def __init__(self, network: Network) -> None:
        self._network = network
        self.decided: list[Slope] = []

    @cached_property
    def _parameters(self) -> Parameters | None:
        try:
            return Parameters(self._network, {})
        except ModelError:  # binding says what is wrong
            return None

    def reads_assigned(self, node: Node) -> bool:
        """Whether the expression reads a parameter that events assign."""
        return reads(node, self._network.discretes)

    def flat(self, branch: Branch, slope: Node) -> bool | None:
        """Whether the slope is zero in all elements; None where it is in some of them: no form holds of them all."""
        if is_const(slope) or variables(slope) or self._parameters is None:
            return False
        found = Slope(branch.name, slope, branch.loops, False, branch.place)
        values = _values(found, self._parameters)
        store = branch.kind == "kinetic"
        if not store and values.any() and not values.all():
            return None
        flat = not store and bool(values.size) and not values.any()
        self.decided.append(replace(found, flat=flat))
        return flat

    def may_divide(self, coupling: Coupling) -> bool:
        """Whether the law of a two-port may be divided by its ratio: not by one that moves or is zero."""
        ratio = coupling.ratio
        if is_const(ratio) or variables(ratio) or self.reads_assigned(ratio):
            return is_const(ratio) and not is_const(ratio, 0.0)
        found = Slope(coupling.stem, ratio, coupling.loops, False, coupling.place)
        whole = self._parameters is None or bool(_values(found, self._parameters).all())
        self.decided.extend([found] if whole else [])
        return whole

    def values(self, branch: Branch, node: Node) -> NDArray[np.float64] | None:
        """The values of an expression of parameters in all elements of a branch; None where they are not known."""
        if self._parameters is None:
            return None
        try:
            return _values(Slope(branch.name, node, branch.loops, False, branch.place), self._parameters)
        except ModelError:
            return None

    def rest_on(self, branch: Branch, node: Node, sign: int) -> None:
        """Keep that the expression is not zero (0) or has this sign."""
        if not is_const(node):
            self.decided.append(Slope(branch.name, node, branch.loops, False, branch.place, sign))


def _values(slope: Slope, parameters: Parameters) -> NDArray[np.float64]:
    return over(slope.loops, (slope.expression,), parameters.lookup_at_place(slope.place))[0]


def check_slopes(network: Network, parameters: Parameters) -> None:
    """ModelError E605 where an expression is zero or of a sign that an inverse excludes, or not zero where it was
    left out.
    """
    found = []
    for slope in network.slopes:
        values = _values(slope, parameters)
        wrong = values != 0.0 if slope.flat else values == 0.0
        if slope.sign:
            wrong = ~(slope.sign * values > 0.0)
        if wrong.any():
            name, text = slope.name.partition("#")[0], to_text(slope.expression)
            help_ = "a formulation in which the law is explicit"
            # left out because it was zero
            if slope.flat:
                message = f"the law of {name} was compiled for {text} = 0, which is now {values[wrong.argmax()]:g}"
                help_ = "compile the model with that value"
            # a root was chosen by the sign
            elif slope.sign:
                told = f"{text} {'>' if slope.sign > 0 else '<'} 0"
                message = f"the law of {name} was compiled for {told}, which is now {values[wrong.argmax()]:g}"
                help_ = "compile the model with that value"
            # divided by
            else:
                some = "" if wrong.all() else " in some of its elements"
                message = f"the law of {name} cannot be inverted: {text} is zero{some}"
            found.append(Diagnostic("E605", message, slope.place, help_))
    if found:
        raise ModelError(found)
