"""What can be said of a model without time integration."""
