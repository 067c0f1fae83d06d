"""Collision of tools with a moving surface: boxes refitted each step, contacts per piece."""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from verify.simulator.collision.bounding_tree import BoundingTree
from verify.simulator.collision.tool_kernels import capsule_contacts, segment_hits
from verify.simulator.collision.tree_kernels import nearest_facets
from verify.xfem.errors import XfemError

__all__ = ["Contacts", "DeformingFacets", "SurfaceCollider"]

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]


class _Rows(Protocol):
    @property
    def rows(self) -> NDArray[Any]: ...


class DeformingFacets(Protocol):
    """Deformed facets of a surface, as `mapping.moving_surface.MovingSurface` has them."""

    @property
    def material(self) -> _Rows:
        """(v, s) vertices in the material frame, in metres."""
        ...

    @property
    def facets(self) -> _Rows:
        """(f, k) vertices of each facet."""
        ...

    @property
    def facet_piece(self) -> _Rows:
        """(f,) piece to which each belongs."""
        ...

    @property
    def used(self) -> _Ints:
        """Numbers of the facets in use."""
        ...

    @property
    def in_order(self) -> bool:
        """Whether neighbours among these are near each other."""
        ...

    @property
    def retired(self) -> int:
        """How many facets have been taken out of use."""
        ...

    def positions(self, displacement: _Floats, out: _Floats | None = None) -> _Floats:
        """(v, s) vertices for a displacement of the dof nodes, in metres."""
        ...


@dataclass(frozen=True)
class Contacts:
    """Points of a surface that answer a query, one a row.

    Attributes
    ----------
    facet : (q,) int array
        Facet of the moving surface; -1 where a query found none.
    piece : (q,) int array
        Piece to which the facet belongs, so that both sides of a cut answer for themselves.
    distance : (q,) float array
        From the tool to the point, in metres.
    at : (q, k) float array
        Barycentric coordinates of the point in the facet, for `MovingSurface.facet_force`.
    share : (q,) float array
        Place on the tool, from its start (0) to its end (1).
    """

    facet: _Ints
    piece: _Ints
    distance: _Floats
    at: _Floats
    share: _Floats


class SurfaceCollider:
    """A tree over the facets of a moving surface.

    Parameters
    ----------
    surface : DeformingFacets

    Attributes
    ----------
    positions : (v, s) float array
        Of the vertices when last refitted, in metres.
    """

    def __init__(self, surface: DeformingFacets) -> None:
        self.surface = surface
        self._facets = np.empty((0, surface.facets.rows.shape[1]), dtype=np.int64)
        self._numbers = np.empty(0, dtype=np.int64)
        self._state = (-1, -1)
        self.positions = surface.material.rows.copy()
        self._rebuild()

    def refit(self, displacement: _Floats) -> None:
        """Move with the body; the tree is built anew only if the surface has changed.

        Parameters
        ----------
        displacement : (N, s) float array
            Of the dof nodes, in metres.
        """
        if len(self.positions) != len(self.surface.material.rows):
            self.positions = np.empty_like(self.surface.material.rows)
        self.follow(self.surface.positions(displacement, self.positions))

    def follow(self, positions: _Floats) -> None:
        """Move to positions (v, s) of all vertices that are known already, kept by reference, m.

        Raises
        ------
        XfemError
            If there are not as many as vertices, or one is not finite.
        """
        if positions.shape != self.surface.material.rows.shape:
            raise XfemError(
                f"positions of shape {positions.shape}; expected {self.surface.material.rows.shape}"
            )
        if not np.isfinite(positions).all():
            raise XfemError("positions of a surface that are not finite")
        self.positions = positions
        if self._state != self._now():
            self._rebuild()
        else:
            self._tree.refit(self.positions)

    def nearest(
        self, points: ArrayLike, limit: float = np.inf, piece_body: _Ints | None = None,
        body: int = -1,
    ) -> Contacts:  # fmt: skip
        """Nearest point of the surface to each point (q, s), if nearer than the limit.

        Parameters
        ----------
        points : (q, s) array_like
            In metres.
        limit : float
            In metres.
        piece_body, body
            Body of each piece, and the only one that counts; all do if it is negative.

        Raises
        ------
        XfemError
            If points are not finite or of another shape, the limit is negative, or pieces are
            without a body.
        """
        queries = self._check(points)
        if not limit >= 0.0:
            raise XfemError(f"limit {limit} m of a distance; expected zero or more")
        facet_body = np.zeros(len(self._numbers), dtype=np.int64)
        if piece_body is not None:
            most = int(self.surface.facet_piece.rows[self._numbers].max(initial=-1))
            if len(piece_body) <= most:
                raise XfemError(f"bodies of {len(piece_body)} pieces; expected {most + 1} or more")
            facet_body = piece_body[self.surface.facet_piece.rows[self._numbers]]
        facet, distance, at = nearest_facets(
            queries, self.positions, self._facets, facet_body, body, self._tree.low,
            self._tree.high, self._tree.order, min(limit, 1e150),
        )  # fmt: skip
        distance[facet < 0] = np.inf
        return self._contacts(facet, distance, at, np.zeros(len(facet)))

    def pierced(self, start: ArrayLike, end: ArrayLike) -> Contacts:
        """Facets that a segment pierces, in order along it."""
        ends = self._check(np.array([start, end], dtype=float))
        facet, share, at = segment_hits(
            ends[0], ends[1], self.positions, self._facets, self._tree.low, self._tree.high,
            self._tree.order,
        )  # fmt: skip
        order = np.argsort(share)
        return self._contacts(facet[order], np.zeros(len(facet)), at[order], share[order])

    def touched(self, start: ArrayLike, end: ArrayLike, radius: float) -> Contacts:
        """Facets within the radius of a tool's axis from start to end (a capsule)."""
        if not radius >= 0.0:
            raise XfemError(f"tool of radius {radius}; expected zero or more")
        ends = self._check(np.array([start, end], dtype=float))
        facet, distance, share, at = capsule_contacts(
            ends[0], ends[1], radius, self.positions, self._facets, self._tree.low,
            self._tree.high, self._tree.order,
        )  # fmt: skip
        return self._contacts(facet, distance, at, share)

    def _contacts(self, facet: _Ints, distance: _Floats, at: _Floats, share: _Floats) -> Contacts:
        if len(facet) == 0 or len(self._numbers) == 0:
            return Contacts(facet, facet, distance, at, share)
        number = np.where(facet >= 0, self._numbers[facet], -1)
        piece = np.where(number >= 0, self.surface.facet_piece.rows[number], -1)
        return Contacts(number, piece, distance, at, share)

    def _now(self) -> tuple[int, int]:
        return len(self.surface.facets.rows), self.surface.retired

    def _rebuild(self) -> None:
        self._numbers = self.surface.used
        self._facets = self.surface.facets.rows.take(self._numbers, axis=0)
        self._tree = BoundingTree(self.positions, self._facets, self.surface.in_order)
        self._state = self._now()

    def _check(self, points: ArrayLike) -> _Floats:
        queries = np.ascontiguousarray(points, dtype=float)
        space = self.positions.shape[1]
        if queries.ndim != 2 or queries.shape[1] != space or not np.isfinite(queries).all():
            raise XfemError(f"query points of shape {queries.shape}; expected finite (q, {space})")
        return queries
