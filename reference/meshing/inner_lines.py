"""Lines and planes that a mesh has to follow beside cuts: interfaces, and ends of parts.

An inequality begins or ends where both sides of one of its comparisons are equal. Of a line, a
circle or a plane, the part inside the body at which the material changes is imprinted on the
reference's mesh: cells lie on either side of it. Other interfaces run through cells. Supports and
tractions end along lines on a box and on the boundary of a given mesh. On that boundary the lines
at which cuts end count too: a graded reference is graded to them.
"""

from collections.abc import Callable
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

from reference.meshing.edge_splitting import split_edges
from reference.meshing.features import Feature, formulas_of_parts
from reference.meshing.opening import doubled_nodes
from verify.errors import UnsupportedSceneError
from verify.geometry.curves import Arc
from verify.geometry.planar import inside_polygon
from verify.geometry.simplices import (
    boundary_facets,
    cell_facets,
    distance_to_outline,
    frame,
    unit_normals,
)
from verify.scene import Box, Polygon, Rectangle, Scene
from verify.scene.parts import on_part, pieces_on_part, size_of
from verify.scene.regions import Region, Side, comparisons, is_affine, parse_region

Array = NDArray[np.float64]
_CURVE_SAMPLES = 4097  # along a line or a circle: a part shorter than 1/4096 of it may be missed
_EXACT = 1e-9  # of the largest term: so well a line or a circle fits
_ASIDE = 1e-9  # of the body's size: where the material on either side is looked at
_SHORTEST = 1e-6  # of it: what gmsh resolves
_PROBES = 64
Cells = NDArray[np.int64]
_SAMPLES = 129  # per direction of a face: a part narrower than 1/128 of it may be missed
_SAME = 1e-5  # of the box's size: an end closer than that to an edge counts as the edge
_MOST_LINES = 8  # per face and direction: more, and the part ends along no straight line
_MOST_PASSES = 12  # one for each line that crosses a facet, and one for each that it made
_CLOSE = 1e-5  # of the body: an end closer than that to a node is no end inside a facet
# What turns less is a side of a curve as a file has it. The field is like r^0.83 at 200°,
# like r^0.67 at 225°; in space the elements along an edge cost more.
_TURN = {2: np.pi / 9, 3: np.pi / 4}
_ON_EDGE = 1e-13  # barycentric coordinate of a point on an edge


def plane_interfaces(scene: Scene) -> list[Feature]:
    """Return the straight and circular interfaces inside a rectangle or polygon.

    Arcs come in parts of less than half a turn.
    """
    if scene.material.is_uniform:
        return []
    assert isinstance(scene.geometry, Rectangle | Polygon)
    outline = scene.geometry.outline()
    lower, size = outline.min(axis=0), np.ptp(outline, axis=0)
    centre, reach = lower + 0.5 * size, float(np.linalg.norm(size))
    found: list[Feature] = []
    for k, (normal, offset, middle) in enumerate(_level_sets(scene, centre, reach)):
        name = f"interface {k}"
        if middle is None:
            foot = centre + (offset - normal @ centre) * normal
            along = np.array([-normal[1], normal[0]])
            curve = _line(foot - reach * along, 2 * reach * along)
        else:
            curve = Arc(middle, offset, 0.0, 2 * np.pi).point
        for low, high in _changes(scene, curve, outline, reach):
            if middle is None:
                found.append(Feature(name, *curve(np.array([low, high]))))
            else:
                points = curve(np.linspace(low, high, 5))
                if (low, high) == (0.0, 1.0):
                    points[-1] = points[0]
                part = 2 * np.pi * (high - low) / 4
                found += [Feature(name, a, b, middle, offset, part) for a, b in pairwise(points)]
    return [one for one in found if one.length > _SHORTEST * reach]


def solid_interfaces(scene: Scene) -> list[Array]:
    """Plane interfaces of a box, each as the corners (4, 3) of a square that reaches beyond it."""
    if scene.material.is_uniform:
        return []
    lower, upper = _corners(scene)
    centre, reach = 0.5 * (lower + upper), float(np.linalg.norm(upper - lower))
    squares = []
    for normal, offset, middle in _level_sets(scene, centre, reach):
        if middle is not None:  # a sphere
            continue
        foot = centre + (offset - normal @ centre) * normal
        second, first, _ = frame(normal)
        across = np.stack([first, -second])
        square = foot + reach * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) @ across
        share = np.linspace(-1.0, 1.0, 65) * reach
        grid = np.stack(np.meshgrid(share, share), axis=-1).reshape(-1, 2)
        points = foot + grid @ across
        inside = ((points > lower) & (points < upper)).all(axis=1)
        if _differs(scene, points[inside], normal, reach).any():
            squares.append(square)
    return squares


def _level_sets(
    scene: Scene, centre: Array, reach: float
) -> list[tuple[Array, float, Array | None]]:
    """Find lines or planes (unit normal, offset, None), and circles (zeros, radius, centre)."""
    found: list[tuple[Array, float, Array | None]] = []
    for region in scene.material.regions:
        for left, right in comparisons(region.where, scene.dimension):
            one = _fitted(left, right, centre, reach)
            if one is not None and not any(_same(one, other, reach) for other in found):
                found.append(one)
    return found


def _fitted(
    left: Side, right: Side, centre: Array, reach: float
) -> tuple[Array, float, Array | None] | None:
    """Fit a line, plane, circle or sphere to where two sides are equal; None if none does."""
    d = len(centre)
    local = np.random.default_rng(7).uniform(-1.0, 1.0, (_PROBES, d))
    points = centre + reach * local
    a, b = left(points), right(points)
    basis = np.column_stack([np.ones(len(local)), local, np.sum(local**2, axis=1)])
    for values in (a - b, a**2 - b**2):  # of hypot(x, y) < r the squares are polynomials
        if not np.isfinite(values).all() or not np.abs(values).max() > 0:
            continue
        weights = np.linalg.lstsq(basis, values, rcond=None)[0]
        if np.abs(basis @ weights - values).max() > _EXACT * np.abs(values).max():
            continue
        slope, bend = weights[1:-1], weights[-1]
        if abs(bend) > _EXACT * np.abs(weights).max():
            middle = -slope / (2 * bend)
            squared = middle @ middle - weights[0] / bend
            return (
                (np.zeros(d), reach * np.sqrt(squared), centre + reach * middle)
                if (squared > 0)
                else None
            )
        steep = float(np.linalg.norm(slope))
        if steep > _EXACT * np.abs(weights).max():
            normal = slope / steep
            return normal, float(normal @ centre - reach * weights[0] / steep), None
    return None


def _same(
    one: tuple[Array, float, Array | None], other: tuple[Array, float, Array | None], reach: float
) -> bool:
    (n, offset, middle), (m, other_offset, other_middle) = one, other
    if (middle is None) != (other_middle is None):
        return False
    if middle is not None and other_middle is not None:
        apart = np.abs(middle - other_middle).max() + abs(offset - other_offset)
        return bool(apart < _EXACT * reach)
    sense = np.sign(n @ m)
    return bool(np.abs(n - sense * m).max() + abs(offset - sense * other_offset) / reach < _EXACT)


def _line(start: Array, along: Array) -> Callable[[Array], Array]:
    return lambda t: start + np.asarray(t)[:, None] * along


def _changes(
    scene: Scene, curve: Callable[[Array], Array], outline: Array, reach: float
) -> list[tuple[float, float]]:
    """Compute parameters between which a curve lies inside the body and separates two materials."""

    def separates(t: Array) -> NDArray[np.bool_]:
        points = curve(t)
        step = curve(t + 1e-6) - points
        normal = np.column_stack([-step[:, 1], step[:, 0]])
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        inside = inside_polygon(points, outline)
        inside &= distance_to_outline(points, outline) > 1e-12 * reach
        return inside & _differs(scene, points, normal, reach)

    t = np.linspace(0.0, 1.0, _CURVE_SAMPLES)
    on = separates(t)
    stops = []
    for i in np.flatnonzero(on[1:] != on[:-1]):
        low, high = t[i], t[i + 1]
        while (middle := 0.5 * (low + high)) not in (low, high):
            low, high = (
                (middle, high) if separates(np.array([middle]))[0] == on[i] else (low, middle)
            )
        stops.append(float(high))
    bounds = [0.0] * bool(on[0]) + stops + [1.0] * bool(on[-1])
    return list(pairwise(bounds))[::2]


def _differs(scene: Scene, points: Array, normal: Array, reach: float) -> NDArray[np.bool_]:
    """Tell whether the material differs on either side of points (n, d) of an interface."""
    aside = _ASIDE * reach * normal
    number = scene.material.number_at
    return np.asarray(number(points + aside) != number(points - aside))


def part_lines(scene: Scene) -> Array:
    """Find segments (s, 2, 3) across faces of the box along which an inequality changes, m.

    A traction that ends along another line ends inside facets.

    Raises
    ------
    UnsupportedSceneError
        If a support ends along a line that is not parallel to an edge of the box.
    """
    lower, upper = _corners(scene)
    supported = {s.where for s in scene.supports}
    found = []
    for text in formulas_of_parts(scene):
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
    """Tell whether some support holds points of the surface."""
    held = np.zeros(len(points), dtype=bool)
    for support in scene.supports:
        held |= on_part(scene.geometry, support.where, points, size)
    return held


def _corners(scene: Scene) -> tuple[Array, Array]:
    assert isinstance(scene.geometry, Box)
    return np.array(scene.geometry.lower, dtype=float), np.array(scene.geometry.upper, dtype=float)


def _ends(region: Region, lower: Array, upper: Array, axis: int, side: int, across: int) -> Array:
    """Find places along `across` at which the region begins or ends on a face, each once, m."""
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

    Facets then lie on a part or beside it, in every refinement too: the reference holds the part
    itself. Curved ends stay inside facets.

    Parameters
    ----------
    scene : Scene
    points : (n, d) array
    cells : (m, k + 1) array
    facets : (f, k) array
        Marked facets; they are split with the cells.
    """
    formulas = [one for one in formulas_of_parts(scene) if is_affine(one)]
    for _ in range(_MOST_PASSES):
        edges, places = _ends_in_facets(scene, formulas, points, boundary_facets(cells)[0])
        if not len(edges):
            break
        points, cells, facets = split_edges(points, cells, facets, edges, places)
    return points, cells, facets


def singular_lines(scene: Scene, points: Array, cells: Cells, facets: Cells) -> Array:
    """Find segments (s, 2, d) at which field of a given mesh is singular, in the plane points, m.

    There a cut ends inside the body, a support ends on its boundary, or that turns into the body;
    of the last two none where an exact field is prescribed, which is smooth there.

    Parameters
    ----------
    scene : Scene
    points : (n, d) array
    cells : (m, d + 1) array
    facets : (f, d) array
        Of the cuts.
    """
    d = points.shape[1]
    rims = boundary_facets(facets)[0]
    opened = np.isin(rims, doubled_nodes(cells, facets)) if len(facets) else rims == -1
    found = [rims[~opened.any(axis=1)]]
    if not any(support.displacement == "exact" for support in scene.supports):
        boundary = boundary_facets(cells)[0]
        held = np.zeros(len(boundary), dtype=bool)
        for support in scene.supports:
            held[pieces_on_part(scene.geometry, support.where, points[boundary]).facet] = True
        rims, place = np.unique(cell_facets(boundary), axis=0, return_inverse=True)
        count = np.bincount(place.ravel())
        holding = np.bincount(place.ravel(), np.repeat(held, d))
        found.append(rims[(holding > 0) & (holding < count)])
        found.append(_turned_in(points, cells))
    return points[np.concatenate(found)[:, [0, -1]]]


def _turned_in(points: Array, cells: Cells) -> Cells:
    """Find edges (r, 2) of boundary, in the plane nodes (r, 1), at which it turns into the body."""
    d = points.shape[1]
    facets, cell, opposite = boundary_facets(cells)
    middles, normals = points[facets].mean(axis=1), unit_normals(points[facets])
    away = middles - points[cells[cell, opposite]]  # cells are on the other side
    normals *= np.sign(np.sum(normals * away, axis=1))[:, None]
    rims, place, count = np.unique(
        cell_facets(facets), axis=0, return_inverse=True, return_counts=True
    )
    paired = np.argsort(place.ravel(), kind="stable")[np.repeat(count, count) == 2]
    one, other = (paired // d).reshape(-1, 2).T
    inwards = np.sum((middles[other] - middles[one]) * normals[one], axis=1) > 0.0
    turned = np.sum(normals[one] * normals[other], axis=1) < np.cos(_TURN[d])
    return rims[count == 2][inwards & turned]


def _ends_in_facets(
    scene: Scene, formulas: list[str], points: Array, boundary: Cells
) -> tuple[Cells, Array]:
    """Find edges (e, 2) of facets in which a part ends, smaller node first, and where (e, d), m."""
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
