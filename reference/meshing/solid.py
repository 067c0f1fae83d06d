"""Meshes of boxes that conform to cut surfaces (gmsh, OpenCASCADE kernel, HXT)."""

from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference.meshing.box_lines import clamped_edges, part_lines
from reference.meshing.edge_splitting import loosen_front
from reference.meshing.grading import Grading
from reference.meshing.interfaces import solid_interfaces
from reference.meshing.opening import ConformingMesh, measures, open_cut
from reference.meshing.session import (
    add_polygon,
    add_size,
    entity_facets,
    gmsh_session,
    set_sizes,
    simplices,
)
from reference.meshing.solid_cuts import CutFaces, add_surface, imprint_surfaces
from verify.errors import InputError
from verify.scene import Box, Scene

Array = NDArray[np.float64]
_HXT = 10  # ten times quicker than gmsh's Delaunay, and keeps embedded faces
_MOST_SAMPLES = 20000


def solid_mesh(scene: Scene, grading: Grading) -> ConformingMesh:
    """Mesh a box so that its cuts run along facets, and open them.

    Parameters
    ----------
    scene : Scene
        A box with cut surfaces; they may end inside, cross, branch and reach beyond the body.
    grading : Grading
        Element sizes.

    Raises
    ------
    InputError
        If gmsh cannot mesh the geometry, or no cut lies inside the body.
    """
    assert isinstance(scene.geometry, Box)
    lower, upper = (np.array(c, dtype=float) for c in (scene.geometry.lower, scene.geometry.upper))
    # gmsh's tolerances are absolute: mesh a body of size one
    scale = float((upper - lower).max())
    where = str(scene.file or "")
    lines = part_lines(scene)
    try:
        with gmsh_session() as gmsh:
            body = int(gmsh.model.occ.addBox(0, 0, 0, *((upper - lower) / scale)))
            faces = {
                tag: cut.name
                for cut in scene.final_cuts
                for tag in add_surface(gmsh, cut, lower, scale)
            }
            met = [
                add_polygon(gmsh.model.occ, (corners - lower) / scale)
                for corners in solid_interfaces(scene)
            ]
            edges = _add_lines(gmsh, (lines - lower) / scale)
            cut = imprint_surfaces(gmsh, body, faces, edges, met)
            if scene.final_cuts and not cut.faces:
                raise InputError("cuts: none of them lies inside the body", where)
            graded = []
            if grading.curves:
                graded = [*cut.singular, *_clamped(gmsh, scene, cut, lower, scale)]
            way = cut.faces if grading.way else []
            _set_sizes(gmsh, grading, graded, way, lower, scale)
            gmsh.option.setNumber("Mesh.Algorithm3D", _HXT)
            gmsh.model.mesh.generate(3)
            points, cells, number = simplices(gmsh, 3)
            facets = entity_facets(gmsh, cut.faces, 2, number)
    except InputError:
        raise
    except Exception as error:  # gmsh raises bare Exception
        raise InputError(f"gmsh could not mesh the body with its cuts ({error})", where) from None
    points, cells, facets = loosen_front(points, cells, facets)
    mesh = open_cut(points * scale + lower, cells, facets)
    _check_volume(mesh, float(np.prod(upper - lower)), where)
    return mesh


def _set_sizes(
    gmsh: ModuleType,
    grading: Grading,
    curves: list[int],
    way: list[int],
    origin: Array,
    scale: float,
) -> None:
    """Set the sizes around curves and fronts, and along faces that a blade makes on its way."""
    size, radius, smallest = (
        value / scale for value in (grading.size, grading.radius, grading.smallest)
    )
    field = gmsh.model.mesh.field
    terms: list[int] = []
    if curves:
        longest = max(gmsh.model.occ.getMass(1, curve) for curve in curves)
        distance = field.add("Distance")
        field.setNumbers(distance, "CurvesList", curves)
        field.setNumber(distance, "Sampling", min(_MOST_SAMPLES, 20 + 2 * longest / smallest))
        law = f"{size:.17g}*(F{distance}/{radius:.17g})^{grading.exponent:.17g} + {smallest:.17g}"
        terms.append(add_size(gmsh, law))
    # factors of several modes or places have one round front
    fronts = {(_distance(front, origin, scale), start / scale) for front, start in grading.fronts}
    for distance_text, start in sorted(fronts):
        least, away = grading.share * start, f"({distance_text})*{grading.share:.17g}"
        law = f"0.5*({least:.17g} + {away} + abs({least:.17g} - {away}))"
        terms.append(add_size(gmsh, law))
        smallest = min(smallest, least)
    if way and grading.way is not None:
        near = grading.way / scale
        smallest = min(smallest, near) if curves or grading.fronts else near
        distance = field.add("Distance")
        field.setNumbers(distance, "SurfacesList", way)
        field.setNumber(distance, "Sampling", min(_MOST_SAMPLES, 20 + 2 / near))
        terms.append(add_size(gmsh, f"{near:.17g} + 0.5*F{distance}"))
    set_sizes(gmsh, terms, smallest * 0.5 if terms else size, size)


def _distance(front: Any, origin: Array, scale: float) -> str:
    """Write the distance to a front, straight or round, as a gmsh expression."""
    start = (np.asarray(front.centre if front.closed else front.start) - origin) / scale
    off = [f"({name}-({at:.17g}))" for name, at in zip("xyz", start, strict=True)]
    axis = np.asarray(front.normal if front.closed else np.subtract(front.end, front.start))
    unit = axis / np.linalg.norm(axis)
    along = "(" + "+".join(f"{o}*({u:.17g})" for o, u in zip(off, unit, strict=True)) + ")"
    squared = "(" + "+".join(f"{o}^2" for o in off) + ")"
    if front.closed:
        in_plane = f"sqrt(abs({squared}-{along}^2))"
        return f"sqrt(({in_plane}-{front.radius / scale:.17g})^2+{along}^2)"
    length = front.length / scale
    foot = f"(0.5*({length:.17g}+abs({along})-abs({along}-{length:.17g})))"  # clipped to it
    return f"sqrt(abs({squared}-2*{along}*{foot}+{foot}^2))"


def _add_lines(gmsh: ModuleType, segments: Array) -> list[int]:
    occ = gmsh.model.occ
    return [int(occ.addLine(occ.addPoint(*a), occ.addPoint(*b))) for a, b in segments]


def _clamped(
    gmsh: ModuleType, scene: Scene, cut: CutFaces, origin: Array, scale: float
) -> list[int]:
    """Curves on the surface of the body at which a support makes the strain unbounded."""
    inner = {curve for face in cut.faces for curve in gmsh.model.getAdjacencies(2, face)[1]}
    curves, middles, tangents = [], [], []
    for _, curve in gmsh.model.getEntities(1):
        if curve in inner and curve not in cut.mouths:
            continue
        low, high = gmsh.model.getParametrizationBounds(1, curve)
        middle = [0.5 * (low[0] + high[0])]
        curves.append(int(curve))
        middles.append(gmsh.model.getValue(1, curve, middle))
        tangents.append(gmsh.model.getDerivative(1, curve, middle))
    mouth = np.isin(curves, cut.mouths)
    on = clamped_edges(scene, origin + scale * np.array(middles), np.array(tangents), mouth)
    return [curve for curve, clamped in zip(curves, on, strict=True) if clamped]


def _check_volume(mesh: ConformingMesh, expected: float, where: str) -> None:
    """Nothing was lost or meshed twice."""
    volume = float(measures(mesh.points[mesh.cells]).sum())
    if abs(volume - expected) > 1e-9 * expected:
        raise InputError(
            f"gmsh's mesh of the cut body has a volume of {volume:.9g} m³; expected "
            f"{expected:.9g} m³",
            where,
        )
