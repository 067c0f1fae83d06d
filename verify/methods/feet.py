"""Feet of nodes on a cut: places to which they may move, inside the body or along its boundary."""

import numpy as np
from numpy.typing import NDArray

from verify.xfem.cuts import Cut
from verify.xfem.mesh import SimplexMesh

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]

_STEPS = 5  # Newton steps; one is exact for a plane
_DIFFERENCE = 1e-5  # element sizes, of the difference quotient
_FLAT = 0.03  # sin² of 10°: boundary facets that differ less are one smooth surface
_GRAZING = 0.04  # squared sine of the angle between cut and boundary below which nothing slides


def free_directions(mesh: SimplexMesh, nodes: _Ints) -> _Floats:
    """(k, d, d) projectors onto the directions in which nodes may move without leaving the body.

    Everything inside; the tangents of a flat or smooth boundary; along a sharp edge; nothing in a
    corner.
    """
    space = mesh.space
    gram = np.zeros((len(mesh.points), space, space))
    cells, opposite = mesh.boundary_facets.T
    normals = mesh.gradients[cells, opposite]
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    on_facet = np.arange(mesh.dim + 1) != opposite[:, None]
    corners = mesh.cells[cells][on_facet].reshape(len(cells), mesh.dim)
    outer = normals[:, :, None] * normals[:, None, :]
    for k in range(mesh.dim):
        np.add.at(gram, corners[:, k], outer)
    gram = gram[nodes]
    total = np.trace(gram, axis1=1, axis2=2)
    values, vectors = np.linalg.eigh(gram)
    free = values <= _FLAT * np.maximum(total, 1.0)[:, None]
    return np.einsum("kim,km,kjm->kij", vectors, free.astype(float), vectors)


def feet_on_cut(
    cut: Cut, points: _Floats, size: _Floats, directions: _Floats
) -> tuple[_Floats, NDArray[np.bool_]]:
    """Nearest points of a cut, in the directions allowed, and whether there is one.

    Parameters
    ----------
    cut : Cut
    points : (k, d) float array
    size : (k,) float array
        Element size at each; a foot farther than half of it is none.
    directions : (k, d, d) float array
        As from `free_directions`.
    """
    at = points.copy()
    found = np.ones(len(points), dtype=bool)
    for _ in range(_STEPS):
        value = cut.level_set(at)
        slope = np.einsum("kij,kj->ki", directions, _gradient(cut, at, _DIFFERENCE * size))
        squared = (slope**2).sum(axis=1)
        found &= squared > _GRAZING
        step = np.where(found, value / np.maximum(squared, _GRAZING), 0.0)
        at = at - step[:, None] * slope
    found &= np.linalg.norm(at - points, axis=1) <= 0.5 * size
    found &= np.abs(cut.level_set(at)) <= 1e-9 * size
    return np.where(found[:, None], at, points), found


def _gradient(cut: Cut, points: _Floats, step: _Floats) -> _Floats:
    """Central differences (k, d) of the level set: of length one, or nearly."""
    columns = []
    for axis in range(points.shape[1]):
        ahead, behind = points.copy(), points.copy()
        ahead[:, axis] += step
        behind[:, axis] -= step
        columns.append((cut.level_set(ahead) - cut.level_set(behind)) / (2.0 * step))
    return np.stack(columns, axis=1)
