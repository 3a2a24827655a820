"""Canonical layout of a text, of an expression and of a unit."""

from __future__ import annotations

from sysdyn.dsl.format_expressions import format_expression, format_unit

__all__ = ["format_expression", "format_unit"]
