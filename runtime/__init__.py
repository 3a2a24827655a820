"""Residual module to trace: consistent start, stepping core, HDF5."""
