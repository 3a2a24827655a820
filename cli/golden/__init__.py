"""Golden traces: what `sysdyn golden` keeps, measures and checks."""
