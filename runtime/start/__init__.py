"""Consistent points: the start, restarts after jumps, impulses."""
