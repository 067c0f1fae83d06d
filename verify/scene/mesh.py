"""Mesh levels of a scene, and how fine its reference shall be."""

from typing import Literal

from pydantic import Field, model_validator

from verify.scene.strict import Positive, Strict

__all__ = ["MeshLevels", "ReferenceLevels"]

CellCounts = tuple[int, ...]


class MeshLevels(Strict):
    """The background meshes on which the solvers are compared, coarse to fine."""

    pattern: Literal["structured", "unstructured"] = Field(
        default="structured",
        description="structured: squares split along the rising diagonal (rectangles only)",
    )
    sizes: list[Positive] | None = Field(default=None, description="element sizes h, m")
    cells: list[CellCounts] | None = Field(
        default=None, description="structured: numbers of cells per direction"
    )

    @model_validator(mode="after")
    def _levels_descend(self) -> "MeshLevels":
        if (self.sizes is None) == (self.cells is None):
            raise ValueError("a mesh has either sizes or cells")
        if self.cells is not None:
            if self.pattern != "structured":
                raise ValueError("cells belong to a structured mesh; give sizes")
            if not self.cells or any(n < 1 for level in self.cells for n in level):
                raise ValueError("cells must be positive numbers, one list per level")
            counts = [min(level) for level in self.cells]
            if sorted(set(counts)) != counts:
                raise ValueError("levels must go from coarse to fine")
        if self.sizes is not None and sorted(set(self.sizes), reverse=True) != self.sizes:
            raise ValueError("sizes must descend from coarse to fine, none of them twice")
        return self

    @property
    def count(self) -> int:
        """Number of levels."""
        return len(self.sizes or self.cells or [])


class ReferenceLevels(Strict):
    """The reference that judges when there is no exact solution, or beside it."""

    kind: Literal["exact", "conforming"] | None = Field(
        default=None, description="default: exact where the scene has an exact solution"
    )
    size: Positive | None = Field(
        default=None, description="far element size of the coarsest level, m (default: chosen)"
    )
    levels: int = Field(default=3, ge=3, le=8, description="number of levels, each halving h")
    degree: Literal[1, 2] = Field(default=2, description="polynomial order")
