"""Cuts: flat, along a polyline or a triangulated surface, or swept by a tool."""

from verify.xfem.faceted_cuts import Polyline, TriangulatedSurface
from verify.xfem.flat_cuts import Cut, ImplicitCut, Plane, PolygonPatch
from verify.xfem.tool_path import ToolPath

__all__ = [
    "Cut",
    "ImplicitCut",
    "Plane",
    "PolygonPatch",
    "Polyline",
    "ToolPath",
    "TriangulatedSurface",
]
