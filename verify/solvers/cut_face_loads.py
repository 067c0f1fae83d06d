"""Loads on the faces of a cut as consistent nodal forces of a cut body."""

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError, UnsupportedSceneError
from verify.scene import CutFaces, Scene, faces_of
from verify.xfem.loads import simplex_rule
from verify.xfem.phantom import PhantomMesh
from verify.xfem.subdivision import Subdivision, subdivide

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]

_DEGREE = 4  # of the load times the shape functions, integrated exactly


def face_forces(scene: Scene, phantom: PhantomMesh, i: int, time: float) -> _Floats:
    """Nodal forces (N, d) of load i, on the faces of a cut as realised, N (per metre in 2D).

    The faces are facets of the conforming sub-division on which the field is linear, so that the
    forces are the exact work of the load. A cut that is still closed in a motion bears none.

    Raises
    ------
    UnsupportedSceneError
        If the cut has no two faces that lie on each other: the method removed the material there,
        or opened nothing.
    """
    load, key = scene.loads[i], f"loads[{i}]"
    assert isinstance(load, CutFaces)
    body = subdivide(phantom)
    facets, outward = _faces(body)
    corners = body.points[facets]
    place = next(k for k, cut in enumerate(scene.cuts) if cut.name == load.cut)
    found = faces_of(scene, corners.mean(axis=1))
    mine = found.cut == place
    if not mine.any() and scene.analysis.kind == "static":
        raise UnsupportedSceneError(f"{key}: cut '{load.cut}' as realised has no faces to bear it")
    corners, nodes, normals = corners[mine], facets[mine], found.normal[mine]
    length = np.linalg.norm(outward[mine], axis=1)
    outward = outward[mine] / np.where(length > 0.0, length, 1.0)[:, None]
    area, d = length / (scene.dimension - 1), scene.dimension
    forces = np.zeros(body.points.shape)
    for shares, weight in zip(*simplex_rule(d - 1, _DEGREE), strict=True):
        points = np.einsum("i,kij->kj", shares, corners)
        try:
            traction = load.values(points, outward, normals, time)
        except InputError as error:
            raise InputError(f"{key}: {error}", str(scene.file or "")) from None
        given = (weight * area)[:, None] * traction
        np.add.at(forces, nodes, shares[None, :, None] * given[:, None, :])
    return np.asarray(body.interpolation.T @ forces)


def _faces(body: Subdivision) -> tuple[_Ints, _Floats]:
    """Nodes (k, d) of the facets that lie on another one, and their normals out of the material.

    The normals are as long as the facets are large, times d − 1.
    """
    count = body.cells.shape[1]
    rest = [[j for j in range(count) if j != k] for k in range(count)]
    nodes = body.cells[:, rest].reshape(-1, count - 1)
    beyond = body.points[body.cells.ravel()]
    _, place = np.unique(body.points, axis=0, return_inverse=True)
    alone = _times(nodes) == 1
    nodes, beyond = nodes[alone], beyond[alone]
    twin = _times(place.ravel()[nodes]) == 2
    nodes, beyond = nodes[twin], beyond[twin]
    corners = body.points[nodes]
    edges = corners[:, 1:] - corners[:, :1]
    if count == 3:
        normals = np.column_stack([edges[:, 0, 1], -edges[:, 0, 0]])
    else:
        normals = np.cross(edges[:, 0], edges[:, 1])
    inward = np.sum(normals * (beyond - corners[:, 0]), axis=1) > 0.0
    normals[inward] *= -1.0
    return nodes, normals


def _times(rows: _Ints) -> _Ints:
    """How often (n,) each row of (n, k) numbers occurs, in whatever order its numbers are."""
    rows = np.sort(rows, axis=1)
    _, which, count = np.unique(rows, axis=0, return_inverse=True, return_counts=True)
    return np.asarray(count[which.ravel()])
