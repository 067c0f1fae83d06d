"""Sessions of gmsh, and element sizes in them: uniform, or graded to singular points.

A session is deterministic and closed whatever happens; unfitted background meshes are made here.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference.meshing.features import (
    Feature,
    crossing_points,
    divided_outline,
    load_jumps,
    plane_features,
    supported_edges,
)
from reference.meshing.inner_lines import plane_interfaces
from verify.geometry.planar import inside_polygon, polygon_area
from verify.geometry.simplices import distance_to_outline, oriented
from verify.scene import ArcCut, Polygon, PolylineCut, Rectangle, Scene
from verify.scene.acceptance import FractureQuantity
from verify.scene.tool_path import Cut

Array = NDArray[np.float64]
# of the body's longest side, which gmsh meshes as 1: below it runs out of digits, and loses facets
# of a cut at its tip (seen from 9e-10 down)
_MESHED = 2e-9
_SMALLEST = 1e-12  # of the grading radius: nearer, coordinates do
_SAME = 1e-9  # of the body: points that close are one
_DOMAIN = 0.4  # of the way from a tip to the next feature: the smallest domain of an integral
_KINK = np.deg2rad(15.0)  # a smaller turn leaves a singularity too weak to matter


@dataclass(frozen=True)
class Grading:
    """Element size h(r) = size · min(1, (r/radius)^exponent) around singular points.

    With exponent 0.8 quadratic elements reach their full order at a crack tip: h ∝ r^β,
    β > 1 − λ/p; λ = ½, p = 2. The smallest size is where h(r) = r.

    Parameters
    ----------
    size : float
        Element size away from the points, m.
    points : (k, 2) array
        Singular points; none gives a uniform mesh.
    radius : float
        Distance at which the grading starts, m.
    exponent : float
        β.
    strip : float, optional
        Element size over the width of the strip between two features that come close to each
        other; none leaves such strips to the other sizes.
    clear : (k,) array, optional
        Distance from each point within which nothing else is, m; infinite where no domain of an
        integral is wanted. Where the elements would be larger than `share` of the distance from
        the point at 0.4 of it, they are graded anew from there: so a domain fits around the tip of
        a short branch or ligament, however large the body is.
    share : float
        Largest element at that place over its distance from the point.
    curves : bool
        In space: whether to grade to fronts, kinks and junctions of the cuts and to the edges
        where supports end. With exponent ⅔ quadratic elements reach order 3 in energy around an
        edge. The unknowns grow by no more than h⁻³, but for a logarithm.
    fronts : sequence of (Front, float)
        In space: fronts that a domain must fit around, each with the radius of its smallest, m.
        There elements are as large as `share` of that radius, farther off of the distance.
    way : float, optional
        Element size along cuts that a blade makes on its way, m: the tip is everywhere there once.
        Elements grow by half of their distance from them.
    """

    size: float
    points: Array
    radius: float = 1.0
    exponent: float = 0.8
    strip: float | None = None
    clear: Array | None = None
    share: float = 1 / 3
    curves: bool = False
    fronts: Sequence[tuple[Any, float]] = ()
    way: float | None = None

    @property
    def smallest(self) -> float:
        """Element size at a singular point, m."""
        ratio = min(self.size / self.radius, 1.0)
        return float(self.radius * max(ratio ** (1 / (1 - self.exponent)), _SMALLEST))

    def meshed(self, extent: float) -> float:
        """Size for gmsh at a singular point of a body that long, m; rings refine it further."""
        return max(self.smallest, extent * _MESHED)

    def halved(self, level: int) -> "Grading":
        """Divide all sizes by 2^level."""
        strip = None if self.strip is None else self.strip / 2**level
        way = None if self.way is None else self.way / 2**level
        size, share = self.size / 2**level, self.share / 2**level
        return replace(self, size=size, strip=strip, share=share, way=way)

    def close_points(self) -> list[tuple[Array, float]]:
        """Find points that are graded to anew, each with the distance r₀ from which on, m.

        There h(r) = share · r₀ · max((r/r₀)^exponent, r/r₀): outside r₀ elements grow in
        proportion to the distance, so that their number grows with its logarithm only.
        """
        if self.clear is None:
            return []
        found = []
        for point, clear in zip(self.points, self.clear, strict=True):
            at = _DOMAIN * float(clear)
            so_far = self.size * min(1.0, at / self.radius) ** self.exponent
            if np.isfinite(at) and self.share * at < so_far:
                found.append((point, at))
        return found

    def smallest_at(self, clear: float, extent: float) -> float:
        """Element size for gmsh at a point to which the mesh is graded from `clear` on, m."""
        return max(clear * self.share ** (1 / (1 - self.exponent)), extent * _MESHED)


def singular_points(scene: Scene) -> Array:
    """Find points (k, 2) where the gradient of the solution may be unbounded.

    Tips, kinks of more than 15°, junctions and crossings of cuts; points of the outline at which
    a support ends or a traction jumps, mouths in a support, and re-entrant corners; and where
    materials meet at the outline, at a cut or at a corner of a region. Tips, kinks and junctions
    alone where the supports prescribe an exact field, which is smooth elsewhere.
    """
    geometry = scene.geometry
    assert isinstance(geometry, Rectangle | Polygon)
    outline = geometry.outline()
    cuts = [feature for feature in plane_features(scene) if feature.name != "the boundary"]
    found = [_tips_and_kinks(cut, outline) for cut in scene.final_cuts]
    if len(scene.final_cuts) > 1:
        found.append(_inner(_junctions(cuts), outline))
    if not any(support.displacement == "exact" for support in scene.supports):
        found.append(_interface_points(scene, cuts, outline))
        found.append(_corners(scene))
        found.append(_held_mouths(scene, cuts))
    points = np.concatenate([np.zeros((0, 2)), *(f.reshape(-1, 2) for f in found)])
    scale = float(np.ptp(outline, axis=0).max())
    _, first = np.unique(np.round(points / scale, 9), axis=0, return_index=True)
    return points[first]


def clear_radii(scene: Scene, points: Array) -> Array:
    """Distance (k,) from singular points to the nearest feature, m, where a domain must fit.

    That is at tips whose stress intensity the scene asks for; it is infinite elsewhere.
    """
    geometry = scene.geometry
    assert isinstance(geometry, Rectangle | Polygon)
    touching = _SAME * float(np.ptp(geometry.outline(), axis=0).max())
    around = [*plane_features(scene), *plane_interfaces(scene)]
    features = np.array([feature.distance(points) for feature in around])
    apart = np.linalg.norm(points[:, None] - points, axis=2)
    away = np.concatenate([features, apart])
    nearest = np.where(away > touching, away, np.inf).min(axis=0, initial=np.inf)
    cuts: dict[str, Any] = {cut.name: cut for cut in scene.final_cuts}
    asked = [
        cuts[one.cut].vertices()[0 if one.end == "start" else -1]
        for one in scene.quantities
        if isinstance(one, FractureQuantity)
    ]
    from_asked = np.linalg.norm(points[:, None] - np.reshape(asked, (1, -1, 2)), axis=2)
    return np.where((from_asked <= touching).any(axis=1), nearest, np.inf)


def _inner(points: Array, outline: Array) -> Array:
    scale = float(np.ptp(outline, axis=0).max())
    away = distance_to_outline(points, outline) > 1e-9 * scale
    return points[inside_polygon(points, outline) & away]


def _tips_and_kinks(cut: Cut, outline: Array) -> Array:
    assert isinstance(cut, ArcCut | PolylineCut)
    vertices = cut.vertices()
    closed = bool(np.array_equal(vertices[0], vertices[-1]))
    if isinstance(cut, ArcCut):
        return _inner(vertices[[0, -1]][: 0 if closed else 2], outline)
    if closed:
        vertices = np.vstack([vertices[-2], vertices])
    along = np.diff(vertices, axis=0)
    turn = np.abs(
        np.arctan2(
            along[:-1, 0] * along[1:, 1] - along[:-1, 1] * along[1:, 0],
            np.sum(along[:-1] * along[1:], axis=1),
        )
    )
    kinks = vertices[1:-1][turn > _KINK]
    return _inner(kinks if closed else np.vstack([vertices[[0, -1]], kinks]), outline)


def _junctions(features: list[Feature]) -> Array:
    """Find points where different cuts meet."""
    pairs = [(a, b) for a, b in combinations(features, 2) if a.name != b.name]
    return np.concatenate([np.zeros((0, 2)), *(crossing_points([a, b]) for a, b in pairs)])


def _corners(scene: Scene) -> Array:
    """Find where a support ends or a traction jumps, and re-entrant corners."""
    corners = divided_outline(scene)
    held = supported_edges(scene, corners)
    following = np.roll(corners, -1, axis=0) - corners
    before = np.roll(following, 1, axis=0)
    turn = before[:, 0] * following[:, 1] - before[:, 1] * following[:, 0]
    sizes = np.linalg.norm(before, axis=1) * np.linalg.norm(following, axis=1)
    reentrant = turn * np.sign(polygon_area(corners)) < -1e-9 * sizes
    free = ~held & ~np.roll(held, 1)
    return corners[(held != np.roll(held, 1)) | reentrant | (free & load_jumps(scene, corners))]


def _held_mouths(scene: Scene, cuts: list[Feature]) -> Array:
    """Find points where a cut meets an edge that is held: a clamped corner on either side."""
    corners = divided_outline(scene)
    held = supported_edges(scene, corners)
    edges = [
        Feature("the boundary", a, b)
        for a, b, on in zip(corners, np.roll(corners, -1, axis=0), held, strict=True)
        if on
    ]
    meetings = [crossing_points([cut, edge]) for cut in cuts for edge in edges]
    return np.concatenate([np.zeros((0, 2)), *meetings])


def _interface_points(scene: Scene, cuts: list[Feature], outline: Array) -> Array:
    """Find where interfaces between materials end, meet cuts or meet each other."""
    interfaces = plane_interfaces(scene)
    ends = np.array([end for one in interfaces for end in (one.start, one.end)]).reshape(-1, 2)
    scale = float(np.ptp(outline, axis=0).max())
    # the parts of one arc meet smoothly
    names = np.repeat([one.name for one in interfaces], 2)
    same = np.linalg.norm(ends[:, None] - ends, axis=2) <= _SAME * scale
    lone = ends[(same & (names[:, None] == names)).sum(axis=1) == 1]
    met = [crossing_points([one, cut]) for one in interfaces for cut in cuts]
    points = np.concatenate([lone, *met, _junctions(interfaces)])
    on_outline = distance_to_outline(points, outline) <= _SAME * scale
    return points[inside_polygon(points, outline) | on_outline]


@contextmanager
def gmsh_session() -> Iterator[ModuleType]:
    """Give the gmsh module with an empty model, and finalise it afterwards."""
    import gmsh

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("General.NumThreads", 1)
        for source in ("FromPoints", "FromCurvature", "ExtendFromBoundary"):
            gmsh.option.setNumber(f"Mesh.MeshSize{source}", 0)
        yield gmsh
    finally:
        gmsh.finalize()


def simplices(
    gmsh: ModuleType, dimension: int
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Return all triangles (in the plane) or tetrahedra (in space) of the model.

    Returns
    -------
    points : (n, d) array
    cells : (m, d + 1) array
        Positively oriented.
    number : array
        Node number (row of `points`) by gmsh tag; −1 where a tag is not used.
    """
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    _, nodes = gmsh.model.mesh.getElementsByType({2: 2, 3: 4}[dimension])
    row = np.full(int(tags.max()) + 1 if len(tags) else 1, -1, dtype=np.int64)
    row[tags.astype(np.int64)] = np.arange(len(tags))
    cells = row[nodes.astype(np.int64)].reshape(-1, dimension + 1)
    used = np.unique(cells)
    compact = np.full(len(tags) + 1, -1, dtype=np.int64)
    compact[used] = np.arange(len(used))
    points = np.ascontiguousarray(coordinates.reshape(-1, 3)[used, :dimension])
    cells = compact[cells]
    number = np.where(row >= 0, compact[row], -1)
    return points, oriented(points, cells), number


def entity_facets(
    gmsh: ModuleType, entities: list[int], dimension: int, number: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Find nodes (f, k) of segments or triangles on curves or faces; `number` as of `simplices`."""
    found = [np.zeros((0, dimension + 1), dtype=np.int64)]
    for entity in entities:
        _, _, nodes = gmsh.model.mesh.getElements(dimension, entity)
        if nodes:
            found.append(number[np.asarray(nodes[0], dtype=np.int64)].reshape(-1, dimension + 1))
    return np.concatenate(found)


def add_polygon(occ: ModuleType, corners: NDArray[np.float64]) -> int:
    """Add the plane face between corners (k, 2 or 3)."""
    tags = [occ.addPoint(*p, *[0.0] * (3 - len(p))) for p in corners]
    lines = [occ.addLine(a, b) for a, b in pairwise([*tags, tags[0]])]
    return int(occ.addPlaneSurface([occ.addCurveLoop(lines)]))


def add_size(gmsh: ModuleType, formula: str) -> int:
    """Add a field of element sizes by a formula."""
    tag: int = gmsh.model.mesh.field.add("MathEval")
    gmsh.model.mesh.field.setString(tag, "F", formula)
    return tag


def set_sizes(gmsh: ModuleType, fields: list[int], smallest: float, largest: float) -> None:
    """Mesh by the least of some fields of sizes; without any, by bounds alone."""
    if fields:
        least = gmsh.model.mesh.field.add("Min")
        gmsh.model.mesh.field.setNumbers(least, "FieldsList", fields)
        gmsh.model.mesh.field.setAsBackgroundMesh(least)
    gmsh.option.setNumber("Mesh.MeshSizeMin", smallest)
    gmsh.option.setNumber("Mesh.MeshSizeMax", largest)


def background_mesh(
    outline: NDArray[np.float64], size: float
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Compute uniform unstructured triangles of a polygon, ignorant of any cut.

    Parameters
    ----------
    outline : (k, 2) array
        Corners in order, m.
    size : float
        Element size, m.

    Returns
    -------
    points : (n, 2) array
    cells : (m, 3) array
    """
    origin, scale = outline.min(axis=0), float(np.ptp(outline, axis=0).max())
    with gmsh_session() as gmsh:
        add_polygon(gmsh.model.occ, (outline - origin) / scale)
        gmsh.model.occ.synchronize()
        set_sizes(gmsh, [], size / scale, size / scale)
        gmsh.model.mesh.generate(2)
        points, cells, _ = simplices(gmsh, 2)
    return points * scale + origin, cells
