"""Comparison of traces: pure values in, a verdict out."""
