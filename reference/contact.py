"""Unilateral contact of the faces of cuts, without friction: gaps, pressures, the active set.

At the doubled nodes of a cut the gap is g = (u₊ − u₋)·n, and p is the pressure on its faces.
Neither is negative, and p g = 0. Pressures are linear over facets, with a value at each doubled
corner; the gap that belongs to one is weighted by its hat function. Of linear elements that is one
value per node (the rule of the corners). Of quadratic ones it is the stable pair P2/P1 (S. Hüeber,
M. Mair, B. Wohlmuth, Appl. Numer. Math. 54, 2005). Corners of a facet at a tip have the pressure of
its other corners, so that a uniform pressure is one. Where a cut bends, or two join, a node lies on
two faces and has a pressure on each: a gap at one does not pay for an overlap at the other.

With weighted gaps B u, forces on the nodes are Bᵀ p. The pressures solve a complementarity problem
of the dense compliance S = B A⁻¹ Bᵀ. A is the matrix of the body with its cuts open.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import nnls
from scipy.sparse import coo_array

from reference.nodal_algebra import facing_nodes, sides_of_cut
from reference.space import ConformingSpace
from verify.geometry.simplices import connected, measures, unit_normals

Array = NDArray[np.float64]
_BLOCK = 64  # right sides that are solved for at once
_MOST = 100  # changes of the active set, far more than any took
_ROUND_OFF = 1e-12  # of the largest gap without pressures
_SMOOTH = np.cos(np.pi / 6.0)  # a resolved arc turns by at most half a radian from facet to facet

# Integrals over a facet, per its size, of the hat of a corner times a quadratic function: of the
# corner, another corner, the middle of an edge at the corner, the middle of another edge
_HAT = {1: (1 / 6, 0.0, 1 / 3, 0.0), 2: (1 / 30, -1 / 60, 2 / 15, 1 / 15)}


class FaceContact:
    """Gaps of the faces of cuts of a body, and the places of their pressures.

    Parameters
    ----------
    space : ConformingSpace
        With all cuts open.
    held : (h,) int array
        Scalar displacements that supports prescribe. Corners whose gap is prescribed have no
        pressure of their own, like those at a tip.

    Attributes
    ----------
    points : (m, d) array
        Where the pressures are, m.
    weights : (m,) array
        Length or area of the cut that each stands for, m or m².
    gaps : (m, k) csr_array
        Weighted gaps of nodal displacements (k,): B.
    pairs : (m, 2) int array
        The nodes that face each other there; the same on several faces at a bend.
    """

    def __init__(self, space: ConformingSpace, held: NDArray[np.int32]) -> None:
        mesh, d = space.mesh, space.dimension
        cell, opposite = sides_of_cut(space.mesh)[0]
        facing, corners = facing_nodes(space), mesh.realised_cut
        normals, sizes = unit_normals(corners), measures(corners)
        inward = mesh.points[mesh.cells[cell, opposite]] - corners[:, 0]
        normals *= np.sign(np.sum(normals * inward, axis=1))[:, None]  # to the first side
        free = np.ones(space.node_points.shape)
        free.ravel()[held] = 0.0
        moves = np.abs(free[facing] * normals[:, None, None]).max(axis=(2, 3)) > _ROUND_OFF
        moves &= facing[:, :, 0] != facing[:, :, 1]
        shares, hats = _shares(space, facing, moves)
        pairs = np.sort(facing, axis=2)
        faces = np.broadcast_to(_faces(pairs, normals)[:, None], hats.shape)
        keys = np.column_stack([pairs[hats > 0.0], faces[hats > 0.0]])
        found, row = np.unique(keys, axis=0, return_inverse=True)
        self.pairs = found[:, :2]
        number = np.full(hats.shape, -1)
        number[hats > 0.0] = row.ravel()
        facet, i, j = np.nonzero(shares)
        size = (shares * sizes[:, None, None])[facet, i, j]
        which, along = number[facet, i], size[:, None] * normals[facet]
        columns = facing[facet, j][:, :, None] * d + np.arange(d)
        values = np.stack([along, -along], axis=1)
        rows = np.broadcast_to(which[:, None, None], values.shape)
        shape = (len(self.pairs), space.node_points.size)
        entries = coo_array((values.ravel(), (rows.ravel(), columns.ravel())), shape=shape)
        self.gaps = entries.tocsr()
        weights = (hats * sizes[:, None])[hats > 0.0]
        self.weights = np.bincount(row.ravel(), weights, minlength=len(self.pairs))
        self.points = space.node_points[self.pairs[:, 0]]

    def compliance(self, solve: Callable[[Array], Array]) -> Array:
        """Return S (m, m): the weighted gaps that unit pressures make, m² or m³ per Pa.

        Parameters
        ----------
        solve : function of (k, c) arrays
            Gives displacements, zero where held, of columns of nodal forces.
        """
        blocks = range(0, len(self.weights), _BLOCK)
        columns = [solve(self.gaps[i : i + _BLOCK].toarray().T) for i in blocks]
        found = self.gaps @ np.hstack(columns) if columns else np.zeros((0, 0))
        return np.asarray(0.5 * (found + found.T))

    def pressed(
        self, gaps: Array, compliance: Array, leader: NDArray[np.int64]
    ) -> tuple[Array, Array]:
        """Return pressures (m,), Pa, and their nodal forces (k,), N; none where nodes are tied.

        Parameters
        ----------
        gaps : (m,) array
            Weighted gaps without pressures.
        compliance : (m, m) array
        leader : (n,) int array
            The node that leads the group of each node.
        """
        apart = np.flatnonzero(leader[self.pairs[:, 0]] != leader[self.pairs[:, 1]])
        found = np.zeros(len(self.weights))
        found[apart] = pressures(compliance[np.ix_(apart, apart)], gaps[apart])[0]
        return found, np.asarray(self.gaps.T @ found)


def _faces(pairs: NDArray[np.int64], normals: Array) -> NDArray[np.int64]:
    """Return the smooth face (f,) of each facet; `pairs` (f, q, 2) say which facets touch."""
    count, of_each, _ = pairs.shape
    _, at = np.unique(pairs.reshape(-1, 2), axis=0, return_inverse=True)
    facets = np.repeat(np.arange(count), of_each)
    touch = coo_array((np.ones(at.size), (facets, at.ravel()))).tocsr()
    one, other = (touch @ touch.T).nonzero()
    smooth = np.abs(np.sum(normals[one] * normals[other], axis=1)) > _SMOOTH
    return connected(count, one[smooth], other[smooth])


def _shares(
    space: ConformingSpace, facing: NDArray[np.int64], moves: NDArray[np.bool_]
) -> tuple[Array, Array]:
    """Compute integrals (f, q, q) of pressures times functions of nodes, and of pressures (f, q).

    Per size of the facet. Corners whose gap is prescribed, not `moves` (f, q), give their hat to
    the other corners of the facet.
    """
    ends = space.edge_ends[facing[:, :, 0]]
    own = facing[:, :, 0]
    is_corner = ends[:, :, 0] == ends[:, :, 1]
    k = space.mesh.cell_dimension  # corners of a facet
    touches = (ends[:, None, :, :] == own[:, :, None, None]).any(axis=3)
    same = np.eye(facing.shape[1], dtype=bool)[None]
    if space.degree == 1:
        shares = np.where(same, 1.0 / k, 0.0) * np.ones((len(facing), 1, 1))
    else:
        here, other, beside, off = _HAT[k - 1]
        at_corner = np.where(same, here, other)
        at_middle = np.where(touches, beside, off)
        shares = np.where(is_corner[:, None, :], at_corner, at_middle)
    shares = np.where(is_corner[:, :, None], shares, 0.0)
    hats = is_corner / k
    loose = is_corner & moves
    loose |= moves & ~loose.any(axis=1, keepdims=True)  # middles of edges, where no corner is
    count = loose.sum(axis=1)
    given = np.where(loose, 1.0 / np.maximum(count, 1)[:, None], 0.0)
    tips = is_corner & ~loose
    shares = np.where(loose[:, :, None], shares, 0.0) + given[:, :, None] * np.sum(
        shares * tips[:, :, None], axis=1, keepdims=True
    )
    hats = np.where(loose, hats, 0.0) + given * np.sum(hats * tips, axis=1, keepdims=True)
    return shares, hats


def pressures(compliance: Array, gaps: Array) -> tuple[Array, int]:
    """Solve p ≥ 0, g = gaps + S p ≥ 0, p·g = 0 by the primal–dual active set.

    It ends at a set that gives itself (M. Hintermüller, K. Ito, K. Kunisch, SIAM J. Optim. 13,
    2002). Should it cycle, the same problem is one of least squares with non-negative unknowns.

    Parameters
    ----------
    compliance : (m, m) array
        S, symmetric and positive definite.
    gaps : (m,) array
        Without pressures.

    Returns
    -------
    pressures : (m,) array
    iterations : int
    """
    scale = 1.0 / np.sqrt(np.diag(compliance))
    matrix, start = scale[:, None] * compliance * scale, scale * gaps
    found, least = np.zeros_like(start), -_ROUND_OFF * np.abs(start).max(initial=0.0)
    active = start < least
    for count in range(1, _MOST + 1):
        found = np.zeros_like(start)
        if active.any():
            factor = cho_factor(matrix[np.ix_(active, active)])
            found[active] = cho_solve(factor, -start[active])
        after = np.where(active, found > 0.0, start + matrix @ found < least)
        if (after == active).all():
            return scale * found, count
        active = after
    half = np.linalg.cholesky(matrix)
    found, _ = nnls(half.T, np.linalg.solve(half, -start))
    return scale * found, _MOST
