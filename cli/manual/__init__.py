"""What the product says of itself: names of a model, the standard library, topics of the language."""
