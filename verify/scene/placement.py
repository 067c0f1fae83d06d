"""Placement in the body: of cuts, and of the points, parts and regions that a scene names.

Each function returns the first fault in words, key first, or nothing.
"""

from collections.abc import Callable, Iterable
from itertools import combinations, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.geometry.planar import inner_parts, inside_polygon, overlap_length, points_along
from verify.geometry.simplices import (
    area_inside,
    boundary_facets,
    distance_to_outline,
    distance_to_pieces,
    length_inside,
    overlap_area,
    rim_edges,
)
from verify.printable import place_text
from verify.scene.acceptance import FractureQuantity, SectionQuantity, StressQuantity
from verify.scene.cuts import ArcCut
from verify.scene.geometry import GROUP, Box, MeshFile, Polygon, Rectangle
from verify.scene.parts import held_facets, on_part, pieces_on_part
from verify.scene.physics import Traction
from verify.scene.strict import NO_POINT_LOADS
from verify.scene.tables import SceneTables

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_TOLERANCE = 1e-9  # of the size of the compared parts
_ON_CUT = 1e-3  # of the body: the cut that a point is held against is triangulated
_SAMPLES = 2**16  # of the body: a region of less than about 1e-4 of it may be missed
_TURNS, _RINGS = {2: 256, 3: 48}, 24  # points on a circle, and circles of a sphere
# steps of an additive recurrence that fills a square or a cube evenly (Roberts 2018)
_STEPS = {2: (0.75487766625, 0.56984029100), 3: (0.81917251340, 0.67104360670, 0.54970047790)}


# -------------------------------------------------------------------------------------- materials
def points_of_body(scene: SceneTables) -> Array:
    """Points (n, d) all over the body; none of a body that only its mesh file knows."""
    body, d = scene.geometry, scene.dimension
    ends = body.extremes()
    if not len(ends):
        return np.zeros((0, d))
    share = np.mod(0.5 + np.outer(np.arange(1, _SAMPLES + 1), _STEPS[d]), 1.0)
    points: Array = ends.min(axis=0) + share * np.ptp(ends, axis=0)
    return points[inside_polygon(points, ends)] if isinstance(body, Polygon) else points


def empty_region(scene: SceneTables, points: Array) -> str | None:
    """Which material none of the points (n, d) of the body has."""
    regions = scene.material.regions
    if not regions or not len(points):
        return None
    found = np.bincount(scene.material.number_at(points), minlength=len(regions) + 1)
    for i, region in enumerate(regions):
        if not found[i + 1]:
            return (
                f"material.regions[{i}].where: no part of the body lies in '{region.where}' alone; "
                "of regions that overlap, the last one counts"
            )
    if not found[0]:
        return "material.regions: they cover the body; [material] is that of no part"
    return None


def group_fault(scene: SceneTables) -> str | None:
    """Which group of a mesh file is missing, has no cells, or shares some with other material."""
    if not isinstance(scene.geometry, MeshFile):
        return None
    body = scene.geometry.body()
    named: list[tuple[str, str, int | None]] = [
        (f"material.regions[{i}].where", region.where, i)
        for i, region in enumerate(scene.material.regions)
    ]
    named += [(key, where, None) for key, where, _ in _inequalities(scene)]
    owner, moduli = np.full(len(body.cells), -1), scene.material.each[1:]
    for key, where, own in named:
        if not scene.geometry.is_part(where):
            continue
        name = where.removeprefix(GROUP)
        try:
            cells = body.group(name).cells
        except InputError as error:
            return f"{key}: {error.what}"
        if own is None:
            continue
        if not len(cells):
            return f"{key}: group '{name}' has no cells of the body, only parts of its boundary"
        before = owner[cells]
        for other in np.unique(before[before >= 0]):
            if moduli[other] != moduli[own]:
                return (
                    f"{key}: {int((before == other).sum())} cells of group '{name}' are also in "
                    f"'{scene.material.regions[other].where}' of another material"
                )
        owner[cells] = own
    return None


# ---------------------------------------------------------------------------- parts of the boundary
def part_without_facets(scene: SceneTables) -> str | None:
    """Which support or traction would act nowhere, by the scene alone.

    A traction needs a part of the boundary's facets; a support that, or a node of the structured
    meshes of the scene. Of other meshes nothing is known but that they have nodes at the corners.
    """
    for level, facets in enumerate(_boundary(scene) if _inequalities(scene) else []):
        where_it_is = f" on mesh level {level}" if scene.mesh.count > 1 else ""
        if found := _without_facets(scene, facets, where_it_is):
            return found
    return None


def part_without_mesh(scene: SceneTables, points: Array, cells: Ints) -> str | None:
    """Which support or traction acts on no node or facet of a given mesh, (n, d) and (m, k)."""
    facets = boundary_facets(cells)[0]
    if not len(facets):
        acting = [
            f"supports[{i}]" for i, one in enumerate(scene.supports)
            if not scene.geometry.holds_inside(one.where)
        ]  # fmt: skip
        acting += [f"loads[{i}]" for i, one in enumerate(scene.loads) if isinstance(one, Traction)]
        if acting:
            return (
                f"{acting[0]}: the surface is closed and has no rim to act on; hold a group of its "
                "triangles or nodes, or let the body move freely in a dynamic analysis"
            )
    return _without_facets(scene, points[facets], "")


def _inequalities(scene: SceneTables) -> list[tuple[str, str, bool]]:
    """Key, inequality, and whether more than a node is needed, of supports and tractions."""
    parts = [(f"supports[{i}].where", s.where, False) for i, s in enumerate(scene.supports)]
    parts += [
        (f"loads[{i}].where", load.where, True)
        for i, load in enumerate(scene.loads)
        if isinstance(load, Traction)
    ]
    named = (*scene.geometry.parts(), "boundary")  # groups are known from the mesh file alone
    return [part for part in parts if part[1] not in named]


def _without_facets(scene: SceneTables, facets: Array, where_it_is: str) -> str | None:
    """Which part has nothing of facets (k, corners, d), and for a support no node."""
    points = facets.reshape(-1, scene.dimension)
    for key, where, area in _inequalities(scene):
        if not area and scene.geometry.holds_inside(where):
            continue
        touched = on_part(scene.geometry, where, points, float(np.ptp(points, axis=0).max()))
        of_facets = facets.shape[1] in _corners_of_group(scene, where)
        if area:
            acts = len(pieces_on_part(scene.geometry, where, facets).facet) > 0
        else:
            held = held_facets(scene.geometry, where, facets).held.any()
            acts = bool(held or (touched.any() and not of_facets))
        if not acts:
            what = "facet" if area or of_facets else "node"
            hint = NO_POINT_LOADS if area and touched.any() and not of_facets else ""
            hint = "; its facets are inside the body" if of_facets else hint
            return f"{key}: no {what} of the boundary lies in '{where}'{where_it_is}{hint}"
    return None


def _corners_of_group(scene: SceneTables, where: str) -> Iterable[int]:
    """Numbers of corners of the parts, below cells, of a group of a mesh file."""
    if not isinstance(scene.geometry, MeshFile) or not scene.geometry.is_part(where):
        return ()
    return scene.geometry.body().group(where.removeprefix(GROUP)).parts


def _boundary(scene: SceneTables) -> list[Array]:
    """Facets (k, corners, d) of the boundary of each level, or pieces in their place."""
    body, mesh = scene.geometry, scene.mesh
    if isinstance(body, Rectangle | Box) and mesh.pattern == "structured":
        lower, upper = np.array(body.lower), np.array(body.upper)
        levels = range(mesh.count)
        return [_faces(lower, upper, mesh.divisions(body, level)) for level in levels]
    if isinstance(body, Rectangle | Polygon):
        outline = body.outline()
        return [np.stack([outline, np.roll(outline, -1, axis=0)], axis=1)]
    return []  # known from its mesh alone, or meshed by nobody


def _faces(lower: Array, upper: Array, counts: Ints) -> Array:
    """Edges (k, 2, 2) of a divided rectangle, or half squares (k, 3, 3) of a divided box."""
    dimension = len(counts)
    axes = [np.linspace(a, b, n + 1) for a, b, n in zip(lower, upper, counts, strict=True)]
    found = []
    for normal, end in product(range(dimension), (0, -1)):
        others = [k for k in range(dimension) if k != normal]
        first = np.meshgrid(*[np.arange(counts[k]) for k in others], indexing="ij")
        corners = []
        for step in product((0, 1), repeat=dimension - 1):
            point = np.empty((first[0].size, dimension))
            point[:, normal] = axes[normal][end]
            for k, index, s in zip(others, first, step, strict=True):
                point[:, k] = axes[k][index.ravel() + s]
            corners.append(point)
        square = np.stack(corners, axis=1)
        found += [square] if dimension == 2 else [square[:, :3], square[:, 1:]]
    return np.concatenate(found)


# ------------------------------------------------------------------------------------------- cuts
def misplaced_cut(scene: SceneTables) -> str | None:
    """Which cut lies outside the body, other than expected, or on another one."""
    cuts = _known(scene)
    for i, cut in enumerate(cuts):
        if found := _misplaced(scene, cut):
            return f"cuts[{i}] ('{cut.name}'): {found}"
    for a, b in combinations(cuts, 2):
        if common := _common(a, b):
            return f"cuts: '{a.name}' and '{b.name}' lie on each other over {common}"
    return None


def _known(scene: SceneTables) -> list[Any]:
    """Return the final cuts; a blade that sweeps no known surface stays a tool path."""
    known: list[Any] = []
    for cut in scene.cuts:
        try:
            known.append(cut.whole())
        except InputError:  # played only: the solvers say so
            known.append(cut)
    return known


def _misplaced(scene: SceneTables, cut: Any) -> str | None:
    body = scene.geometry
    if isinstance(body, Rectangle | Polygon) and cut.dimension == 2:
        outline, vertices = body.outline(), cut.vertices()
        cuts_it = bool(inner_parts(vertices, outline))
        closed = np.array_equal(vertices[0], vertices[-1])
        ends = vertices[[0, -1]]
        inside = inside_polygon(ends, outline)
        inside &= distance_to_outline(ends, outline) > _TOLERANCE * np.ptp(outline, axis=0).max()
        kind = ("through", "edge", "inner")[int(inside.sum())]
    elif isinstance(body, Box) and cut.dimension == 3 and not cut.on_the_way:
        surface, (lower, upper) = cut.facets(), body.extremes()
        cuts_it = area_inside(surface, lower, upper) > 0.0
        rim = rim_edges(surface)
        closed = len(rim) == 0
        length = float(np.linalg.norm(rim[:, 1] - rim[:, 0], axis=1).sum())
        share = length_inside(rim, lower, upper) / length if length else 0.0
        kind = "through" if share == 0.0 else "inner" if share > 1 - _TOLERANCE else "edge"
    else:
        return None  # known to the mesh only: checked by the solvers
    if not cuts_it:
        return "lies outside the body or along its boundary; it cuts nothing"
    if cut.expected and cut.expected != kind and not closed:
        return f"expected '{cut.expected}' but it is '{kind}'"
    return None


def _common(a: Any, b: Any) -> str | None:
    """How much of two cuts lies on each other, with its unit, or None."""
    if a.dimension != b.dimension:
        return None
    if a.dimension == 3:
        area = 0.0 if a.on_the_way or b.on_the_way else overlap_area(a.facets(), b.facets())
        return f"{area:.3g} m²" if area else None
    if isinstance(a, ArcCut) and isinstance(b, ArcCut):
        length = _common_arc(a, b)
    else:  # an arc has no straight part
        length = overlap_length(a.vertices(), b.vertices()) if a.faceted and b.faceted else 0.0
    return f"{length:.3g} m" if length else None


def _common_arc(a: ArcCut, b: ArcCut) -> float:
    """Length that two arcs have in common: they touch at points, unless their circle is one."""
    tolerance = _TOLERANCE * max(a.radius, b.radius)
    apart = float(np.hypot(a.centre[0] - b.centre[0], a.centre[1] - b.centre[1]))
    if apart > tolerance or abs(a.radius - b.radius) > tolerance:
        return 0.0
    first = (b.start - a.start) % 360.0
    covered = 0.0
    for begin in (first - 360.0, first):
        covered += max(0.0, min(a.sweep, begin + b.sweep) - max(0.0, begin))
    length = float(np.deg2rad(covered)) * a.radius
    return length if length > tolerance else 0.0


# ----------------------------------------------------------------------------------------- points
def on_unit_sphere(d: int) -> tuple[Array, Array]:
    """Points (n, d) evenly on the unit circle or sphere and weights (n,) that sum to 1.

    Evenly spaced around an axis and of Gauss-Legendre along it: opposite ones are both there.
    """
    heights, weights = np.polynomial.legendre.leggauss(_RINGS) if d == 3 else np.array([[0.0], [2]])
    turn = 2.0 * np.pi * np.arange(_TURNS[d]) / _TURNS[d]
    wide = np.sqrt(1.0 - heights**2)[:, None]
    across = [np.ravel(wide * np.cos(turn)), np.ravel(wide * np.sin(turn))]
    points = np.column_stack([*across, *[np.repeat(heights, _TURNS[d])] * (d - 2)])
    return points, np.repeat(0.5 * weights, _TURNS[d]) / _TURNS[d]


def misplaced_point(
    scene: SceneTables, size: float | None = None, holds: Callable[[Array], bool] | None = None
) -> str | None:
    """Which quantity is at a place without material, or with two values.

    Of a body from a mesh file its `size`, m, must be given, and whether it `holds` a point (d,).
    """
    ends = scene.geometry.extremes()
    if size is None and not len(ends):
        return None
    size = float(np.ptp(ends, axis=0).max()) if size is None else size
    for i, asked in enumerate(scene.quantities):
        place, point = f"quantities[{i}].point:", getattr(asked, "point", None)
        if asked.kind == "opening" and scene.dimension == 2:
            cut = next(cut for cut in _known(scene) if cut.name == asked.cut)
            place = f"quantities[{i}].at: {asked.at} of cut '{asked.cut}' is at"
            point = points_along(cut.vertices(), asked.at or 0.0)
        if point is None or isinstance(asked, FractureQuantity | SectionQuantity):
            continue
        at = np.array(point, dtype=float)
        where = f"{place} {place_text(at)}"
        ball = [at]
        if isinstance(asked, StressQuantity):
            where += f" as the centre of a ball of {asked.radius:.4g} m"
            ball += list(at + (1 - _TOLERANCE) * asked.radius * on_unit_sphere(len(at))[0])
        near = _TOLERANCE * size
        if not all(holds(x) if holds else scene.geometry.holds(x[None], near)[0] for x in ball):
            return f"{where}, which is not in the body"
        if len(ball) > 1 and np.ptp(scene.material.number_at(np.array(ball))):
            return f"{where}, in which materials differ; expected one"
        if found := _at_a_cut(scene, asked, at, size):
            return f"{where} {found}"
    return None


def _at_a_cut(scene: SceneTables, asked: Any, point: Array, size: float) -> str | None:
    """Say that a quantity has two values at a point of a cut, or that an opening has none there."""
    away = {
        cut.name: float(distance_to_pieces(point[None], cut.pieces())[0])
        for cut in _known(scene)
        if cut.dimension == 2 or not cut.on_the_way
    }
    if asked.kind == "opening":
        off = away.get(asked.cut, 0.0) if scene.dimension == 3 else 0.0
        return f"is {off:.3g} m away from cut '{asked.cut}'" if off > _ON_CUT * size else None
    for name, off in away.items():
        if isinstance(asked, StressQuantity):
            if off < asked.radius:
                return f"is {off:.4g} m away from cut '{name}'; expected more than the radius"
            continue
        if off <= _TOLERANCE * size and asked.kind == "part":
            return f"lies on cut '{name}', between two parts"
        if off <= _TOLERANCE * size:
            return (
                f"lies on cut '{name}', where the displacement has two values; ask for an opening"
            )
    return None
