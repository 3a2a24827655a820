"""From an expression as written to a node: names bound, quantities in SI, every dimension checked.

Received: syntax expressions and the scope they stand in.  Returned: `Typed` values.  A rule that fails is reported
once and stands for itself with an unknown dimension, so that one mistake gives one message.
"""

from __future__ import annotations

from collections.abc import Callable

from sysdyn.dsl.names.arithmetic import Arithmetic
from sysdyn.dsl.names.calls import CallResolver
from sysdyn.dsl.names.context import Value
from sysdyn.dsl.names.members import Members
from sysdyn.dsl.tree import syntax


class Resolver(Members, Arithmetic, CallResolver):
    """Resolves the expressions of one model."""

    def resolve(self, expression: syntax.Expr) -> Value:
        """The value of an expression."""
        return _RULES[type(expression)](self, expression)


_RULES: dict[type, Callable[..., Value]] = {
    syntax.Number: Resolver._number,
    syntax.QuantityLiteral: Resolver._quantity,
    syntax.Text: Resolver._text,
    syntax.Bool: Resolver._bool,
    syntax.Name: Resolver._name,
    syntax.Parenthesized: Resolver._group,
    syntax.Member: Resolver._member,
    syntax.Item: Resolver._item,
    syntax.Prime: Resolver._prime,
    syntax.FunctionCall: Resolver._call,
    syntax.MethodCall: Resolver._method,
    syntax.Reduction: Resolver._reduction,
    syntax.Sum: Resolver._sum,
    syntax.Product: Resolver._product,
    syntax.Negative: Resolver._negative,
    syntax.Power: Resolver._power,
    syntax.Compare: Resolver._compare,
    syntax.And: Resolver._and,
    syntax.Or: Resolver._or,
    syntax.Not: Resolver._not,
    syntax.Conditional: Resolver._conditional,
    syntax.Array: Resolver._array,
}
