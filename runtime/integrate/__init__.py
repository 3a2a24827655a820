"""One run: methods, steps, and the control of accuracy."""
