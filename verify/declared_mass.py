"""Mass that a solver moves with, on the nodes of its solution: none, a word, a vector, a matrix.

`CONSISTENT` says that it is ∫ρ N_i N_j of the solution's own field. A vector has the mass of each
node; a sparse matrix what couples nodes too, as the mass of phantom nodes does that is expressed by
the nodes around them. All are of the body with all its cuts open, the same at all times and for
every component.
"""

from typing import Any

import numpy as np

from verify.errors import InputError
from verify.handed_over import check_field

CONSISTENT = "consistent"
_SYMMETRIC = 1e-9  # of the largest entry


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
