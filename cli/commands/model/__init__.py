"""Commands about a model as it is written."""
