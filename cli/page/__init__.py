"""Self-contained HTML pages: no font, no picture and no script is loaded from anywhere."""
