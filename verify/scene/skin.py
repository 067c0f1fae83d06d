"""Skin: a patch of body surface, as a membrane or with a thickness; made by formulas, or own."""

from pathlib import Path
from typing import Literal

from pydantic import Field, model_validator

from verify.scene.strict import Count, Positive, Strict


class Skin(Strict):
    """A face or the back of a hand, or a surface file; its part ``rim`` is its outer border.

    Coordinates of ``shape``: z out of the body; a face has x to its left and y up, a hand y
    along its fingers; the origin is in the middle. The geometry brings its own mesh.
    """

    kind: Literal["skin"]
    shape: Literal["face", "hand"] | None = Field(default=None, description="which patch; or file")
    elements: Count | None = Field(
        default=None, description="of a shape: about how many elements are wanted"
    )
    file: Path | None = Field(
        default=None, description="triangulated surface (STL, OBJ, PLY, VTU …), taken as it is"
    )
    thickness: Positive | None = Field(
        default=None, description="m; tetrahedra below the surface. Without it: a membrane"
    )
    layers: Count = Field(default=1, description="with a thickness: layers of elements")

    @model_validator(mode="after")
    def _has_one_source(self) -> "Skin":
        if (self.shape is None) == (self.file is None):
            raise ValueError("a skin has either a shape or a file")
        if (self.shape is None) != (self.elements is None):
            raise ValueError("elements belong to a shape, and a shape needs them")
        if self.thickness is None and self.layers > 1:
            raise ValueError("layers belong to a skin with a thickness")
        return self

    @property
    def dimension(self) -> int:
        """Space dimension."""
        return 3

    @property
    def is_membrane(self) -> bool:
        """Whether its elements are triangles in space."""
        return self.thickness is None

    def parts(self) -> tuple[str, ...]:
        """Names of the boundary parts."""
        return ("rim",)
