"""The values that the compiler receives: expressions, units, dimensions, the network."""
