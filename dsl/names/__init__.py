"""Names and expressions: what a word of the text stands for, with its dimension."""
