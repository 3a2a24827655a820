"""The runs of one simulation, and how accurate they are."""
