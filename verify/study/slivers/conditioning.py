"""Condition numbers, conjugate-gradient iterations and compliance of a body with slivers.

Everything comes from one inverse of the stiffness in side-wise unknowns, scaled by its diagonal
beforehand: that scaling removes the slivers, so that the smallest eigenvalues of every basis
and scaling are exact down to ε = 1e-12, where those of the matrix itself are round-off. Where a
body is so slender that the scaled matrix is singular to round-off, nothing is said.
"""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, solve_triangular
from scipy.sparse import csr_array, identity, kron

from verify.study.slivers.bodies import SweptBody, soft
from verify.xfem.bases import transformation
from verify.xfem.errors import XfemError
from verify.xfem.loads import body_force
from verify.xfem.sparsity import body_pattern
from verify.xfem.stiffness import LinearStiffness
from verify.xfem.virtual import VirtualMesh

__all__ = ["BASES", "SCALINGS", "HeldStiffness", "stiffness_matrix"]

BASES = ("side-wise", "shifted", "heaviside")
SCALINGS = ("raw", "Jacobi", "nodal blocks")
_ITERATIONS, _TOLERANCE = 3000, 1e-10
_TRUSTED = 1e13  # condition number up to which the smallest eigenvalue has two digits and more
_Floats = NDArray[np.float64]


def stiffness_matrix(body: SweptBody) -> csr_array:
    """(N d, N d) linear stiffness, with the ghost penalty if there is one."""
    virtual: VirtualMesh = body.virtual
    pattern = body_pattern(virtual)
    blocks = LinearStiffness(virtual, soft(body.dimension)).assemble(pattern)
    matrix = csr_array(pattern.matrix(blocks))
    if body.ghost is not None:
        matrix = csr_array(matrix + kron(body.ghost.matrix, identity(body.dimension)))
    return matrix


class HeldStiffness:
    """Stiffness K of a body clamped at both faces across its cut, and K⁻¹, both dense.

    Parameters
    ----------
    body : SweptBody
    """

    def __init__(self, body: SweptBody) -> None:
        self.body = body
        self._free = np.flatnonzero(~body.held.ravel())
        self._K = stiffness_matrix(body).toarray()[np.ix_(self._free, self._free)]
        scale = 1.0 / np.sqrt(np.diag(self._K))
        scaled = scale[:, None] * self._K * scale
        least, *_, largest = np.linalg.eigvalsh(scaled)
        self._is_known = bool(least * _TRUSTED > largest)
        self._inverse = np.full_like(scaled, np.nan)
        if self._is_known:
            self._inverse = scale[:, None] * np.linalg.inv(scaled) * scale
        self._cache: dict[str, tuple[_Floats, _Floats, _Floats, NDArray[np.int64]]] = {}

    def in_basis(self, basis: str) -> tuple[_Floats, _Floats, _Floats, NDArray[np.int64]]:
        """Stiffness, its inverse, a load, and the node of each unknown, in another basis.

        Raises
        ------
        XfemError
            If the basis does not exist on this body.
        """
        if basis not in self._cache:
            self._cache[basis] = self._changed(basis)
        return self._cache[basis]

    def condition_number(self, basis: str, scaling: str) -> float:
        """λ_max/λ_min of the stiffness, both to round-off of a well-scaled matrix.

        Raises
        ------
        XfemError
            If the basis does not exist on this body, or scaling leaves the matrix singular to
            round-off.
        """
        self._check_known()
        K, inverse, _, node = self.in_basis(basis)
        root = _root(K, scaling, node)
        scaled = _both_sides(K, root)
        largest = np.linalg.eigvalsh(scaled)[-1]
        smallest = 1.0 / np.linalg.eigvalsh(_symmetric(root.T @ inverse @ root))[-1]
        return float(largest / smallest)

    def iterations(self, basis: str, scaling: str) -> tuple[int, float]:
        """Count iterations to a residual of 1e-10 under gravity; also the residual reached."""
        K, _, load, node = self.in_basis(basis)
        root = _root(K, scaling, node)
        return _conjugate_gradients(_both_sides(K, root), solve_triangular(root, load, lower=True))

    @cached_property
    def compliance(self) -> float:
        """Displacement per unit force across the cut, at the centroid of a smallest piece.

        The worst among the pieces of up to twice the smallest volume: which one of several equal
        ones is smallest is up to round-off.

        Raises
        ------
        XfemError
            If scaling leaves the matrix singular to round-off.
        """
        self._check_known()
        body, before = self.body, self.body.untreated
        small = np.flatnonzero(before.volumes <= 2.0 * before.volumes.min())
        shape = before.shape_integrals[small] / before.volumes[small, None]
        rows = np.repeat(np.arange(len(small))[:, None], shape.shape[1], axis=1)
        spread = csr_array(
            (shape.ravel(), (rows.ravel(), before.cells[small].ravel())),
            shape=(len(small), before.node_count),
        )
        nodal = (spread @ body.extension).toarray()
        axis = self._free % body.dimension == body.dimension - 1
        force = nodal[:, self._free[axis] // body.dimension]
        inverse = self._inverse[np.ix_(axis, axis)]
        return float(np.einsum("pi,ij,pj->p", force, inverse, force).max())

    def _check_known(self) -> None:
        if not self._is_known:
            raise XfemError(
                f"condition number above {_TRUSTED:.0e} after scaling by the diagonal: what "
                "depends on the smallest eigenvalue is round-off"
            )

    def _changed(self, basis: str) -> tuple[_Floats, _Floats, _Floats, NDArray[np.int64]]:
        body, dim = self.body, self.body.dimension
        load = body_force(body.virtual, -np.eye(dim)[-1]).ravel()[self._free]
        if basis == "side-wise":
            return self._K, self._inverse, load, self._free // dim
        T = transformation(body.virtual, basis).toarray()  # type: ignore[arg-type]
        # supports fix all unknowns of a node, so that free ones change among themselves
        nodes = len(body.virtual.mesh.points)
        own = np.concatenate([np.arange(nodes), body.virtual.enriched_nodes])
        rows = ~body.held[:, 0]
        columns = ~body.held[:nodes, 0][own]
        T = np.kron(T[np.ix_(rows, columns)], np.eye(dim))
        back = np.linalg.inv(T)
        node = np.repeat(own[columns], dim)
        return T.T @ self._K @ T, back @ self._inverse @ back.T, T.T @ load, node


def _root(K: _Floats, scaling: str, node: NDArray[np.int64]) -> _Floats:
    """Lower triangular L of the scaling L⁻¹ K L⁻ᵀ; blocks are all unknowns of one number."""
    if scaling == "raw":
        return np.eye(len(K))
    if scaling == "Jacobi":
        return np.diag(np.sqrt(np.diag(K)))
    if scaling != "nodal blocks":
        raise ValueError(f"scaling '{scaling}'; expected one of {', '.join(SCALINGS)}")
    starts = np.flatnonzero(np.diff(node, prepend=-1))
    parts = [slice(a, b) for a, b in zip(starts, [*starts[1:], len(node)], strict=True)]
    return np.asarray(block_diag(*(np.linalg.cholesky(K[p, p]) for p in parts)))


def _both_sides(K: _Floats, root: _Floats) -> _Floats:
    half = solve_triangular(root, K, lower=True)
    return _symmetric(solve_triangular(root, half.T, lower=True))


def _symmetric(matrix: _Floats) -> _Floats:
    return 0.5 * (matrix + matrix.T)


def _conjugate_gradients(K: _Floats, load: _Floats) -> tuple[int, float]:
    x = np.zeros_like(load)
    residual = load.copy()
    direction = residual.copy()
    square = start = float(residual @ residual)
    for iteration in range(1, _ITERATIONS + 1):
        image = K @ direction
        step = square / float(direction @ image)
        x += step * direction
        residual -= step * image
        before, square = square, float(residual @ residual)
        if square <= _TOLERANCE**2 * start:
            return iteration, float(np.sqrt(square / start))
        direction = residual + square / before * direction
    return _ITERATIONS, float(np.sqrt(square / start))
