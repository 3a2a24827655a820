"""The text of a model, places in it, and findings as data."""
