"""Nodes of the statements of scenes from the rules of `sd.lark`; see `build_expressions`."""

from __future__ import annotations

from sysdyn.dsl.parser.build_expressions import Values
from sysdyn.dsl.parser.notes import Notes
from sysdyn.dsl.text.source import Span
from sysdyn.dsl.tree import syntax as s


def time(v: Values, span: Span, notes: Notes) -> s.TimeStatement:
    """`time arith to arith`."""
    return s.TimeStatement(v[0], v[1], span, notes.doc(span))


def set_(v: Values, span: Span, notes: Notes) -> s.SetStatement:
    """`set ref = expr`."""
    return s.SetStatement(v[0], v[1], span, notes.doc(span))


def scene_level(v: Values, span: Span, notes: Notes) -> s.SceneLevelStatement:
    """`level ref = NAME`."""
    return s.SceneLevelStatement(v[0], v[1], span, notes.doc(span))


def trace(v: Values, span: Span, notes: Notes) -> s.TraceStatement:
    """`trace trace_items [every arith]`."""
    return s.TraceStatement(v[0], v[1], span, notes.doc(span))


def trace_item(v: Values, span: Span, notes: Notes) -> s.TraceItem:
    """`arith [in unit] [as NAME]`."""
    return s.TraceItem(v[0], v[1], v[2], span)


def accuracy(v: Values, span: Span, notes: Notes) -> s.AccuracyStatement:
    """`accuracy arith [on ariths [relative to range]]`."""
    return s.AccuracyStatement(v[0], v[1] or (), v[2] is not None, span, notes.doc(span))


def to_range(v: Values, span: Span, notes: Notes) -> Span:
    """`relative to range`."""
    return span


def formulation(v: Values, span: Span, notes: Notes) -> s.FormulationStatement:
    """`formulation NAME`."""
    return s.FormulationStatement(v[0], span, notes.doc(span))


def solver(v: Values, span: Span, notes: Notes) -> s.SolverStatement:
    """`solver NAME [options]`."""
    return s.SolverStatement(v[0], v[1], span, notes.doc(span))


def index_form(v: Values, span: Span, notes: Notes) -> s.Arg:
    """`NAME = INDEX`."""
    return s.Arg(v[0].name, s.Name(v[1].name, v[1].span), span)


def redundancy(v: Values, span: Span, notes: Notes) -> s.RedundancyStatement:
    """`redundancy NAME`."""
    return s.RedundancyStatement(v[0], span, notes.doc(span))


def limit(v: Values, span: Span, notes: Notes) -> s.LimitStatement:
    """`limit NAME arith`."""
    return s.LimitStatement(v[0], v[1], span, notes.doc(span))
