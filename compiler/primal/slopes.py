"""Slopes of linear laws that are to be inverted: with the parameters' values a slope may be zero.

A law v = c + s w with s = 0 has no inverse: it holds v at c, whatever w is.  Which of the two a law is, the values of
the text decide once; a binding with others must agree.

Received: a line over the loops of its branch.  Returned: whether it is flat; `decided` is kept with the network.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from sysdyn.compiler.interpret import over
from sysdyn.compiler.parameters import Parameters
from sysdyn.dsl.diagnostics import Diagnostic, ModelError
from sysdyn.dsl.expression import Node, is_const, to_text, variables
from sysdyn.dsl.network import Branch, Network, Slope


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

    def flat(self, branch: Branch, slope: Node) -> bool:
        """Whether the slope is zero in all elements."""
        if is_const(slope) or variables(slope) or self._parameters is None:
            return False
        found = Slope(branch.name, slope, branch.loops, False, branch.place)
        values = _values(found, self._parameters)
        flat = branch.kind != "kinetic" and bool(values.size) and not values.any()
        self.decided.append(replace(found, flat=flat))
        return flat


def _values(slope: Slope, parameters: Parameters) -> NDArray[np.float64]:
    return over(slope.loops, (slope.expression,), parameters.checked(slope.place))[0]


def check_slopes(network: Network, parameters: Parameters) -> None:
    """ModelError E605 where a slope is zero that was divided by, or not zero that was left out."""
    found = []
    for slope in network.slopes:
        values = _values(slope, parameters)
        wrong = values != 0.0 if slope.flat else values == 0.0
        if wrong.any():
            name, text = slope.name.partition("#")[0], to_text(slope.expression)
            help_ = "a formulation in which the law is explicit"
            if slope.flat:
                message = f"the law of {name} was compiled for {text} = 0, which is now {values[wrong.argmax()]:g}"
                help_ = "compile the model with that value"
            else:
                some = "" if wrong.all() else " in some of its elements"
                message = f"the law of {name} cannot be inverted: {text} is zero{some}"
            found.append(Diagnostic("E605", message, slope.place, help_))
    if found:
        raise ModelError(found)
