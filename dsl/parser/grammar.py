"""The grammar `sd.lark` turned into the tables of `table.py`.

lark builds the LALR(1) automaton (strict: no conflict is resolved silently); this module renumbers
it in the order of a walk from the start state, so that equal grammars give equal tables, and writes
it as lines of text. Reading a model then needs neither lark nor a cache: the tables load with the
package. Measured: 0.24 s to build with lark, 75 ms to import lark, 5 ms to load the tables.

Run `python -m sysdyn.dsl.parser.grammar` after a change of `sd.lark`; a test compares the two files.

Terminals are named by what the author writes: a keyword or sign by itself (`param`, `->`), a class
of words by each of its words, and the rest in angle brackets (`<name>`, `<newline>`).
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

_HERE = Path(__file__).parent
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


def build_lark() -> Any:
    """Lark's parser of `sd.lark`; raises lark's GrammarError where the grammar has a conflict."""
    from lark import Lark

    text = (_HERE / "sd.lark").read_text(encoding="utf-8")
    return Lark(text, parser="lalr", lexer="contextual", strict=True, start="start", maybe_placeholders=True)


def table_text() -> str:
    """The text of `table.py`."""
    lark = build_lark()
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
    for state in order:
        by_action: dict[int, set[str]] = {}
        goto = []
        for symbol, (action, target) in sorted(automaton.states[state].items(), key=_symbol):
            if action.name == "Reduce":
                code = -1 - rules.setdefault(target, len(rules))
            elif symbol in kinds:
                code = number[target]
            else:
                goto.append((symbol, number[target]))
                continue
            by_action.setdefault(code, set()).update(kinds[symbol])
        states.append(_numbered(by_action, lookaheads))
        gotos.append(tuple(sorted(goto)))
    return _print(states, gotos, list(rules), lookaheads, number[automaton.end_states["start"]])


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


def _numbered(by_action: dict[int, set[str]], lookaheads: dict[tuple[str, ...], int]) -> tuple[tuple[int, int], ...]:
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
    for absent in missing:
        if absent:
            children.append("-")
            continue
        symbol = rule.expansion[position]
        if options.keep_all_tokens or not (symbol.is_term and symbol.filter_out):
            spliced = not symbol.is_term and symbol.name.startswith("_")
            children.append(f"{position}{'*' if spliced else ''}")
        position += 1
    name = rule.alias or rule.origin.name
    if rule.alias is None and rule.origin.name.startswith("_"):
        name = "[]"
    elif rule.alias is None and options.expand1 and len(children) == 1:
        name = "="
    return " ".join((rule.origin.name, str(len(rule.expansion)), name, *children))


def _print(states: list[Any], gotos: list[Any], rules: list[Any], lookaheads: dict[Any, int], final: int) -> str:
    """The module's text."""
    rows = [" ".join(f"{action}:{number}" for action, number in row) for row in states]
    moves = [" ".join(f"{left}:{target}" for left, target in row) for row in gotos]
    lines = [
        '"""Tables of the parser, generated from `sd.lark` by `grammar.py`: do not edit.',
        "",
        "Texts, not tuples, because a text costs nothing to compile; `automaton` decodes them.",
        '"""',
        "",
        "# ruff: noqa: E501",
        "",
        f"FINAL = {final}",
        '"""The state that has read a whole file."""',
        "",
        *_block("LOOKAHEADS", [" ".join(terminals) for terminals in lookaheads]),
        '"""Sets of terminals, one a line."""',
        "",
        *_block("ROWS", rows),
        '"""For each state action:set, where the action is a state to shift to, or -1 - rule to reduce."""',
        "",
        *_block("GOTOS", moves),
        '"""For each state left side:state."""',
        "",
        *_block("RULES", [_rule(rule) for rule in rules]),
        '"""Left side, length, function, children: see `grammar._rule`."""',
    ]
    return "\n".join(lines) + "\n"


def _block(name: str, rows: Iterable[str]) -> list[str]:
    """A constant of lines."""
    return [f'{name} = """\\', *rows, '"""']


if __name__ == "__main__":
    (_HERE / "table.py").write_text(table_text(), encoding="utf-8")
