"""Models: book."""
