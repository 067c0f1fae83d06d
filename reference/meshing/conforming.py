"""Meshes of a scene that conform to its cuts (gmsh, OpenCASCADE kernel)."""

from itertools import pairwise
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from reference.meshing.edge_splitting import flip_flat_cells, shrink_to_points
from reference.meshing.features import (
    APART,
    Feature,
    check_separation,
    check_strips,
    close_pairs,
    divided_outline,
    plane_features,
)
from reference.meshing.inner_lines import plane_interfaces
from reference.meshing.opening import ConformingMesh, open_cut
from reference.meshing.session import (
    Grading,
    add_polygon,
    add_size,
    entity_facets,
    gmsh_session,
    set_sizes,
    simplices,
)
from reference.meshing.solid import solid_mesh
from verify.errors import InputError, UnsupportedSceneError
from verify.scene import ArcCut, Box, Polygon, PolylineCut, Rectangle, Scene

Array = NDArray[np.float64]


def conforming_mesh(scene: Scene, grading: Grading) -> ConformingMesh:
    """Mesh the body of a scene so that its cuts run along facets, and open them.

    Parameters
    ----------
    scene : Scene
        A rectangle, polygon or box with cuts; they may end inside, cross, branch and reach
        beyond the body.
    grading : Grading
        Element sizes.

    Returns
    -------
    ConformingMesh

    Raises
    ------
    UnsupportedSceneError
        If the geometry is not a rectangle, polygon or box.
    InputError
        If gmsh cannot mesh the geometry, or no cut lies inside the body.
    """
    geometry = scene.geometry
    if isinstance(geometry, Box):
        return solid_mesh(scene, grading)
    if not isinstance(geometry, Rectangle | Polygon):
        raise UnsupportedSceneError(
            f"a conforming mesh of a '{geometry.kind}' geometry is not offered yet"
        )
    outline = divided_outline(scene)
    # gmsh's tolerances are absolute: mesh a body of size one
    origin, scale = outline.min(axis=0), float(np.ptp(outline, axis=0).max())
    where = str(scene.file or "")
    features = plane_features(scene)
    check_separation(features, scale, where)
    if grading.strip is not None:
        check_strips(features, scale, grading.strip, where)
    try:
        with gmsh_session() as gmsh:
            surface = add_polygon(gmsh.model.occ, (outline - origin) / scale)
            curves = [tag for cut in scene.final_cuts for tag in _add_cut(gmsh, cut, origin, scale)]
            met = [_add_interface(gmsh, f, origin, scale) for f in plane_interfaces(scene)]
            cut_curves = _fragment(gmsh, surface, curves, met)
            ways = [one for one in features if one.name in _ways(scene)]
            _set_sizes(gmsh, grading, (features, ways), origin, scale)
            gmsh.option.setNumber("Mesh.Algorithm", 5 if len(grading.points) else 6)
            gmsh.model.mesh.generate(2)
            points, cells, number = simplices(gmsh, 2)
            facets = entity_facets(gmsh, cut_curves, 1, number)
    except InputError:
        raise
    except Exception as error:  # gmsh raises bare Exception
        raise InputError(f"gmsh could not mesh the body with its cuts ({error})", where) from None
    if scene.final_cuts and not len(facets):
        raise InputError("cuts: none of them lies inside the body", where)
    points, cells = points * scale + origin, flip_flat_cells(points, cells, facets)
    if grading.smallest < grading.meshed(scale):
        points, cells, facets = shrink_to_points(
            points, cells, facets, grading.points, grading.smallest
        )
    return open_cut(points, cells, facets)


def _add_cut(gmsh: ModuleType, cut: object, origin: Array, scale: float) -> list[int]:
    occ = gmsh.model.occ
    if isinstance(cut, ArcCut):
        x, y = (np.asarray(cut.centre) - origin) / scale
        # each part is less than half a turn: of half a turn gmsh does not know which half is meant
        start, sweep = np.deg2rad(cut.start), np.deg2rad(cut.sweep)
        stops = start + sweep * np.linspace(0.0, 1.0, 3 if cut.sweep <= 180.0 else 4)
        ends = [
            occ.addPoint(x + cut.radius / scale * np.cos(t), y + cut.radius / scale * np.sin(t), 0)
            for t in (stops[:-1] if cut.sweep == 360.0 else stops)
        ]
        if cut.sweep == 360.0:
            ends.append(ends[0])
        centre = occ.addPoint(x, y, 0.0)
        parts = [occ.addCircleArc(a, centre, b) for a, b in pairwise(ends)]
        return [int(tag) for tag in parts]
    assert isinstance(cut, PolylineCut)
    vertices = (cut.vertices() - origin) / scale
    closed = np.array_equal(vertices[0], vertices[-1])
    tags = [occ.addPoint(x, y, 0.0) for x, y in (vertices[:-1] if closed else vertices)]
    if closed:
        tags.append(tags[0])
    return [int(occ.addLine(a, b)) for a, b in pairwise(tags)]


def _add_interface(gmsh: ModuleType, interface: Feature, origin: Array, scale: float) -> int:
    occ = gmsh.model.occ
    a, b = (
        occ.addPoint(*((end - origin) / scale), 0.0) for end in (interface.start, interface.end)
    )
    if interface.centre is None:
        return int(occ.addLine(a, b))
    return int(occ.addCircleArc(a, occ.addPoint(*((interface.centre - origin) / scale), 0.0), b))


def _fragment(gmsh: ModuleType, surface: int, curves: list[int], met: list[int]) -> list[int]:
    """Imprint cuts and the curves where materials meet; return the cuts' inside the body."""
    occ = gmsh.model.occ
    if not curves and not met:
        occ.synchronize()
        return []
    _, images = occ.fragment([(2, surface)], [(1, tag) for tag in (*curves, *met)])
    occ.synchronize()
    images = images[: 1 + len(curves)]
    surfaces = [tag for dim, tag in images[0] if dim == 2]
    pieces = {abs(tag) for image in images[1:] for dim, tag in image if dim == 1}
    inside, beyond = [], []
    for curve in sorted(pieces):
        sides = [s for s in gmsh.model.getAdjacencies(1, curve)[0] if s in surfaces]
        embedded = [s for s in surfaces if (1, curve) in gmsh.model.mesh.getEmbedded(2, s)]
        if len(sides) == 2 or embedded:
            inside.append(curve)
        elif not sides:
            beyond.append((1, curve))
        else:
            raise InputError(
                "cuts: a part of a cut was taken for a part of the boundary that it touches; "
                "move it away from the boundary"
            )
    occ.remove(beyond, recursive=True)
    occ.synchronize()
    return inside


def _ways(scene: Scene) -> list[str]:
    """Find names of the features that a blade cuts on its way."""
    return [f"cut '{cut.name}'" for cut in scene.cuts if cut.on_the_way]


def _set_sizes(
    gmsh: ModuleType,
    grading: Grading,
    features: tuple[list[Feature], list[Feature]],
    origin: Array,
    scale: float,
) -> None:
    """Set the sizes around all features, and along those that a blade makes on its way."""
    size, radius, smallest = (
        value / scale for value in (grading.size, grading.radius, grading.meshed(scale))
    )
    terms = []
    for x, y in (grading.points - origin) / scale:
        squared = f"((x-({x:.17g}))^2+(y-({y:.17g}))^2)"
        graded = f"{size:.17g}*({squared}/{radius**2:.17g})^{grading.exponent / 2:.17g}"
        terms.append(f"{graded} + {smallest:.17g}")
    for point, start in grading.close_points():
        at_point = grading.smallest_at(start, scale)
        terms.append(_close(grading, (point - origin) / scale, start, at_point, scale))
        smallest = min(smallest, at_point / scale)
    if grading.strip is not None:
        close = close_pairs(features[0], APART * scale, grading.size / grading.strip)
        for i, j in close:
            apart = " + ".join(_distance(features[0][k], origin, scale) for k in (i, j))
            terms.append(f"{grading.strip:.17g}*({apart})")
            gap = grading.strip * features[0][i].gap(features[0][j]) / scale
            smallest = min(smallest, gap)
    near = (grading.way or grading.size) / scale
    for one in features[1]:
        terms.append(f"{near:.17g} + 0.5*({_distance(one, origin, scale)})")
        smallest = min(smallest, near)
    fields = [add_size(gmsh, formula) for formula in (*terms, f"{size:.17g}")]
    set_sizes(gmsh, fields, smallest * 0.5, size)


def _close(grading: Grading, point: Array, start: float, least: float, scale: float) -> str:
    """Write the sizes around a point that is graded to from a distance on; see `Grading`."""
    away = f"(sqrt((x-({point[0]:.17g}))^2+(y-({point[1]:.17g}))^2)/{start / scale:.17g})"
    power = f"{away}^{grading.exponent:.17g}"
    larger = f"0.5*({power}+{away}+abs({power}-{away}))"
    return f"{grading.share * start / scale:.17g}*{larger} + {least / scale:.17g}"


def _distance(feature: Feature, origin: Array, scale: float) -> str:
    """Write the distance to a feature as a gmsh expression; an arc stands for its circle."""
    if feature.centre is not None:
        x, y = (feature.centre - origin) / scale
        return f"abs(sqrt((x-({x:.17g}))^2+(y-({y:.17g}))^2)-{feature.radius / scale:.17g})"
    x, y = (feature.start - origin) / scale
    u, v = (feature.end - feature.start) / scale
    along = f"(((x-({x:.17g}))*({u:.17g})+(y-({y:.17g}))*({v:.17g}))/{u * u + v * v:.17g})"
    share = f"(0.5*(1+abs({along})-abs({along}-1)))"  # clipped to 0…1
    return f"sqrt((x-({x:.17g})-{share}*({u:.17g}))^2+(y-({y:.17g})-{share}*({v:.17g}))^2)"
