"""Mesh levels of a scene, and how fine its reference shall be."""

from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, model_validator

from verify.scene.strict import Count, Positive, Strict

CellCounts = tuple[Count, ...]


class MeshLevels(Strict):
    """The background meshes on which the solvers are compared, coarse to fine."""

    pattern: Literal["structured", "unstructured", "given"] = Field(
        default="structured",
        description="structured: squares split along the rising diagonal (rectangles only); "
        "given: the mesh file of the geometry, as it is",
    )
    sizes: Annotated[list[Positive], Field(min_length=1)] | None = Field(
        default=None, description="element sizes h, m"
    )
    cells: Annotated[list[CellCounts], Field(min_length=1)] | None = Field(
        default=None, description="structured: numbers of cells per direction"
    )

    @model_validator(mode="after")
    def _levels_descend(self) -> "MeshLevels":
        if self.pattern == "given":
            if self.sizes is not None or self.cells is not None:
                raise ValueError("a given mesh has neither sizes nor cells")
            return self
        if (self.sizes is None) == (self.cells is None):
            raise ValueError("a mesh has either sizes or cells")
        if self.cells is not None:
            if self.pattern != "structured":
                raise ValueError("cells belong to a structured mesh; give sizes")
            if not all(_finer(b, a) for a, b in pairwise(self.cells)):
                raise ValueError("cells must go from coarse to fine, no level twice")
        if self.sizes is not None and sorted(set(self.sizes), reverse=True) != self.sizes:
            raise ValueError("sizes must descend from coarse to fine, none of them twice")
        return self

    @property
    def count(self) -> int:
        """Number of levels."""
        return 1 if self.pattern == "given" else len(self.sizes or self.cells or [])


class ReferenceLevels(Strict):
    """The reference that judges when there is no exact solution, or beside it."""

    kind: Literal["exact", "conforming"] | None = Field(
        default=None, description="default: exact where the scene has an exact solution"
    )
    size: Positive | None = Field(
        default=None, description="far element size of the coarsest level, m (default: chosen)"
    )
    levels: int = Field(
        strict=True, default=3, ge=3, le=8, description="number of levels, each halving h"
    )
    max_levels: int | None = Field(
        strict=True,
        default=None,
        ge=3,
        le=8,
        description="further levels are solved, up to that many, until the uncertainty is below "
        "a tenth of every error that it judges (default: `levels`)",
    )
    degree: Literal[1, 2] = Field(default=2, description="polynomial order")

    @model_validator(mode="after")
    def _levels_are_in_order(self) -> "ReferenceLevels":
        if self.max_levels is not None and self.max_levels < self.levels:
            raise ValueError(f"max_levels {self.max_levels} is below levels {self.levels}")
        return self


def _finer(one: CellCounts, other: CellCounts) -> bool:
    return one != other and all(i >= j for i, j in zip(one, other, strict=False))
