"""SPICE netlists as model texts."""
