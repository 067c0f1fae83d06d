"""A part of an embedded surface as a surface of its own: what one sees, what one touches.

Surfaces that are cut together are divided in one go: at a step a blade meets so few facets that
the number of goes is what costs.
"""

import numpy as np
from numpy.typing import NDArray

from verify.simulator.arrays.growing_array import GrowingArray
from verify.simulator.collision.bounding_tree import BoundingTree
from verify.simulator.cutting.semi_progressive import SemiProgressiveCutter
from verify.simulator.mapping.embedded_surface import EmbeddedSurface

__all__ = ["SurfacePart", "embed_together"]

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]


class SurfacePart:
    """Facets that have come from some of the facets given to an embedded surface.

    Parameters
    ----------
    embedded : EmbeddedSurface
    begin, end : int
        The given facets from `begin` on and before `end`.
    """

    def __init__(self, embedded: EmbeddedSurface, begin: int, end: int) -> None:
        self._embedded, self._whole = embedded, embedded.surface
        # along a curve that fills space, so that a tree over them need not sort them at each cut
        self._given = begin + BoundingTree(embedded.points, embedded.facets[begin:end]).order

    @property
    def material(self) -> GrowingArray:
        """(v, s) vertices in the material frame, of the whole surface, m."""
        return self._whole.material

    @property
    def facets(self) -> GrowingArray:
        """(f, k) vertices of each facet of the whole surface."""
        return self._whole.facets

    @property
    def facet_piece(self) -> GrowingArray:
        """(f,) piece to which each belongs."""
        return self._whole.facet_piece

    @property
    def inner(self) -> GrowingArray:
        """(f,) whether each lies on a cut."""
        return self._whole.inner

    @property
    def used(self) -> _Ints:
        """Numbers of the facets of this part in use, neighbours near each other."""
        return self._embedded.parts_of(self._given)

    @property
    def in_order(self) -> bool:
        """Whether neighbours among these are near each other."""
        return True

    @property
    def retired(self) -> int:
        """How many facets of the whole surface have been taken out of use."""
        return self._whole.retired

    def positions(self, displacement: _Floats, out: _Floats | None = None) -> _Floats:
        """(v, s) vertices of the whole surface for a displacement of the dof nodes, m."""
        return self._whole.positions(displacement, out)

    def facet_force(self, facet: int, at: _Floats, force: _Floats, out: _Floats) -> _Floats:
        """Add a force at a point of a facet to those on the dof nodes (N, s), N."""
        return self._whole.facet_force(facet, at, force, out)


def embed_together(
    cutter: SemiProgressiveCutter, surfaces: list[tuple[_Floats, _Ints] | None]
) -> tuple[EmbeddedSurface | None, list[SurfacePart | None]]:
    """Embed several surfaces as one; None for what there is not.

    Parameters
    ----------
    cutter : SemiProgressiveCutter
    surfaces : list of (points, facets) or None

    Raises
    ------
    XfemError
        If one of them is not valid; see `EmbeddedSurface`.
    """
    there = [surface for surface in surfaces if surface is not None]
    if not there:
        return None, [None] * len(surfaces)
    first = np.cumsum([0, *(len(points) for points, _ in there)])
    facets = [facets + begin for (_, facets), begin in zip(there, first[:-1], strict=True)]
    embedded = EmbeddedSurface(
        cutter, np.concatenate([points for points, _ in there]), np.concatenate(facets)
    )
    parts: list[SurfacePart | None] = []
    begin = 0
    for surface in surfaces:
        parts.append(None)
        if surface is not None:
            end = begin + len(surface[1])
            parts[-1] = SurfacePart(embedded, begin, end)
            begin = end
    return embedded, parts
