"""Nodes of the statements of scenes from the rules of `sd.lark`; see `build_expressions`."""

from __future__ import annotations

from sysdyn.dsl.parser.build_expressions import Values
from sysdyn.dsl.parser.notes import Notes
from sysdyn.dsl.text.source import Span
from sysdyn.dsl.tree import syntax as s


def time(v: Values, span: Span, notes: Notes) -> s.Time:
    """`time arith to arith`."""
    return s.Time(v[0], v[1], span, notes.doc(span))


def set_(v: Values, span: Span, notes: Notes) -> s.Set:
    """`set ref = expr`."""
    return s.Set(v[0], v[1], span, notes.doc(span))


def scene_level(v: Values, span: Span, notes: Notes) -> s.SceneLevel:
    """`level ref = NAME`."""
    return s.SceneLevel(v[0], v[1], span, notes.doc(span))


def trace(v: Values, span: Span, notes: Notes) -> s.Trace:
    """`trace trace_items [every arith]`."""
    return s.Trace(v[0], v[1], span, notes.doc(span))


def trace_item(v: Values, span: Span, notes: Notes) -> s.TraceItem:
    """`arith [in unit] [as NAME]`."""
    return s.TraceItem(v[0], v[1], v[2], span)


def accuracy(v: Values, span: Span, notes: Notes) -> s.Accuracy:
    """`accuracy arith [on ariths [relative to range]]`."""
    return s.Accuracy(v[0], v[1] or (), v[2] is not None, span, notes.doc(span))


def to_range(v: Values, span: Span, notes: Notes) -> Span:
    """`relative to range`."""
    return span


def formulation(v: Values, span: Span, notes: Notes) -> s.Formulation:
    """`formulation NAME`."""
    return s.Formulation(v[0], span, notes.doc(span))


def solver(v: Values, span: Span, notes: Notes) -> s.Solver:
    """`solver NAME [options]`."""
    return s.Solver(v[0], v[1], span, notes.doc(span))


def index_form(v: Values, span: Span, notes: Notes) -> s.Arg:
    """`NAME = INDEX`."""
    return s.Arg(v[0].name, s.Name(v[1].name, v[1].span), span)


def redundancy(v: Values, span: Span, notes: Notes) -> s.Redundancy:
    """`redundancy NAME`."""
    return s.Redundancy(v[0], span, notes.doc(span))


def limit(v: Values, span: Span, notes: Notes) -> s.Limit:
    """`limit NAME arith`."""
    return s.Limit(v[0], v[1], span, notes.doc(span))
