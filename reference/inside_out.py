"""Places at which a solve fails: inverted cells, and supports that hold too weakly.

The corotated energy has no barrier at det F = 0. At a tip, a re-entrant corner or the end of a
support its strains are unbounded. Therefore det F ≤ 0 in a small zone around such a place is a
property of the law: refinement does not shrink the zone. Anywhere else it is an error.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from reference.linear_solvers import IllConditionedError
from reference.space import ConformingSpace, Unknowns
from verify.errors import InputError
from verify.geometry.simplices import boundary_facets
from verify.scene import Scene

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
# of the body: a zone around a singular place that disturbs nothing else, as ASTM E399 asks of the
# plastic zone at a tip: a fiftieth of the lengths of the specimen
ZONE = 0.02
_REENTRANT = np.pi + np.deg2rad(15.0)  # a smaller turn leaves a singularity too weak to matter


@dataclass(frozen=True)
class Orientation:
    """Least det F of a state, and the cells where it is not positive.

    Attributes
    ----------
    least : float
        At the quadrature points.
    place : tuple of float
        Centroid of its cell, m.
    share : float
        Of the body, where det F is not positive.
    stray : str
        Place of the least det F that is not positive outside the zones; "" if there is none.
    """

    least: float
    place: tuple[float, ...]
    share: float
    stray: str


class OrientationCheck:
    """det F of a displacement at the quadrature points of its space.

    Parameters
    ----------
    space : ConformingSpace
    unknowns : (k,) int array
        Constrained scalar unknowns, by nodes.
    determinant : ufl expression
    points : (q, d) array
        Quadrature points of the reference cell.
    opening : bool
        Whether cuts open on the way, so that any place of theirs may be a tip.
    """

    def __init__(
        self,
        space: ConformingSpace,
        unknowns: NDArray[np.int32],
        determinant: Any,
        points: Array,
        opening: bool = False,
    ) -> None:
        from dolfinx import fem

        self._space, self._unknowns, self._opening = space, unknowns, opening
        self._determinant = fem.Expression(determinant, points)
        domain = space.function_space.mesh
        here = np.flatnonzero(space.dolfinx_cell >= 0)
        cell_of = np.empty(len(here), dtype=np.int64)
        cell_of[space.dolfinx_cell[here]] = here
        self._own = cell_of[: domain.topology.index_map(space.mesh.cell_dimension).size_local]

    @cached_property
    def _singular(self) -> Array:
        space = self._space
        found = space.node_points[singular_nodes(space, self._unknowns)]
        tips = space.mesh.realised_cut.reshape(-1, space.dimension)
        return np.concatenate([found, tips]) if self._opening else found

    def __call__(self) -> Orientation:
        """Judge the displacement as it is; on all ranks together."""
        space, own = self._space, self._own
        domain = space.function_space.mesh
        cells = np.arange(len(own), dtype=np.int32)
        found = self._determinant.eval(domain, cells)
        values = np.asarray(found, dtype=float).reshape(len(own), -1)
        least = values.min(axis=1, initial=np.inf)
        share = np.count_nonzero(~(values > 0), axis=1) / max(values.shape[1], 1)
        out = np.flatnonzero(share)
        zone = ZONE * float(np.ptp(space.node_points, axis=0).max())
        stray = out[self._distances(own[out]) > zone]
        all_ranks = domain.comm.allgather(
            (
                self._worst(least, np.arange(len(own))),
                self._worst(least, stray),
                float(share @ space.measures[own]),
            )
        )
        worst, strays, shares = zip(*all_ranks, strict=True)
        value, place = min(worst)
        lost, where = min(strays)
        whole = float(space.measures.sum())
        said = "" if not where else f"det F is {lost:.2g} at {place_text(where)}"
        return Orientation(value, place, sum(shares) / whole, said)

    def fault(self, most: float) -> str:
        """Say where the displacement is inside out though it must not be; "" if nowhere.

        Around singular places a share `most` of the body may be.
        """
        found = self()
        if found.stray:
            return (
                f"{found.stray}, away from tips, corners and ends of supports: the body is turned "
                "inside out there; expected det F > 0, so a smaller load or a finer mesh"
            )
        if found.share > most:
            part = "area" if self._space.mesh.cell_dimension == 2 else "volume"
            return (
                f"{found.share:.2g} of the {part} is turned inside out, with a least det F of "
                f"{found.least:.2g} at {place_text(found.place)}; at most {most:g} may be"
            )
        return ""

    def _worst(self, least: Array, among: Ints) -> tuple[float, tuple[float, ...]]:
        """Compute the least value of some cells, and the centroid of its cell."""
        if not len(among):
            return np.inf, ()
        cell = among[int(np.argmin(least[among]))]
        return float(least[cell]), tuple(map(float, self._space.centroids[self._own[cell]]))

    def _distances(self, cells: Ints) -> Array:
        """Distance (k,) of cells from the next singular place, m; 0 of cells that touch one."""
        if not len(cells):
            return np.empty(0)
        if not len(self._singular):
            return np.full(len(cells), np.inf)
        tree = cKDTree(self._singular)
        corners = self._space.mesh.points[self._space.mesh.cells[cells]]
        touches = (tree.query(corners)[0] == 0.0).any(axis=1)
        return np.where(touches, 0.0, tree.query(self._space.centroids[cells])[0])


def singular_nodes(space: ConformingSpace, unknowns: NDArray[np.int32]) -> Ints:
    """Find corner nodes (k,) at which strains may be unbounded.

    Nodes of tips and fronts, re-entrant corners and edges, kinks and junctions of cuts: the
    material around a corner of the boundary (in space, an edge) takes more than 195°. And nodes
    where a held part of the boundary ends.

    Parameters
    ----------
    space : ConformingSpace
        Its mesh with the cuts open.
    unknowns : (k,) int array
        Constrained scalar unknowns, by nodes.
    """
    d = space.mesh.cell_dimension
    cells, points = space.cell_nodes[:, : d + 1], space.node_points
    held = np.zeros(points.shape, dtype=bool)
    held.ravel()[unknowns] = True
    facets = boundary_facets(cells)[0]
    is_held = held.any(axis=1)[facets].all(axis=1)
    ends = np.intersect1d(_hinges(facets[is_held], d), _hinges(facets[~is_held], d))
    hinges, angles = _angles(cells, points, d)
    found, place = np.unique(hinges, return_inverse=True)
    wide = found[np.bincount(place, weights=angles) > _REENTRANT]
    chosen = np.union1d(ends, np.intersect1d(wide, _hinges(facets, d)))
    return np.unique(np.concatenate(np.divmod(chosen, _BASE) if d == 3 else [chosen]))


_BASE = 1 << 31  # of the number of an edge, by its nodes


def _hinges(facets: Ints, d: int) -> Ints:
    """Find numbers of the corners, in space of the edges, of facets."""
    if d == 2:
        return np.asarray(facets.ravel())
    return np.concatenate(
        [_numbers(facets[:, i], facets[:, j]) for i, j in ((0, 1), (0, 2), (1, 2))]
    )


def _numbers(one: Ints, two: Ints) -> Ints:
    return np.asarray(np.minimum(one, two) * _BASE + np.maximum(one, two), dtype=np.int64)


def _angles(cells: Ints, points: Array, d: int) -> tuple[Ints, Array]:
    """Find numbers of all corners or edges of cells, and the angle of the cell there, rad."""
    hinges, angles = [], []
    for across in combinations(range(d + 1), 2):
        on = [i for i in range(d + 1) if i not in across]
        origin = points[cells[:, on[0]]]
        one, two = (points[cells[:, i]] - origin for i in across)
        number = cells[:, on[0]]
        if d == 3:
            along = points[cells[:, on[1]]] - origin
            along /= np.linalg.norm(along, axis=1, keepdims=True)
            one, two = (v - (v * along).sum(axis=1, keepdims=True) * along for v in (one, two))
            number = _numbers(number, cells[:, on[1]])
        size = np.linalg.norm(one, axis=1) * np.linalg.norm(two, axis=1)
        angles.append(np.arccos(np.clip((one * two).sum(axis=1) / size, -1.0, 1.0)))
        hinges.append(number)
    return np.concatenate(hinges), np.concatenate(angles)


def place_text(place: tuple[float, ...]) -> str:
    """Give a place as "(x, y)"."""
    return f"({', '.join(f'{x:.4g}' for x in place)})"


@contextmanager
def naming_weak_places(
    scene: Scene, space: ConformingSpace, unknowns: Unknowns | None = None
) -> Iterator[None]:
    """Say of a system that is lost in round-off where the body is held too weakly.

    Parameters
    ----------
    scene : Scene
    space : ConformingSpace
        Of the displacements.
    unknowns : Unknowns, optional
        Of the system, if it has others beside.

    Raises
    ------
    InputError
        In place of an `IllConditionedError`.
    """
    try:
        yield
    except IllConditionedError as error:
        correction = (unknowns or space).everywhere(error.correction)
        raise _weak_place(scene, space, error, correction) from error


def _weak_place(
    scene: Scene,
    space: ConformingSpace,
    error: IllConditionedError,
    correction: NDArray[np.float64],
) -> InputError:
    """Say in terms of the geometry why a system could not be solved."""
    size = np.linalg.norm(np.nan_to_num(correction, nan=np.inf), axis=1)
    node = int(np.argmax(size))
    around = (space.cell_nodes == node).any(axis=1)
    corners = space.mesh.points[space.mesh.cells[around]]
    longest = np.linalg.norm(corners[:, 1:] - corners[:, :1], axis=2).max()
    return InputError(
        f"geometry: the material around {place_text(space.node_points[node])}, in cells of "
        f"{longest:.2g} m, is held so weakly that its displacement is lost in round-off "
        f"({error.size:.1e} of the whole is not known): a needle or strip this slender "
        "between cuts, or between a cut and the boundary, cannot be solved for; move them apart, "
        "or let them meet",
        str(scene.file or ""),
    )
