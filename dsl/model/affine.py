"""Why an index is none of the form i + c, in the author's words."""

from __future__ import annotations

import re

from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.expression import Node, topological
from sysdyn.dsl.model.expression_text import to_text

EACH = "one size for all of them, or a label of its own for each: a1: ..., a2: ..."
AFFINE = "i + c; a statement for each element, x[1], x[4]; or in place of an array of numbers a table, k(2*i)"
_OWN_NAMES = "ijklmn"
"""Of loop variables that the author did not name."""


def index_text(node: Node) -> str:
    """An index with its loop variables as the author names them: the compiler calls them i_2 where one i lies in or
    beside another, and #0, #1, ... in what it made of them.
    """
    change = {}
    for n in topological([node]):
        if n.op == "index":
            name = str(n.data)
            own = _OWN_NAMES[int(name[1:]) % 6] if re.fullmatch(r"#\d+", name) else re.sub(r"_\d+$", "", name)
            change[n] = ex.index(own)
    return to_text(ex.substitute(node, change))


def not_affine(node: Node, otherwise: str, written: str = "") -> tuple[str, str, str | None]:
    """Message, remedy and the parameter of a size that differs in an array of components; else what is said otherwise,
    and None; written: the index as it stands in the text.
    """
    nodes = topological([node])
    sizes = [n for n in nodes if n.op == "param" and not n.data.startswith("#") and _moves(n)]
    if not sizes:
        return f"index {written or index_text(node)} is not affine{otherwise}", AFFINE, None
    text = f"{to_text(sizes[0])} is a size, and differs between the elements of an array: these are alike"
    return text, EACH, str(sizes[0].data)


def _moves(node: Node) -> bool:
    """Whether it is read with a loop variable."""
    return any(n.op == "index" for n in topological([node]))
