"""Linear algebra without physics."""
