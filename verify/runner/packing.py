"""A reference's solution in few bytes: what a bundle keeps of one level.

Fields are rounded to whole multiples of a power of two, far below what a reference knows. At the
middle of an edge, a quadratic field is kept as its difference from the mean of both ends: a small
number, and zero for the points of straight edges. Whole numbers are stored byte by byte, the lowest
bytes of all first, and compressed as one (LZMA). Points, cells and cuts come back bit by bit.
"""

import io
import json
import lzma
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.solution import ContactPressure, Regularisation, Solution
from verify.solution_checks import plain_mass, restored_mass

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# random digits below what a reference knows take half of the room: at rest eight are kept, in
# motion six: the best of those beside cases is known to 5e-6 of the displacement (C7)
BITS, BITS_IN_MOTION = 27, 20
# limit for what somebody else has packed: ours unpacks to some ten times its size
_MOST_TIMES, _LEAST = 200, 2**26
_FIELDS = ("displacement", "velocity", "acceleration")
_CONTACT = ("points", "weights", "pressure")
_ARRAYS = ("points", "cells", "cell_sides", "cut_facets", "mass", "contact", *_FIELDS)
_PLAIN = "plain"
# corners at the ends of the edges that the further nodes of a quadratic simplex stand on (VTK)
_ENDS = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))
_XZ = [{"id": lzma.FILTER_LZMA2, "preset": 9}]


def packed(solution: Solution, inertia: bool) -> bytes:
    """Pack a solution, its fields rounded; the same solution gives the same bytes.

    Parameters
    ----------
    solution : Solution
    inertia : bool
        Keep accelerations too, a third of a motion's numbers.
    """
    bits = BITS if len(solution.times) == 1 else BITS_IN_MOTION
    ends = _ends(solution.cells, solution.order, len(solution.points))
    arrays: dict[str, NDArray[Any]] = {"cells": _planes(np.diff(solution.cells, axis=0, prepend=0))}
    arrays["points"] = _planes(_bits(solution.points) - _bits(_means(solution.points, ends)))
    if solution.cell_sides is not None:
        arrays["cell_sides"] = _planes(solution.cell_sides)
    arrays["cut_facets"] = _planes(_bits(solution.cut_facets))
    for name in _FIELDS:
        if (values := getattr(solution, name)) is None or (name == _FIELDS[-1] and not inertia):
            continue
        largest = np.abs(values).max(axis=(1, 2))
        exponents = np.frexp(np.where(largest > 0.0, largest, 1.0))[1].astype(np.int64) - 1 - bits
        whole = np.round(np.ldexp(values, -exponents[:, None, None])).astype(np.int64)
        whole -= np.stack([_whole_means(one, ends) for one in whole])
        arrays[name], arrays[f"{name} exponents"] = _planes(whole), exponents
    if solution.contact is not None:
        for name in _CONTACT:
            arrays[f"contact {name}"] = _planes(_bits(getattr(solution.contact, name)))
    plain = {
        entry.name: getattr(solution, entry.name)
        for entry in fields(Solution)
        if entry.name not in _ARRAYS
    }
    plain |= {
        "shape": [*solution.points.shape, *solution.cells.shape],
        "facets": list(solution.cut_facets.shape),
        "times": solution.times.tolist(),
        "ledger": {n: np.asarray(v, dtype=float).tolist() for n, v in solution.ledger.items()},
        "regularisations": [vars(entry) for entry in solution.regularisations],
        "mass": plain_mass(solution.mass),
    }
    arrays[_PLAIN] = np.frombuffer(json.dumps(plain, sort_keys=True).encode(), np.uint8)
    together = io.BytesIO()
    for name, array in arrays.items():
        np.lib.format.write_array(together, np.array(name))
        np.lib.format.write_array(together, array)
    return lzma.compress(together.getvalue(), filters=_XZ)


def unpacked(data: bytes) -> Solution:
    """Return the solution that `packed` packed.

    Raises
    ------
    InputError
        If it is not one.
    """
    try:
        arrays = _read(data)
        plain = json.loads(arrays[_PLAIN].tobytes())
        n, d, m, k = plain.pop("shape")
        t, order = len(plain["times"]), plain["order"]
        cells = np.cumsum(_whole(arrays["cells"], (m, k)), axis=0)
        ends = _ends(cells, order, n)
        points = _from_ends(_whole(arrays["points"], (n, d)), ends)
        found: dict[str, Any] = {}
        for name in _FIELDS:
            if name in arrays:
                whole = _whole(arrays[name], (t, n, d))
                for one in whole:
                    one[ends[:, 0]] += _whole_means(one, ends)[ends[:, 0]]
                exponents = arrays[f"{name} exponents"]
                found[name] = np.ldexp(whole.astype(float), exponents[:, None, None])
        if "contact points" in arrays:
            shapes = ((-1, d), (-1,), (t, -1))
            found["contact"] = ContactPressure(
                *(
                    _whole(arrays[f"contact {name}"], shape).view(float)
                    for name, shape in zip(_CONTACT, shapes, strict=True)
                )
            )
        if "cell_sides" in arrays:
            found["cell_sides"] = _whole(arrays["cell_sides"], (m,))
        found["cut_facets"] = _whole(arrays["cut_facets"], plain.pop("facets")).view(float)
        found |= plain
        found |= {
            "times": np.array(plain["times"]),
            "ledger": {name: np.array(column) for name, column in plain["ledger"].items()},
            "regularisations": [Regularisation(**entry) for entry in plain["regularisations"]],
            "mass": restored_mass(plain["mass"], n),
        }
        return Solution(points=points, cells=cells, **found)
    except InputError:
        raise
    except Exception as error:
        text = f"not a packed solution ({type(error).__name__}: {error})"
        raise InputError(text) from None


def _read(data: bytes) -> dict[str, NDArray[Any]]:
    """Return the arrays by their names."""
    plain = lzma.LZMADecompressor()
    whole = plain.decompress(data, _MOST_TIMES * len(data) + _LEAST)
    if not plain.eof:
        raise InputError("not a packed solution (cut off, or far too large)")
    stream, arrays = io.BytesIO(whole), {}
    while stream.tell() < len(whole):
        name = str(np.lib.format.read_array(stream, allow_pickle=False))
        arrays[name] = np.lib.format.read_array(stream, allow_pickle=False)
    return arrays


def _ends(cells: Ints, order: int, count: int) -> Ints:
    """Return nodes in the middle of edges and the ends of their edges (e, 3), of `count` nodes."""
    corners = {3: 3, 6: 3, 4: 4, 10: 4}[cells.shape[1]]
    ends = np.full((count, 2), -1)
    if order == 2:
        for middle, (one, other) in enumerate(_ENDS[: cells.shape[1] - corners], corners):
            ends[cells[:, middle]] = cells[:, [one, other]]
    middles = np.flatnonzero(ends[:, 0] >= 0)
    return np.column_stack([middles, ends[middles]])


def _means(points: Floats, ends: Ints) -> Floats:
    """Return the mean of the ends of each edge, at its middle; elsewhere zero."""
    means = np.zeros_like(points)
    means[ends[:, 0]] = 0.5 * (points[ends[:, 1]] + points[ends[:, 2]])
    return means


def _whole_means(values: Ints, ends: Ints) -> Ints:
    """Return the same of whole numbers, rounded down."""
    means = np.zeros_like(values)
    means[ends[:, 0]] = (values[ends[:, 1]] + values[ends[:, 2]]) // 2
    return means


def _from_ends(differences: Ints, ends: Ints) -> Floats:
    """Return points from the differences of their bits."""
    points = differences.view(float)  # of corners, which have no mean
    bits = differences + _bits(_means(points, ends))
    return bits.view(float)


def _bits(values: Floats) -> Ints:
    return np.ascontiguousarray(values, dtype=float).view(np.int64)


def _planes(values: Ints) -> NDArray[np.uint8]:
    """Return the bytes (b, n) of whole numbers, lowest first, signs in the lowest bit.

    As many as the largest has.
    """
    flat = np.ascontiguousarray(values).ravel()
    unsigned = ((flat << 1) ^ (flat >> 63)).view(np.uint64)
    count = -(-int(unsigned.max(initial=0)).bit_length() // 8)
    return np.ascontiguousarray(unsigned.astype("<u8").view(np.uint8).reshape(-1, 8).T[:count])


def _whole(planes: NDArray[np.uint8], shape: tuple[int, ...]) -> Ints:
    """Return whole numbers of a shape from their bytes."""
    given = np.zeros((planes.shape[1], 8), dtype=np.uint8)
    given[:, : len(planes)] = planes.T
    unsigned = given.view("<u8").ravel().astype(np.uint64)
    whole = (unsigned >> np.uint64(1)).view(np.int64) ^ -(unsigned & np.uint64(1)).view(np.int64)
    return whole.reshape(shape)
