"""Nodes of a given mesh along the lines where the parts of supports and tractions end."""

import numpy as np
from numpy.typing import NDArray

from reference.meshing.edge_splitting import split_edges
from reference.meshing.opening import cell_facets
from verify.scene import Scene, Traction
from verify.scene.parts import pieces_on_part, size_of
from verify.scene.regions import is_affine

Array = NDArray[np.float64]
Cells = NDArray[np.int64]

_MOST_PASSES = 12  # one for each line that crosses a facet, and one for each that it made
_CLOSE = 1e-5  # of the body: an end closer than that to a node is no end inside a facet
_ON_EDGE = 1e-13  # barycentric coordinate of a point on an edge


def split_at_part_ends(
    scene: Scene, points: Array, cells: Cells, facets: Cells
) -> tuple[Array, Cells, Cells]:
    """Split the edges of boundary facets in which a support or traction ends.

    Facets then lie on a part or beside it, and so do those of every refinement: the reference
    holds the part itself. Curved ends stay inside facets.

    Parameters
    ----------
    scene : Scene
    points : (n, d) array
    cells : (m, k + 1) array
    facets : (f, k) array
        Marked facets; they are split with the cells.
    """
    names = (*scene.geometry.parts(), "boundary")
    parts = {s.where for s in scene.supports}
    parts |= {load.where for load in scene.loads if isinstance(load, Traction)}
    formulas = [one for one in sorted(parts - set(names)) if is_affine(one)]
    for _ in range(_MOST_PASSES):
        edges, places = _ends(scene, formulas, points, _boundary(cells))
        if not len(edges):
            break
        points, cells, facets = split_edges(points, cells, facets, edges, places)
    return points, cells, facets


def _boundary(cells: Cells) -> Cells:
    """Nodes (b, k) of the facets of one cell only."""
    facets, count = np.unique(cell_facets(cells), axis=0, return_counts=True)
    return np.asarray(facets[count == 1])


def _ends(scene: Scene, formulas: list[str], points: Array, boundary: Cells) -> tuple[Cells, Array]:
    """Edges (e, 2) of facets in which a part ends, the smaller node first, and where (e, d), m."""
    corners = points[boundary]
    edges, places = [np.zeros((0, 2), dtype=np.int64)], [np.zeros((0, points.shape[1]))]
    for where in formulas:
        pieces = pieces_on_part(scene.geometry, where, corners)
        covered = pieces.covered(len(boundary))[pieces.facet]
        pieces = pieces[covered < 1.0 - _ON_EDGE]
        within = pieces.barycentric.reshape(-1, corners.shape[1])
        facet = np.repeat(pieces.facet, corners.shape[1])
        inside = within > _ON_EDGE
        on_edge = inside.sum(axis=1) == 2
        within, facet, inside = within[on_edge], facet[on_edge], inside[on_edge]
        edges.append(boundary[facet][inside].reshape(-1, 2))
        places.append(np.einsum("rk,rkd->rd", within, corners[facet]))
    pairs, where_split = np.sort(np.concatenate(edges), axis=1), np.concatenate(places)
    away = np.linalg.norm(points[pairs] - where_split[:, None], axis=2).min(axis=1, initial=np.inf)
    far = away > _CLOSE * size_of(corners)
    pairs, first = np.unique(pairs[far], axis=0, return_index=True)
    return pairs, where_split[far][first]
