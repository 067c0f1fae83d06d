"""A cut made by a tool on its way: where its tip is at what time, and in space how deep it reaches.

It goes through the semi-progressive algorithm: an element is separated when the tool has crossed
it through, not before.
"""

from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from verify.scene.planar import polyline_defect
from verify.scene.strict import Line, NonNegative, Point3, Positive, Strict, Vector

__all__ = ["ToolPathCut"]

Directions = Annotated[list[Point3], Field(min_length=1)]


class ToolPathCut(Strict):
    """Points of the tool's tip in order, with times or a speed; in space a blade of some depth.

    In the plane what lies left of the path is its positive side; in space the positive side is
    that of (direction of motion) × (direction of the blade).
    """

    kind: Literal["tool_path"]
    name: Line = "cut"
    points: list[Vector] = Field(min_length=2, description="points of the tip in order, m")
    times: list[NonNegative] | None = Field(
        default=None, description="when the tip is at each point, s; or a speed"
    )
    speed: Positive | None = Field(default=None, description="of the tip, m/s; or times")
    starts_at: NonNegative = Field(
        default=0.0, description="with a speed: when the tip is at its first point, s"
    )
    depth: Positive | None = Field(default=None, description="3D: length of the blade, m")
    direction: Point3 | Directions | None = Field(
        default=None,
        description="3D: where the blade points from the tip; one direction, or one per point",
    )
    expected: Literal["through", "edge", "inner"] | None = None

    @model_validator(mode="after")
    def _is_a_path(self) -> "ToolPathCut":
        dimensions = {len(point) for point in self.points}
        if len(dimensions) > 1:
            raise ValueError("points: some have 2 coordinates, others 3")
        self._check_times()
        self._check_blade()
        tips = np.array(self.points, dtype=float)
        if (np.linalg.norm(np.diff(tips, axis=0), axis=1).max()) == 0.0:
            raise ValueError("points: the tool does not move")
        if self.dimension == 2 and (defect := polyline_defect(self.vertices())):
            raise ValueError(f"the path {defect}; begin another tool_path there")
        return self

    def _check_times(self) -> None:
        if (self.times is None) == (self.speed is None):
            raise ValueError("a tool path has either times or a speed")
        if self.times is None:
            return
        if len(self.times) != len(self.points):
            raise ValueError(f"{len(self.times)} times for {len(self.points)} points")
        if any(b < a for a, b in pairwise(self.times)):
            raise ValueError("times: time runs backwards")
        if self.starts_at > 0.0:
            raise ValueError("starts_at belongs to a speed; times say when it starts")

    def _check_blade(self) -> None:
        if self.dimension == 2:
            for key in ("depth", "direction"):
                if getattr(self, key) is not None:
                    raise ValueError(f"{key}: belongs to a path in space; the points are plane")
            return
        for key in ("depth", "direction"):
            if getattr(self, key) is None:
                raise ValueError(f"{key}: missing; in space the blade has a depth and a direction")
        if len(self._directions()) not in (1, len(self.points)):
            raise ValueError(
                f"direction: {len(self._directions())} for {len(self.points)} points; "
                "expected one, or one per point"
            )
        if not np.linalg.norm(self._directions(), axis=1).all():
            raise ValueError("direction: has no length")

    @property
    def dimension(self) -> int:
        """Space dimension."""
        return len(self.points[0])

    @property
    def moments(self) -> NDArray[np.float64]:
        """(n,) when the tip is at each point, in s."""
        if self.times is not None:
            return np.array(self.times, dtype=float)
        assert self.speed is not None
        steps = np.linalg.norm(np.diff(np.array(self.points, dtype=float), axis=0), axis=1)
        return self.starts_at + np.concatenate([[0.0], np.cumsum(steps)]) / self.speed

    @property
    def opens_at(self) -> float:
        """When the tip is at its first point, in s."""
        return float(self.moments[0])

    @property
    def ends_at(self) -> float:
        """When the tip is at its last point, in s."""
        return float(self.moments[-1])

    @property
    def blade(self) -> NDArray[np.float64]:
        """(n, 3) vector from the tip to the other end of the blade at each point, in m."""
        directions = self._directions()
        lengths = np.linalg.norm(directions, axis=1, keepdims=True)
        blade = (self.depth or 0.0) * directions / lengths
        return np.broadcast_to(blade, (len(self.points), 3)).copy()

    def vertices(self, spacing: float | None = None) -> NDArray[np.float64]:
        """Points (n, d) of the tip, each once; `spacing` does not matter to straight segments."""
        tips = np.array(self.points, dtype=float)
        moves = np.linalg.norm(np.diff(tips, axis=0), axis=1) > 0.0
        return tips[np.concatenate([[True], moves])]

    def _directions(self) -> NDArray[np.float64]:
        return np.array(self.direction, dtype=float).reshape(-1, 3)
