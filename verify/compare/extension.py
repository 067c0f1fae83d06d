"""Smooth fields on a body that have given values where it is held.

An affine field is a velocity that every linear method can have, whatever it does at its cuts. So
what of the values is a rigid motion, then what is affine, is taken exactly; only the rest is
harmonic in the body, in one piece across all cuts, as it is while they are closed.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from verify.compare.locate import ROUND_OFF
from verify.compare.mass import assembled
from verify.compare.simplices import EDGES, cells_of, simplex_rule
from verify.errors import InputError
from verify.solution import Solution

Array = NDArray[np.float64]

_NOTHING = 1e-9  # of the largest value: an affine field that fits so well is the field


@dataclass
class Extension:
    """Fields of the nodes of a solution by their values where it is held.

    Parameters
    ----------
    solution : Solution
    held : (n, d) bool array
        Which components of which nodes have values.
    in_layer : bool
        Whether what is not affine ends in the cells at what is held; else it is harmonic.

    Attributes
    ----------
    is_affine : bool
        Whether all values so far were affine where it is held, so that nothing was harmonic.
    """

    solution: Solution
    held: NDArray[np.bool_]
    in_layer: bool = False
    is_affine: bool = field(default=True, init=False)

    def of(self, values: Array, points: Array) -> tuple[Array, bool]:
        """Extend values (n, d), of which those that are held count, to all nodes (n, d).

        Parameters
        ----------
        points : (n, d) array
            Places of the nodes in which rigid and affine fields are meant, m.

        Returns
        -------
        field : (n, d) array
        is_rigid : bool
            Whether it is a rigid motion, on which no stress does work.

        Raises
        ------
        InputError
            If nodes at one place, on the faces of a cut, have different values that are not affine.
        """
        held, largest = self.held, float(np.abs(values[self.held]).max(initial=0.0))
        found = np.zeros_like(values)
        if largest == 0.0:
            return found, True
        for is_rigid, modes_of in ((True, _rigid), (False, _affine)):
            modes = modes_of(points)
            matrix = modes[:, held].T
            share = np.linalg.lstsq(matrix, (values - found)[held], rcond=1e-12)[0]
            found += np.tensordot(share, modes, axes=1)
            if np.abs((values - found)[held]).max() <= _NOTHING * largest:
                return found, is_rigid
        rest = np.where(held, values - found, 0.0)
        if not self.in_layer:
            rest = self._harmonic(rest, _NOTHING * largest)
        return found + rest, False

    def _harmonic(self, rest: Array, nothing: float) -> Array:
        """Extend the rest (n, d) by Δw = 0, without flux where it is not held."""
        self.is_affine = False
        place, found = self._places, np.zeros_like(rest)
        for axis, (own, known) in enumerate(zip(self.held.T, self._solvers, strict=True)):
            values = np.zeros(place.max() + 1)
            values[place[own]] = rest[own, axis]
            if np.abs(values[place[own]] - rest[own, axis]).max(initial=0.0) > nothing:
                raise InputError("they move the faces of a cut apart")
            if values.any():
                values[~known.fixed] = -known.solve(known.coupling @ values[known.fixed])
            found[:, axis] = values[place]
        return found

    @cached_property
    def _places(self) -> NDArray[np.int64]:
        """Number (n,) of the place of each node: the copies on the faces of a cut share one."""
        points = self.solution.points
        near = 10 * ROUND_OFF * float(np.linalg.norm(np.ptp(points, axis=0)))
        pairs = cKDTree(points).query_pairs(near, output_type="ndarray")
        same = csr_array((np.ones(len(pairs)), pairs.T), shape=(len(points), len(points)))
        return np.asarray(connected_components(same, directed=False)[1], dtype=np.int64)

    @cached_property
    def _stiffness(self) -> csr_array:
        """∫ ∇N_i·∇N_j of the places."""
        solution = self.solution
        k, nodes = solution.cell_dimension, self._places[solution.cells]
        shape = cells_of(solution)
        local = np.zeros((*nodes.shape, nodes.shape[1]))
        for at, weight in zip(*simplex_rule(k, solution.order), strict=True):
            slopes = _slopes(at, shape.gradients, solution.order)
            local += (weight * shape.volume)[:, None, None] * (slopes @ np.swapaxes(slopes, 1, 2))
        matrix = assembled(local, nodes, int(self._places.max()) + 1)
        # a place of cells without volume alone has no equation
        alone = np.where(matrix.diagonal() > 0.0, 0.0, 1.0)
        return csr_array(matrix + diags_array(alone))

    @cached_property
    def _solvers(self) -> list["_Known"]:
        """For each component what is held, and the solver of the rest."""
        found: dict[bytes, _Known] = {}
        for own in self.held.T:
            if own.tobytes() not in found:
                fixed = np.zeros(self._places.max() + 1, dtype=bool)
                fixed[self._places[own]] = True
                rows, solve = self._stiffness[~fixed], None
                if own.any() and not fixed.all():
                    solve = splu(rows[:, ~fixed].tocsc()).solve
                found[own.tobytes()] = _Known(fixed, rows[:, fixed], solve)
        return [found[own.tobytes()] for own in self.held.T]


class _Known(NamedTuple):
    """Places (p,) that are held, what couples the others to them, and the solver of the others."""

    fixed: NDArray[np.bool_]
    coupling: csr_array
    solve: Any


def _rigid(points: Array) -> Array:
    """Return translations and rotations (q, n, d), all of size one."""
    n, d = points.shape
    turns = [(i, j) for i in range(d) for j in range(i)]
    modes = np.zeros((d + len(turns), n, d))
    away = _scaled(points)
    for i in range(d):
        modes[i, :, i] = 1.0
    for mode, (i, j) in zip(modes[d:], turns, strict=True):
        mode[:, i], mode[:, j] = away[:, j], -away[:, i]
    return modes


def _affine(points: Array) -> Array:
    """Fields (q, n, d) that are affine in the points."""
    n, d = points.shape
    away = np.column_stack([np.ones(n), _scaled(points)])
    modes = np.zeros((d, d + 1, n, d))
    for i in range(d):
        modes[i, :, :, i] = away.T
    return modes.reshape(-1, n, d)


def _scaled(points: Array) -> Array:
    away = points - points.mean(axis=0)
    scaled: Array = away / max(float(np.abs(away).max()), 1e-300)
    return scaled


def _slopes(at: Array, gradients: Array, order: int) -> Array:
    """Gradients (m, nodes, d) of the shape functions of cells at barycentric coordinates (k+1,)."""
    if order == 1:
        return gradients
    corners = (4.0 * at - 1.0)[:, None] * gradients
    edges = [
        4.0 * (at[a] * gradients[:, b] + at[b] * gradients[:, a]) for a, b in EDGES[len(at) - 1]
    ]
    return np.concatenate([corners, np.stack(edges, axis=1)], axis=1)
