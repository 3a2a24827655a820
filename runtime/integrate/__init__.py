"""One run: methods, steps, rows."""
