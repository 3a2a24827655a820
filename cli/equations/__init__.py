"""Equations written for a reader."""
