"""One scene in every formulation and by two methods."""
