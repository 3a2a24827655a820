"""Scenes: what is asked of a model."""
