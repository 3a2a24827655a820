"""Statements of a body: names, equations, events."""
