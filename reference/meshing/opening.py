"""Opening a cut: the nodes on it are doubled by the connectivity of the cells around them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from verify.errors import InputError

__all__ = ["ConformingMesh", "open_cut"]


@dataclass(frozen=True)
class ConformingMesh:
    """A simplicial mesh that conforms to a cut, with the cut open.

    Attributes
    ----------
    points : (n, 2) float array
        Nodes in m; doubled on the cut.
    cells : (m, 3) int array
        Positively oriented triangles.
    parent : (n,) int array
        The node before the cut was opened.
    boundary : (b, 2) int array
        Cell and opposite corner of each facet on the outer boundary (faces of the cut are not).
    cut_facets : (f, 2) int array
        Nodes before opening of each facet of the cut.
    """

    points: NDArray[np.float64]
    cells: NDArray[np.int64]
    parent: NDArray[np.int64]
    boundary: NDArray[np.int64]
    cut_facets: NDArray[np.int64]

    @property
    def pieces(self) -> NDArray[np.int64]:
        """(m,) number of the connected piece of material that each cell belongs to."""
        node = np.repeat(np.arange(len(self.cells)), 3)
        link = coo_array((np.ones(len(node)), (node, self.cells.ravel())),
                         shape=(len(self.cells), len(self.points)))  # fmt: skip
        _, label = connected_components((link @ link.T).tocsr(), directed=False)
        return label.astype(np.int64)


def open_cut(
    points: NDArray[np.float64], cells: NDArray[np.int64], cut_facets: NDArray[np.int64]
) -> ConformingMesh:
    """Double the nodes on a cut.

    Around each node the cells are grouped through the facets that are not cut; every group
    after the first gets a node of its own. Tips stay closed, mouths open, and a junction gets
    as many nodes as there are sectors, without being told which is which.

    Parameters
    ----------
    points : (n, 2) float array
    cells : (m, 3) int array
    cut_facets : (f, 2) int array
        Node pairs of the interior facets along the cut.

    Raises
    ------
    InputError
        If a facet of the cut is not an interior facet of the mesh, or a cell has no area.
    """
    _check_areas(points, cells)
    count = len(points)
    corners = np.array([[1, 2], [2, 0], [0, 1]])
    facets = np.sort(cells[:, corners], axis=2).reshape(-1, 2)
    keys = facets[:, 0] * count + facets[:, 1]
    order = np.argsort(keys, kind="stable")
    twin = np.flatnonzero(keys[order][1:] == keys[order][:-1])
    first, second = order[twin], order[twin + 1]
    alone = np.ones(len(keys), dtype=bool)
    alone[first] = alone[second] = False
    outer = np.flatnonzero(alone)

    sorted_cut = np.sort(np.asarray(cut_facets, dtype=np.int64).reshape(-1, 2), axis=1)
    cut_keys = np.unique(sorted_cut[:, 0] * count + sorted_cut[:, 1])
    is_cut = np.isin(keys[first], cut_keys)
    if is_cut.sum() != len(cut_keys):
        missing = len(cut_keys) - int(is_cut.sum())
        raise InputError(f"{missing} facets of the cut are not inside the mesh")

    # a slot is (cell, corner); join the slots of one node across every facet that is not cut
    joined_first, joined_second = first[~is_cut], second[~is_cut]
    slot_a, slot_b = _facing_slots(cells, joined_first, joined_second)
    link = coo_array((np.ones(len(slot_a)), (slot_a, slot_b)), shape=(cells.size, cells.size))
    _, group = connected_components(link.tocsr(), directed=False)
    _, start, label = np.unique(group, return_index=True, return_inverse=True)
    parent = cells.ravel()[start]
    # number the groups by their old node, so that nodes off the cut keep their order
    rank = np.empty(len(start), dtype=np.int64)
    rank[np.argsort(parent, kind="stable")] = np.arange(len(start))
    opened = rank[label].reshape(cells.shape)
    parent = np.sort(parent, kind="stable")
    boundary = np.column_stack([outer // 3, outer % 3])
    mesh = ConformingMesh(
        points[parent], opened, parent, boundary, np.column_stack(np.divmod(cut_keys, count))
    )
    _check_opening(mesh, len(outer))
    return mesh


def _facing_slots(
    cells: NDArray[np.int64], first: NDArray[np.int64], second: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs of slots (cell · 3 + corner) of one node in two cells that share a facet."""
    pairs_a, pairs_b = [], []
    for step in (1, 2):
        corner = (first % 3 + step) % 3
        node = cells[first // 3, corner]
        at = np.argmax(cells[second // 3] == node[:, None], axis=1)
        pairs_a.append(first // 3 * 3 + corner)
        pairs_b.append(second // 3 * 3 + at)
    return np.concatenate(pairs_a), np.concatenate(pairs_b)


def _check_areas(points: NDArray[np.float64], cells: NDArray[np.int64]) -> None:
    if not len(cells):
        raise InputError("the mesh has no cells")
    a, b, c = (points[cells[:, k]] for k in range(3))
    area = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    longest = np.max([np.linalg.norm(e, axis=1) for e in (b - a, c - b, a - c)], axis=0)
    if not (area > 1e-10 * longest**2).all():
        raise InputError(f"the mesh generator made a cell of area {area.min():.3g} m²")


def _check_opening(mesh: ConformingMesh, outer: int) -> None:
    """Every facet of the cut must have become two exterior facets."""
    corners = np.array([[1, 2], [2, 0], [0, 1]])
    facets = np.sort(mesh.cells[:, corners], axis=2).reshape(-1, 2)
    _, times = np.unique(facets, axis=0, return_counts=True)
    exterior = int((times == 1).sum())
    # a facet between two closed tips stays whole: its two ends are single nodes
    expected = outer + 2 * len(mesh.cut_facets)
    if exterior != expected:
        raise InputError(
            f"opening the cut gave {exterior - outer} faces for {len(mesh.cut_facets)} facets; "
            "expected two each (a cut of a single facet cannot open: refine the mesh)"
        )
