"""The compiler of the kernels: numba where it is installed; else they are plain Python.

A judge alone is installed without numba. What it would spend most of its time in has a form in
numpy, taken where `COMPILED` is false; the rest runs as it is written.
"""

from collections.abc import Callable
from typing import Any

try:
    from numba import njit

    COMPILED = True
except ModuleNotFoundError:
    COMPILED = False

    def njit(**how: Any) -> Callable[[Any], Any]:  # type: ignore[no-redef]
        """Leave a function as it is."""
        return lambda function: function


__all__ = ["COMPILED", "njit"]
