"""Models: benchmark."""
