"""The triangulation of a sweep, with what its level set needs at faces, edges and vertices."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from verify.xfem.errors import XfemError

__all__ = ["STILL", "SweepArrays", "SweepSurface", "sweep_surface"]

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]

_FLAT = 1e-12  # area over squared edge below which a swept triangle counts as not swept
STILL = 1e-14  # of the length of the path: shorter moves are none
_TURNED_BACK = -1.0 + 1e-9  # cosine between the normals of neighbouring facets


class SweepArrays(NamedTuple):
    """Per facet and corner, for kernels; k corners in s dimensions.

    Attributes
    ----------
    corners : (t, k, s) float array
    normals : (t, s) float array
        Of length one.
    edge_normals, vertex_normals : (t, k, s) float array
        At the edge opposite to, and at, each corner; of length one.
    edge_rim, vertex_rim : (t, k) bool array
        Whether the sweep ends there.
    rim : (r, k - 1, s) float array
        The facets of the rim: points in 2D, edges in 3D.
    travel : (t, k) float array
        How far the blade has come at each corner, in metres.
    """

    corners: _Floats
    normals: _Floats
    edge_normals: _Floats
    vertex_normals: _Floats
    edge_rim: NDArray[np.bool_]
    vertex_rim: NDArray[np.bool_]
    rim: _Floats
    travel: _Floats


class SweepSurface(NamedTuple):
    """Vertices (v, s), facets (t, k), and the arrays for kernels."""

    points: _Floats
    facets: _Ints
    arrays: SweepArrays


def sweep_surface(blades: _Floats, travel: _Floats) -> SweepSurface:
    """Triangulate the sweep of blades (k, b, s) with the travel (k,) of each position.

    Raises
    ------
    XfemError
        If the blade turns back on the surface that it has just swept.
    """
    points, lengths, facets = _facets(blades, travel)
    corners = points[facets]
    if facets.shape[1] == 2:
        along = corners[:, 1] - corners[:, 0]
        normals = np.stack([-along[:, 1], along[:, 0]], axis=1)
        angles = np.ones(facets.shape)
    else:
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        angles = _corner_angles(corners)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    across = _across(facets)
    edge_normals = normals[:, None] + np.where(
        across[..., None] >= 0, normals[np.maximum(across, 0)], normals[:, None]
    )
    if facets.shape[1] == 3:
        cosine = (normals[:, None] * normals[np.maximum(across, 0)]).sum(axis=2)
        back = (across >= 0) & (cosine < _TURNED_BACK)
        if back.any():
            where = points[facets[back.any(axis=1)][0]].mean(axis=0)
            raise XfemError(f"the blade turns back on its own sweep near {where.tolist()}")
    total = np.zeros_like(points)
    np.add.at(total, facets, angles[:, :, None] * normals[:, None])
    total /= np.maximum(np.linalg.norm(total, axis=1), 1e-300)[:, None]
    edge_normals /= np.maximum(np.linalg.norm(edge_normals, axis=2), 1e-300)[..., None]
    edge_rim = across < 0
    vertex_rim, rim = _rim(facets, edge_rim, len(points))
    arrays = SweepArrays(
        corners=np.ascontiguousarray(corners),
        normals=normals,
        edge_normals=edge_normals,
        vertex_normals=total[facets],
        edge_rim=edge_rim,
        vertex_rim=vertex_rim[facets],
        rim=np.ascontiguousarray(points[rim]),
        travel=lengths[facets],
    )
    return SweepSurface(points, facets, arrays)


def _facets(blades: _Floats, travel: _Floats) -> tuple[_Floats, _Floats, _Ints]:
    """Vertices, their travel, and the facets that have a length or an area."""
    count, width, space = blades.shape
    ids = np.arange(count * width).reshape(count, width)
    for k in range(1, count):
        # a point of the blade that stays, up to round-off of the path, is one vertex: what turns
        # around it is connected
        still = np.linalg.norm(blades[k] - blades[k - 1], axis=1) <= STILL * travel[-1]
        ids[k, still] = ids[k - 1, still]
    points = blades.reshape(-1, space)
    lengths = np.repeat(travel, width)
    if width == 1:
        facets = np.stack([ids[:-1, 0], ids[1:, 0]], axis=1)
        return points, lengths, facets[facets[:, 0] != facets[:, 1]]
    a, b, c, d = ids[:-1, :-1], ids[1:, :-1], ids[1:, 1:], ids[:-1, 1:]
    both = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], axis=2).reshape(-1, 3)
    edges = points[both][:, [1, 2, 0]] - points[both]
    area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    return points, lengths, both[area > _FLAT * (edges**2).sum(axis=2).max(axis=1)]


def _corner_angles(corners: _Floats) -> _Floats:
    angles = np.empty(corners.shape[:2])
    for k in range(3):
        p, q = (corners[:, (k + i) % 3] - corners[:, k] for i in (1, 2))
        cross = np.linalg.norm(np.cross(p, q), axis=1)
        angles[:, k] = np.arctan2(cross, (p * q).sum(axis=1))
    return angles


def _across(facets: _Ints) -> _Ints:
    """(t, k) facet across the edge (2D: the vertex) opposite to each corner, -1 on the rim."""
    corners = facets.shape[1]
    others = [[j for j in range(corners) if j != k] for k in range(corners)]
    seen: dict[tuple[int, ...], tuple[int, int]] = {}
    across = np.full(facets.shape, -1)
    for t, facet in enumerate(facets.tolist()):
        for k in range(corners):
            key = tuple(sorted(facet[j] for j in others[k]))
            if key in seen:
                across[t, k], across[seen[key]] = seen[key][0], t
            else:
                seen[key] = (t, k)
    return across


def _rim(facets: _Ints, edge_rim: NDArray[np.bool_], count: int) -> tuple[NDArray[np.bool_], _Ints]:
    """Whether each vertex is on the rim, and the facets (r, k - 1) of the rim."""
    corners = facets.shape[1]
    others = np.array([[j for j in range(corners) if j != k] for k in range(corners)])
    facet, k = np.nonzero(edge_rim)
    rim = facets[facet[:, None], others[k]]
    on_rim = np.zeros(count, dtype=bool)
    on_rim[rim] = True
    return on_rim, rim
