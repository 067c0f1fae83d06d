"""The uncut body: a rectangle, a polygon, a box, or a mesh file, with named boundary parts."""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from verify.geometry.planar import polygon_defect
from verify.scene.skin import Skin
from verify.scene.strict import Point2, Point3, Strict

_SIDES = ("left", "right", "bottom", "top", "front", "back")


class Rectangle(Strict):
    """An axis-parallel rectangle; its parts are ``left``, ``right``, ``bottom``, ``top``."""

    kind: Literal["rectangle"]
    lower: Point2 = Field(description="lower left corner, m")
    upper: Point2 = Field(description="upper right corner, m")

    @model_validator(mode="after")
    def _has_area(self) -> "Rectangle":
        if not all(b > a for a, b in zip(self.lower, self.upper, strict=True)):
            raise ValueError(
                f"upper {self.upper} must exceed lower {self.lower} in both coordinates"
            )
        return self

    @property
    def dimension(self) -> int:
        """Space dimension."""
        return 2

    def outline(self) -> NDArray[np.float64]:
        """Corners (4, 2), counter-clockwise from the lower left."""
        (x0, y0), (x1, y1) = self.lower, self.upper
        return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], dtype=float)

    def parts(self) -> tuple[str, ...]:
        """Names of the boundary parts, one per edge of `outline`."""
        return ("bottom", "right", "top", "left")


class Polygon(Strict):
    """A simple polygon; edge i goes from corner i to corner i + 1 and bears the i-th name."""

    kind: Literal["polygon"]
    corners: list[Point2] = Field(min_length=3, description="corners in order, m")
    names: list[str] | None = Field(
        default=None, description="a name per edge; default edge0, edge1, …"
    )

    @model_validator(mode="after")
    def _is_simple(self) -> "Polygon":
        if self.names is not None and len(self.names) != len(self.corners):
            raise ValueError(f"{len(self.names)} names for {len(self.corners)} edges")
        if defect := polygon_defect(np.array(self.corners, dtype=float)):
            raise ValueError(defect)
        return self

    @property
    def dimension(self) -> int:
        """Space dimension."""
        return 2

    def outline(self) -> NDArray[np.float64]:
        """Corners (n, 2) in the order given."""
        return np.array(self.corners, dtype=float)

    def parts(self) -> tuple[str, ...]:
        """Names of the boundary parts, one per edge of `outline`."""
        return tuple(self.names or (f"edge{i}" for i in range(len(self.corners))))


class Box(Strict):
    """An axis-parallel box.

    Its parts are ``left``/``right`` (x), ``front``/``back`` (y) and ``bottom``/``top`` (z).
    """

    kind: Literal["box"]
    lower: Point3 = Field(description="lowest corner, m")
    upper: Point3 = Field(description="highest corner, m")

    @model_validator(mode="after")
    def _has_volume(self) -> "Box":
        if not all(b > a for a, b in zip(self.lower, self.upper, strict=True)):
            raise ValueError(
                f"upper {self.upper} must exceed lower {self.lower} in all coordinates"
            )
        return self

    @property
    def dimension(self) -> int:
        """Space dimension."""
        return 3

    def parts(self) -> tuple[str, ...]:
        """Names of the boundary parts."""
        return _SIDES


class MeshFile(Strict):
    """A simplicial mesh in any format that meshio reads; parts are said by inequalities."""

    kind: Literal["file"]
    file: Path = Field(description="mesh file, relative to the case file")
    dimension_: Literal[2, 3] = Field(default=2, alias="dimension", description="space dimension")
    cells: Literal["volume", "surface"] = Field(
        default="volume", description="surface: triangles in space, a membrane"
    )

    @model_validator(mode="after")
    def _surface_is_in_space(self) -> "MeshFile":
        if self.cells == "surface" and self.dimension_ == 2:
            raise ValueError("cells = 'surface' is a membrane in space: dimension = 3")
        return self

    @property
    def dimension(self) -> int:
        """Space dimension."""
        return int(self.dimension_)

    def parts(self) -> tuple[str, ...]:
        """Names of the boundary parts: none, use inequalities."""
        return ()


Geometry = Annotated[Rectangle | Polygon | Box | MeshFile | Skin, Field(discriminator="kind")]
