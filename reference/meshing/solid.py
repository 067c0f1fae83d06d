"""Meshes of boxes that conform to cut surfaces (gmsh, OpenCASCADE kernel, HXT).

Cut surfaces in space are OpenCASCADE faces, of which only what lies inside the body stays.
"""

from itertools import pairwise
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from reference.meshing.edge_splitting import loosen_front
from reference.meshing.inner_lines import clamped_edges, part_lines, solid_interfaces
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
from verify.errors import InputError
from verify.geometry.simplices import measures
from verify.scene import Box, Scene

Array = NDArray[np.float64]
_MERGED = 1e-6  # of the body's size
_KINK = np.deg2rad(15.0)  # a smaller turn leaves a singularity too weak to matter
_HXT = 10  # ten times quicker than gmsh's Delaunay, and keeps embedded faces
_MOST_SAMPLES = 20000


class CutFaces(NamedTuple):
    """gmsh's numbers of what the cuts left in the body.

    Attributes
    ----------
    faces : list of int
        Faces of the cuts inside the body.
    singular : list of int
        Curves inside the body at which a cut ends, turns by more than 15°, crosses or branches.
    mouths : list of int
        Curves at which a cut meets the surface of the body.
    """

    faces: list[int]
    singular: list[int]
    mouths: list[int]


def add_surface(gmsh: ModuleType, cut: Any, origin: Array, scale: float) -> list[int]:
    """Add the faces of a cut in space, in coordinates (x − origin)/scale."""
    occ = gmsh.model.occ
    match cut.kind:
        case "polygon":
            return [add_polygon(occ, (np.array(cut.points) - origin) / scale)]
        case "disc":
            centre = (np.array(cut.centre) - origin) / scale
            first, second, normal = cut.axes()
            a, b = (value / scale for value in cut.semi_axes)
            if a < b:  # OpenCASCADE wants the longer one first
                a, b, first, normal = b, a, second, -normal
            return [int(occ.addDisk(*centre, a, b, zAxis=normal.tolist(), xAxis=first.tolist()))]
        case "cylinder":
            ring = _arcs(occ, cut, origin, scale)
            return _swept(occ, ring, cut.height / scale * cut.axes()[2])
        case "sphere":
            return _cap(occ, cut, (np.array(cut.centre) - origin) / scale, cut.radius / scale)
        case "swept":
            points = (np.array(cut.points) - origin) / scale
            tags = [occ.addPoint(*p) for p in (points[:-1] if cut.closed else points)]
            following = [*tags[1:], tags[0]] if cut.closed else tags[1:]
            lines = [occ.addLine(a, b) for a, b in zip(tags, following, strict=False)]
            return _swept(occ, lines, np.array(cut.along) / scale)
    raise AssertionError(f"a {cut.kind} cut in space")  # the scene has checked it


def imprint_surfaces(
    gmsh: ModuleType, body: int, faces: dict[int, str], lines: list[int], met: list[int]
) -> CutFaces:
    """Fragment the body by the faces of the cuts; what lies outside or along it is removed.

    `faces` have the names of their cuts; `lines` on the surface of the body become edges of it,
    and at the faces `met` materials meet.

    Raises
    ------
    InputError
        If OpenCASCADE takes two cuts, or a cut and the surface of the body, for one.
    """
    occ = gmsh.model.occ
    if not faces and not lines and not met:
        occ.synchronize()
        return CutFaces([], [], [])
    tools = [(2, tag) for tag in (*faces, *met)] + [(1, tag) for tag in lines]
    _, images = occ.fragment([(3, body)], tools)
    occ.synchronize()
    _check_not_merged(dict(zip(faces, images[1:], strict=False)), faces)
    volumes = [tag for dim, tag in images[0] if dim == 3]
    embedded = {tag for v in volumes for dim, tag in gmsh.model.mesh.getEmbedded(3, v) if dim == 2}
    inside, beyond, one_sided = [], [], []
    of_cuts = {abs(tag) for image in images[1 : 1 + len(faces)] for dim, tag in image if dim == 2}
    for face in sorted({abs(tag) for image in images[1:] for dim, tag in image if dim == 2}):
        sides = gmsh.model.getAdjacencies(2, face)[0]
        if len(sides) == 2 or face in embedded:
            inside += [face] * (face in of_cuts)
        elif not len(sides):
            beyond.append((2, face))
        else:
            one_sided.append(face)
    occ.remove(beyond, recursive=True)
    occ.synchronize()
    if not all(_on_surface(gmsh, face) for face in one_sided):
        raise InputError(
            "cuts: a part of a cut was taken for a part of the body's surface, which it touches; "
            "move it away from the surface"
        )
    return CutFaces(inside, *_rims(gmsh, inside))


def _check_not_merged(images: dict[int, list[tuple[int, int]]], names: dict[int, str]) -> None:
    """Refuse faces of two cuts of which a part became one and the same face."""
    owner: dict[int, int] = {}
    for face, image in images.items():
        for dim, tag in image:
            if dim == 2 and owner.setdefault(abs(tag), face) != face:
                one, other = names[owner[abs(tag)]], names[face]
                raise InputError(
                    f"cuts: '{one}' and '{other}' come so close to each other that a part of them "
                    "is taken for one; a conforming mesh resolves about 1e-6 of the body's size: "
                    "move them apart, or merge them"
                )


def _on_surface(gmsh: ModuleType, face: int) -> bool:
    """Tell whether the centre of a face lies on the surface of the box, to what gmsh merges."""
    box = np.array(gmsh.model.getBoundingBox(-1, -1)).reshape(2, 3)
    centre = np.array(gmsh.model.occ.getCenterOfMass(2, face))
    return bool(np.abs(box - centre).min() < _MERGED * np.ptp(box, axis=0).max())


def _arcs(occ: ModuleType, cut: Any, origin: Array, scale: float) -> list[int]:
    """Return arcs of less than half a turn, so that each extrudes to a simple patch."""
    count = 1 + int(cut.sweep // 120.0) if cut.sweep < 360.0 else 3
    first, second, _ = cut.axes()
    base, radius = (np.array(cut.base) - origin) / scale, cut.radius / scale
    angle = np.deg2rad(cut.start + cut.sweep * np.arange(count + 1) / count)
    ring = base + radius * (np.outer(np.cos(angle), first) + np.outer(np.sin(angle), second))
    closed = cut.sweep == 360.0
    tags = [occ.addPoint(*p) for p in (ring[:-1] if closed else ring)]
    centre = occ.addPoint(*base)
    return [
        occ.addCircleArc(a, centre, b) for a, b in pairwise([*tags, tags[0]] if closed else tags)
    ]


def _cap(occ: ModuleType, cut: Any, centre: Array, radius: float) -> list[int]:
    """Turn a meridian around the pole's axis by thirds of a turn."""
    first, second, pole = cut.axes()
    polar = np.deg2rad(cut.opening) * np.array([0.0, 0.5, 1.0])  # arcs of less than half a turn
    made = []
    for turn in 2.0 * np.pi * np.arange(3) / 3:
        out = np.cos(turn) * first + np.sin(turn) * second
        line = centre + radius * (np.outer(np.cos(polar), pole) + np.outer(np.sin(polar), out))
        tags, middle = [occ.addPoint(*p) for p in line], occ.addPoint(*centre)
        arcs = [(1, occ.addCircleArc(a, middle, b)) for a, b in pairwise(tags)]
        made += occ.revolve(arcs, *centre, *pole, 2.0 * np.pi / 3)
    return [int(tag) for dim, tag in made if dim == 2]


def _swept(occ: ModuleType, curves: list[int], along: Array) -> list[int]:
    made = occ.extrude([(1, tag) for tag in curves], *along)
    return [int(tag) for dim, tag in made if dim == 2]


def _rims(gmsh: ModuleType, faces: list[int]) -> tuple[list[int], list[int]]:
    """Return curves off the surface of the body with a kink or other than two faces, and mouths."""
    mine = set(faces)
    curves = {
        abs(tag) for face in faces for _, tag in gmsh.model.getBoundary([(2, face)], oriented=False)
    }
    singular, mouths = [], []
    for curve in sorted(curves):
        around = [int(face) for face in gmsh.model.getAdjacencies(1, curve)[0]]
        if not set(around) <= mine:
            mouths.append(curve)
        elif len(around) != 2 or _turn(gmsh, curve, around) > _KINK:
            singular.append(curve)
    return singular, mouths


def _turn(gmsh: ModuleType, curve: int, faces: list[int]) -> float:
    """Angle between two faces at the middle of the curve they share, whatever their senses."""
    low, high = gmsh.model.getParametrizationBounds(1, curve)
    normals = []
    for face in faces:
        place = gmsh.model.reparametrizeOnSurface(1, curve, [0.5 * (low[0] + high[0])], face)
        normals.append(gmsh.model.getNormal(face, place))
    return float(np.arccos(np.clip(abs(normals[0] @ normals[1]), 0.0, 1.0)))


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
    """Return curves on the surface of the body at which a support makes the strain unbounded."""
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
