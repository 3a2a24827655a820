"""Events: what ends a smooth piece, what it changes, and how the next piece begins."""
