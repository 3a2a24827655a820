"""Text to syntax tree: never raises, reports everything that cannot be read, returns the rest.

An error ends its statement, not the file: reading goes on with the next statement of the same
block, and a `BrokenStatement` node stands where the statement was.
"""

from __future__ import annotations

from sysdyn.dsl.model.collecting import at_rest
from sysdyn.dsl.parser.automaton import MAX_NESTING, Automaton, words
from sysdyn.dsl.parser.patterns import Patterns
from sysdyn.dsl.parser.recovery import Recovery
from sysdyn.dsl.text.decoding import MAX_BYTES
from sysdyn.dsl.text.diagnostics import Diagnostic
from sysdyn.dsl.text.source import SourceText, Span
from sysdyn.dsl.tree.syntax import File

MAX_LINE = 10_000
"""Longest line that is read."""


def parse(source: SourceText) -> tuple[File, tuple[Diagnostic, ...]]:
    """The syntax tree of a text, and what is wrong with its syntax.

    The codes are E107 to E118, and E308 for a content written as an energy. Never raises; the time
    is proportional to the length of the text.
    """
    refused = _check_length(source)
    if refused is not None:
        return File(source, (), (), Span(0, len(source.text))), (refused,)
    with at_rest():
        return _parse(source)


def expected_words(source: SourceText) -> frozenset[str]:
    """The words of the language that may follow a text: what an editor offers behind it."""
    if _check_length(source) is not None:
        return frozenset()
    with at_rest():
        automaton = _run_automaton(source, len(source.text))
        return frozenset(word for word in words() if automaton.accepts(word))


def _parse(source: SourceText) -> tuple[File, tuple[Diagnostic, ...]]:
    """Run the automaton to the end of the text."""
    automaton = _run_automaton(source)
    comments = tuple(automaton.scanner.comments)
    tree = File(source, automaton.values[-1], comments, Span(0, len(source.text)))
    return tree, automaton.notes.report.diagnostics


def _run_automaton(source: SourceText, until: int | None = None) -> Automaton:
    """The automaton behind a text; until: before what is added at its end to finish statements and blocks."""
    automaton = Automaton(source)
    recovery, patterns = Recovery(automaton), Patterns(automaton)
    scanner = automaton.scanner
    while not automaton.finished:
        kind = scanner.read(automaton.row)
        if scanner.start == until:
            break
        # slips that are certain are corrected on the way
        kind = recovery.correct_terminal(kind)
        if not automaton.advance(kind):
            recovery.recover(kind)
        elif automaton.depths[-1] > MAX_NESTING:
            recovery.too_deep()
        elif automaton.overflow:
            recovery.too_long()
        # lines that are alike are read by a recipe
        else:
            patterns.follow(kind)
    return automaton


def _check_length(source: SourceText) -> Diagnostic | None:
    """E116 where the text is longer than anyone writes."""
    text = source.text
    if len(text) > MAX_BYTES:
        message = f"the file is longer than {MAX_BYTES // 1_000_000} MB"
        return Diagnostic("E116", message, source.place(0, 0), "a table of data belongs in a .csv file")
    starts = (*source.line_starts, len(text))
    for number in range(1, len(starts)):
        if starts[number] - starts[number - 1] > MAX_LINE + 2:
            start = starts[number - 1]
            message = f"line {number} is longer than {MAX_LINE} characters"
            help_ = "a line may be broken after a comma or an operator, or inside parentheses"
            return Diagnostic("E116", message, source.place(start, start + 1), help_)
    return None
