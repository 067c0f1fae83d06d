"""Kernels: the value of a P1 or P2 field in given cells, and squares of what fields differ by."""

import numpy as np
from numba import njit

from verify.compare.locate_kernels import Floats, Ints, axes_of


def evaluate_linear(
    points: Floats, found: Ints, origins: Floats, values: Floats, slopes: Floats
) -> Floats:
    """Return value (n, d) of u = u_0 + G (x - x_0), x_0 and u_0 those of the first corner."""
    result = np.empty(points.shape)
    _evaluate_linear(points, found, origins, values, slopes, axes_of(points.shape[1]), result)
    return result


@njit(cache=True)
def _evaluate_linear(points, found, origins, values, slopes, axes, result):
    d = len(axes)
    for i in range(points.shape[0]):
        cell = found[i]
        for c in range(d):
            value = values[cell, c]
            for a in range(d):
                value += slopes[cell, c, a] * (points[i, a] - origins[cell, a])
            result[i, c] = value


def evaluate_quadratic(
    points: Floats, found: Ints, nodes: Ints, values: Floats, corners: Floats, gradients: Floats
) -> tuple[Floats, Floats]:
    """Return value (n, d) and gradient (n, d, d) of a P2 field on straight-edged simplices."""
    n, d = points.shape
    u, grad = np.empty((n, d)), np.empty((n, d, d))
    axes, vertices = axes_of(d), axes_of(corners.shape[1])  # a triangle in space has three of each
    _evaluate_quadratic(points, found, nodes, values, corners, gradients, axes, vertices, u, grad)
    return u, grad


@njit(cache=True)
def _evaluate_quadratic(points, found, nodes, values, corners, gradients, axes, vertices, u, grad):
    d, count = len(axes), len(vertices)
    weight, slope = np.empty(count), np.empty(d)
    for i in range(points.shape[0]):
        cell = found[i]
        for k in range(count):
            weight[k] = 0.0
            for a in range(d):
                from_facet = points[i, a] - corners[cell, (k + 1) % count, a]
                weight[k] += gradients[cell, k, a] * from_facet
        for c in range(d):
            u[i, c] = 0.0
            for a in range(d):
                grad[i, c, a] = 0.0
        for k in range(count * (count + 1) // 2):
            if k < count:
                shape, factor = weight[k] * (2.0 * weight[k] - 1.0), 4.0 * weight[k] - 1.0
                for a in range(d):
                    slope[a] = factor * gradients[cell, k, a]
            else:  # VTK: edges 01 12 20, and of tetrahedra then 03 13 23
                edge = k - count
                p = edge if edge < 3 else edge - 3
                q = (edge + 1) % 3 if edge < 3 else 3
                shape = 4.0 * weight[p] * weight[q]
                for a in range(d):
                    both = weight[p] * gradients[cell, q, a] + weight[q] * gradients[cell, p, a]
                    slope[a] = 4.0 * both
            for c in range(d):
                value = values[nodes[cell, k], c]
                u[i, c] += shape * value
                for a in range(d):
                    grad[i, c, a] += slope[a] * value


def squares(values: Floats) -> Floats:
    """Sum (n,) of the squares of the entries of each of `values` (n, ...)."""
    found = np.empty(len(values))
    _squares(np.ascontiguousarray(values).reshape(len(values), -1), found)
    return found


@njit(cache=True)
def _squares(values, found):
    for i in range(values.shape[0]):
        found[i] = 0.0
        for c in range(values.shape[1]):
            found[i] += values[i, c] ** 2


def strain_squares(gradient: Floats) -> tuple[Floats, Floats]:
    """tr² ε (n,) and ε : ε (n,) of the strain ε of displacement gradients (n, d, d)."""
    trace2, square = np.empty(len(gradient)), np.empty(len(gradient))
    _strain_squares(np.ascontiguousarray(gradient), axes_of(gradient.shape[1]), trace2, square)
    return trace2, square


@njit(cache=True)
def _strain_squares(gradient, axes, trace2, square):
    for i in range(len(gradient)):
        trace = sheared = 0.0
        for a in axes:
            trace += gradient[i, a, a]
            sheared += 2.0 * gradient[i, a, a] ** 2
            for b in range(a):
                sheared += (gradient[i, a, b] + gradient[i, b, a]) ** 2
        trace2[i], square[i] = trace**2, 0.5 * sheared
