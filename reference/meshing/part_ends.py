"""Lines where the part that a support or traction acts on ends, on a box and in a given mesh.

Of a given mesh those too at which cuts end: what a graded reference is graded to.
"""

from itertools import product

import numpy as np
from numpy.typing import NDArray

from reference.meshing.edge_splitting import split_edges
from reference.meshing.opening import cell_facets, doubled_nodes
from verify.errors import UnsupportedSceneError
from verify.scene import Box, Scene, Traction
from verify.scene.parts import on_part, pieces_on_part, size_of
from verify.scene.regions import Region, is_affine, parse_region

Array = NDArray[np.float64]
Cells = NDArray[np.int64]

_SAMPLES = 129  # per direction of a face: a part narrower than 1/128 of it may be missed
_SAME = 1e-5  # of the box's size: an end closer than that to an edge counts as the edge
_MOST_LINES = 8  # per face and direction: more, and the part ends along no straight line
_MOST_PASSES = 12  # one for each line that crosses a facet, and one for each that it made
_CLOSE = 1e-5  # of the body: an end closer than that to a node is no end inside a facet
_ON_EDGE = 1e-13  # barycentric coordinate of a point on an edge


def part_lines(scene: Scene) -> Array:
    """Segments (s, 2, 3) across faces of the box along which an inequality changes, m.

    A traction that ends along another line ends inside facets.

    Raises
    ------
    UnsupportedSceneError
        If a support ends along a line that is not parallel to an edge of the box.
    """
    lower, upper = _corners(scene)
    names = (*scene.geometry.parts(), "boundary")
    supported = {s.where for s in scene.supports}
    places = supported | {load.where for load in scene.loads if isinstance(load, Traction)}
    found = []
    for text in sorted(places - set(names)):
        region = parse_region(text, 3)
        for axis, side in product(range(3), (0, 1)):
            for across in (axis - 1, axis - 2):
                ends = _ends(region, lower, upper, axis, side, across % 3)
                if len(ends) > _MOST_LINES and text not in supported:
                    continue
                if len(ends) > _MOST_LINES:
                    raise UnsupportedSceneError(
                        f"a support ends along a curved or oblique line on a face of the box: "
                        f"'{text}'; conforming meshes follow lines parallel to its edges"
                    )
                for place in ends:
                    segment = np.stack([lower, upper])
                    segment[:, axis] = (lower, upper)[side][axis]
                    segment[:, across] = place
                    found.append(segment)
    return np.array(found).reshape(-1, 2, 3)


def clamped_edges(
    scene: Scene, middles: Array, tangents: Array, mouth: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Tell at which curves on the surface of the box a support makes the strain unbounded.

    There a support ends, or a cut meets a face that is held. None where the supports prescribe an
    exact field, which is smooth there.

    Parameters
    ----------
    scene : Scene
    middles, tangents : (k, 3) arrays
        Middle of each curve, m, and its direction there.
    mouth : (k,) bool array
        Whether a cut ends there.
    """
    if any(support.displacement == "exact" for support in scene.supports):
        return np.zeros(len(middles), dtype=bool)
    lower, upper = _corners(scene)
    size = float((upper - lower).max())
    inward = np.where(np.abs(middles - lower) < _SAME * size, 1.0, 0.0)
    inward -= np.where(np.abs(middles - upper) < _SAME * size, 1.0, 0.0)
    found = np.zeros(len(middles), dtype=bool)
    for k, (middle, tangent) in enumerate(zip(middles, tangents, strict=True)):
        axes = np.flatnonzero(inward[k])
        normals = inward[k, axes][:, None] * np.eye(3)[axes]
        if len(axes) == 2:  # an edge of the box: into each face along the other's normal
            ways = normals
        else:
            way = np.cross(normals[0], tangent)
            ways = np.stack([way, -way]) / np.linalg.norm(way)
        held = _held(scene, middle + 1e-4 * size * ways, size)
        found[k] = held[0] != held[1] or (mouth[k] and held.any())
    return found


def _held(scene: Scene, points: Array, size: float) -> NDArray[np.bool_]:
    """Whether some support holds points of the surface."""
    held = np.zeros(len(points), dtype=bool)
    for support in scene.supports:
        held |= on_part(scene.geometry, support.where, points, size)
    return held


def _corners(scene: Scene) -> tuple[Array, Array]:
    assert isinstance(scene.geometry, Box)
    return np.array(scene.geometry.lower, dtype=float), np.array(scene.geometry.upper, dtype=float)


def _ends(region: Region, lower: Array, upper: Array, axis: int, side: int, across: int) -> Array:
    """Places along `across` at which the region begins or ends on a face, each once, m."""
    along = 3 - axis - across
    size = upper - lower
    share = (np.arange(_SAMPLES) + 0.5) / _SAMPLES
    lines = lower[along] + share * size[along]

    def inside(places: Array, line: Array) -> NDArray[np.bool_]:
        points = np.empty((len(places), 3))
        points[:, axis] = (lower, upper)[side][axis]
        points[:, across], points[:, along] = places, line
        return region(points)

    stops = lower[across] + np.linspace(0.0, 1.0, _SAMPLES) * size[across]
    grid = inside(np.tile(stops, _SAMPLES), np.repeat(lines, _SAMPLES)).reshape(_SAMPLES, -1)
    row, column = np.nonzero(grid[:, 1:] != grid[:, :-1])
    low, high, line = stops[column], stops[column + 1], lines[row]
    first = grid[row, column]
    for _ in range(60):
        middle = 0.5 * (low + high)
        same = inside(middle, line) == first
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    inner = (high > lower[across] + _SAME * size.max()) & (
        high < upper[across] - _SAME * size.max()
    )
    places = np.sort(high[inner])
    return places[np.diff(places, prepend=-np.inf) > _SAME * size.max()]


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
    formulas = [one for one in sorted(parts - set(names)) if not scene.geometry.is_part(one)]
    formulas = [one for one in formulas if is_affine(one)]
    for _ in range(_MOST_PASSES):
        edges, places = _ends_in_facets(scene, formulas, points, _boundary(cells))
        if not len(edges):
            break
        points, cells, facets = split_edges(points, cells, facets, edges, places)
    return points, cells, facets


def singular_lines(scene: Scene, points: Array, cells: Cells, facets: Cells) -> Array:
    """Segments (s, 2, d) at which the field of a given mesh is singular, in the plane points, m.

    There a cut ends inside the body, or a support ends on its boundary; not where an exact field
    is prescribed, which is smooth there.

    Parameters
    ----------
    scene : Scene
    points : (n, d) array
    cells : (m, d + 1) array
    facets : (f, d) array
        Of the cuts.
    """
    d = points.shape[1]
    rims, times = np.unique(_rims(facets), axis=0, return_counts=True)
    opened = np.isin(rims, doubled_nodes(cells, facets)) if len(facets) else rims == -1
    found = [rims[(times == 1) & ~opened.any(axis=1)]]
    if not any(support.displacement == "exact" for support in scene.supports):
        boundary = _boundary(cells)
        held = np.zeros(len(boundary), dtype=bool)
        for support in scene.supports:
            held[pieces_on_part(scene.geometry, support.where, points[boundary]).facet] = True
        rims, place = np.unique(_rims(boundary), axis=0, return_inverse=True)
        count = np.bincount(place.ravel())
        holding = np.bincount(place.ravel(), np.tile(held, d))
        found.append(rims[(holding > 0) & (holding < count)])
    return points[np.concatenate(found)[:, [0, -1]]]


def _rims(facets: Cells) -> Cells:
    """Edges of triangles, or ends of segments (f, k), of all facets in turn."""
    k = facets.shape[1]
    return np.sort(np.concatenate([np.delete(facets, i, axis=1) for i in range(k)]), axis=1)


def _boundary(cells: Cells) -> Cells:
    """Nodes (b, k) of the facets of one cell only."""
    facets, count = np.unique(cell_facets(cells), axis=0, return_counts=True)
    return np.asarray(facets[count == 1])


def _ends_in_facets(
    scene: Scene, formulas: list[str], points: Array, boundary: Cells
) -> tuple[Cells, Array]:
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
