"""Text to checked network: the language of sysdyn."""
