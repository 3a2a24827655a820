"""Energies to the descriptor form of one formulation."""
