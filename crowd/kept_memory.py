"""Memory of arrays that are gone, kept for the next ones.

The C library gives large blocks back to the system as soon as they are free, and the system clears each page of a new
one when it is first touched: 1 to 5 us for 4 kB, more than the arithmetic that fills it. A run makes and frees the same
arrays for every chunk of frames.
"""

from __future__ import annotations

import ctypes

# of glibc's <malloc.h>
M_TRIM_THRESHOLD, M_MMAP_MAX, M_ARENA_MAX = -1, -4, -8


def keep() -> bool:
    """Freed memory stays with this process from now on; False where the C library cannot be told.

    For programs that step a crowd and end, such as `crowd run`. Call before JAX's first array.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):
        return False
    # One heap: those of threads are cut into pieces of 64 MB, which are always given back.
    asked = ((M_MMAP_MAX, 0), (M_TRIM_THRESHOLD, 2**31 - 1), (M_ARENA_MAX, 1))
    return all([mallopt(what, value) for what, value in asked])
