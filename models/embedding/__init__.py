"""Compiled models called from other programs: C with SUNDIALS IDA, Python with SciPy, C++."""
