"""Derivatives of fields by differences, which know nothing of how the field is made."""

import numpy as np


def difference(field, points, h):
    """Central differences of order 4 at points (n, d); the last axis is the direction."""
    columns = []
    for step in h * np.eye(points.shape[1]):
        near, far = (field(points + k * step) - field(points - k * step) for k in (1, 2))
        columns.append((8 * near - far) / (12 * h))
    return np.stack(columns, axis=-1)


def check_equations(u, points):
    """Hold the gradient of an exact solution against its displacement, its stress to equilibrium.

    Truncation is h⁴ u⁽⁵⁾; some points lie next to a tip or with their stencil across the cut.
    """
    expected = difference(u.displacement, points, 1e-3)
    error = np.abs(u.gradient(points) - expected).max(axis=(1, 2)) / (1 + np.abs(expected).max())
    divergence = np.trace(difference(u.stress, points, 1e-3), axis1=2, axis2=3)
    residual = np.abs(divergence + u.body_force(points)).max(axis=1)
    residual /= 1 + np.abs(u.stress(points)).max()
    for off, most in ((error, 1e-10), (residual, 1e-9)):
        assert np.median(off) < most
        assert np.quantile(off, 0.9) < 1e3 * most
