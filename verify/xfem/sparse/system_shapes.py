"""Shapes that a linear solver checks: compiled loops check no bounds."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from verify.xfem.errors import XfemError
from verify.xfem.given_arrays import check_floats

__all__ = ["check_blocks", "checked_load", "checked_start", "largest_entry"]

_Floats = NDArray[np.float64]


def check_blocks(blocks: _Floats, count: int, size: int) -> None:
    """Check nodal blocks (B, d, d) of a matrix.

    Raises
    ------
    XfemError
        If their shape or type is another.
    """
    check_floats("blocks", blocks, (count, size, size))


def checked_load(load: ArrayLike, nodes: int, size: int) -> _Floats:
    """Right-hand side as a float array (N, d) without gaps.

    Raises
    ------
    XfemError
        If its shape is another, or a number is not finite.
    """
    return _checked(load, "right-hand side", nodes, size)


def checked_start(start: ArrayLike, nodes: int, size: int) -> _Floats:
    """First guess as a float array (N, d) without gaps; errors as of a right-hand side."""
    return _checked(start, "first guess", nodes, size)


def _checked(values: ArrayLike, name: str, nodes: int, size: int) -> _Floats:
    found = np.ascontiguousarray(values, dtype=float)
    if found.shape != (nodes, size):
        raise XfemError(f"{name} of shape {found.shape}; expected {(nodes, size)}")
    # one pass that allocates nothing tells, but of numbers whose squares overflow
    if not np.vdot(found, found) < np.inf and not largest_entry(found) < np.inf:
        first = int(np.argmin(np.isfinite(found).all(axis=1)))
        raise XfemError(f"the {name} is not finite, first at unknown node {first}")
    return found


def largest_entry(values: _Floats) -> float:
    """Largest absolute value, not a number if one is not; nothing is allocated."""
    return float(max(values.max(initial=0.0), -values.min(initial=0.0)))
