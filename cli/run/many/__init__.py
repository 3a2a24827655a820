"""One text run often: in memory, in the core, in processes."""
