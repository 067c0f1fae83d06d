"""Cuts of a scene as the level sets of the compact XFEM solver."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from verify.errors import UnsupportedSceneError
from verify.methods.tip_nodes import with_tip_nodes
from verify.scene import (
    ArcCut,
    CylinderCut,
    DiscCut,
    PolygonCut,
    Scene,
    SphereCut,
    SweptCut,
    ToolPathCut,
)
from verify.solution import Regularisation
from verify.xfem.crossing import TipRule
from verify.xfem.cuts import Cut, ImplicitCut, PolygonPatch, Polyline, ToolPath, TriangulatedSurface
from verify.xfem.mesh import SimplexMesh

Array = NDArray[np.float64]

_ARC_SEGMENTS_PER_CELL = 8


def cuts_of(scene: Scene, size: float) -> list[Cut]:
    """Return the cuts as the solver's own; an arc that ends is sampled finely against `size`."""
    return [_cut(cut, size) for cut in scene.cuts]


class ToCut(NamedTuple):
    """What the library is to cut, by what, by which rule, and what was done for that."""

    mesh: SimplexMesh
    cuts: list[Cut]
    rule: TipRule
    done: list[Regularisation]


def to_cut(mesh: SimplexMesh, cuts: list[Cut], tip: Any) -> ToCut:
    """Prepare a mesh for the tip rule `tip`.

    Raises
    ------
    UnsupportedSceneError
        If the rule is "partial" and the body a solid.
    """
    if tip != "partial":
        return ToCut(mesh, cuts, tip, [])
    if mesh.dim == 3:
        raise UnsupportedSceneError(
            "tip = 'partial' in a solid; it is offered for triangles, other tip rules are for both"
        )
    nodes = with_tip_nodes(mesh, cuts)
    kind, largest = "end of a cut made a node", float(nodes.moved.max(initial=0.0))
    said = Regularisation(kind, len(nodes.moved), largest, "m")
    return ToCut(nodes.mesh, list(nodes.cuts), "inside", [said] if len(nodes.moved) else [])


def _cut(cut: Any, size: float) -> Cut:
    match cut:
        case PolygonCut():
            return PolygonPatch(cut.points)
        case DiscCut():
            return _disc(cut)
        case CylinderCut():
            return _cylinder(cut)
        case SphereCut():
            return _sphere(cut)
        case SweptCut():  # plane facets: the triangulation is the cut
            return TriangulatedSurface(*cut.surface())
        case ToolPathCut() if cut.dimension == 3:
            return ToolPath.of_tip(cut.points, cut.moments, cut.blade).sweep
        case ArcCut(sweep=360.0):
            centre, radius = np.array(cut.centre), cut.radius
            return ImplicitCut(lambda points: radius - np.linalg.norm(points - centre, axis=1))
    vertices = cut.vertices(size / _ARC_SEGMENTS_PER_CELL)
    closed = bool(np.array_equal(vertices[0], vertices[-1]))
    return Polyline(vertices[:-1] if closed else vertices, closed)


def _disc(cut: DiscCut) -> Cut:
    axes, centre, radii = cut.axes(), np.array(cut.centre), np.array(cut.semi_axes)

    def height(points: Array) -> Array:
        found: Array = (points - centre) @ axes[2]
        return found

    def depth(points: Array) -> Array:
        """Distance to the rim: exact for a circle, of first order in it for an ellipse."""
        plane = (points - centre) @ axes[:2].T
        share = np.linalg.norm(plane / radii, axis=1)
        steepness = np.linalg.norm(plane / radii**2, axis=1)
        inner = share > 1e-12
        off = np.divide((1.0 - share) * share, steepness, where=inner, out=np.zeros_like(share))
        return np.where(inner, off, radii.min())

    return ImplicitCut(height, depth)


def _cylinder(cut: CylinderCut) -> Cut:
    axes, base = cut.axes(), np.array(cut.base)
    half = np.deg2rad(cut.sweep) / 2.0
    middle = np.deg2rad(cut.start) + half

    def inside(points: Array) -> Array:
        found: Array = cut.radius - np.linalg.norm((points - base) @ axes[:2].T, axis=1)
        return found

    def depth(points: Array) -> Array:
        x, y, z = axes @ (points - base).T
        along = np.minimum(z, cut.height - z)
        if cut.sweep == 360.0:
            return np.asarray(along)
        turn = np.angle(np.exp(1j * (np.arctan2(y, x) - middle)))
        return np.minimum(along, cut.radius * (half - np.abs(turn)))

    return ImplicitCut(inside, depth)


def _sphere(cut: SphereCut) -> Cut:
    pole, centre, half = cut.axes()[2], np.array(cut.centre), np.deg2rad(cut.opening)

    def inside(points: Array) -> Array:
        found: Array = cut.radius - np.linalg.norm(points - centre, axis=1)
        return found

    def depth(points: Array) -> Array:
        """Distance to the rim along the sphere."""
        away = points - centre
        along = away @ pole
        across = np.linalg.norm(away - along[:, None] * pole, axis=1)
        return np.asarray(cut.radius * (half - np.arctan2(across, along)))

    return ImplicitCut(inside) if cut.closed else ImplicitCut(inside, depth)
