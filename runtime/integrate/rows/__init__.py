"""Rows of a run: the point that is written, what observes it, what ledgers count."""
