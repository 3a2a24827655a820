"""Syntax tree to network: instances, levels, scenes, tables, files."""
