"""Cuts of a scene as the level sets of the compact XFEM solver."""

from typing import Any, NamedTuple

import numpy as np

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
        case DiscCut() | CylinderCut() | SphereCut():
            (surface,) = cut.pieces()
            return ImplicitCut(surface.level, None if surface.closed else surface.depth)
        case SweptCut():  # plane facets: the triangulation is the cut
            return TriangulatedSurface(*cut.facets())
        case ToolPathCut() if cut.dimension == 3:
            return ToolPath.of_tip(cut.points, cut.moments, cut.blade).sweep
        case ArcCut(sweep=360.0):
            (circle,) = cut.pieces()
            return ImplicitCut(circle.level)
    vertices = cut.vertices(size / _ARC_SEGMENTS_PER_CELL)
    closed = bool(np.array_equal(vertices[0], vertices[-1]))
    return Polyline(vertices[:-1] if closed else vertices, closed)
