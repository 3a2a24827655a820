"""Commands that read traces, or keep them."""
