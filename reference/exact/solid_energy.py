"""Strain energy of an exact solution in a box, computed with the accuracy checked."""

from itertools import product

import numpy as np

from reference.exact.field import Array, ExactField
from verify.errors import InputError
from verify.scene import Box, Scene

_ORDERS = (12, 20, 32, 48, 80)
_TOLERANCE = 1e-11


def box_of(body: Array | Scene) -> Array:
    """Lower and upper corner (2, 3) of a box.

    Raises
    ------
    InputError
        If the body is not a box.
    """
    if isinstance(body, Scene):
        if not isinstance(body.geometry, Box):
            raise InputError(
                f"exact strain energy of a geometry of kind '{body.geometry.kind}'; expected box"
            )
        return np.array([body.geometry.lower, body.geometry.upper], dtype=float)
    corners = np.asarray(body, dtype=float)
    if corners.shape != (2, 3):
        raise InputError(f"a box of shape {corners.shape}; expected its two corners, (2, 3)")
    return corners


def surface_work(solution: ExactField, corners: Array) -> float:
    """Half the work of the tractions on the faces of a box, J, where the field is smooth there."""
    known = None
    for order in _ORDERS:
        value = 0.0
        for quad in _faces(corners):
            points, weights = _square_rule(quad, order)
            normal = np.cross(quad[1] - quad[0], quad[3] - quad[0])
            traction = solution.stress(points) @ (normal / np.linalg.norm(normal))
            value += 0.5 * float(np.sum(traction * solution.displacement(points), axis=1) @ weights)
        if known is not None and abs(value - known) <= _TOLERANCE * abs(value):
            return value
        known = value
    raise InputError(
        "the exact solution varies too quickly on the surface of the body for its energy to be "
        "integrated (does the crack reach it?)"
    )


def box_energy(solution: ExactField, corners: Array) -> float:
    """Half the integral of stress times strain over a box, J, smooth on each side of a plane.

    Each side is a signed sum of cones from a point of the plane over its faces: the field of a
    side is smooth beyond it, and the section itself has no volume below it.
    """
    plane = solution.cut_plane
    apex, normal = plane if plane is not None else (corners.mean(axis=0), np.array([0.0, 0.0, 1.0]))
    size = 10 * float(np.ptp(corners, axis=0).max()) + float(np.abs(corners - apex).max())
    known = None
    for order in _ORDERS[:-1]:
        value = 0.0
        for quad in _faces(corners):
            if plane is None:
                value += _cone_energy(solution, apex, quad, None, order)
                continue
            height = (quad - apex) @ normal
            for sign in (1.0, -1.0):
                part = _clip(quad, sign * height)
                value += _cone_energy(solution, apex, part, sign * size * normal, order)
        if known is not None and abs(value - known) <= _TOLERANCE * abs(value):
            return value
        known = value
    raise InputError(
        "the exact solution varies too quickly over the body for its energy to be integrated"
    )


def _faces(corners: Array) -> list[Array]:
    """Faces (4, 3) of a box, anticlockwise seen from outside."""
    faces = []
    for axis, side in product(range(3), (0, 1)):
        b, c = (axis + 1) % 3, (axis + 2) % 3
        ring = [(0, 0), (1, 0), (1, 1), (0, 1)] if side else [(0, 0), (0, 1), (1, 1), (1, 0)]
        quad = np.empty((4, 3))
        quad[:, axis] = corners[side, axis]
        quad[:, b] = [corners[i, b] for i, _ in ring]
        quad[:, c] = [corners[j, c] for _, j in ring]
        faces.append(quad)
    return faces


def _square_rule(quad: Array, order: int) -> tuple[Array, Array]:
    nodes, weights = np.polynomial.legendre.leggauss(order)
    x, w = 0.5 * (nodes + 1), 0.5 * weights
    u, v = quad[1] - quad[0], quad[3] - quad[0]
    points = quad[0] + np.repeat(x, order)[:, None] * u + np.tile(x, order)[:, None] * v
    return points, np.outer(w, w).ravel() * float(np.linalg.norm(np.cross(u, v)))


def _cone_energy(
    solution: ExactField, apex: Array, polygon: Array, towards: Array | None, order: int
) -> float:
    """Energy in the signed tetrahedra from the apex over a polygon."""
    nodes, weights = np.polynomial.legendre.leggauss(order)
    x, w = 0.5 * (nodes + 1), 0.5 * weights
    # the cube collapsed onto the tetrahedron 0, a, b, c
    r, s, t = (g.ravel() for g in np.meshgrid(x, x, x, indexing="ij"))
    weight = np.einsum("i,j,k->ijk", w * x**2, w * x, w).ravel()
    shares = np.column_stack([r * (1 - s), r * s * (1 - t), r * s * t])
    total = 0.0
    for k in range(1, len(polygon) - 1):
        edges = np.stack([polygon[0], polygon[k], polygon[k + 1]]) - apex
        volume = float(np.linalg.det(edges))
        if volume == 0.0:
            continue
        points = apex + shares @ edges
        gradient = solution.gradient(points, None if towards is None else points + towards)
        density = 0.5 * np.sum(solution.law.stress(gradient) * gradient, axis=(1, 2))
        total += volume * float(density @ weight)
    return total


def _clip(polygon: Array, height: Array) -> Array:
    """Part (k, 3) of a convex polygon with height ≥ 0."""
    kept = []
    for i in range(len(polygon)):
        j = (i + 1) % len(polygon)
        if height[i] >= 0:
            kept.append(polygon[i])
        if height[i] * height[j] < 0:
            share = height[i] / (height[i] - height[j])
            kept.append(polygon[i] + share * (polygon[j] - polygon[i]))
    return np.array(kept).reshape(-1, 3)
