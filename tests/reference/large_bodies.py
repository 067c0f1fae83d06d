"""Bodies at large strain: spaces with cuts, supports that follow a path, strips bent exactly."""

import numpy as np
from scipy.spatial.transform import Rotation

from reference.large_strain import solve_large_strain
from reference.meshing import imprint_polygons, open_cut, structured_tetrahedra
from reference.meshing.imprint import imprint, structured_triangles
from reference.nodal_algebra import nodal_forces
from reference.space import conforming_space
from verify.scene import Material


def space_of(degree, counts, lower=(0.0,) * 3, upper=(1.0,) * 3, cuts=()):
    """Structured mesh of a rectangle or box in so many cells, with its cuts open."""
    d = len(counts)
    make, split = structured_triangles, imprint
    if d == 3:
        make, split = structured_tetrahedra, imprint_polygons
    mesh = make(lower[:d], upper[:d], counts)
    return conforming_space(open_cut(*split(*mesh, [np.array(c, float) for c in cuts])), degree)


def on_ends(space):
    y = space.node_points[:, 1]
    return (y < 1e-12) | (y > y.max() - 1e-12)


def solve(space, held, field, poisson=0.3, **parameters):
    """Equilibrium at E = 1 with nodes (n,) or components (n, d) held on a field of the factor."""
    plane = "strain" if space.dimension == 2 else None
    held = np.broadcast_to(held.reshape(len(held), -1), space.node_points.shape)
    return solve_large_strain(
        Material(young=1.0, poisson=poisson, plane=plane),
        space,
        np.flatnonzero(held).astype(np.int32),
        lambda factor: field(factor)[held],
        **parameters,
    )


def forces_of(space, load):
    """Nodal forces of a load, which gives the work of a test function."""
    import ufl

    return nodal_forces(load(ufl.TestFunction(space.function_space)), space)


def lame(poisson):
    return poisson / ((1 + poisson) * (1 - 2 * poisson)), 0.5 / (1 + poisson)


def turn(d, angle):
    """Rotation about (1, 2, −1) in space."""
    if d == 2:
        return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return Rotation.from_rotvec(angle * np.array([1.0, 2.0, -1.0]) / np.sqrt(6)).as_matrix()


def bent(height, curvature, poisson):
    """Radii r(X), and their slopes, of a strip |X| < height/2 bent with its faces free.

    ((2μ+λ) (r' − 1) + λ (κr − 1))' = κ (λ (r' − 1) + (2μ+λ) (κr − 1)): r = A cosh κX + B sinh κX +
    b/κ with b = 2 (λ+μ) / (λ+2μ).
    """
    lam, mu = lame(poisson)
    stiff = lam + 2 * mu
    b = 2 * (lam + mu) / stiff
    # faces free: stiff r' + λ κ r = 2 (λ + μ) at both
    x = curvature * height / 2
    c, s = np.cosh(x), np.sinh(x)
    free = 2 * (lam + mu) - lam * b
    rows = [[stiff * s + lam * c, stiff * c + lam * s], [-stiff * s + lam * c, stiff * c - lam * s]]
    A, B = np.linalg.solve(rows, [free, free]) / curvature

    def radius(X):
        return A * np.cosh(curvature * X) + B * np.sinh(curvature * X) + b / curvature

    def slope(X):
        return curvature * (A * np.sinh(curvature * X) + B * np.cosh(curvature * X))

    return radius, slope


def rolled(points, curvature, height, poisson=0.3):
    """Displacement (n, 2) of that strip, whose middle stays where it is at Y = 0."""
    if curvature == 0.0:
        return np.zeros_like(points)
    X, Y = points.T
    radius, _ = bent(height, curvature, poisson)
    r, angle = radius(X), curvature * Y
    return np.column_stack([r * np.cos(angle) - radius(0.0), r * np.sin(angle)]) - points
