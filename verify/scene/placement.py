"""Checks that take more than one part of a scene: dimensions, names, where the cuts lie."""

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from verify.scene.acceptance import METRICS, DisplacementQuantity, OpeningQuantity
from verify.scene.cuts import ArcCut, PolygonCut, PolylineCut
from verify.scene.geometry import MeshFile, Polygon, Rectangle
from verify.scene.nearest import nearest
from verify.scene.physics import BodyForce, Gravity, Traction
from verify.scene.planar import (
    distance_to_outline,
    distance_to_polyline,
    inner_parts,
    inside_polygon,
    overlap_length,
    point_along,
    polylines_meet,
)
from verify.scene.regions import parse_region

if TYPE_CHECKING:
    from verify.scene.scene import Scene

Array = NDArray[np.float64]

__all__ = ["boundary_condition_names", "check_placement", "crossing_cuts"]


def check_placement(scene: "Scene") -> None:
    """Raise ValueError with one clear line if the parts of `scene` do not fit together."""
    _check_dimensions(scene)
    _check_regions(scene)
    _check_exact(scene)
    _check_names(scene)
    for i, cut in enumerate(scene.cuts):
        _check_cut(scene, cut, f"cuts[{i}] ('{cut.name}')")
    _check_overlaps(scene)
    _check_points(scene)


def boundary_condition_names(scene: "Scene") -> tuple[str, ...]:
    """Names that `where` may use: the boundary parts, and ``boundary`` for all of it."""
    return (*scene.geometry.parts(), "boundary")


def _check_dimensions(scene: "Scene") -> None:
    d = scene.dimension
    if d == 2 and scene.material.plane is None:
        raise ValueError("material.plane: a 2D scene needs plane = 'strain' or 'stress'")
    if d == 3 and scene.material.plane is not None:
        raise ValueError("material.plane: belongs to 2D scenes")
    for cells in scene.mesh.cells or []:
        if len(cells) != d:
            raise ValueError(f"mesh.cells: {list(cells)} has {len(cells)} numbers; expected {d}")
    if isinstance(scene.geometry, MeshFile) != (scene.mesh.pattern == "given"):
        raise ValueError("mesh.pattern: 'given' and a geometry of kind 'file' belong together")
    if scene.mesh.pattern == "structured" and isinstance(scene.geometry, Polygon):
        raise ValueError(
            "mesh.pattern: only rectangles and boxes have structured meshes; use 'unstructured'"
        )
    for i, support in enumerate(scene.supports):
        if any(c >= d for c in support.held(d)):
            raise ValueError(f"supports[{i}].components: z in a 2D scene")
        if support.displacement != "exact" and len(support.displacement) != len(support.held(d)):
            raise ValueError(
                f"supports[{i}].displacement: {len(support.displacement)} values; "
                f"expected {len(support.held(d))}"
            )
    for i, load in enumerate(scene.loads):
        vector = {"gravity": "acceleration", "body_force": "force", "traction": "traction"}
        value = getattr(load, vector[load.kind])
        if value != "exact" and len(value) != d:
            raise ValueError(f"loads[{i}].{vector[load.kind]}: {len(value)} values; expected {d}")
        if isinstance(load, Gravity) and scene.material.density is None:
            raise ValueError(f"loads[{i}]: gravity needs material.density")
    for i, cut in enumerate(scene.cuts):
        if isinstance(cut, PolygonCut) != (d == 3):
            raise ValueError(f"cuts[{i}]: a {cut.kind} cut in a {d}D scene")
    if scene.analysis.kind == "dynamic" and scene.material.density is None:
        raise ValueError("material.density: a dynamic analysis needs it")


def _check_regions(scene: "Scene") -> None:
    names = boundary_condition_names(scene)
    places = [(f"supports[{i}].where", s.where) for i, s in enumerate(scene.supports)]
    places += [
        (f"loads[{i}].where", load.where)
        for i, load in enumerate(scene.loads)
        if isinstance(load, Traction)
    ]
    for place, where in places:
        if where in names:
            continue
        if where.replace("_", "").isalnum():
            raise ValueError(f"{place}: no part '{where}'{nearest(where, names)}")
        try:
            parse_region(where, scene.dimension)
        except ValueError as error:
            raise ValueError(f"{place}: {error}") from None


def _check_exact(scene: "Scene") -> None:
    wants = [f"supports[{i}]" for i, s in enumerate(scene.supports) if s.displacement == "exact"]
    wants += [
        f"loads[{i}]"
        for i, load in enumerate(scene.loads)
        if (isinstance(load, BodyForce) and load.force == "exact")
        or (isinstance(load, Traction) and load.traction == "exact")
    ]
    if scene.reference.kind == "exact":
        wants.append("reference.kind")
    if wants and scene.exact is None:
        raise ValueError(f"{wants[0]}: 'exact' needs an [exact] solution")


def _check_names(scene: "Scene") -> None:
    cuts = [cut.name for cut in scene.cuts]
    if len(set(cuts)) != len(cuts):
        raise ValueError(f"cuts: names must differ, got {cuts}")
    quantities = [quantity.name for quantity in scene.quantities]
    if len(set(quantities)) != len(quantities):
        raise ValueError(f"quantities: names must differ, got {quantities}")
    for i, quantity in enumerate(scene.quantities):
        if quantity.kind == "opening" and quantity.cut not in cuts:
            raise ValueError(
                f"quantities[{i}].cut: no cut '{quantity.cut}'{nearest(quantity.cut, cuts)}"
            )
        if quantity.kind == "displacement" and len(quantity.point) != scene.dimension:
            raise ValueError(f"quantities[{i}].point: expected {scene.dimension} coordinates")
    known = dict.fromkeys((*METRICS, *quantities))
    for i, check in enumerate(scene.acceptance):
        if check.metric not in known:
            raise ValueError(
                f"acceptance[{i}].metric: no '{check.metric}'{nearest(check.metric, known)}"
            )
        if check.metric == "jump_l2" and not cuts:
            raise ValueError(f"acceptance[{i}].metric: jump_l2 needs a cut")
        if check.check == "rate" and scene.mesh.count < 2:
            raise ValueError(f"acceptance[{i}]: a rate needs at least two mesh levels")


def _check_cut(scene: "Scene", cut: PolylineCut | ArcCut | PolygonCut, place: str) -> None:
    if not isinstance(scene.geometry, Rectangle | Polygon) or isinstance(cut, PolygonCut):
        return  # checked against the mesh by the solvers
    outline = scene.geometry.outline()
    vertices = cut.vertices()
    if not inner_parts(vertices, outline):
        raise ValueError(f"{place}: lies outside the body or along its boundary; it cuts nothing")
    kind = {0: "through", 1: "edge", 2: "inner"}[int(_inside(vertices[[0, -1]], outline).sum())]
    if cut.expected and cut.expected != kind and not np.array_equal(vertices[0], vertices[-1]):
        raise ValueError(f"{place}: expected '{cut.expected}' but it is '{kind}'")


def _check_overlaps(scene: "Scene") -> None:
    plane = [cut for cut in scene.cuts if not isinstance(cut, PolygonCut)]
    for a, b in combinations(plane, 2):
        length = overlap_length(a.vertices(), b.vertices())
        if length > 0.0:
            raise ValueError(
                f"cuts: '{a.name}' and '{b.name}' lie on each other over {length:.3g} m"
            )


def _check_points(scene: "Scene") -> None:
    """Quantities are asked for where there is material, and on one side of each cut."""
    if not isinstance(scene.geometry, Rectangle | Polygon):
        return
    outline = scene.geometry.outline()
    tolerance = 1e-9 * float(np.ptp(outline, axis=0).max())
    cuts = {cut.name: cut.vertices() for cut in scene.cuts if not isinstance(cut, PolygonCut)}
    for i, quantity in enumerate(scene.quantities):
        if isinstance(quantity, DisplacementQuantity):
            place, point = f"quantities[{i}].point:", np.array([quantity.point], dtype=float)
        elif isinstance(quantity, OpeningQuantity):
            place = f"quantities[{i}].at: {quantity.at} of cut '{quantity.cut}' is at"
            point = point_along(cuts[quantity.cut], quantity.at)[None]
        else:
            continue
        where = f"{place} ({', '.join(f'{x:.6g}' for x in point[0])})"
        on_boundary = distance_to_outline(point, outline)[0] <= tolerance
        if not (on_boundary or inside_polygon(point, outline)[0]):
            raise ValueError(f"{where}, which is not in the body")
        on_cut = [n for n, v in cuts.items() if distance_to_polyline(point, v)[0] <= tolerance]
        if isinstance(quantity, DisplacementQuantity) and on_cut:
            raise ValueError(
                f"{where} lies on cut '{on_cut[0]}', where the displacement has two values; "
                "ask for an opening"
            )


def _inside(points: Array, outline: Array) -> NDArray[np.bool_]:
    """Whether `points` (n, 2) lie inside the body and not on its boundary."""
    tolerance = 1e-9 * float(np.ptp(outline, axis=0).max())
    inner: NDArray[np.bool_] = inside_polygon(points, outline)
    return inner & (distance_to_outline(points, outline) > tolerance)


def crossing_cuts(scene: "Scene") -> list[tuple[str, str]]:
    """Pairs of names of plane cuts whose polylines share a point."""
    plane = [cut for cut in scene.cuts if not isinstance(cut, PolygonCut)]
    return [
        (a.name, b.name)
        for a, b in combinations(plane, 2)
        if polylines_meet(a.vertices(), b.vertices())
    ]
