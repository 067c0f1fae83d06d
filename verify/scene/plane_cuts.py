"""Cuts of plane scenes in the material frame: polylines and circular arcs."""

from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from verify.geometry.curves import Arc, Piece, Segment
from verify.geometry.planar import polyline_defect
from verify.scene.strict import Finite, Line, NonNegative, Point2, Positive, Strict


class PolylineCut(Strict):
    """A polyline in the plane; what lies left of its direction is its positive side."""

    kind: Literal["polyline"]
    name: Line = "cut"
    points: list[Point2] = Field(min_length=2, description="points in order, m")
    expected: Literal["through", "edge", "inner"] | None = Field(
        default=None,
        description="how it meets the body: checked if given (through: both ends outside or on "
        "the boundary; edge: one end; inner: none)",
    )
    opens_at: NonNegative = Field(default=0.0, description="time at which it opens, s")

    @model_validator(mode="after")
    def _is_simple(self) -> "PolylineCut":
        if defect := polyline_defect(np.array(self.points, dtype=float)):
            raise ValueError(f"the polyline {defect}")
        return self

    @property
    def dimension(self) -> int:
        """Space dimension."""
        return 2

    def vertices(self, spacing: float | None = None) -> NDArray[np.float64]:
        """Vertices (n, 2) of the polyline; `spacing` does not matter to straight segments."""
        return np.array(self.points, dtype=float)

    def pieces(self) -> list[Piece]:
        """Return its segments, in order."""
        return [Segment(a, b) for a, b in pairwise(self.vertices())]


class ArcCut(Strict):
    """A circular arc in the plane, counter-clockwise; its centre is on the positive side."""

    kind: Literal["arc"]
    name: Line = "cut"
    centre: Point2 = Field(description="m")
    radius: Positive = Field(description="m")
    start: Finite = Field(default=0.0, description="angle of the first end, degrees")
    sweep: float = Field(
        strict=True, default=360.0, gt=0.0, le=360.0, description="angle covered, degrees"
    )
    expected: Literal["through", "edge", "inner"] | None = None
    opens_at: NonNegative = Field(default=0.0, description="time at which it opens, s")

    @property
    def dimension(self) -> int:
        """Space dimension."""
        return 2

    def vertices(self, spacing: float | None = None) -> NDArray[np.float64]:
        """Points (n, 2) on the arc, at most `spacing` apart (default: a 256th of a turn)."""
        (arc,) = self.pieces()
        step = spacing or 2 * np.pi * self.radius / 256
        n = max(4, int(np.ceil(arc.length / step)))
        ring = arc.point(np.arange(n + 1) / n)
        if self.sweep == 360.0:
            ring[-1] = ring[0]
        return ring

    def pieces(self) -> list[Piece]:
        """Return the arc itself, which is not cut into facets."""
        centre = np.array(self.centre, dtype=float)
        return [Arc(centre, self.radius, np.deg2rad(self.start), np.deg2rad(self.sweep))]


PlaneCut = PolylineCut | ArcCut
