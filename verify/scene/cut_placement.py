"""Placement of cuts: in the body, as expected, not on each other; and of what lies on them."""

from collections.abc import Callable
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.geometry.nearest import distance_to_outline, distance_to_pieces
from verify.geometry.planar import inner_parts, inside_polygon, overlap_length, point_along
from verify.geometry.spatial import area_inside, length_inside, overlap_area, rim_edges
from verify.scene.acceptance import DisplacementQuantity, OpeningQuantity, PartQuantity
from verify.scene.cuts import ArcCut, whole_cut
from verify.scene.geometry import Box, Polygon, Rectangle
from verify.scene.spatial_cuts import SpatialCut
from verify.scene.tables import SceneTables
from verify.scene.tool_path import ToolPathCut

Array = NDArray[np.float64]

_TOLERANCE = 1e-9  # of the size of what is compared
_ON_CUT = 1e-3  # of the body: the cut that a point is held against is triangulated


def check_cuts(scene: SceneTables) -> None:
    """Raise ValueError if a cut lies outside the body, other than expected, or on another."""
    for i, cut in enumerate(_known(scene)):
        _check_cut(scene, cut, f"cuts[{i}] ('{cut.name}')")
    for a, b in combinations(_known(scene), 2):
        if common := _common(a, b):
            raise ValueError(f"cuts: '{a.name}' and '{b.name}' lie on each other over {common}")


def _known(scene: SceneTables) -> list[Any]:
    """Return the final cuts; a blade that sweeps no known surface stays a tool path."""
    known: list[Any] = []
    for cut in scene.cuts:
        try:
            known.append(whole_cut(cut))
        except InputError:  # played only: the solvers say so
            known.append(cut)
    return known


def _check_cut(scene: SceneTables, cut: Any, place: str) -> None:
    body = scene.geometry
    nothing = f"{place}: lies outside the body or along its boundary; it cuts nothing"
    if isinstance(body, Rectangle | Polygon) and cut.dimension == 2:
        outline, vertices = body.outline(), cut.vertices()
        if not inner_parts(vertices, outline):
            raise ValueError(nothing)
        closed = np.array_equal(vertices[0], vertices[-1])
        inner = int(_inside(vertices[[0, -1]], outline).sum())
        kind = {0: "through", 1: "edge", 2: "inner"}[inner]
    elif isinstance(body, Box) and isinstance(cut, SpatialCut):
        lower, upper = np.array(body.lower), np.array(body.upper)
        surface = cut.surface()
        if not area_inside(surface, lower, upper):
            raise ValueError(nothing)
        rim = rim_edges(surface)
        closed = len(rim) == 0
        whole = float(np.linalg.norm(rim[:, 1] - rim[:, 0], axis=1).sum())
        share = length_inside(rim, lower, upper) / whole if whole else 0.0
        kind = "through" if share == 0.0 else "inner" if share > 1 - _TOLERANCE else "edge"
    else:
        return  # known to the mesh only: checked by the solvers
    if cut.expected and cut.expected != kind and not closed:
        raise ValueError(f"{place}: expected '{cut.expected}' but it is '{kind}'")


def _common(a: Any, b: Any) -> str | None:
    """How much of two cuts lies on each other, with its unit, or None."""
    if isinstance(a, SpatialCut) and isinstance(b, SpatialCut):
        area = overlap_area(a.surface(), b.surface())
        return f"{area:.3g} m²" if area else None
    if a.dimension != 2 or b.dimension != 2:
        return None
    if isinstance(a, ArcCut) and isinstance(b, ArcCut):
        length = _common_arc(a, b)
    elif isinstance(a, ArcCut) or isinstance(b, ArcCut):
        return None  # an arc has no straight part
    else:
        length = overlap_length(a.vertices(), b.vertices())
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


def check_points(
    scene: SceneTables, size: float | None = None, holds: Callable[[Array], bool] | None = None
) -> None:
    """Raise ValueError if a quantity is asked for where there is no material, or two values.

    Of a body from a mesh file its `size`, m, must be given, and whether it `holds` a point (d,).
    """
    size = _body_size(scene) if size is None else size
    if size is None:
        return
    for i, asked in enumerate(scene.quantities):
        if isinstance(asked, PartQuantity) and asked.point is None:
            continue
        if isinstance(asked, DisplacementQuantity | PartQuantity):
            place, point = f"quantities[{i}].point:", np.array(asked.point, dtype=float)
        elif isinstance(asked, OpeningQuantity) and scene.dimension == 2:
            cut: Any = next(cut for cut in _known(scene) if cut.name == asked.cut)
            place = f"quantities[{i}].at: {asked.at} of cut '{asked.cut}' is at"
            point = point_along(cut.vertices(), asked.at or 0.0)
        elif isinstance(asked, OpeningQuantity):
            place, point = f"quantities[{i}].point:", np.array(asked.point, dtype=float)
        else:
            continue
        where = f"{place} ({', '.join(f'{x:.6g}' for x in point)})"
        if not (holds(point) if holds else _holds(scene, point, _TOLERANCE * size)):
            raise ValueError(f"{where}, which is not in the body")
        _check_cuts_at(scene, asked, point, where, size)


def _check_cuts_at(scene: SceneTables, asked: Any, point: Array, where: str, size: float) -> None:
    near = {name: d for name, d in _cut_distances(scene, point).items() if d <= _TOLERANCE * size}
    if isinstance(asked, PartQuantity) and near:
        raise ValueError(f"{where} lies on cut '{next(iter(near))}', between two parts")
    if isinstance(asked, DisplacementQuantity) and near:
        raise ValueError(
            f"{where} lies on cut '{next(iter(near))}', where the displacement has two values; "
            "ask for an opening"
        )
    if isinstance(asked, OpeningQuantity) and scene.dimension == 3:
        off = _cut_distances(scene, point).get(asked.cut, 0.0)
        if off > _ON_CUT * size:
            raise ValueError(f"{where} is {off:.3g} m away from cut '{asked.cut}'")


def _body_size(scene: SceneTables) -> float | None:
    body = scene.geometry
    if isinstance(body, Rectangle | Polygon):
        return float(np.ptp(body.outline(), axis=0).max())
    if isinstance(body, Box):
        return float(np.max(np.subtract(body.upper, body.lower)))
    return None


def _holds(scene: SceneTables, point: Array, tolerance: float) -> bool:
    body = scene.geometry
    if isinstance(body, Box):
        low, high = np.array(body.lower) - tolerance, np.array(body.upper) + tolerance
        return bool(((point >= low) & (point <= high)).all())
    assert isinstance(body, Rectangle | Polygon)
    outline = body.outline()
    on_boundary = distance_to_outline(point[None], outline)[0] <= tolerance
    return bool(on_boundary or inside_polygon(point[None], outline)[0])


def _cut_distances(scene: SceneTables, point: Array) -> dict[str, float]:
    """Distance of a point to every cut whose shape is known, by the name of the cut."""
    return {
        cut.name: float(distance_to_pieces(point[None], cut.pieces())[0])
        for cut in _known(scene)
        if not isinstance(cut, ToolPathCut) or cut.dimension == 2
    }


def _inside(points: Array, outline: Array) -> NDArray[np.bool_]:
    """Whether `points` (n, 2) lie inside the body and not on its boundary."""
    tolerance = _TOLERANCE * float(np.ptp(outline, axis=0).max())
    inner: NDArray[np.bool_] = inside_polygon(points, outline)
    return inner & (distance_to_outline(points, outline) > tolerance)
