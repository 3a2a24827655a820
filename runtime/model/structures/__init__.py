"""The structures of runtime/core/*/*.h as ctypes sees them; see README.md."""
