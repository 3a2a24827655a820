"""Command line and the Python face."""
