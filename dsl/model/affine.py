"""Why an index is none of the form i + c, in the author's words."""

from __future__ import annotations

from sysdyn.dsl.model.expression import Node, topological
from sysdyn.dsl.model.expression_text import to_text

EACH = "one size for all of them, or a label of its own for each: a1: ..., a2: ..."
AFFINE = "i + c, or a table over the index"


def not_affine(node: Node, otherwise: str) -> tuple[str, str, str | None]:
    """Message, remedy and the parameter of a size that differs in an array of components; else what is said otherwise,
    and None.
    """
    nodes = topological([node])
    sizes = [n for n in nodes if n.op == "param" and not n.data.startswith("#") and _moves(n)]
    if not sizes:
        return f"index {to_text(node)} is not affine{otherwise}", AFFINE, None
    text = f"{to_text(sizes[0])} is a size, and differs between the elements of an array: these are alike"
    return text, EACH, str(sizes[0].data)


def _moves(node: Node) -> bool:
    """Whether it is read with a loop variable."""
    return any(n.op == "index" for n in topological([node]))
