"""A compiled model as numbers: its description, its forms, and the system that the steppers see."""
