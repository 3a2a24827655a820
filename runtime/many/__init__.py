"""Many runs of one model that differ in numbers alone."""
