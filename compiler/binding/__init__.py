"""The numbers of one set of parameter values, and the manifest."""
