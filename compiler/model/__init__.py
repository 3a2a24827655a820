"""Energies and terms: the values between network and forms, and their interpreter."""
