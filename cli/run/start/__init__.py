"""The consistent start in the author's words."""
