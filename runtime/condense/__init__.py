"""Unknowns that are constant sums of others, and the system without them."""
