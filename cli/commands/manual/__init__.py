"""Commands that tell of sysdyn itself."""
