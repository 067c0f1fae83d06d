"""Cuts: geometric objects in the material frame, of every kind that a scene may have."""

from typing import Annotated

from pydantic import Field

from verify.scene.plane_cuts import ArcCut, PlaneCut, PolylineCut
from verify.scene.spatial_cuts import CylinderCut, DiscCut, PolygonCut, SphereCut, SweptCut
from verify.scene.tool_path import ToolPathCut

__all__ = ["ArcCut", "Cut", "PlaneCut", "PolylineCut", "whole_cut"]

Cut = Annotated[
    PolylineCut | ArcCut | PolygonCut | DiscCut | CylinderCut | SphereCut | SweptCut | ToolPathCut,
    Field(discriminator="kind"),
]


def whole_cut(cut: Cut) -> Cut:
    """Return the cut that is there in the end: of a tool path, all that its blade sweeps."""
    return cut.whole() if isinstance(cut, ToolPathCut) else cut
