"""Network to residual module: energies, descriptor forms, generated code."""
