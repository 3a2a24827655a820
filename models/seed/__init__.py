"""Models: seed."""
