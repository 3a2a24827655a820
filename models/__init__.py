"""Models that a user can learn from."""
