"""What the fields of structures are: numbers of the core, and addresses."""

from __future__ import annotations

import ctypes as c

D, I, L, P = c.c_double, c.c_int32, c.c_int64, c.c_void_p
