"""Rank, redundancy, index: what the blocks say of the model."""
