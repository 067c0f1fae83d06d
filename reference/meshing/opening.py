"""Opening a cut: the nodes on it are doubled by the connectivity of the cells around them."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.geometry.simplices import cell_facets, connected, measures

_TINY = 1e-4  # of the body's size: an inner part less than that across stays joined


@dataclass(frozen=True)
class ConformingMesh:
    """A simplicial mesh that conforms to a cut, with the cut open; in d = 2 or 3 dimensions.

    Its cells fill k = d dimensions, or k = 2 of three: triangles in space, a membrane.

    Attributes
    ----------
    points : (n, d) float array
        Nodes in m; doubled on the cut.
    cells : (m, k + 1) int array
        Simplices; positively oriented if k = d.
    parent : (n,) int array
        The node before the cut was opened.
    boundary : (b, 2) int array
        Cell and opposite corner of each facet on the outer boundary (faces of the cut are not).
    cut_facets : (f, k) int array
        Nodes before opening of each facet of the cut.
    tiny_parts : (s,) float array
        Measures (m^k) of inner parts that were left joined to a neighbour as they are tiny, over
        the body's.
    """

    points: NDArray[np.float64]
    cells: NDArray[np.int64]
    parent: NDArray[np.int64]
    boundary: NDArray[np.int64]
    cut_facets: NDArray[np.int64]
    tiny_parts: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))

    @property
    def dimension(self) -> int:
        """Space dimension, 2 or 3."""
        return int(self.points.shape[1])

    @property
    def cell_dimension(self) -> int:
        """Dimension of the cells: 2 for a membrane, else the space dimension."""
        return int(self.cells.shape[1]) - 1

    @property
    def pieces(self) -> NDArray[np.int64]:
        """(m,) number of the connected piece of material that each cell belongs to."""
        first, second = _links_of_corners(self.cells)
        label = connected(len(self.points), first, second)
        # numbered by their first cells
        _, start, of_cell = np.unique(
            label[self.cells[:, 0]], return_index=True, return_inverse=True
        )
        return np.argsort(np.argsort(start))[of_cell].astype(np.int64)

    @cached_property
    def faces(self) -> NDArray[np.int64]:
        """(g, 2) cell and opposite corner of each facet on the faces of the cuts."""
        corners = self.cells.shape[1]
        _, which, count = np.unique(
            cell_facets(self.cells), axis=0, return_inverse=True, return_counts=True
        )
        alone = count[which.ravel()] == 1
        alone[self.boundary[:, 0] * corners + self.boundary[:, 1]] = False
        return np.column_stack(np.divmod(np.flatnonzero(alone), corners))

    @property
    def realised_cut(self) -> NDArray[np.float64]:
        """(f, k, d) corner coordinates of the facets of the cut, m."""
        first = np.zeros(int(self.parent.max()) + 1, dtype=np.int64)
        first[self.parent[::-1]] = np.arange(len(self.parent))[::-1]
        k, d = self.cell_dimension, self.dimension
        corners: NDArray[np.float64] = self.points[first[self.cut_facets]].reshape(-1, k, d)
        return corners


def interior_facets(
    cells: NDArray[np.int64], chosen: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_], NDArray[np.int64]]:
    """Match the facets of neighbouring cells, and find some of them by their nodes.

    Parameters
    ----------
    cells : (m, d + 1) array
    chosen : (f, d) array
        Nodes of facets.

    Returns
    -------
    first, second : (i,) arrays
        Interior facets as rows of `cell_facets`, seen from either cell.
    is_chosen : (i,) bool array
        Whether it is one of `chosen`.
    outer : (b,) array
        Facets of one cell only.

    Raises
    ------
    InputError
        If one of `chosen` is not an interior facet.
    """
    keys, wanted = _facet_keys(cell_facets(cells), np.sort(chosen, axis=1))
    order = np.argsort(keys, kind="stable")
    twin = np.flatnonzero(keys[order][1:] == keys[order][:-1])
    first, second = order[twin], order[twin + 1]
    alone = np.ones(len(keys), dtype=bool)
    alone[first] = alone[second] = False
    wanted = np.unique(wanted)
    is_chosen = np.isin(keys[first], wanted)
    if is_chosen.sum() != len(wanted):
        missing = len(wanted) - int(is_chosen.sum())
        raise InputError(f"{missing} facets of the cut are not inside the mesh")
    return first, second, is_chosen, np.flatnonzero(alone)


def inner_facets(cells: NDArray[np.int64], facets: NDArray[np.int64]) -> NDArray[np.int64]:
    """Keep the facets (f, d) that two cells share, ascending, each once."""
    facets = np.unique(np.sort(facets, axis=1), axis=0)
    keys, wanted = _facet_keys(cell_facets(cells), facets)
    values, times = np.unique(keys, return_counts=True)
    return facets[np.isin(wanted, values[times == 2])]


def open_cut(
    points: NDArray[np.float64], cells: NDArray[np.int64], cut_facets: NDArray[np.int64]
) -> ConformingMesh:
    """Double the nodes on a cut.

    Around each node the cells are grouped through the facets that are not cut; every group
    after the first gets a fresh node. Tips and fronts stay closed, mouths open, and a junction
    gets as many nodes as there are sectors, without being told which is which.

    An inner part less than a ten-thousandth of the body across stays joined to the part with which
    it shares the largest face. Three cuts that miss a common point make such parts.

    Parameters
    ----------
    points : (n, d) float array
    cells : (m, k + 1) int array
        Positively oriented if k = d.
    cut_facets : (f, k) int array
        Nodes of the interior facets along the cut.

    Raises
    ------
    InputError
        If a facet of the cut is not an interior facet of the mesh, or a cell has no volume.
    """
    _check_volumes(points, cells)
    k = cells.shape[1] - 1
    cut_facets = np.asarray(cut_facets, dtype=np.int64).reshape(-1, k)
    first, second, is_cut, outer = interior_facets(cells, cut_facets)
    is_cut, tiny = _without_tiny_parts(points, cells, (first, second, is_cut, outer))

    opened, parent = _opened(cells, first[~is_cut], second[~is_cut])
    boundary = np.column_stack(np.divmod(outer, k + 1))
    facets = np.unique(cell_facets(cells)[first[is_cut]], axis=0)
    mesh = ConformingMesh(points[parent], opened, parent, boundary, facets, tiny)
    _check_opening(mesh, len(outer))
    return mesh


def _without_tiny_parts(
    points: NDArray[np.float64],
    cells: NDArray[np.int64],
    found: tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_], NDArray[np.int64]],
) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Which facets are cut if inner parts of round-off size stay joined, and these parts' sizes."""
    first, second, is_cut, outer = found
    k = cells.shape[1] - 1
    one, other = first // (k + 1), second // (k + 1)
    part = connected(len(cells), one[~is_cut], other[~is_cut])
    count = int(part.max()) + 1
    if count == 1:
        return is_cut, np.zeros(0)
    size = np.bincount(part, measures(points[cells]), count)
    size /= size.sum()
    inner = np.ones(count, dtype=bool)
    inner[part[outer // (k + 1)]] = False
    tiny = np.flatnonzero(inner & (size < _TINY**k))
    is_cut = is_cut.copy()
    for own in tiny:
        ours = np.flatnonzero(is_cut & ((part[one] == own) != (part[other] == own)))
        beside = np.where(part[one[ours]] == own, part[other[ours]], part[one[ours]])
        faces = measures(points[cell_facets(cells)[first[ours]]])
        neighbour = np.bincount(beside, faces).argmax()
        is_cut[ours[beside == neighbour]] = False
    return is_cut, size[tiny]


def doubled_nodes(cells: NDArray[np.int64], cut_facets: NDArray[np.int64]) -> NDArray[np.int64]:
    """Find nodes that `open_cut` gives to several groups of cells, ascending."""
    first, second, is_cut, _ = interior_facets(cells, cut_facets)
    _, parent = _opened(cells, first[~is_cut], second[~is_cut])
    return parent[1:][parent[1:] == parent[:-1]]


def _opened(
    cells: NDArray[np.int64], first: NDArray[np.int64], second: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Give each group of cells around a node, joined by pairs of facets, a node of its own.

    Returns
    -------
    opened : (m, d + 1) array
        The cells with their new nodes.
    parent : array
        The old node of each new one, ascending.
    """
    # a slot is (cell, corner); the slots of one node are joined across every facet not cut
    slot_a, slot_b = _facing_slots(cells, first, second)
    group = connected(cells.size, slot_a, slot_b)
    _, start, label = np.unique(group, return_index=True, return_inverse=True)
    parent = cells.ravel()[start]
    # number the groups by their old node, so that nodes off the cut keep their order
    rank = np.empty(len(start), dtype=np.int64)
    rank[np.argsort(parent, kind="stable")] = np.arange(len(start))
    return rank[label].reshape(cells.shape), np.sort(parent, kind="stable")


def _facet_keys(
    facets: NDArray[np.int64], others: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Give equal facets (rows) of both arrays equal whole numbers."""
    rows = np.vstack([facets, others])
    count = int(rows.max(initial=0)) + 1
    keys = rows[:, 0]
    for column in rows.T[1:]:
        # compressed before each product, which so stays below 2⁶³
        keys = np.unique(keys, return_inverse=True)[1] * count + column
    return keys[: len(facets)], keys[len(facets) :]


def _facing_slots(
    cells: NDArray[np.int64], first: NDArray[np.int64], second: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Find pairs of slots (cell · (d + 1) + corner) of one node in two cells that share a facet."""
    k = cells.shape[1]
    pairs_a, pairs_b = [], []
    for step in range(1, k):
        corner = (first % k + step) % k
        node = cells[first // k, corner]
        at = np.argmax(cells[second // k] == node[:, None], axis=1)
        pairs_a.append(first // k * k + corner)
        pairs_b.append(second // k * k + at)
    return np.concatenate(pairs_a), np.concatenate(pairs_b)


def _links_of_corners(cells: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Find pairs of nodes that some cell holds together: its first corner with each other."""
    others = cells[:, 1:]
    return np.repeat(cells[:, 0], others.shape[1]), others.ravel()


def _check_volumes(points: NDArray[np.float64], cells: NDArray[np.int64]) -> None:
    if not len(cells):
        raise InputError("the mesh has no cells")
    d = cells.shape[1] - 1
    edges = points[cells[:, 1:]] - points[cells[:, :1]]
    if points.shape[1] > d:  # a membrane
        volume = measures(points[cells])
    else:
        volume = np.linalg.det(edges) / (2 if d == 2 else 6)
    longest = np.linalg.norm(edges, axis=2).max(axis=1)
    if not (volume > (1e-10 if d == 2 else 1e-15) * longest**d).all():
        unit = "area {:.3g} m²" if d == 2 else "volume {:.3g} m³"
        raise InputError(f"the mesh generator made a cell of {unit.format(volume.min())}")


def _check_opening(mesh: ConformingMesh, outer: int) -> None:
    """Every facet of the cut must have become two exterior facets."""
    none = np.zeros((0, mesh.cell_dimension), dtype=np.int64)
    keys, _ = _facet_keys(cell_facets(mesh.cells), none)
    _, times = np.unique(keys, return_counts=True)
    exterior = int((times == 1).sum())
    # a facet between two closed tips stays whole: its ends are single nodes
    expected = outer + 2 * len(mesh.cut_facets)
    if exterior != expected:
        raise InputError(
            f"opening the cut gave {exterior - outer} faces for {len(mesh.cut_facets)} facets; "
            "expected two each (a cut of a single facet cannot open: refine the mesh)"
        )
