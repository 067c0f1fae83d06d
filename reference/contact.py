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
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import nnls
from scipy.sparse import coo_array, csr_array, diags_array, kron

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
        # what each facet adds to each pressure: shares of the jumps at its nodes
        self._shape = len(self.pairs), space.node_points.size
        self._facet, i = np.nonzero(hats > 0.0)
        self._row = number[self._facet, i]
        self._shares = (shares * sizes[:, None, None])[self._facet, i]
        self._facing, self._normals = facing[self._facet], normals[self._facet]
        along = self._shares[..., None] * self._normals[:, None]
        columns = self._facing[..., None] * d + np.arange(d)
        rows = self._row[:, None, None, None]
        self.gaps = _entries(np.stack([along, -along], axis=2), rows, columns, self._shape)
        weights = (hats * sizes[:, None])[hats > 0.0]
        self.weights = np.bincount(row.ravel(), weights, minlength=len(self.pairs))
        self.points = space.node_points[self.pairs[:, 0]]

    def opened(self, displacement: Array) -> Array:
        """Compute weighted gaps (m,) at a displacement (k,)."""
        return np.asarray(self.gaps @ displacement)

    def slopes(self, before: Array, after: Array) -> csr_array:
        """Return G (m, k): by its transpose pressures act on nodes, in a step between two (k,)."""
        del before, after  # normals do not turn
        return self.gaps

    def compliance(self, solve: Callable[[Array], Array], gaps: csr_array | None = None) -> Array:
        """Return S (m, m): the weighted gaps that unit pressures make, m² or m³ per Pa.

        Parameters
        ----------
        solve : function of (k, c) arrays
            Gives displacements, zero where held, of columns of nodal forces.
        gaps : (m, k) csr_array, optional
            By default of undeformed normals.
        """
        gaps = self.gaps if gaps is None else gaps
        blocks = range(0, len(self.weights), _BLOCK)
        columns = [solve(gaps[i : i + _BLOCK].toarray().T) for i in blocks]
        found = gaps @ np.hstack(columns) if columns else np.zeros((0, 0))
        return np.asarray(0.5 * (found + found.T))

    def pressed(self, gaps: Array, compliance: Array, leader: NDArray[np.int64]) -> Array:
        """Return pressures (m,), Pa; none where nodes are tied.

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
        return found


class TurningContact(FaceContact):
    """Gaps along normals that turn with the faces, at finite rotation.

    F is the mean deformation gradient, by their corners, of the cells that have a node of a facet:
    a tiny facet turns with its surroundings. Its deformed normal is along F⁻ᵀN. So a jump D has
    the gap μ·FᵀD with μ = y/s, y = (FᵀF)⁻¹N, s = √(N·y), functions of FᵀF and FᵀD. A discrete
    gradient by these gives forces that turn nothing. Their work in a step is pressure times change
    of the gap (O. Gonzalez, Comput. Methods Appl. Mech. Engrg. 190, 2000). `slopes` with the same
    displacement twice is the derivative of the gaps.
    """

    def __init__(self, space: ConformingSpace, held: NDArray[np.int32]) -> None:
        super().__init__(space, held)
        mesh, d, count = space.mesh, space.dimension, len(self._facet)
        points, corners = mesh.points[mesh.cells], space.cell_nodes[:, : d + 1]
        slopes = np.linalg.inv(points[:, 1:] - points[:, :1])  # (c, d, d), of corners 1…
        slopes = np.concatenate([-slopes.sum(axis=2, keepdims=True), slopes], axis=2)
        each = np.arange(corners.size).reshape(corners.shape)
        ones, cell, nodes = np.ones(corners.size), each // (d + 1), len(space.node_points)
        of_cells = _entries(
            slopes, cell[:, None] * d + np.arange(d)[:, None],
            np.broadcast_to(corners[:, None], slopes.shape), (len(corners) * d, nodes),
        )  # fmt: skip
        has = coo_array((ones, (corners.ravel(), cell.ravel())), shape=(nodes, len(corners)))
        beside = self._facing.reshape(count, -1)
        row = np.broadcast_to(np.arange(count)[:, None], beside.shape)
        around = _entries(np.ones(beside.shape), row, beside, (count, nodes)) @ has.tocsr()
        around.data[:] = measures(points)[around.indices]
        around = diags_array(1.0 / around.sum(axis=1)) @ around
        # give Fᵀ − I (p d d,) and D (p d,) of displacements (k,)
        self._mean = kron(kron(around, np.eye(d)) @ of_cells, np.eye(d)).tocsr()
        shares = np.stack([self._shares, -self._shares], axis=2).reshape(count, -1)
        self._jump = kron(_entries(shares, row, beside, (count, nodes)), np.eye(d)).tocsr()

    def _at(self, displacement: Array) -> tuple[Array, ...]:
        """Find F (p, d, d), D (p, d), (FᵀF)⁻¹ (p, d, d), y (p, d) and s (p, 1)."""
        d = self._normals.shape[1]
        F = np.eye(d) + np.swapaxes((self._mean @ displacement).reshape(-1, d, d), 1, 2)
        inverse = np.linalg.inv(np.swapaxes(F, 1, 2) @ F)
        y = np.einsum("pkl,pl->pk", inverse, self._normals)
        s = np.sqrt(np.sum(self._normals * y, axis=1, keepdims=True))
        return F, (self._jump @ displacement).reshape(-1, d), inverse, y, s

    def opened(self, displacement: Array) -> Array:
        """Compute weighted gaps (m,) at a displacement (k,)."""
        F, D, _, y, s = self._at(displacement)
        gaps = np.einsum("pa,pak,pk->p", D, F, y / s)
        return np.bincount(self._row, gaps, minlength=self._shape[0])

    def slopes(self, before: Array, after: Array) -> csr_array:
        """Return G (m, k): times the change from one (k,) to another it is how gaps change."""
        (F0, D0, inverse0, y0, s0), (F1, D1, inverse1, y1, s1) = self._at(before), self._at(after)
        F, D, mu = 0.5 * (F0 + F1), 0.5 * (D0 + D1), 0.5 * (y0 / s0 + y1 / s1)
        along = 0.5 * (np.einsum("pak,pa->pk", F0, D0) + np.einsum("pak,pa->pk", F1, D1))
        # along · δμ = by_y · δy, with δy = −(F₁ᵀF₁)⁻¹ δ(FᵀF) y₀, and the same from the other end
        fall = 0.5 * np.sum(along * (y0 + y1), axis=1, keepdims=True) / (s0 * s1 * (s0 + s1))
        by_y = 0.5 * (1.0 / s0 + 1.0 / s1) * along - fall * self._normals
        form = np.einsum("pkl,pl,pm->pkm", inverse1, by_y, y0)
        form += np.einsum("pkl,pl,pm->pkm", inverse0, by_y, y1)
        by_F = np.einsum("pa,pk->pak", D, mu) - 0.5 * F @ (form + np.swapaxes(form, 1, 2))
        by_D = np.einsum("pak,pk->pa", F, mu)
        found = self._sums(np.swapaxes(by_F, 1, 2)) @ self._mean + self._sums(by_D) @ self._jump
        return csr_array(found)

    def turning(self, displacement: Array, pressures: Array) -> csr_array:
        """Return the second derivative (k, k) of pressures (m,) times gaps.

        n = Fμ turns by δn = −(1 − nn)F⁻ᵀδFᵀn. A gap changes by n·v, where v = δD − δF w with the
        slip w = F⁻¹(D − gn). Hence δ²g = 2 δn·v − g δn·δn.
        """
        F, D, _, y, s = self._at(displacement)
        n = np.einsum("pak,pk->pa", F, y / s)
        gap = np.sum(n * D, axis=1, keepdims=True)
        slip = np.linalg.solve(F, (D - gap * n)[..., None])[..., 0]
        away = np.linalg.inv(F).swapaxes(1, 2)
        away = away - n[..., None] * np.einsum("pa,pak->pk", n, away)[:, None]
        turn = _diagonal(-np.einsum("pak,pb->pakb", away, n)) @ self._mean
        step = np.einsum("ab,pk->pakb", np.eye(n.shape[1]), slip)
        step = self._jump - _diagonal(step) @ self._mean
        press, gaps = (np.repeat(one, n.shape[1]) for one in (pressures[self._row], 0.5 * gap))
        half = turn.T @ (diags_array(press) @ (step - diags_array(gaps) @ turn))
        return csr_array(half + half.T)

    def _sums(self, values: Array) -> csr_array:
        """Make the matrix (m, …) that sums products with values (p, …) over each pressure."""
        flat = values.reshape(len(values), -1)
        columns = np.arange(flat.size).reshape(flat.shape)
        rows = np.broadcast_to(self._row[:, None], flat.shape)
        return _entries(flat, rows, columns, (self._shape[0], flat.size))


def _diagonal(blocks: Array) -> csr_array:
    """Make the matrix of blocks (p, a, …) on its diagonal."""
    rows = np.arange(len(blocks) * blocks.shape[1]).reshape(len(blocks), -1, 1)
    flat = blocks.reshape(*blocks.shape[:2], -1)
    columns = np.arange(flat[:, 0].size).reshape(len(blocks), 1, -1)
    columns, shape = np.broadcast_to(columns, flat.shape), (rows.size, flat[:, 0].size)
    return _entries(flat, rows, columns, shape)


def _entries(values: Array, rows: Any, columns: Any, shape: tuple[int, int]) -> csr_array:
    """Make a matrix; entries at one place are summed."""
    rows = np.broadcast_to(rows, values.shape)
    return coo_array((values.ravel(), (rows.ravel(), columns.ravel())), shape=shape).tocsr()


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
