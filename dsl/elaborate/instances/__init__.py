"""Labels: elements, components, what connects them."""
