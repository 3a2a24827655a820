"""The linearisation of a model about a state: matrices, modes, zeros, states of rest."""
