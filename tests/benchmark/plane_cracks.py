"""Straight cracks in a rectangle, cubic elements on a graded mesh: scikit-fem, numpy, scipy.

The second route of the plane scenes of the benchmark. It shares neither mesh generator nor
elements nor code with the reference: points on the cracks and around them, Delaunay's triangles,
halved towards every end (scikit-fem's red, green and blue refinement), nodes doubled on the cracks.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import skfem
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import Delaunay
from skfem.helpers import ddot, sym_grad, trace


@dataclass
class Answer:
    """A solved scene: basis and coefficients of the displacement, energy, Lamé's moduli."""

    basis: skfem.Basis
    u: np.ndarray
    energy: float
    moduli: tuple[float, float]


def solve(lower, upper, cracks, crossings, marks, held, young, poisson, size, grade):
    """Solve for the displacement `held(x, beside)` on the whole border, in plane strain.

    Parameters
    ----------
    lower, upper : (2,) arrays
        Corners of the body.
    cracks : list of (2, 2) arrays
        Both ends of each crack, which may lie on another crack.
    crossings, marks : lists of (2,) arrays
        Where cracks cross; places on cracks where openings are read.
    held : callable
        Displacement (n, 2) of points (n, 2).
    size : float
        Distance of the nodes of the first mesh.
    grade : float
        Elements are halved until they are smaller than `grade` times their distance from the
        nearest end or crossing, or than 1e-8 of the body
        (elements at an end act as if a crack were shorter by about their size).
    """
    cracks = [np.asarray(crack, dtype=float) for crack in cracks]
    mesh = _triangles(lower, upper, cracks, [*crossings, *marks], size)
    places = np.array([*(end for crack in cracks for end in crack), *crossings])
    least = 1e-8 * np.max(np.subtract(upper, lower))
    while len(large := _too_large(mesh, places, grade, least)):
        mesh = mesh.refined(large)
    mesh = _opened(mesh, cracks)
    lame = young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    shear = young / (2 * (1 + poisson))
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTriP3()), intorder=4)

    @skfem.BilinearForm
    def stiffness(u, v, _):
        strain = sym_grad(u)
        return lame * trace(strain) * trace(sym_grad(v)) + 2 * shear * ddot(strain, sym_grad(v))

    matrix = stiffness.assemble(basis)
    border = mesh.facets_satisfying(
        lambda x: (
            np.isclose(x[0], lower[0])
            | np.isclose(x[0], upper[0])
            | np.isclose(x[1], lower[1])
            | np.isclose(x[1], upper[1])
        )
    )
    dofs = basis.get_dofs(border).all()
    values = held(basis.doflocs[:, dofs].T)
    known = np.zeros(basis.N)
    # a location is that of one component, and which is told by the order within a node or an edge
    component = np.zeros(basis.N, dtype=int)
    for table in (basis.nodal_dofs, basis.facet_dofs, basis.interior_dofs):
        for row, numbers in enumerate(table):
            component[numbers] = row % 2
    known[dofs] = values[np.arange(len(dofs)), component[dofs]]
    u = skfem.solve(*skfem.condense(matrix, x=known, D=dofs))
    return Answer(basis, u, 0.5 * float(u @ (matrix @ u)), (lame, shear))


def opening(answer, place, normal):
    """Normal opening at a node on a crack, whose normal points to the positive side."""
    mesh = answer.basis.mesh
    jump = 0.0
    for node in _nodes_at(mesh, place):
        around = np.flatnonzero((mesh.t == node).any(axis=0))
        offset = mesh.p[:, mesh.t[:, around]].mean(axis=(1, 2)) - place
        sign = np.sign(offset @ normal)
        jump += sign * answer.u[answer.basis.nodal_dofs[:, node]] @ normal
    return float(jump)


def intensity(answer, tip, ahead, radius):
    """K_I and K_II at an end of a crack from the interaction integral over a disc of `radius`.

    The weight falls from one to zero between a fifth of the radius and the radius. `ahead` is the
    direction out of the crack; the crack is straight within the disc, its faces are free.
    """
    lame, shear = answer.moduli
    kolosov = 1 + 2 * shear / (lame + shear)
    turn = np.array([ahead, [-ahead[1], ahead[0]]])
    corners = answer.basis.mesh.p[:, answer.basis.mesh.t] - np.reshape(tip, (2, 1, 1))
    near = np.flatnonzero(np.linalg.norm(corners, axis=0).min(axis=0) < radius)
    basis = skfem.Basis(answer.basis.mesh, answer.basis.elem, intorder=10, elements=near)
    x = np.einsum("ai,icq->acq", turn, basis.global_coordinates() - np.reshape(tip, (2, 1, 1)))
    slope = np.einsum("ai,ijcq,bj->abcq", turn, basis.interpolate(answer.u).grad, turn)
    r, theta = np.hypot(*x), np.arctan2(x[1], x[0])
    s = np.clip((r - 0.2 * radius) / (0.8 * radius), 0.0, 1.0)
    fall = -30 * s**2 * (1 - s) ** 2 / (0.8 * radius) * x / r
    stress = _stress(slope, lame, shear)
    factors = []
    for mode in (0, 1):
        w = _williams(r, theta, mode, kolosov, shear)
        other = _stress(w, lame, shear)
        flow = np.einsum("ijcq,icq->jcq", stress, w[:, 0]) + np.einsum(
            "ijcq,icq->jcq", other, slope[:, 0]
        )
        flow[0] -= np.einsum("ijcq,ijcq->cq", stress, w)
        # the weight falls outwards: minus its gradient
        total = float(np.sum(np.einsum("jcq,jcq->cq", flow, fall) * basis.dx))
        factors.append(total * 8 * shear / (2 * (kolosov + 1)))
    return tuple(factors)


def _stress(slope, lame, shear):
    pressure = lame * (slope[0, 0] + slope[1, 1]) * np.eye(2)[:, :, None, None]
    return pressure + shear * (slope + np.swapaxes(slope, 0, 1))


def _williams(r, theta, mode, kolosov, shear):
    """Gradient of the displacement of unit K, from φ = ω = √(z/2π) times 1 or −i."""
    factor = (1.0, -1j)[mode] / np.sqrt(2 * np.pi)
    root = np.sqrt(r) * np.exp(0.5j * theta)
    z = root**2
    phi_1, phi_2 = 0.5 * factor / root, -0.25 * factor / root**3
    omega_1 = 0.5 * factor / root.conj()
    d_z = kolosov * phi_1 - phi_1.conj()
    d_bar = -omega_1 + phi_1.conj() - (z - z.conj()) * phi_2.conj()
    d_x, d_y = (d_z + d_bar) / (2 * shear), 1j * (d_z - d_bar) / (2 * shear)
    return np.array([[d_x.real, d_y.real], [d_x.imag, d_y.imag]])


def _triangles(lower, upper, cracks, marks, size):
    """Delaunay's triangles of a grid and of points on the cracks, from which the grid keeps off."""
    counts = [int(np.ceil((b - a) / size)) for a, b in zip(lower, upper, strict=True)]
    axes = [np.linspace(a, b, n + 1) for a, b, n in zip(lower, upper, counts, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    on_cracks = []
    for start, end in cracks:
        fixed = [start, end]
        others = [*marks, *(p for crack in cracks for p in crack)]
        fixed += [p for p in others if _distance(p[None], (start, end))[0] < 1e-9]
        shares = np.unique(np.round([(p - start) @ (end - start) for p in fixed], 12))
        shares /= (end - start) @ (end - start)
        for low, high in pairwise(shares):
            pieces = max(1, round((high - low) * np.linalg.norm(end - start) / (0.7 * size)))
            steps = np.linspace(low, high, pieces + 1)
            on_cracks.append(start + steps[:, None] * (end - start))
    border = np.isin(grid[:, 0], axes[0][[0, -1]]) | np.isin(grid[:, 1], axes[1][[0, -1]])
    clear = np.min([_distance(grid, crack) for crack in cracks], axis=0) > 0.6 * size
    points = np.vstack([grid[border | clear], *on_cracks])
    points = points[np.unique(np.round(points, 10), axis=0, return_index=True)[1]]
    return skfem.MeshTri(points.T, np.sort(Delaunay(points).simplices.T, axis=0))


def _opened(mesh, cracks):
    """Double the nodes on the cracks: corners share a node if a way around it joins them."""
    middle = mesh.p[:, mesh.facets].mean(axis=1).T
    ends = mesh.p[:, mesh.facets].transpose(1, 2, 0)
    cut = np.zeros(len(middle), dtype=bool)
    for crack in cracks:
        cut |= np.all([_distance(p, crack) < 1e-12 for p in (middle, *ends)], axis=0)
    for start, end in cracks:
        covered = sum(
            np.linalg.norm(np.diff(ends[:, n], axis=0))
            for n in np.flatnonzero(cut)
            if _distance(middle[n : n + 1], (start, end))[0] < 1e-12
        )
        assert np.isclose(covered, np.linalg.norm(end - start)), "no edges all along a crack"
    tied = np.flatnonzero((mesh.f2t[1] >= 0) & ~cut)
    one, two = mesh.f2t[:, tied]
    i, j = np.hstack(
        [
            [3 * t + np.argmax(mesh.t[:, t] == node, axis=0) for t in (one, two)]
            for node in mesh.facets[:, tied]
        ]
    )
    graph = coo_matrix((np.ones(len(i)), (i, j)), shape=(3 * mesh.nelements,) * 2)
    count, node = connected_components(graph, directed=False)
    points = np.empty((2, count))
    points[:, node] = mesh.p[:, mesh.t.T.ravel()]
    return skfem.MeshTri(points, np.sort(node.reshape(-1, 3).T, axis=0))


def _too_large(mesh, places, grade, least):
    corners = mesh.p[:, mesh.t]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=0).max(axis=0)
    far = np.linalg.norm(corners.mean(axis=1).T[:, None] - places, axis=2).min(axis=1)
    return np.flatnonzero(edges > np.maximum(grade * far, least))


def _distance(points, crack):
    start, end = crack
    along = end - start
    share = np.clip((points - start) @ along / (along @ along), 0.0, 1.0)
    return np.linalg.norm(points - start - share[:, None] * along, axis=1)


def _nodes_at(mesh, place):
    return np.flatnonzero(np.linalg.norm(mesh.p.T - place, axis=1) < 1e-10)
