"""Strain energy of an exact solution in a polygon: computed, with the accuracy checked."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from reference.exact.field import Array, ExactField
from verify.errors import InputError
from verify.scene import Polygon, Rectangle, Scene

Density = Callable[[Array], Array]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)
_TOLERANCE = 1e-13  # of ∫ |t| |u|
_HALVINGS = 60
_MOST_PANELS = 20000
_INWARD = 1e-7  # of the body's size: how far inside the outline `near` is


def outline_of(body: Array | Scene) -> Array:
    """Corners (k, 2) of a polygonal body, counter-clockwise.

    Raises
    ------
    InputError
        If the body is not a rectangle or a polygon.
    """
    if isinstance(body, Scene):
        if not isinstance(body.geometry, Rectangle | Polygon):
            raise InputError(
                f"exact strain energy of a geometry of kind '{body.geometry.kind}'; "
                "expected rectangle or polygon"
            )
        body = body.geometry.outline()
    corners = np.asarray(body, dtype=float)
    return corners if _signed_area(corners) > 0 else corners[::-1]


def boundary_work(solution: ExactField, outline: Array) -> float:
    """Half the work of the tractions on a closed polygon (counter-clockwise), J/m.

    Faces of cuts are free of traction in all solutions here and do no work.
    """
    size = float(np.ptp(outline, axis=0).max())
    densities = []
    for corners, direction in solution.smooth_parts(outline):
        for a, b in pairwise(np.vstack([corners, corners[:1]])):
            stops = [0.0, *sorted(solution.kinks(a, b)), 1.0]
            for start, end in pairwise(stops):
                p, q = a + start * (b - a), a + end * (b - a)
                if (p != q).any():
                    densities.append(_work_density(solution, p, q, size, direction))
    panels = np.linspace(0.0, 1.0, 9)
    scale = sum(float(_gauss(bound, panels[:-1], panels[1:]).sum()) for _, bound in densities)
    return 0.5 * sum(_adaptive(work, panels, _TOLERANCE * scale) for work, _ in densities)


def elastic_energy(solution: ExactField, outline: Array) -> float:
    """Half the integral of stress times strain over a polygon, J/m, for smooth sides.

    Each side's polygon is a signed sum of triangles: the field of a side is smooth beyond it.
    """
    known = None
    for order in (12, 20, 32, 48, 64):
        value = sum(
            _fan_energy(solution, corners, direction, order)
            for corners, direction in solution.smooth_parts(outline)
        )
        if known is not None and abs(value - known) <= 1e-12 * abs(value):
            return value
        known = value
    raise InputError(
        "the exact solution varies too quickly over the body for its energy to be integrated"
    )


def _work_density(
    solution: ExactField, a: Array, b: Array, size: float, direction: Array | None
) -> tuple[Density, Density]:
    """Give t·u and |t| |u| along the edge from a to b as functions of its parameter in [0, 1].

    The second sets the tolerance: where t·u cancels to zero it leaves its round-off behind.
    """
    length = float(np.linalg.norm(b - a))
    normal = np.array([b[1] - a[1], a[0] - b[0]]) / length
    inward = -normal * _INWARD * size if direction is None else direction

    def both(t: Array) -> tuple[Array, Array]:
        points = a + t[:, None] * (b - a)
        near = points + inward
        return solution.stress(points, near) @ normal, solution.displacement(points, near)

    def work(t: Array) -> Array:
        traction, u = both(t)
        return length * np.asarray(np.sum(traction * u, axis=1))

    def bound(t: Array) -> Array:
        traction, u = both(t)
        return length * np.asarray(np.linalg.norm(traction, axis=1) * np.linalg.norm(u, axis=1))

    return work, bound


def _adaptive(density: Density, panels: Array, tolerance: float) -> float:
    """∫ density over [0, 1]: Gauss points on panels that are halved until two sums agree."""
    starts, ends = panels[:-1], panels[1:]
    coarse = _gauss(density, starts, ends)
    total = 0.0
    for _ in range(_HALVINGS):
        middles = 0.5 * (starts + ends)
        left, right = _gauss(density, starts, middles), _gauss(density, middles, ends)
        settled = np.abs(left + right - coarse) <= tolerance
        total += float((left + right)[settled].sum())
        if settled.all():
            break
        coarse = np.concatenate([left[~settled], right[~settled]])
        starts, ends = (
            np.concatenate([starts[~settled], middles[~settled]]),
            np.concatenate([middles[~settled], ends[~settled]]),
        )
        if len(starts) > _MOST_PANELS:
            raise InputError("the exact solution varies too quickly along the outline")
    else:
        total += float(coarse.sum())  # around a tip on the outline, 2⁻⁶⁰ of an edge
    return total


def _gauss(density: Density, starts: Array, ends: Array) -> Array:
    half = 0.5 * (ends - starts)
    t = 0.5 * (starts + ends)[:, None] + half[:, None] * _NODES
    values: Array = density(t.ravel()).reshape(t.shape) @ _WEIGHTS * half
    return values


def _fan_energy(solution: ExactField, corners: Array, direction: Array | None, order: int) -> float:
    nodes, weights = np.polynomial.legendre.leggauss(order)
    x, w = 0.5 * (nodes + 1), 0.5 * weights
    # the square collapsed onto the triangle with corners 0, a, b
    a_share = np.outer(x, 1 - x).ravel()
    b_share = np.outer(x, x).ravel()
    weight = np.outer(w * x, w).ravel()
    total = 0.0
    for a, b in pairwise(corners[1:] - corners[0]):
        points = corners[0] + np.outer(a_share, a) + np.outer(b_share, b)
        near = None if direction is None else points + direction
        gradient = solution.gradient(points, near)
        density = 0.5 * np.sum(solution.law.stress(gradient) * gradient, axis=(1, 2))
        total += float(a[0] * b[1] - a[1] * b[0]) * float(density @ weight)
    return total


def _signed_area(corners: Array) -> float:
    x, y = (corners - corners[0]).T
    return float(0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
