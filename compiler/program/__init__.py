"""Descriptor form to program, C or NumPy text, and a loaded library."""
