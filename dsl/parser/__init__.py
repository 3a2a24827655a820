"""Text to syntax tree: an automaton over tables generated from `sd.lark`, recovery and complaints."""
