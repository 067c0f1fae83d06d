"""Cuts: flat, along a polyline or a triangulated surface, or swept by a tool."""

from verify.xfem.cuts.flat import Cut, ImplicitCut, Plane, PolygonPatch
from verify.xfem.cuts.polyline import Polyline
from verify.xfem.cuts.surface_cut import TriangulatedSurface
from verify.xfem.cuts.tool_path import ToolPath

__all__ = [
    "Cut",
    "ImplicitCut",
    "Plane",
    "PolygonPatch",
    "Polyline",
    "ToolPath",
    "TriangulatedSurface",
]
