"""Tractions on parts of the boundary, which may end inside a facet."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from reference.space import ConformingSpace
from verify.errors import InputError
from verify.scene import Scene, Traction, is_uniform
from verify.scene.part_pieces import Pieces, pieces_on_part

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_WHOLE = 1e-12  # of a facet: what may be left of one that is loaded as a whole
_DEGREE = 8  # of the rule for what is integrated over pieces of facets


class LoadedFacets(NamedTuple):
    """Facets that a traction acts on.

    Attributes
    ----------
    whole : (w,) int array
        Those on all of which it acts, as rows of the mesh's `boundary`.
    ended : (e,) int array
        Those in which it ends.
    pieces : Pieces
        What is loaded of the latter; `facet` counts rows of `boundary`.
    """

    whole: Ints
    ended: Ints
    pieces: Pieces

    def opposite_to(self, space: ConformingSpace, corner: int) -> "LoadedFacets":
        """Return those in which it ends that are opposite to a corner of their cell."""
        rows = self.ended[space.mesh.boundary[self.ended, 1] == corner]
        pieces = self.pieces[np.isin(self.pieces.facet, rows)]
        return LoadedFacets(np.zeros(0, dtype=np.int64), rows, pieces)


def loaded_facets(scene: Scene, space: ConformingSpace, load: Traction, key: str) -> LoadedFacets:
    """Find the facets that a traction acts on.

    Raises
    ------
    InputError
        If there are none.
    """
    corners = space.boundary_facets[1]
    pieces = pieces_on_part(scene.geometry, load.where, corners)
    if not len(pieces.facet):
        raise InputError(f"{key}: no boundary facet lies in '{load.where}'", str(scene.file or ""))
    covered = pieces.covered(len(corners))
    whole, ended = covered > 1.0 - _WHOLE, (covered > 0.0) & (covered <= 1.0 - _WHOLE)
    mine = pieces[ended[pieces.facet]]
    return LoadedFacets(np.flatnonzero(whole), np.flatnonzero(ended), mine)


def density_on_whole(
    space: ConformingSpace, loaded: LoadedFacets, load: Traction, exact: Any, time: float
) -> Array:
    """Force per area on whole facets that does the work of a traction on pieces of them.

    It is the polynomial of the space's degree with the same integrals against all shape functions:
    what is loaded is the piece itself, though forms are integrated over facets. All facets must be
    opposite to the same corner.

    Returns
    -------
    (e, q, d) array
        At the nodes of the facets in which the load ends, as `ConformingSpace.facet_nodes` has
        them, Pa.
    """
    import basix

    k = space.mesh.cell_dimension
    cell_type = {2: basix.CellType.interval, 3: basix.CellType.triangle}[k]
    at, weights = map(np.asarray, basix.make_quadrature(cell_type, _DEGREE))
    rule = np.column_stack([1.0 - at.sum(axis=1), at])
    weights = weights / weights.sum()
    edges = space.edges_of_facet(int(space.mesh.boundary[loaded.ended[0], 1]))
    shapes = _facet_shapes(rule, edges)
    mass = np.einsum("q,qa,qb->ab", weights, shapes, shapes)
    facet = np.searchsorted(loaded.ended, loaded.pieces.facet)
    within = rule @ loaded.pieces.barycentric
    points = within @ space.boundary_facets[1][loaded.pieces.facet]
    values = _values(space, loaded, load, exact, time, points)
    shapes, share = _facet_shapes(within, edges), loaded.pieces.share
    given = np.einsum("r,q,rqa,rqc->rac", share, weights, shapes, values)
    moments = np.zeros((len(loaded.ended), *given.shape[1:]))
    np.add.at(moments, facet, given)
    return np.asarray(np.linalg.solve(mass, moments))


def _values(
    space: ConformingSpace,
    loaded: LoadedFacets,
    load: Traction,
    exact: Any,
    time: float,
    points: Array,
) -> Array:
    """Force per area (r, q, d) at points (r, q, d) of the pieces, Pa."""
    if load.traction != "exact" and is_uniform(load.traction):
        return np.broadcast_to(np.asarray(load.traction, dtype=float), points.shape)
    flat = points.reshape(-1, points.shape[2])
    if load.traction != "exact":
        return np.asarray(load.values(flat, time)).reshape(points.shape)
    rows = loaded.pieces.facet
    near = np.repeat(space.centroids[space.mesh.boundary[rows, 0]], points.shape[1], axis=0)
    stress = exact.stress(flat, near).reshape(*points.shape, -1)
    normals = space.outward_normals(rows)
    return np.asarray(np.einsum("rqij,rj->rqi", stress, normals))


def _facet_shapes(barycentric: Array, edges: list[tuple[int, int]]) -> Array:
    """Shape functions (…, q) of a facet at barycentric coordinates (…, k).

    Those of the corners, and of the middles of edges in a quadratic one.
    """
    if not edges:
        return barycentric
    middles = [4.0 * barycentric[..., i] * barycentric[..., j] for i, j in edges]
    corners = barycentric * (2.0 * barycentric - 1.0)
    return np.concatenate([corners, np.stack(middles, axis=-1)], axis=-1)
