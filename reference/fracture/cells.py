"""A finite element field at quadrature points of cells: gradients, stress, and the force it bears.

The stress of a mixed solution has the pressure that its displacement determines. The force per
volume that balances the stress is the body force less the inertia.
"""

from collections.abc import Callable
from functools import partial
from itertools import combinations
from math import factorial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import cg

from reference.exact.solution import Hooke
from verify.errors import InputError
from verify.geometry.simplices import unit_rule
from verify.scene import Material
from verify.solution import Solution

Array = NDArray[np.float64]
# Gauss points per direction of the collapsed square or cube: exact to degree 10 in the plane and
# 4 in space, where a tube has a hundred times the cells of a ring
_ORDER = {2: 6, 3: 3}
_EDGES = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]  # of VTK; the first three in the plane
MIXED = "displacement and pressure"  # what a solution's note on its unknowns says
Force = Array | Callable[[Array], Array] | None


class CellGradients(NamedTuple):
    """Values at the q quadrature points of m cells.

    Attributes
    ----------
    points : (m, q, d) array
        m.
    weights : (m, q) array
        Areas or volumes, m^d.
    gradient : (m, q, d, d) array
        ∂u_i/∂x_j.
    hats : (m, q, d + 1, d) array
        Gradients of the linear hat functions of the corners, 1/m.
    corner_shares : (q, d + 1) array
        Values of the hat functions.
    shape : (q, k) array
        Values of the shape functions of all nodes.
    """

    points: Array
    weights: Array
    gradient: Array
    hats: Array
    corner_shares: Array
    shape: Array


def cell_gradients(
    solution: Solution, cells: NDArray[np.int64], step: int = -1, order: int | None = None
) -> CellGradients:
    """Evaluate the gradient in some cells of a solution, isoparametric if it is quadratic.

    Parameters
    ----------
    solution : Solution
    cells : (m,) int array
        Which cells.
    step : int
        Which output time; default the last.
    order : int, optional
        Gauss points per direction of the collapsed square or cube.
    """
    d = solution.dimension
    nodes = solution.cells[cells]
    x, u = solution.points[nodes], solution.displacement[step][nodes]
    xi, weight = _rule(d, order or _ORDER[d])
    corner, corner_slope = _linear(xi)
    if solution.order == 1:  # one Jacobian for all points of a cell
        shape, corner_slope = corner, corner_slope[:1]
        slope = corner_slope
    else:
        shape, slope = _quadratic(xi)
    jacobian = np.einsum("qka,mki->mqia", slope, x)  # ∂x_i/∂ξ_a
    inverse = np.linalg.inv(jacobian)
    gradient = np.einsum("mqib,mqbj->mqij", np.einsum("qka,mki->mqia", slope, u), inverse)
    hats = np.einsum("qka,mqaj->mqkj", corner_slope, inverse)
    points = np.einsum("qk,mki->mqi", shape, x)
    gradient, hats = (
        np.broadcast_to(one, (*points.shape[:2], *one.shape[2:])) for one in (gradient, hats)
    )
    return CellGradients(
        points, np.abs(np.linalg.det(jacobian)) * weight, gradient, hats, corner, shape
    )


def _rule(dimension: int, order: int) -> tuple[Array, Array]:
    """Compute Gauss points of the square or cube collapsed onto the unit simplex."""
    s, w = unit_rule(order)
    grids = np.meshgrid(*[s] * dimension, indexing="ij")
    total = np.ones_like(grids[0])
    for k, factor in enumerate(np.meshgrid(*[w] * dimension, indexing="ij")):
        total = total * factor * (1 - grids[k]) ** (dimension - 1 - k)
    left, columns = np.ones_like(grids[0]), []
    for grid in grids:
        columns.append((left * grid).ravel())
        left = left * (1 - grid)
    return np.column_stack(columns), total.ravel()


def _linear(xi: Array) -> tuple[Array, Array]:
    n, d = xi.shape
    slope = np.vstack([-np.ones(d), np.eye(d)])
    shape = np.column_stack([1 - xi.sum(axis=1), xi])
    return shape, np.broadcast_to(slope, (n, d + 1, d))


def _quadratic(xi: Array) -> tuple[Array, Array]:
    """Compute VTK's order: corners, then the mid-nodes of the edges."""
    corner, slope = _linear(xi)
    d = xi.shape[1]
    ends = _EDGES[: len(list(combinations(range(d + 1), 2)))]
    shape = [corner[:, k] * (2 * corner[:, k] - 1) for k in range(d + 1)]
    shape += [4 * corner[:, i] * corner[:, j] for i, j in ends]
    slopes = [(4 * corner[:, k] - 1)[:, None] * slope[:, k] for k in range(d + 1)]
    slopes += [
        4 * (corner[:, i, None] * slope[:, j] + corner[:, j, None] * slope[:, i]) for i, j in ends
    ]
    return np.stack(shape, axis=1), np.stack(slopes, axis=1)


class NodalPressure:
    """Continuous linear pressures, p = λ div u in the mean with every one of them (Taylor–Hood).

    That is the equation by which `reference.elasticity` finds both, so that this is
    the pressure it found, though a solution keeps its displacement only. λ div u itself is off by
    far more where ν is near ½.

    Parameters
    ----------
    solution : Solution
        Quadratic, with straight edges.
    law : Hooke
    step : int
        Which output time; default the last.
    """

    def __init__(self, solution: Solution, law: Hooke, step: int = -1) -> None:
        d = solution.dimension
        corners, self._place = np.unique(solution.cells[:, : d + 1], return_inverse=True)
        self._place = self._place.reshape(-1, d + 1)
        edges = solution.points[solution.cells[:, 1 : d + 1]]
        edges = edges - solution.points[solution.cells[:, :1]]
        inverse = np.linalg.inv(edges.swapaxes(1, 2))
        # in a straight cell div u is linear: its values at the corners, times the mass below
        slope = _quadratic(np.vstack([np.zeros(d), np.eye(d)]))[1]
        moved = inverse @ solution.displacement[step][solution.cells].swapaxes(1, 2)
        divergence = moved.reshape(len(moved), -1) @ slope.transpose(2, 1, 0).reshape(-1, d + 1)
        ones = np.ones((d + 1, d + 1)) + np.eye(d + 1)
        mass = np.abs(np.linalg.det(edges))[:, None, None] * (ones / factorial(d + 2))
        shares = law.lame * (mass @ divergence[:, :, None])
        right = np.bincount(self._place.ravel(), shares.ravel(), len(corners))
        rows = np.broadcast_to(self._place[:, :, None], mass.shape)
        matrix = sparse.csr_matrix((mass.ravel(), (rows.ravel(), rows.swapaxes(1, 2).ravel())))
        # a mass in units of its diagonal has a condition number of at most 10: some 30 iterations
        jacobi = sparse.diags_array(1 / matrix.diagonal())
        self._values, failed = cg(matrix, right, rtol=1e-12, maxiter=1000, M=jacobi)
        if failed:
            raise RuntimeError("the pressure of a mixed solution was not found: are cells flat?")

    def stress(self, law: Hooke, cells: NDArray[np.int64], at: CellGradients) -> Array:
        """Compute the stress (m, q, d, d) at the quadrature points of some cells, Pa."""
        deviatoric = Hooke(0.0, law.shear, law.dimension).stress(at.gradient)
        pressure = self._values[self._place[cells]] @ at.corner_shares.T
        return deviatoric + pressure[..., None, None] * np.eye(law.dimension)


Stresses = Callable[[NDArray[np.int64], CellGradients], Array]


def stress_of(solution: Solution, law: Hooke, step: int = -1) -> Stresses:
    """Give the stress (m, q, d, d) at points of cells: with a pressure if the solution has one."""
    if solution.notes.get("unknowns") == MIXED:
        return partial(NodalPressure(solution, law, step).stress, law)
    return lambda _cells, at: law.stress(at.gradient)


NetForce = Callable[[NDArray[np.int64], CellGradients], Array]


def net_force(
    solution: Solution,
    material: Material,
    body_force: Force = None,
    drag: float = 0.0,
    step: int = -1,
) -> NetForce | None:
    """Give −div σ = f − ρ (ü + α u̇) at the quadrature points of cells, N/m³; None where it is 0.

    In a domain integral inertia is a force like any other: while a crack stands still, neither the
    singular fields nor what the integral tends to at its tip know of it.

    Parameters
    ----------
    solution : Solution
        One with velocities is in motion, and must carry accelerations.
    material : Material
    body_force : (d,) array or callable, optional
        f, N/m³, or its values (n, d) at points (n, d).
    drag : float
        α, Rayleigh's damping by the mass, 1/s.
    step : int
        Which output time; default the last.

    Raises
    ------
    InputError
        If a field in motion carries no accelerations, or its material has no density.
    """

    def given(at: CellGradients) -> Array:
        if callable(body_force):
            points = at.points.reshape(-1, solution.dimension)
            return np.reshape(body_force(points), at.points.shape)
        return np.broadcast_to(0.0 if body_force is None else body_force, at.points.shape)

    if solution.velocity is None and solution.acceleration is None:
        return None if body_force is None else lambda _cells, at: given(at)
    if solution.acceleration is None or (drag and solution.velocity is None):
        raise InputError(
            "the solution is in motion and carries no accelerations: its inertia is not known"
        )
    density = material.density
    if density is None:
        raise InputError("a field in motion of a material without a density")
    rate = solution.acceleration[step]
    if drag:
        assert solution.velocity is not None
        rate = rate + drag * solution.velocity[step]

    def force(cells: NDArray[np.int64], at: CellGradients) -> Array:
        return given(at) - density * (at.shape @ rate[solution.cells[cells]])

    return force
