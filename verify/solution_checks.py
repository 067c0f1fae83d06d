"""Checks of a solution as its solver returns it, so that a malformed one fails there, not later.

Shapes, types, and numbers that mean nothing: not finite, or so large that their squares are not;
sizes and times below zero. Whether an answer is right is not asked here.

The mass that a solver moves with, on the nodes of its solution, is none, a word, a vector or a
matrix. `CONSISTENT` says that it is ∫ρ N_i N_j of the solution's own field. A vector has the mass
of each node; a sparse matrix what couples nodes too, as the mass of phantom nodes does that is
expressed by the nodes around them. All are of the body with all its cuts open, the same at all
times and for every component.
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
CONSISTENT = "consistent"
_SYMMETRIC = 1e-9  # of the largest entry


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


def _is_matrix(mass: Any) -> bool:
    """Whether a mass is a sparse array, found without SciPy, which takes its time to import."""
    return hasattr(mass, "tocoo")


def check_mass(mass: Any, count: int) -> None:
    """Raise `InputError` if a declared mass is none of `count` nodes."""
    if mass is None or (isinstance(mass, str) and mass == CONSISTENT):
        return
    if isinstance(mass, str):
        raise InputError(f"mass '{mass}'; expected '{CONSISTENT}', numbers or a sparse matrix")
    if not _is_matrix(mass):
        check_field("mass", mass, (count,))
        return
    if mass.shape != (count, count):
        raise InputError(f"mass of shape {mass.shape}; expected {(count, count)}")
    entries = mass.tocoo()
    check_field("entries of the mass", entries.data, (None,))
    if np.abs((mass - mass.T).data).max(initial=0.0) > _SYMMETRIC * np.abs(entries.data).max():
        raise InputError("a mass that is not symmetric")


def plain_mass(mass: Any) -> Any:
    """Write a declared mass as plain values: of a matrix the entries on and above the diagonal."""
    if mass is None or isinstance(mass, str):
        return mass
    if not _is_matrix(mass):
        return np.asarray(mass, dtype=float).tolist()
    entries = mass.tocoo()
    upper = entries.row <= entries.col
    columns = {"rows": entries.row, "columns": entries.col, "values": entries.data}
    return {name: values[upper].tolist() for name, values in columns.items()}


def restored_mass(content: Any, count: int) -> Any:
    """Read what `plain_mass`, or another program, wrote of a mesh of `count` nodes.

    Raises
    ------
    InputError
        If it is nothing of the kind.
    """
    if content is None or isinstance(content, str):
        return content
    if isinstance(content, list):
        return np.asarray(content, dtype=float)
    if not isinstance(content, dict) or set(content) != {"rows", "columns", "values"}:
        kinds = f"'{CONSISTENT}', a list by node, or rows, columns and values"
        raise InputError(f"mass of type '{type(content).__name__}'; expected {kinds}")
    from scipy.sparse import csr_array

    rows, columns = (np.asarray(content[name], dtype=np.int64) for name in ("rows", "columns"))
    values = np.asarray(content["values"], dtype=float)
    if (rows > columns).any():
        raise InputError("mass has entries below its diagonal; expected those on and above it")
    off = rows < columns
    entries = (
        np.concatenate([values, values[off]]),
        (np.concatenate([rows, columns[off]]), np.concatenate([columns, rows[off]])),
    )
    return csr_array(entries, shape=(count, count))
