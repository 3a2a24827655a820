"""Network to network: laws over the coordinates of one formulation."""
