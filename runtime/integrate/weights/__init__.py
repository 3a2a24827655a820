"""What the tolerances of a run are relative to."""
