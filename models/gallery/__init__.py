"""Models: gallery."""
