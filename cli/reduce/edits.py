"""Changes of an author's text: an element left out, or what it stands between joined.

An element that hardly takes part either lets nothing pass (it is left out: no current, no force), or nothing stands
across it (a wire, a rigid link): a source of effort or flow zero takes its place.  What only served it goes too: its
initial values, parameters that nothing reads any more.

Received: a document's text and its syntax; handed back: texts.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from sysdyn.cli.reduce.activity import Activity
from sysdyn.cli.run.request.targets import Target
from sysdyn.dsl.model.network import Branch, Network
from sysdyn.dsl.text.diagnostics import SourceText
from sysdyn.dsl.tree import syntax
from sysdyn.values import dataclass

Cut = tuple[int, int, str]
"""Code points first..last-1 of a text, and what stands there instead."""
NO_MEMBER = r"(?<!\w)(?<!(?<!\.)\.)"
"""What stands before a name that is none of a member: no letter, no dot but those of a range."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """A statement of the model that may go.  label: of the element or statement; activity [J], share: of all its
    parts; span: of the statement; name: that it declares; joined: an element that joins its ends, "" where it has none.
    """

    label: str
    activity: float
    share: float
    span: tuple[int, int]
    name: str
    joined: str


def candidates(target: Target, network: Network, found: Sequence[Activity]) -> tuple[Candidate, ...]:
    """Statements of the author's own model with their activities, the least active first; sources are none."""
    source = target.document.file.source
    groups: dict[tuple[int, int], list[Activity]] = {}
    owners: dict[tuple[int, int], syntax.Statement] = {}
    # parts of one statement together: an array goes as a whole
    for activity in found:
        statement = _statement(target, activity)
        if statement is not None:
            key = (statement.span.start, statement.span.end)
            groups.setdefault(key, []).append(activity)
            owners[key] = statement
    made = []
    for key, group in groups.items():
        statement = owners[key]
        # sources drive the model
        if all(a.role in ("in", "through") for a in group):
            continue
        name = statement.decl.name if isinstance(statement, syntax.InstanceStatement) else ""
        several = sum(isinstance(s, syntax.InstanceStatement) and s.decl.name == name for s in target.model.body) > 1
        value, share = sum(a.activity for a in group), sum(a.share for a in group)
        label = group[0].label if several else name or group[0].label
        made.append(
            Candidate(label, value, share, key, "" if several else name, _zero_source(source, statement, network))
        )
    return tuple(sorted(made, key=lambda c: (c.activity, c.span)))


def _statement(target: Target, activity: Activity) -> syntax.Statement | None:
    """The statement of the model that makes an element, or that is one; None inside components and loops."""
    if activity.name:
        first = re.split(r"[.\[#]", activity.name, maxsplit=1)[0]
        text, own = target.document.file.source.text, "".join(activity.name.split())
        named = [s for s in target.model.body if isinstance(s, syntax.InstanceStatement) and s.decl.name == first]
        said = {"".join(text[s.decl.span.start : s.decl.span.end].split()): s for s in named}
        several = next(
            (s for label, s in said.items() if own == label or own.startswith((f"{label}.", f"{label}#"))), None
        )
        return several or (named[0] if named and not own.startswith(f"{first}[") else None)
    place = activity.place
    if place.file != target.document.file.source.name:
        return None
    return next((s for s in target.model.body if s.span.start == place.span.start), None)


def _zero_source(source: SourceText, statement: syntax.Statement, network: Network) -> str:
    """`label: effort(e = 0 V) a -> b`, or of zero flow where nodes have a common flow."""
    if not isinstance(statement, syntax.InstanceStatement) or statement.decl.indices or len(statement.connections) != 1:
        return ""
    connection = statement.connections[0]
    branch = next((b for b in network.branches if b.name.partition(".")[0] == statement.decl.name), None)
    if branch is None or not isinstance(connection, syntax.Across | syntax.Single):
        return ""
    ends = source.text[connection.span.start : connection.span.end]
    ends = ends if isinstance(connection, syntax.Across) else f"{ends} -> ground"
    return f"{statement.decl.name}: {_source(branch)} {ends}"


def _source(branch: Branch) -> str:
    domain = branch.domain
    if domain.common == "effort":
        return f"effort(e = 0 {domain.effort.text})"
    return f"flow(f = 0 {domain.flow.text})"


def remove_statement(target: Target, text: str, candidate: Candidate) -> str:
    """The text without a statement, and without the initial values of what it declares."""
    cuts = [(*candidate.span, ""), *((*span, "") for span in _initials(target, candidate.name))]
    return apply_cuts(text, cuts)


def replace_by_zero_source(target: Target, text: str, candidate: Candidate) -> str:
    """The text with a source of zero in the element's place."""
    cuts = [(*candidate.span, candidate.joined), *((*span, "") for span in _initials(target, candidate.name))]
    return apply_cuts(text, cuts)


def merge_nodes(target: Target, text: str, candidate: Candidate) -> str | None:
    """The text with the ends of an element as one node, named by the first; None where that cannot be said.

    What lies between the two goes: elements with both ends there.  A node of which anything but the ends of elements
    speaks is not renamed.
    """
    statement = next((s for s in target.model.body if (s.span.start, s.span.end) == candidate.span), None)
    if not isinstance(statement, syntax.InstanceStatement) or not candidate.joined:
        return None
    ends = _ends(text, statement.connections[0])
    if len(ends) != 2 or not all(re.fullmatch(r"\w+", end) for end in ends):
        return None
    # the second end goes, or the first where the model speaks of the second elsewhere
    for stays, goes in (ends, ends[::-1]):
        node = _node_statement(target, goes)
        if node is not None and stays != goes and _spoken(target, text, goes) == 0:
            return apply_cuts(text, [*_rename_cuts(target, text, goes, stays), *_declaration_cuts(text, node, goes)])
    return None


def _ends(text: str, connection: syntax.Connection) -> list[str]:
    """What an element stands between."""
    if isinstance(connection, syntax.Across | syntax.BindAcross):
        return [text[end.span.start : end.span.end] for end in (connection.plus, connection.minus)]
    return (
        [text[connection.node.span.start : connection.node.span.end], "ground"]
        if isinstance(connection, syntax.Single)
        else []
    )


def _node_statement(target: Target, name: str) -> syntax.NodeStatement | None:
    """The scalar node of that name that the model declares."""
    nodes = (s for s in target.model.body if isinstance(s, syntax.NodeStatement))
    return next((s for s in nodes if any(d.name == name and not d.indices for d in s.decls)), None)


def _connections(target: Target) -> Iterator[tuple[syntax.InstanceStatement, syntax.Connection]]:
    for s in target.model.body:
        if isinstance(s, syntax.InstanceStatement):
            yield from ((s, connection) for connection in s.connections)


def _spoken(target: Target, text: str, name: str) -> int:
    """How often the model and its scenes speak of a node, declarations and ends of elements apart."""
    scenes = [item.span for item in target.document.file.items if isinstance(item, syntax.SceneDefinition)]
    whole = sum(_read(text[span.start : span.end], name, of=True) for span in (target.model.span, *scenes))
    ends = sum(_read(text[c.span.start : c.span.end], name, of=True) for _, c in _connections(target))
    return whole - ends - 1


def _rename_cuts(target: Target, text: str, goes: str, stays: str) -> Iterator[Cut]:
    """Cuts that put one node for another at the ends of elements, and take away what then has both ends there."""
    word = re.compile(rf"{NO_MEMBER}{re.escape(goes)}(?!\w)")
    for statement in dict.fromkeys(s for s, _ in _connections(target)):
        within = [(c, word.sub(stays, text[c.span.start : c.span.end])) for c in statement.connections]
        sides = [[word.sub(stays, end) for end in _ends(text, c)] for c, _ in within]
        if len(sides) == 1 and len(sides[0]) == 2 and sides[0][0] == sides[0][1]:
            yield statement.span.start, statement.span.end, ""
            yield from ((*span, "") for span in _initials(target, statement.decl.name))
            continue
        for connection, new in within:
            if new != text[connection.span.start : connection.span.end]:
                yield connection.span.start, connection.span.end, new


def _declaration_cuts(text: str, node: syntax.NodeStatement, name: str) -> Iterator[Cut]:
    """Cuts that take a name out of a declaration."""
    if len(node.decls) == 1:
        yield node.span.start, node.span.end, ""
        return
    names = [text[d.span.start : d.span.end] for d in node.decls if d.name != name]
    yield node.decls[0].span.start, node.decls[-1].span.end, ", ".join(names)


def _initials(target: Target, name: str) -> Iterator[tuple[int, int]]:
    """Spans of `init` statements of the model and the scene whose target begins with a name."""
    source = target.document.file.source
    if not name:
        return
    for s in (*target.model.body, *(target.scene.body if target.scene else ())):
        if isinstance(s, syntax.InitStatement):
            words = re.split(r"[.'\[\s]", source.text[s.target.span.start : s.target.span.end], maxsplit=1)
            if words[0] == name:
                yield s.span.start, s.span.end


def apply_cuts(text: str, cuts: Sequence[Cut]) -> str:
    """The text after cuts; a line of which nothing is left goes with its comment."""
    for first, last, instead in sorted(cuts, reverse=True):
        if not instead:
            start = text.rfind("\n", 0, first) + 1
            end = text.find("\n", last)
            end = len(text) if end < 0 else end + 1
            rest = text[start:first].strip() + text[last:end].partition("#")[0].strip().removeprefix(";")
            if not rest:
                first, last = start, end
        text = text[:first] + instead + text[last:]
    return text


def unread(target: Target, text: str, before: str) -> str:
    """The text without scalar parameters of the model that nothing reads any more, but something read before."""
    cuts = []
    for s in target.model.body:
        if isinstance(s, syntax.ParamStatement):
            name = s.decl.name
            if _read(before, name) > 1 and _read(text, name) == 1:
                cuts.append((s.span.start, s.span.end, ""))
    return apply_cuts(text, cuts)


def _read(text: str, name: str, *, of: bool = False) -> int:
    """How often a name stands in a text, comments apart; of: as what is said of something too (`x.name`).  A range
    ends at a name: `1..name`.
    """
    plain, before = re.sub(r"#[^\n]*", "", text), r"(?<!\w)" if of else NO_MEMBER
    return len(re.findall(rf"{before}{re.escape(name)}(?!\w)", plain))
