"""The grammar `sd.lark` turned into the tables that the automaton runs: `sd.tables`, written by the build.

lark builds the LALR(1) automaton; this module renumbers it in the order of a walk from the start state, so that equal
grammars give equal tables, and writes it as lines of text beside the grammar.  Reading a model then needs no lark.
`load_tables` builds them anew where they are absent or of another text of the grammar (a clone without a build, an
editable install whose grammar is being changed).

Terminals are named by what the author writes: a keyword or sign by itself (`param`, `->`), a class
of words by each of its words, and the rest in angle brackets (`<name>`, `<newline>`).
"""

from __future__ import annotations

import os
import re
import zlib
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

_GRAMMAR = Path(__file__).parent / "sd.lark"
_TABLES = Path(__file__).parent / "sd.tables"
_CLASS_OF_WORDS = re.compile(r"\(([\w|]+)\)\\b")
_REGULAR = {
    "NAME": "<name>",
    "NUMBER": "<number>",
    "QUANTITY": "<quantity>",
    "STRING": "<text>",
    "INDEX": "<index>",
    "STATE_FUNCTION": "<function>",
    "_NL": "<newline>",
    "$END": "<end>",
}


class AutomatonText(NamedTuple):
    """The automaton as lines of text: `automaton` decodes a row where it comes there."""

    final: str
    """The state that has read a whole file."""
    lookaheads: str
    """Sets of terminals, one a line."""
    rows: str
    """For each state action:set, where the action is a state to shift to, or -1 - rule to reduce."""
    gotos: str
    """For each state left side:state."""
    rules: str
    """Left side, length, function, children: see `_rule`."""


_BREAK = "\n\f\n"
"""Between the parts of the file: the fingerprint of the grammar, and the fields of `AutomatonText`."""


def load_tables() -> AutomatonText:
    """The tables of the grammar: those that stand beside it, or built by lark and put there where that can be.

    Raises ImportError where neither they nor lark are there.
    """
    grammar = _GRAMMAR.read_text(encoding="utf-8")
    try:
        fingerprint, *parts = _TABLES.read_text(encoding="utf-8").split(_BREAK)
    except OSError:
        fingerprint, parts = "", []
    if fingerprint == _fingerprint(grammar):
        return AutomatonText(*parts)
    try:
        tables = build_tables()
    except ModuleNotFoundError as error:
        raise ImportError(f"the tables of {_GRAMMAR} are not built, and lark is missing: pip install lark") from error
    with suppress(OSError):  # a folder that may not be written: the next process builds them again
        _write(tables)
    return tables


def write_tables() -> None:
    """Build the tables and put them beside the grammar; raises OSError, and lark's GrammarError."""
    _write(build_tables())


def _write(tables: AutomatonText) -> None:
    """Whole or not at all: other processes may read meanwhile."""
    partial = _TABLES.with_suffix(f".{os.getpid()}")
    fingerprint = _fingerprint(_GRAMMAR.read_text(encoding="utf-8"))
    partial.write_text(_BREAK.join((fingerprint, *tables)), encoding="utf-8")
    partial.replace(_TABLES)


def _fingerprint(grammar: str) -> str:
    """By which tables know the grammar that they are of."""
    return f"{zlib.crc32(grammar.encode()):08x}"


def build_lark(*, strict: bool = False) -> Any:
    """Lark's parser of `sd.lark`; strict (it needs interegular): raises lark's GrammarError where it has a conflict."""
    from lark import Lark

    text = _GRAMMAR.read_text(encoding="utf-8")
    return Lark(text, parser="lalr", lexer="contextual", strict=strict, start="start", maybe_placeholders=True)


def build_tables(*, strict: bool = False) -> AutomatonText:
    """The tables, built by lark; strict: as of `build_lark`."""
    lark = build_lark(strict=strict)
    kinds = {terminal.name: _kinds(terminal) for terminal in lark.terminals}
    kinds["$END"] = ("<end>",)
    # lark has no public view of its automaton
    automaton = lark.parser.parser._parse_table
    order = _walk(automaton, kinds)
    number = {state: index for index, state in enumerate(order)}
    rules: dict[Any, int] = {}
    lookaheads: dict[tuple[str, ...], int] = {}
    states = []
    gotos = []
    # a row of actions by sets of terminals, a row of gotos by left sides
    for state in order:
        by_action: dict[int, set[str]] = {}
        goto = []
        for symbol, (action, target) in sorted(automaton.states[state].items(), key=_symbol):
            # negative: the number of a rule
            if action.name == "Reduce":
                code = -1 - rules.setdefault(target, len(rules))
            # a terminal: the state behind it
            elif symbol in kinds:
                code = number[target]
            # a left side: where to go on after a reduction
            else:
                goto.append((symbol, number[target]))
                continue
            by_action.setdefault(code, set()).update(kinds[symbol])
        states.append(_number_lookaheads(by_action, lookaheads))
        gotos.append(tuple(sorted(goto)))
    return AutomatonText(
        final=str(number[automaton.end_states["start"]]),
        lookaheads="\n".join(" ".join(terminals) for terminals in lookaheads),
        rows="\n".join(" ".join(f"{action}:{number}" for action, number in row) for row in states),
        gotos="\n".join(" ".join(f"{left}:{target}" for left, target in row) for row in gotos),
        rules="\n".join(map(_rule, rules)),
    )


def _kinds(terminal: Any) -> tuple[str, ...]:
    """What the author writes for a terminal of lark."""
    if terminal.name in _REGULAR:
        return (_REGULAR[terminal.name],)
    words = _CLASS_OF_WORDS.fullmatch(terminal.pattern.value)
    if words is not None:
        return tuple(words.group(1).split("|"))
    return (terminal.pattern.value,)


def _walk(automaton: Any, kinds: dict[str, tuple[str, ...]]) -> list[Any]:
    """All states, breadth first from the start, symbols in the order of their names."""
    order = [automaton.start_states["start"]]
    seen = set(order)
    for state in order:
        moves = {
            (symbol in kinds, kinds.get(symbol, (symbol,))): target
            for symbol, (action, target) in automaton.states[state].items()
            if action.name == "Shift"
        }
        for _, target in sorted(moves.items()):
            if target not in seen:
                seen.add(target)
                order.append(target)
    return order


def _symbol(entry: tuple[str, Any]) -> str:
    """The symbol of an entry of lark's table."""
    return entry[0]


def _number_lookaheads(
    by_action: dict[int, set[str]], lookaheads: dict[tuple[str, ...], int]
) -> tuple[tuple[int, int], ...]:
    """Actions of a state with the number of the set of terminals that each is taken on."""
    sets = {action: tuple(sorted(terminals)) for action, terminals in by_action.items()}
    return tuple((action, lookaheads.setdefault(sets[action], len(lookaheads))) for action in sorted(sets))


def _rule(rule: Any) -> str:
    """Left side, length, name of the function, children: positions, `*` for a list to be spliced
    in, `-` for an absent part. The name is `=` for a rule that hands on its one child, `[]` for a list.
    """
    options = rule.options
    missing = options.empty_indices or (False,) * len(rule.expansion)
    children: list[str] = []
    position = 0
    # a `-` for an optional part that is not there
    for absent in missing:
        if absent:
            children.append("-")
            continue
        symbol = rule.expansion[position]
        if options.keep_all_tokens or not (symbol.is_term and symbol.filter_out):
            spliced = not symbol.is_term and symbol.name.startswith("_")
            children.append(f"{position}{'*' if spliced else ''}")
        position += 1
    # the function that builds the node; `_body` and its like make lists
    name = rule.alias or rule.origin.name
    if rule.alias is None and rule.origin.name.startswith("_"):
        name = "[]"
    elif rule.alias is None and options.expand1 and len(children) == 1:
        name = "="
    return " ".join((rule.origin.name, str(len(rule.expansion)), name, *children))
