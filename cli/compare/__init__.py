"""Traces compared, and the page that shows it."""
