"""A project of a user: what it begins with, and what the machine lacks for it."""
