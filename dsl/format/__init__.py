"""Syntax tree to the one canonical layout."""
