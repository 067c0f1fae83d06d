"""Derivatives of fields by differences, which know nothing of how the field is made."""

import numpy as np


def difference(field, points, h):
    """Central differences of order 4 at points (n, d); the last axis is the direction."""
    columns = []
    for step in h * np.eye(points.shape[1]):
        near, far = (field(points + k * step) - field(points - k * step) for k in (1, 2))
        columns.append((8 * near - far) / (12 * h))
    return np.stack(columns, axis=-1)
