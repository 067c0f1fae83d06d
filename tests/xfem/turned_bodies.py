"""Random unstructured bodies with random cuts, and supports that turn their parts."""

from typing import NamedTuple

import numpy as np
from cut_bodies import isotropic, rotation
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from verify.xfem.cuts import Plane, Polyline
from verify.xfem.internal_force import InternalForce
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import PhantomMesh, cut_mesh

YOUNG, POISSON = 3e4, 0.42


class TurnedBody(NamedTuple):
    """A body cut in two: unknowns of the upper part, and held components."""

    phantom: PhantomMesh
    upper: NDArray[np.bool_]
    fixed: NDArray[np.bool_]

    @property
    def force(self) -> InternalForce:
        dim, space = self.phantom.mesh.dim, self.phantom.mesh.space
        kind = "solid" if dim == 3 else "plane strain" if space == 2 else "plane stress"
        return InternalForce(self.phantom, isotropic(YOUNG, POISSON, kind))


def random_mesh(seed: int, dim: int, across: int) -> SimplexMesh:
    """Delaunay cells of a box [0, 1.3] x [0, 1] (x [0, 0.8]) with random points inside."""
    random = np.random.default_rng(seed)
    size = np.array([1.3, 1.0, 0.8][:dim])
    counts = np.maximum(np.rint(size * across).astype(int), 2)
    grid = np.stack(
        np.meshgrid(*[np.linspace(0.0, 1.0, n + 1) for n in counts], indexing="ij"), axis=-1
    ).reshape(-1, dim)
    free = (grid > 0.0) & (grid < 1.0)  # points of a face stay in it, corners where they are
    grid = grid + np.where(free, random.uniform(-0.35, 0.35, grid.shape) / counts, 0.0)
    points = grid * size
    cells = Delaunay(points).simplices.astype(np.int64)
    edges = points[cells[:, 1:]] - points[cells[:, :1]]
    volumes = np.abs(np.linalg.det(edges))
    return SimplexMesh(points, cells[volumes > 1e-3 * volumes.mean()])


def turned_body(seed: int, dim: int, across: int, strip: bool = False) -> TurnedBody:
    """Random body with a random cut; seed 0 in the plane has that of the reported case.

    The lower 3 tenths are held, and the upper quarter is to be turned: boundary nodes, or with
    `strip` those of the top alone.
    """
    random = np.random.default_rng(1000 + seed)
    mesh = random_mesh(seed, dim, across)
    if dim == 3:
        point = [0.65, random.uniform(0.45, 0.6), 0.4]
        cuts = [Plane(point, [random.uniform(-0.2, 0.2), 1.0, random.uniform(-0.2, 0.2)])]
    elif seed == 0:
        cuts = [Polyline([[-0.1, 0.62], [0.5, 0.45], [0.9, 0.58], [1.4, 0.4]])]
    else:
        x = np.concatenate([[-0.1], np.sort(random.uniform(0.2, 1.1, 2)), [1.4]])
        cuts = [Polyline(np.column_stack([x, random.uniform(0.38, 0.67, 4)]))]
    phantom = cut_mesh(mesh, cuts)
    return _held(phantom, strip)


def turned_sheet(seed: int, across: int) -> TurnedBody:
    """A bent membrane in space with a random cut."""
    flat = random_mesh(seed, 2, across)
    x, y = flat.points.T
    mesh = SimplexMesh(np.column_stack([x, y, 0.1 * np.sin(3.0 * x)]), flat.cells)
    random = np.random.default_rng(1000 + seed)
    cut = Plane([0.65, 0.5, 0.0], [random.uniform(-0.2, 0.2), 1.0, 0.1])
    return _held(cut_mesh(mesh, [cut]), False)


def _held(phantom: PhantomMesh, strip: bool) -> TurnedBody:
    mesh, points = phantom.mesh, phantom.node_points
    on = np.zeros(len(mesh.points), dtype=bool)
    for cell, opposite in mesh.boundary_facets:
        on[np.delete(mesh.cells[cell], opposite)] = True
    upper = phantom.bodies == phantom.bodies[np.argmax(points[:, 1])]
    high = points[:, 1] == 1.0 if strip else points[:, 1] > 0.75
    held = on[phantom.node_parent] & np.where(upper, high, points[:, 1] < 0.3)
    return TurnedBody(phantom, upper, np.repeat(held[:, None], points.shape[1], axis=1))


def turn(body: TurnedBody, degrees: float, axis=(0.3, -0.5, 0.8), shift=0.2, stretch=0.0):
    """Path of displacements: the upper part stretched along x, turned about a place, and moved."""
    points, space = body.phantom.node_points, body.phantom.node_points.shape[1]
    centre = np.array([0.6, 0.5, 0.3][:space])
    along = np.zeros(space)
    along[0] = 1.0

    def path(share):
        Q = rotation(space, np.radians(degrees) * share, axis)
        arm = (points - centre) * (1.0 + stretch * share * along)
        moved = arm @ Q.T + centre + share * shift - points
        return np.where(body.upper[:, None], moved, 0.0)

    return path
