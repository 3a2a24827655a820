"""What `compile` writes: files that anyone can call, without sysdyn on the path."""
