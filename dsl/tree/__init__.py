"""The frozen syntax tree."""
