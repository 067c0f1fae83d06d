"""C8 from its page: two halves with a wave in each, quadratic elements of scikit-fem.

Each half is convex, so Delaunay's simplices of points in it and on its sides fill it; the cut is
one of its sides and stays free. The body force is differentiated from the field, not taken over.
"""

from itertools import product

import numpy as np
import skfem
from scipy.spatial import Delaunay
from skfem.helpers import ddot, dot, sym_grad, trace

YOUNG, POISSON = 1.0, 0.3
LAME = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
SHEAR = YOUNG / (2 * (1 + POISSON))
ETA = LAME / (LAME + 2 * SHEAR)

# rows (A, k along s..., phase in degrees) of U along the cut and last V
WAVES = {
    2: ([[0.06, 2.1, 20], [-0.05, 1.7, -65]], [[-0.07, 1.6, 75], [0.04, 2.3, 15]]),
    3: (
        [[0.06, 1.2, -0.7, 20], [-0.05, 0.8, 1.5, -65], [0.08, -1.1, 0.9, 110]],
        [[-0.07, 1.6, 0.4, 75], [0.04, -1.3, 1.1, 15], [-0.06, 0.5, -1.7, -130]],
    ),
}


def strain_energy(dimension, epsilon, cells):
    """Energy of both halves on `cells` elements along a side of the body."""
    origin, axes = frame(dimension, epsilon)
    return sum(
        half(dimension, origin, axes, side, rows, cells)
        for side, rows in zip((1, -1), WAVES[dimension], strict=True)
    )


def frame(dimension, epsilon):
    """A place on the cut, and its axes: along it, and last its normal."""
    if dimension == 2:
        along = np.array([3.0, 1.0]) / np.sqrt(10)
        return np.array([0.5, 0.5 + epsilon / 32]), np.array([along, [-along[1], along[0]]])
    normal, first = np.ones(3) / np.sqrt(3), np.array([1.0, -1.0, 0.0]) / np.sqrt(2)
    axes = np.array([first, np.cross(normal, first), normal])
    return np.full(3, 0.5 + epsilon / 24), axes


def field(points, origin, axes, rows):
    """Displacement (d, ...) at points (d, ...), which may be complex."""
    s = np.tensordot(axes, points - origin.reshape(-1, *[1] * (points.ndim - 1)), 1)
    along, t = range(len(s) - 1), s[-1]

    def wave(row, slope=None):
        amplitude, *k, degrees = row
        angle = sum(k[a] * s[a] for a in along) + np.deg2rad(degrees)
        return amplitude * (np.sin(angle) if slope is None else k[slope] * np.cos(angle))

    local = [wave(rows[a]) - t * wave(rows[-1], a) for a in along]
    local.append(wave(rows[-1]) - ETA * t * sum(wave(rows[a], a) for a in along))
    return np.tensordot(axes.T, np.array(local), 1)


def body_force(points, *of_field):
    """−div σ: gradients by a complex step, the divergence by central differences."""
    d = len(points)
    unit = np.eye(d).reshape(d, d, *[1] * (points.ndim - 1))

    def stress(x):
        slope = np.array([field(x + 1e-30j * e, *of_field).imag / 1e-30 for e in unit])
        identity = np.eye(d).reshape(d, d, *[1] * (points.ndim - 1))
        return LAME * np.einsum("ii...", slope) * identity + SHEAR * (slope + slope.swapaxes(0, 1))

    step = 1e-4
    return -sum(
        (stress(points + step * e)[i] - stress(points - step * e)[i]) / (2 * step)
        for i, e in enumerate(unit)
    )


def half(dimension, origin, axes, side, rows, cells):
    """Energy of one half."""
    mesh = fill(origin, side * axes[-1], cells)
    scalar = skfem.ElementTriP2() if dimension == 2 else skfem.ElementTetP2()
    basis = skfem.Basis(mesh, skfem.ElementVector(scalar), intorder=5)

    @skfem.BilinearForm
    def stiffness(u, v, _):
        strain = sym_grad(u)
        return LAME * trace(strain) * trace(sym_grad(v)) + 2 * SHEAR * ddot(strain, sym_grad(v))

    @skfem.LinearForm
    def load(v, w):
        return dot(body_force(w.x, origin, axes, rows), v)

    matrix, force = stiffness.assemble(basis), load.assemble(basis)
    outer = mesh.facets_satisfying(
        lambda x: np.any((x < 1e-9) | (x > 1 - 1e-9), axis=0), boundaries_only=True
    )
    held = basis.get_dofs(outer)
    known = np.zeros(basis.N)
    exact = field(basis.doflocs, origin, axes, rows)
    for component in range(dimension):
        dofs = held.all(f"u^{component + 1}")
        known[dofs] = exact[component, dofs]
    u = skfem.solve(*skfem.condense(matrix, force, x=known, D=held.all()))
    return 0.5 * float(u @ (matrix @ u))


def fill(origin, normal, cells):
    """Simplices of the part of the unit body beyond the plane, as many along a side as `cells`."""
    d, ticks = len(origin), np.linspace(0.0, 1.0, cells + 1)
    lattice = np.array(list(product(ticks, repeat=d)))
    inside = lattice[(lattice - origin) @ normal > 0.35 / cells * np.abs(normal).max()]
    corners = (lattice - origin) @ normal > 0
    on_plane = [inside]
    for axis in range(d):
        # where the lines of the lattice meet the plane
        feet = lattice[lattice[:, axis] == 0.0]
        feet[:, axis] = -((feet - origin) @ normal) / normal[axis]
        on_plane.append(feet[(feet[:, axis] >= 0.0) & (feet[:, axis] <= 1.0)])
    hull = lattice[corners & np.isin(lattice, (0.0, 1.0)).all(axis=1)]
    # off the lattice, along the sides that they lie on: cospherical points make flat simplices
    free = ~np.isin(inside, (0.0, 1.0))
    moved = inside + free * np.random.default_rng(1).uniform(-0.15, 0.15, inside.shape) / cells
    points = np.vstack([moved, *on_plane[1:], hull])
    points = points[np.unique(np.round(points, 9), axis=0, return_index=True)[1]]
    simplices = Delaunay(points).simplices
    edges = points[simplices[:, 1:]] - points[simplices[:, :1]]
    simplices = simplices[np.abs(np.linalg.det(edges)) > 1e-7 / cells**d]
    kind = skfem.MeshTri if d == 2 else skfem.MeshTet
    mesh = kind(points.T, np.sort(simplices.T, axis=0))
    return mesh.remove_unused_nodes() if hasattr(mesh, "remove_unused_nodes") else mesh


def fall_of_the_corner(epsilon):
    """Fall after 0.5 s of a corner that nothing holds: one linear triangle, trapezoidal rule."""
    leg, gravity, step, density = epsilon / 8, 9.8, 0.01, 1000.0
    x = np.array([[1.0, 1.0], [1.0 - leg, 1.0], [1.0, 1.0 - leg]])
    slope = np.linalg.inv(np.column_stack([np.ones(3), x]))[1:]
    area = leg**2 / 2
    lame, shear = 1e4 * LAME, 1e4 * SHEAR
    strain = np.zeros((3, 6))
    strain[0, ::2], strain[1, 1::2], strain[2, ::2], strain[2, 1::2] = (*slope, slope[1], slope[0])
    law = np.array([[lame + 2 * shear, lame, 0], [lame, lame + 2 * shear, 0], [0, 0, shear]])
    stiffness = area * strain.T @ law @ strain
    mass = density * area / 12 * np.kron(np.ones((3, 3)) + np.eye(3), np.eye(2))
    pull = mass @ np.tile([0.0, -gravity], 3)
    u, v = np.zeros(6), np.zeros(6)
    a = np.linalg.solve(mass, pull)
    for _ in range(50):
        ahead = u + step * v + step**2 / 4 * a
        a_new = np.linalg.solve(mass + step**2 / 4 * stiffness, pull - stiffness @ ahead)
        u, v, a = ahead + step**2 / 4 * a_new, v + step / 2 * (a + a_new), a_new
    return float(u[1::2].mean())
