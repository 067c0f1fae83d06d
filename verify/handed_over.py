"""Faults of a solution where a solver hands it over, so that a wrong one fails there, not later.

Shapes, types, and numbers that mean nothing: what is not finite, or so large that its square is
not; sizes and times below zero. Whether an answer is right is not asked here.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.printable import shown

# squares of displacements are multiplied by moduli, summed, and squared again
_LARGEST = 1e100
_LONGEST = 200  # characters of a name
_LONGEST_NOTE = 10_000
_MOST_ENTRIES = 1000


def check_field(name: str, values: Any, shape: tuple[int | None, ...]) -> None:
    """Raise `InputError` if `values` are no floats of that `shape` that can be computed with.

    Parameters
    ----------
    name : str
        What they are called in the message.
    values : object
    shape : tuple
        Expected; None for a length that is free.
    """
    if not isinstance(values, np.ndarray) or isinstance(values, np.ma.MaskedArray):
        raise InputError(f"{name}: {_kind(values)}; expected an array of numbers")
    if values.dtype.kind not in "fiu":
        raise InputError(f"{name}: an array of {values.dtype}; expected numbers")
    if values.ndim != len(shape) or any(
        n not in (None, m) for n, m in zip(shape, values.shape, strict=True)
    ):
        wanted = str(shape).replace("None", "n")
        raise InputError(f"{name} of shape {values.shape}; expected {wanted}")
    if not np.isfinite(values).all():
        raise InputError(f"{name} has values that are not finite")
    if (largest := float(np.abs(values).max(initial=0.0))) > _LARGEST:
        text = f"{name} has {largest:.3g}; expected less than {_LARGEST:g}, which can be squared"
        raise InputError(text)


def check_vectors(name: str, values: Any, shapes: list[tuple[int, int]]) -> None:
    """Raise `InputError` if `values` are not (k, a, b) floats, with (a, b) in `shapes`, or none."""
    if isinstance(values, np.ndarray) and len(values) == 0:
        return
    check_field(name, values, (None, None, None))
    if values.shape[1:] not in shapes:
        wanted = " or ".join(f"(f, {a}, {b})" for a, b in shapes)
        raise InputError(f"{name} of shape {values.shape}; expected {wanted}")


def check_cells(points: NDArray[np.float64], cells: Any, widths: Mapping[int, str]) -> None:
    """Raise `InputError` if `cells` do not name `points`, or have no volume, all of them.

    Parameters
    ----------
    points : (n, d) array
    cells : object
    widths : mapping of int to str
        Nodes per cell that fit, and what such cells are called.
    """
    if not isinstance(cells, np.ndarray):
        raise InputError(f"cells: {_kind(cells)}; expected an array of node numbers")
    if cells.ndim != 2 or cells.shape[1] not in widths:
        wanted = " or ".join(f"(m, {k}) for {name}" for k, name in widths.items())
        raise InputError(f"cells of shape {cells.shape}; expected {wanted}")
    if cells.dtype.kind not in "iu":
        raise InputError(f"cells: an array of {cells.dtype}; expected whole numbers")
    if len(cells) == 0:
        raise InputError("a solution without cells")
    if cells.min() < 0 or cells.max() >= len(points):
        raise InputError(f"cell nodes outside 0..{len(points) - 1}")
    if not _any_volume(points, cells, 2 if widths[cells.shape[1]].startswith("tri") else 3):
        raise InputError("no cell has a volume; expected cells that cover the body")


def check_accounts(
    size: Any, unknowns: Any, timings: Any, iterations: Any, quantities: Any, notes: Any
) -> None:
    """Raise `InputError` if what a solver says of itself cannot be: negative, or no number."""
    if not _is_number(size) or not (np.isnan(size) or 0.0 < size < np.inf):
        raise InputError(f"size {shown(size)} m; expected a positive number, or nan if unknown")
    if not _is_count(unknowns):
        raise InputError(f"unknowns {shown(unknowns)}; expected a whole number from 0 on")
    for name, seconds in _entries("timings", timings):
        if not isinstance(seconds, list | tuple | np.ndarray) or not all(
            _is_number(t) and 0.0 <= t < np.inf for t in seconds
        ):
            text = f"timings '{name}': {shown(seconds)}; expected seconds, none of them negative"
            raise InputError(text)
    for name, count in _entries("iterations", iterations):
        if not _is_count(count):
            text = f"iterations '{name}': {shown(count)}; expected a whole number from 0 on"
            raise InputError(text)
    for name, value in _entries("quantities", quantities):
        if not _is_number(value) or not np.isfinite(value):
            raise InputError(f"quantities '{name}': {shown(value)}; expected a finite number")
    for name, text in _entries("notes", notes):
        if not isinstance(text, str) or len(text) > _LONGEST_NOTE:
            wanted = f"a text of at most {_LONGEST_NOTE} characters"
            raise InputError(f"notes '{name}': {shown(text)}; expected {wanted}")


def _entries(what: str, mapping: Any) -> list[tuple[str, Any]]:
    if not isinstance(mapping, Mapping) or len(mapping) > _MOST_ENTRIES:
        wanted = f"a mapping of at most {_MOST_ENTRIES} names"
        raise InputError(f"{what}: {_kind(mapping)}; expected {wanted}")
    for name in mapping:
        if not isinstance(name, str) or not name.isprintable() or not 0 < len(name) <= _LONGEST:
            wanted = f"a printable name of at most {_LONGEST} characters"
            raise InputError(f"{what}: {shown(name)}; expected {wanted}")
    return list(mapping.items())


def _any_volume(points: NDArray[np.float64], cells: NDArray[np.int64], dimension: int) -> bool:
    corners = points[cells[:, : dimension + 1]]
    edges = corners[:, 1:] - corners[:, :1]
    with np.errstate(over="ignore"):
        if edges.shape[1] == edges.shape[2]:
            return bool(np.linalg.det(edges).any())
        return bool(np.cross(edges[:, 0], edges[:, 1]).any())


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)


def _is_count(value: Any) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool) and bool(value >= 0)


def _kind(value: Any) -> str:
    return "None" if value is None else f"of type '{type(value).__name__}'"
