"""Commands that run a model, once or often."""
