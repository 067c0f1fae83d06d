"""Elasticity and density of a scene, which may differ by region."""

from typing import ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PrivateAttr

from verify.scene.geometry import GROUP, MeshFile
from verify.scene.regions import parse_region
from verify.scene.strict import Positive, Rules, Strict

Array = NDArray[np.float64]

_INWARDS = 1e-6  # of the way from a corner of a cell to its centroid


class Moduli(NamedTuple):
    """Young's modulus (n,) in Pa, Poisson's ratio (n,) and density (n,) in kg/m³ at points.

    Where a scene has no density, it is not a number.
    """

    young: Array
    poisson: Array
    density: Array


class MaterialRegion(Strict):
    """A region of another material; what it does not name is that of ``[material]``."""

    where: str = Field(
        description="an inequality in x, y, z, or 'group:NAME' of a mesh file; of regions that "
        "overlap, the last"
    )
    young: Positive | None = Field(default=None, description="Young's modulus E, Pa")
    poisson: float | None = Field(
        default=None, strict=True, gt=-1.0, lt=0.5, description="Poisson's ratio"
    )
    density: Positive | None = Field(default=None, description="density, kg/m³")

    rules: ClassVar[Rules] = (
        ("", lambda r: r.young is None and r.poisson is None and r.density is None,
         "expected young, poisson or density of the region"),
    )  # fmt: skip

    _geometry: MeshFile | None = PrivateAttr(default=None)  # whose groups it names; set by a scene

    def holds(self, points: Array) -> NDArray[np.bool_]:
        """Tell which points (n, d) lie in it."""
        if self._geometry is not None and self._geometry.is_part(self.where):
            return self._geometry.body().inside(self.where.removeprefix(GROUP), points)
        return parse_region(self.where, points.shape[1])(points)


class Material(Strict):
    """Isotropic elasticity: one material, or others in regions of the body."""

    young: Positive = Field(description="Young's modulus E, Pa")
    poisson: float = Field(strict=True, gt=-1.0, lt=0.5, description="Poisson's ratio")
    density: Positive | None = Field(default=None, description="density, kg/m³")
    plane: Literal["strain", "stress"] | None = Field(
        default=None, description="2D only: plane strain or plane stress"
    )
    thickness: Positive | None = Field(default=None, description="membranes only: thickness, m")
    regions: list[MaterialRegion] = Field(
        default_factory=list, description="other materials; what no region covers is this one"
    )

    @property
    def is_uniform(self) -> bool:
        """Whether the whole body is of one material."""
        return not self.regions

    @property
    def each(self) -> "list[Material]":
        """All materials, each alone: that outside the regions, then that of each region."""
        base = self.model_copy(update={"regions": []})
        given = [r.model_dump(exclude={"where"}, exclude_none=True) for r in self.regions]
        return [base, *(base.model_copy(update=own) for own in given)]

    def number_at(self, points: Array) -> NDArray[np.int64]:
        """Return the number (n,) in `each` of the material at points (n, d)."""
        found = np.zeros(len(points), dtype=np.int64)
        for k, region in enumerate(self.regions):
            found[region.holds(points)] = k + 1
        return found

    def at(self, points: Array) -> Moduli:
        """Return the moduli at points (n, d)."""
        each, number = self.each, self.number_at(points)
        rows = [(m.young, m.poisson, np.nan if m.density is None else m.density) for m in each]
        return Moduli(*np.array(rows, dtype=float)[number].T)


def crossed_by_interfaces(
    material: Material, points: Array, cells: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Tell of which cells (m,) the corners do not all lie in the material of the centroid.

    Corners count just inside the cell: an interface along a facet crosses no cell.
    """
    corners = points[cells]
    middle = corners.mean(axis=1)
    own = material.number_at(middle)
    crossed = np.zeros(len(cells), dtype=bool)
    for k in range(corners.shape[1]):
        crossed |= material.number_at(corners[:, k] + _INWARDS * (middle - corners[:, k])) != own
    return crossed
