"""Bodies with a cut, as the tests of corotation and motion need them."""

from typing import Any, NamedTuple

import numpy as np

from verify.xfem.cuts import Plane
from verify.xfem.element import isotropic
from verify.xfem.ghost_penalty import GhostPenalty
from verify.xfem.internal_force import InternalForce
from verify.xfem.linear_solvers import PLAIN
from verify.xfem.mass import Mass, side_wise_mass
from verify.xfem.mesh import SimplexMesh, box_mesh, rectangle_mesh
from verify.xfem.phantom import PhantomMesh, cut_mesh
from verify.xfem.slivers import treat_slivers

SOFT = 1e4  # Pa, the thesis' material
DENSITY = 1000.0  # kg/m³
GRAVITY = 9.8  # m/s²


def material(dim, young=SOFT):
    return isotropic(young, 0.3, "plane strain" if dim == 2 else "solid")


def cut_square(n=8, point=(0.5, 0.53), normal=(-1.0 / 3.0, 1.0)):
    return cut_mesh(rectangle_mesh((n, n)), [Plane(point, normal)])


def cut_cube(n=3, point=(0.5, 0.5, 0.5), normal=(-1.0, -2.0, 3.0)):
    return cut_mesh(box_mesh((n, n, n)), [Plane(point, normal)])


def cut_body(dim):
    return cut_square(4) if dim == 2 else cut_cube(2, (0.5, 0.53, 0.47))


def cut_membrane():
    flat = rectangle_mesh((4, 4))
    x, y = flat.points.T
    bent = SimplexMesh(np.stack([x, y, 0.3 * np.sin(3.0 * x)], axis=1), flat.cells)
    return cut_mesh(bent, [Plane((0.5, 0.53, 0.0), (0.3, 1.0, 0.0))])


class TreatedBody(NamedTuple):
    """A cut body whose slivers have been seen to."""

    phantom: PhantomMesh
    force: InternalForce
    mass: Mass
    slivers: Any


def treated_body(phantom, policy="merge", held=None):
    treated, report = treat_slivers(phantom, policy, supported=held)
    force = InternalForce(treated, material(phantom.mesh.dim))
    return TreatedBody(treated, force, side_wise_mass(treated, DENSITY), report)


def penalised(phantom, factor=0.01, kernels=PLAIN):
    stuff = material(phantom.mesh.dim)
    ghost = GhostPenalty(phantom, stuff, factor)
    force = InternalForce(phantom, stuff, kernels=kernels, ghost=ghost)
    return TreatedBody(phantom, force, ghost.mass(side_wise_mass(phantom, DENSITY), DENSITY), None)


def rotation(dim, angle, axis=(1.0, 2.0, -0.5)):
    """Rotation matrix by Rodrigues' formula."""
    if dim == 2:
        c, s = np.cos(angle), np.sin(angle)
        return np.array([[c, -s], [s, c]])
    n = np.asarray(axis) / np.linalg.norm(axis)
    K = np.array([[0.0, -n[2], n[1]], [n[2], 0.0, -n[0]], [-n[1], n[0], 0.0]])
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K


def shaken(mesh, seed, amount=0.2):
    """Inner nodes of a box moved at random: every element is cut in its own way."""
    random = np.random.default_rng(seed)
    points = mesh.points.copy()
    low, high = points.min(axis=0), points.max(axis=0)
    inner = ((points > low + 1e-9) & (points < high - 1e-9)).all(axis=1)
    size = np.linalg.norm(mesh.edge_vectors, axis=2).min()
    points[inner] += amount * size * random.uniform(-1.0, 1.0, (inner.sum(), mesh.space))
    return SimplexMesh(points, mesh.cells)
