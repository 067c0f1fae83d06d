"""Memory that is there before the first step needs it.

A page costs some microseconds when it is touched first. The arrays of a body that has been cut fill
some hundred, which is a millisecond in the step that makes them. So room for all of them is taken,
touched and given back beforehand: glibc's allocator keeps blocks up to the size of the largest that
has ever been given back to it (malloc(3), M_MMAP_THRESHOLD), and hands the same pages out again.
With an allocator that does otherwise, nothing is gained or lost.
"""

import numpy as np

__all__ = ["touch_memory"]

_ROOM = 24 << 20  # bytes; the allocator's bound does not rise beyond 32 MiB
_PAGE = 4096


def touch_memory() -> None:
    """Let the allocator hold room for the arrays of a cut body, its pages touched."""
    np.empty(_ROOM + _PAGE, dtype=np.uint8)  # given back at once, which raises the bound
    room = np.empty(_ROOM, dtype=np.uint8)
    room[::_PAGE] = 0
