"""Checks that take more than one part of a scene: dimensions, names, where the cuts lie."""

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from verify.scene.cuts import ArcCut, PolygonCut, PolylineCut
from verify.scene.geometry import MeshFile, Polygon, Rectangle
from verify.scene.nearest import nearest
from verify.scene.physics import BodyForce, Gravity, Traction
from verify.scene.planar import distance_to_outline, inside_polygon
from verify.scene.regions import parse_region

if TYPE_CHECKING:
    from verify.scene.scene import Scene

__all__ = ["boundary_condition_names", "check_placement"]

METRICS = ("displacement_l2", "energy_norm", "jump_l2", "strain_energy")


def check_placement(scene: "Scene") -> None:
    """Raise ValueError with one clear line if the parts of `scene` do not fit together."""
    _check_dimensions(scene)
    _check_regions(scene)
    _check_exact(scene)
    _check_names(scene)
    for cut in scene.cuts:
        _check_cut(scene, cut)


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
    if scene.mesh.pattern == "structured" and isinstance(scene.geometry, Polygon | MeshFile):
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
            raise ValueError(f"quantities[{i}].cut: no cut '{quantity.cut}'{nearest(quantity.cut, cuts)}")
        if quantity.kind == "displacement" and len(quantity.point) != scene.dimension:
            raise ValueError(f"quantities[{i}].point: expected {scene.dimension} coordinates")
    known = (*METRICS, *quantities)
    for i, check in enumerate(scene.acceptance):
        if check.metric not in known:
            raise ValueError(f"acceptance[{i}].metric: no '{check.metric}'{nearest(check.metric, known)}")
        if check.metric == "jump_l2" and not cuts:
            raise ValueError(f"acceptance[{i}].metric: jump_l2 needs a cut")
        if check.check == "rate" and scene.mesh.count < 2:
            raise ValueError(f"acceptance[{i}]: a rate needs at least two mesh levels")


def _check_cut(scene: "Scene", cut: PolylineCut | ArcCut | PolygonCut) -> None:
    if not isinstance(scene.geometry, Rectangle | Polygon) or isinstance(cut, PolygonCut):
        return  # checked against the mesh by the solvers
    outline = scene.geometry.outline()
    size = float(np.ptp(outline, axis=0).max())
    vertices = cut.vertices()
    # enough samples that a cut through a corner of the body is not taken for one outside
    samples = np.concatenate(
        [a + np.linspace(0, 1, 65)[:, None] * (b - a) for a, b in zip(vertices, vertices[1:], strict=False)]
    )
    border = distance_to_outline(samples, outline) <= 1e-9 * size
    if not (inside_polygon(samples, outline) & ~border).any():
        place = f"cuts[{scene.cuts.index(cut)}] ('{cut.name}')"
        raise ValueError(f"{place}: lies outside the body or along its boundary; it cuts nothing")
    ends = vertices[[0, -1]]
    inner = inside_polygon(ends, outline) & (distance_to_outline(ends, outline) > 1e-9 * size)
    kind = {0: "through", 1: "edge", 2: "inner"}[int(inner.sum())]
    if cut.expected and cut.expected != kind and not np.array_equal(ends[0], ends[1]):
        place = f"cuts[{scene.cuts.index(cut)}] ('{cut.name}')"
        raise ValueError(f"{place}: expected '{cut.expected}' but it is '{kind}'")


def crossing_cuts(scene: "Scene") -> list[tuple[str, str]]:
    """Pairs of names of plane cuts whose polylines share a point."""
    from verify.scene.planar import _meet

    pairs = []
    for a, b in combinations([c for c in scene.cuts if not isinstance(c, PolygonCut)], 2):
        p, q = a.vertices(), b.vertices()
        if any(
            _meet(p[i], p[i + 1], q[j], q[j + 1])
            for i in range(len(p) - 1)
            for j in range(len(q) - 1)
        ):
            pairs.append((a.name, b.name))
    return pairs
