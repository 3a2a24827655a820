"""Many runs of one compiled model."""
