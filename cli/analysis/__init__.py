"""Linear analysis: a model about a state, its states of rest."""
