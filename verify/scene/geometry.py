"""The uncut body, with named boundary parts, and its mesh levels.

A rectangle, a polygon, a box, a mesh file; or skin: a patch of body surface, made by formulas or
from a surface file.
"""

from itertools import pairwise
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PrivateAttr

from verify.geometry.planar import inside_polygon, polygon_defect
from verify.geometry.simplices import distance_to_outline, feet
from verify.scene.mesh_file import FileBody, read_body
from verify.scene.mesh_position import POSITIONS, mesh_position
from verify.scene.strict import (
    Count,
    Point2,
    Point3,
    Positive,
    Rules,
    Strict,
    none_or_both,
    one_alone,
)

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]

#: before the name of a group of a mesh file, in a text that says where
GROUP = "group:"
_AXES = {"left": 0, "right": 0, "front": 1, "back": 1, "bottom": 2, "top": 2}


class _Body(Strict):
    """A body that only its mesh knows, unless a kind of body says more."""

    @property
    def is_membrane(self) -> bool:
        """Whether its elements are triangles in space."""
        return False

    def parts(self) -> tuple[str, ...]:
        """Names of the boundary parts: none, use inequalities."""
        return ()

    def is_part(self, where: str) -> bool:
        """Whether a text is the name of a part of it, not an inequality."""
        return where in self.parts()

    def holds_inside(self, where: str) -> bool:
        """Whether a support on `where` holds what it has of the whole body, not of its boundary."""
        return False

    def extremes(self) -> Array:
        """Points (n, d) with the same bounding box as the body; none where it is not known."""
        return np.zeros((0, 3))

    def holds(self, points: Array, tolerance: float) -> Bools:
        """Tell which points (n, d) lie in it, or outside by no more than a tolerance, m."""
        raise NotImplementedError

    def on(self, part: str, points: Array, tolerance: float) -> Bools:
        """Tell which points (n, d) lie on the boundary part of that name, to a tolerance, m."""
        raise NotImplementedError


class _PlaneBody(_Body):
    """A body within an outline, of which each edge bears the name of a part."""

    dimension: ClassVar[int] = 2

    def outline(self) -> Array:
        """Corners (n, 2) in order."""
        raise NotImplementedError

    def extremes(self) -> Array:
        """Points (n, 2) with the same bounding box as the body."""
        return self.outline()

    def measure(self) -> float:
        """Return its area, m²."""
        x, y = self.outline().T
        return float(0.5 * abs(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)))

    def holds(self, points: Array, tolerance: float) -> Bools:
        """Tell which points (n, 2) lie in it, or outside by no more than a tolerance, m."""
        outline = self.outline()
        beside = distance_to_outline(points, outline) <= tolerance
        return np.asarray(beside | inside_polygon(points, outline))

    def on(self, part: str, points: Array, tolerance: float) -> Bools:
        """Tell which points (n, 2) lie on the boundary part of that name, to a tolerance, m."""
        outline, found = self.outline(), np.zeros(len(points), dtype=bool)
        for edge, name in enumerate(self.parts()):  # a name may be given to several edges
            if name == part:
                foot = feet(points, outline[edge], outline[(edge + 1) % len(outline)])
                found |= np.linalg.norm(points - foot, axis=1) <= tolerance
        return found


class Rectangle(_PlaneBody):
    """An axis-parallel rectangle; its parts are ``left``, ``right``, ``bottom``, ``top``.

    Attributes
    ----------
    lower
        lower left corner, m
    upper
        upper right corner, m
    """

    kind: Literal["rectangle"]
    lower: Point2
    upper: Point2

    rules: ClassVar[Rules] = (
        ("", lambda b: not np.greater(b.upper, b.lower).all() and (b.upper, b.lower),
         "upper {} must exceed lower {} in both coordinates"),
    )  # fmt: skip

    def outline(self) -> Array:
        """Corners (4, 2), counter-clockwise from the lower left."""
        (x0, y0), (x1, y1) = self.lower, self.upper
        return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], dtype=float)

    def parts(self) -> tuple[str, ...]:
        """Names of the boundary parts, one per edge of `outline`."""
        return ("bottom", "right", "top", "left")


class Polygon(_PlaneBody):
    """A simple polygon; edge i goes from corner i to corner i + 1 and bears the i-th name.

    Attributes
    ----------
    corners
        corners in order, m
    names
        a name per edge; default edge0, edge1, …
    """

    kind: Literal["polygon"]
    corners: list[Point2] = Field(min_length=3)
    names: list[str] | None = None

    rules: ClassVar[Rules] = (
        ("", lambda b: b.names is not None and len(b.names) != len(b.corners)
         and (len(b.names), len(b.corners)), "{} names for {} edges"),
        ("", lambda b: polygon_defect(b.outline()), "{}"),
    )  # fmt: skip

    def outline(self) -> Array:
        """Corners (n, 2) in the order given."""
        return np.array(self.corners, dtype=float)

    def parts(self) -> tuple[str, ...]:
        """Names of the boundary parts, one per edge of `outline`."""
        return tuple(self.names or (f"edge{i}" for i in range(len(self.corners))))


class Box(_Body):
    """An axis-parallel box.

    Its parts are ``left``/``right`` (x), ``front``/``back`` (y) and ``bottom``/``top`` (z).

    Attributes
    ----------
    lower
        lowest corner, m
    upper
        highest corner, m
    """

    kind: Literal["box"]
    lower: Point3
    upper: Point3

    dimension: ClassVar[int] = 3
    rules: ClassVar[Rules] = (
        ("", lambda b: not np.greater(b.upper, b.lower).all() and (b.upper, b.lower),
         "upper {} must exceed lower {} in all coordinates"),
    )  # fmt: skip

    def parts(self) -> tuple[str, ...]:
        """Names of the boundary parts."""
        return ("left", "right", "bottom", "top", "front", "back")

    def extremes(self) -> Array:
        """Lowest and highest corner (2, 3)."""
        return np.array([self.lower, self.upper], dtype=float)

    def measure(self) -> float:
        """Return its volume, m³."""
        return float(np.prod(np.subtract(self.upper, self.lower)))

    def holds(self, points: Array, tolerance: float) -> Bools:
        """Tell which points (n, 3) lie in it, or outside by no more than a tolerance, m."""
        low, high = self.extremes()
        return np.asarray(((points >= low - tolerance) & (points <= high + tolerance)).all(axis=1))

    def on(self, part: str, points: Array, tolerance: float) -> Bools:
        """Tell which points (n, 3) lie on the boundary part of that name, to a tolerance, m."""
        axis, low = _AXES[part], part in ("left", "front", "bottom")
        end = (self.lower if low else self.upper)[axis]
        return np.asarray(np.abs(points[:, axis] - end) <= tolerance)


class MeshFile(_Body):
    """A mesh file; its parts are inequalities, or its groups: ``group:NAME``.

    Attributes
    ----------
    file
        mesh file, relative to the case file
    dimension_
        space dimension
    cells
        surface: triangles in space, a membrane
    scale
        metres per unit of the file: 1e-3 for millimetres
    weld
        nodes of the file that are as close become one, m
    """

    kind: Literal["file"]
    file: Path
    dimension_: Literal[2, 3] = Field(default=2, alias="dimension")
    cells: Literal["volume", "surface"] = "volume"
    scale: Positive = 1.0
    weld: Positive | None = None

    rules: ClassVar[Rules] = (
        ("", lambda b: b.cells == "surface" and b.dimension == 2,
         "cells = 'surface' is a membrane in space: dimension = 3"),
    )  # fmt: skip

    # of the case file; set where a scene is read
    _folder: Path | None = PrivateAttr(default=None)

    @property
    def dimension(self) -> int:
        """Space dimension."""
        return int(self.dimension_)

    @property
    def is_membrane(self) -> bool:
        """Whether its elements are triangles in space."""
        return self.cells == "surface"

    @property
    def path(self) -> Path:
        """The mesh file."""
        return (self._folder or Path.cwd()) / self.file

    def body(self) -> FileBody:
        """Read the body; see `verify.scene.mesh_file.read_body`."""
        return read_body(self.path, self.dimension, self.is_membrane, self.scale, self.weld or 0.0)

    def is_part(self, where: str) -> bool:
        """Whether a text is the name of a group."""
        return where.startswith(GROUP)

    def holds_inside(self, where: str) -> bool:
        """Whether `where` is a group of a membrane, which may be closed."""
        return self.is_membrane and self.is_part(where)

    def on(self, part: str, points: Array, tolerance: float) -> Bools:
        """Tell which points (n, d) of the boundary lie on a group, to a tolerance, m."""
        return self.body().on(part.removeprefix(GROUP), points, tolerance)


class Skin(_Body):
    """A face or the back of a hand, or a surface file; its part ``rim`` is its outer border.

    Coordinates of ``shape``: z out of the body; a face has x to its left and y up, a hand y
    along its fingers; the origin is in the middle. The geometry brings its own mesh.

    Attributes
    ----------
    shape
        which patch; or file
    elements
        of a shape: about how many elements are wanted
    file
        triangulated surface (STL, OBJ, PLY, VTU …), taken as it is
    thickness
        m; tetrahedra below the surface. Without it: a membrane
    layers
        with a thickness: layers of elements
    """

    kind: Literal["skin"]
    shape: Literal["face", "hand"] | None = None
    elements: Count | None = None
    file: Path | None = None
    thickness: Positive | None = None
    layers: Count = 1

    dimension: ClassVar[int] = 3
    rules: ClassVar[Rules] = (
        ("", none_or_both("shape", "file"), "a skin has either a shape or a file"),
        ("", one_alone("shape", "elements"), "elements belong to a shape, and a shape needs them"),
        ("", lambda b: b.thickness is None and b.layers > 1,
         "layers belong to a skin with a thickness"),
    )  # fmt: skip

    @property
    def is_membrane(self) -> bool:
        """Whether its elements are triangles in space."""
        return self.thickness is None

    def parts(self) -> tuple[str, ...]:
        """Names of the boundary parts."""
        return ("rim",)


Geometry = Annotated[Rectangle | Polygon | Box | MeshFile | Skin, Field(discriminator="kind")]
CellCounts = tuple[Count, ...]


class MeshLevels(Strict):
    """The background meshes on which the solvers are compared, coarse to fine.

    Attributes
    ----------
    pattern
        structured: squares split along the rising diagonal (rectangles only); given: the mesh file
        of the geometry, as it is or refined
    sizes
        element sizes h, m
    cells
        structured: numbers of cells per direction
    refine
        given: how often the mesh of the file is refined uniformly, each a level more; a curved
        boundary stays as the file has it
    position
        structured: 0 as asked, else another mesh of nearly equal size: one element more or less
        along each axis, falling diagonals, moved inner nodes; layers of one element stay layers
    """

    pattern: Literal["structured", "unstructured", "given"] = "structured"
    sizes: Annotated[list[Positive], Field(min_length=1)] | None = None
    cells: Annotated[list[CellCounts], Field(min_length=1)] | None = None
    refine: int = Field(strict=True, default=0, ge=0, le=6)  # fmt: skip
    position: int = Field(strict=True, default=0, ge=0, lt=POSITIONS)  # fmt: skip

    rules: ClassVar[Rules] = (
        ("", lambda m: m.pattern == "given" and (m.sizes or m.cells),
         "a given mesh has neither sizes nor cells"),
        ("", lambda m: m.pattern != "given" and none_or_both("sizes", "cells")(m),
         "a mesh has either sizes or cells"),
        ("", lambda m: m.refine and m.pattern != "given", "refine belongs to a given mesh"),
        ("position", lambda m: m.pattern != "structured" and m.position,
         "{}; only structured meshes, of rectangles and boxes, have others than 0"),
        ("", lambda m: m.cells and m.pattern == "unstructured",
         "cells belong to a structured mesh; give sizes"),
        ("", lambda m: not all(_finer(b, a) for a, b in pairwise(m.cells or [])),
         "cells must go from coarse to fine, no level twice"),
        ("", lambda m: m.sizes and sorted(set(m.sizes), reverse=True) != m.sizes,
         "sizes must descend from coarse to fine, none of them twice"),
    )  # fmt: skip

    @property
    def count(self) -> int:
        """Number of levels."""
        given = self.pattern == "given"
        return 1 + self.refine if given else len(self.sizes or self.cells or [])

    def divisions(self, body: Rectangle | Box, level: int) -> Ints:
        """Numbers of elements along each axis of a structured mesh, (d,) int."""
        if self.cells is not None:
            counts = np.array(self.cells[level])
        else:
            assert self.sizes is not None
            sides = np.subtract(body.upper, body.lower)
            # a size that divides the side up to round-off is that size
            counts = np.ceil(sides / self.sizes[level] * (1 - 1e-9)).astype(np.int64)
        return counts + np.where(counts > 1, mesh_position(self.position).more, 0)


class ReferenceLevels(Strict):
    """The reference that judges when there is no exact solution, or beside it.

    Attributes
    ----------
    kind
        default: exact where the scene has an exact solution
    size
        far element size of the coarsest level, m (default: chosen)
    levels
        number of levels, each halving h
    max_levels
        further levels are solved, up to that many, until the uncertainty is below a tenth of every
        error that it judges (default: `levels`)
    degree
        polynomial order
    time_step
        dynamic: largest step of the coarsest level, s, which every level halves (default: the
        step of the analysis)
    """

    kind: Literal["exact", "conforming"] | None = None
    size: Positive | None = None
    levels: int = Field(strict=True, default=3, ge=3, le=8)
    max_levels: int | None = Field(strict=True, default=None, ge=3, le=8)
    degree: Literal[1, 2] = 2
    time_step: Positive | None = None

    rules: ClassVar[Rules] = (
        ("", lambda r: r.max_levels is not None and r.max_levels < r.levels
         and (r.max_levels, r.levels), "max_levels {} is below levels {}"),
    )  # fmt: skip


def _finer(one: CellCounts, other: CellCounts) -> bool:
    return one != other and all(i >= j for i, j in zip(one, other, strict=False))
