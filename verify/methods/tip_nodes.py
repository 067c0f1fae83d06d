"""Ends of cuts inside elements of the plane: each becomes a node of the mesh.

By the rule of the thesis an element in which a cut ends stays whole, and the cut is as much
shorter. Here the element is divided into three at the end of the cut. If the end is near an edge,
it is divided into two together with its neighbour; if near a node, the cut ends there. Behind its
end the cut goes through one of these parts and stops at their common node. So the jump falls
linearly from the nodes of the edge by which the cut comes in to zero at its end: the partially cut
element of Rabczuk, Zi, Gerstenberger & Wall (Int. J. Numer. Meth. Engng 75, 2008), whose end is a
node.

`verify.methods.snapping` needs the first of these divisions alone: `add_tip_points`.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from verify.xfem.arrays import Bools, Floats, Ints, XfemError
from verify.xfem.crossing import AT_END, REACH, level_and_depth
from verify.xfem.cuts import Cut, Polyline
from verify.xfem.mesh import SimplexMesh
from verify.xfem.pieces import nodal_values

_LEAST = 0.15  # share in an element or an edge that each part of it has at least
# Linear elements act as if a cut ended 0.4 elements behind the node at its end (the study of
# ends of cuts): a place ahead of the end costs less than one as far behind it.
_BEHIND = 4.0
_HALVINGS = 52  # of a way through an element, in search of the end: down to round-off
_ROUND_OFF = 1e-9  # of a share, and of a way
_NEAR = 0.05  # element sizes: an end farther from the cut than that is none
_AT_EDGE = 1e-6  # barycentric: an end as near as that to an edge or node lies on it


@dataclass(frozen=True)
class EndingCut:
    """A cut that ends exactly at some nodes, and is elsewhere as before they were there.

    Attributes
    ----------
    cut : Cut
        As asked for.
    ends : (k, space) float array
        The nodes at which it ends, in metres. Level set and depth are zero there.
    others : (n, space) float array
        Further new nodes, in metres.
    levels : (n,) float array
        Level set there: linear in the element that was divided, so that it is cut as it was.
    """

    cut: Cut
    ends: Floats
    others: Floats
    levels: Floats

    def level_set(self, points: Floats) -> Floats:
        """Compute the level set of the cut, as stated at the new nodes."""
        found = np.array(self.cut.level_set(points), dtype=float)
        for place, level in zip(self.others, self.levels, strict=True):
            found[(points == place).all(axis=1)] = level
        return self._zero_at_ends(found, points)

    def depth(self, points: Floats) -> Floats:
        """Compute the depth of the cut, zero at its ends."""
        return self._zero_at_ends(np.array(self.cut.depth(points), dtype=float), points)

    def _zero_at_ends(self, values: Floats, points: Floats) -> Floats:
        for end in self.ends:
            values[(points == end).all(axis=1)] = 0.0
        return values


class TipNodes(NamedTuple):
    """A mesh with nodes at the ends of cuts.

    Attributes
    ----------
    mesh : SimplexMesh
        Nodes keep their numbers, new ones follow. The first part of a divided cell keeps its
        number, the others follow.
    cuts : list of EndingCut
        The cuts as they end at nodes of `mesh`, to be applied by the tip rule "inside".
    moved : (k,) float array
        Distance of each of these ends from where it was asked for, in metres.
    """

    mesh: SimplexMesh
    cuts: list[EndingCut]
    moved: Floats


class _Chord(NamedTuple):
    """Way of a cut through the element in which it ends.

    Attributes
    ----------
    cell : int
    entry, end, exit : (3,) float array
        Barycentric coordinates of where it comes in, ends, and would go out.
    """

    cell: int
    entry: Floats
    end: Floats
    exit: Floats


class _Met(NamedTuple):
    """What a cut meets.

    Attributes
    ----------
    cells : (m,) bool array
    nodes : (n,) bool array
        Nodes on it.
    chords : list of _Chord
        Two of an end on an edge along which the cut runs.
    """

    cells: Bools
    nodes: Bools
    chords: list[_Chord]


def with_tip_nodes(mesh: SimplexMesh, cuts: Sequence[Cut]) -> TipNodes:
    """Make the ends of cuts inside elements nodes of the mesh.

    The node is at the end if that leaves each part at least 0.15 of its element. Else it is at a
    place beside it that does, and rather ahead of the end than behind it. Ends on other cuts stay
    as they are, and so do ends for which only the outline of the body has a place.

    Parameters
    ----------
    mesh : SimplexMesh
        Triangles.
    cuts : sequence of Cut

    Raises
    ------
    XfemError
        If the mesh is of a solid, or a cut bad.
    """
    if mesh.dim != 2:
        raise XfemError("nodes at the ends of cuts in a mesh of tetrahedra; expected triangles")
    values = nodal_values(mesh, cuts)[0]
    met = [_met(mesh, cut, values[:, k]) for k, cut in enumerate(cuts)]
    times_met = np.zeros(len(mesh.cells), dtype=int)
    for one in met:
        times_met += one.cells
    division = _Division(mesh, times_met > 1)
    ends = division.ends(met)
    divided = division.mesh()
    nodes = divided.points[len(mesh.points) :]
    levels = division.interpolated(values)
    ending = [
        EndingCut(cut, places, nodes, levels[:, k])
        for k, (cut, places) in enumerate(zip(cuts, ends, strict=True))
    ]
    return TipNodes(divided, ending, np.array(division.moved))


def _met(mesh: SimplexMesh, cut: Cut, values: Floats) -> _Met:
    """Find the cells a cut with nodal values (n,) meets, and its way through those it ends in.

    It meets cells that it crosses, and both of an edge along which it runs. Those that it touches
    in a node alone it does not.
    """
    at_nodes = values[mesh.cells]
    above, below = at_nodes > 0.0, at_nodes < 0.0
    along = (at_nodes == 0.0).sum(axis=1) == 2
    cells = np.flatnonzero(above.any(axis=1) & below.any(axis=1) | along)
    above, below, rows = above[cells], below[cells], np.arange(len(cells))
    lone = np.where((above.sum(axis=1) == 1)[:, None], above, below).argmax(axis=1)
    corners, size = mesh.points[mesh.cells[cells]], mesh.longest_edges(cells)
    ways, within = np.zeros((2, len(cells), 3)), np.zeros((2, len(cells)), dtype=bool)
    near = np.zeros_like(within)
    for turn, at in enumerate(ways):
        other = (lone + turn + 1) % 3
        here, there = (values[mesh.cells[cells, k]] for k in (lone, other))
        at[rows, lone], at[rows, other] = there / (there - here), here / (here - there)
        level, depth = level_and_depth(cut, np.einsum("qi,qid->qd", at, corners))
        near[turn], within[turn] = np.abs(level) <= REACH * size, depth >= -AT_END * size
    meets = np.zeros(len(mesh.cells), dtype=bool)
    meets[cells] = (near & within).any(axis=0)
    some = np.flatnonzero(near.all(axis=0) & (within[0] != within[1]))
    if len(some) == 0:
        return _Met(meets, values == 0.0, [])
    first = np.where(within[0, some], 0, 1)
    low, out = ways[first, some], ways[1 - first, some]
    entry, high = low, out
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        depth = level_and_depth(cut, np.einsum("qi,qid->qd", middle, corners[some]))[1]
        inner = (depth >= 0.0)[:, None]
        low, high = np.where(inner, middle, low), np.where(inner, high, middle)
    # beside a kink the depth may change its sign off the cut, where the level set jumps, too
    level = level_and_depth(cut, np.einsum("qi,qid->qd", low, corners[some]))[0]
    ends = np.abs(level) <= _NEAR * size[some]
    found = zip(cells[some].tolist(), entry, low, out, strict=True)
    chords = [_Chord(*each) for each, is_end in zip(found, ends, strict=True) if is_end]
    return _Met(meets, values == 0.0, chords)


@dataclass(frozen=True, eq=False)
class _Place:
    """A place at which a cut may end.

    Attributes
    ----------
    cut : int
    end : (2,) float array
        Where the cut was to end, in metres.
    cell : int
    at : (3,) float array
        Barycentric coordinates in that cell.
    place : (2,) float array
        The same in metres.
    cells : set of int
        Cells that change: they are divided, or their node moves onto the cut.
    cost, close : float
        Distance from the end, more where the place is behind it; difference up to which costs,
        and places, are equal, in metres.
    """

    cut: int
    end: Floats
    cell: int
    at: Floats
    place: Floats
    cells: set[int]
    cost: float
    close: float

    def same_end(self, other: "_Place") -> bool:
        """Tell whether it is for the same end of the same cut."""
        return self.cut == other.cut and bool(np.abs(self.end - other.end).max() <= self.close)

    def excludes(self, other: "_Place") -> bool:
        """Tell whether it is another one for the same end, or needs the same cells."""
        return other is not self and (
            self.same_end(other) or not self.cells.isdisjoint(other.cells)
        )


class _Division:
    """A mesh some of whose cells are divided, each once.

    Parameters
    ----------
    mesh : SimplexMesh
    taken : (m,) bool array
        Cells that are not to be divided, nor are ends to be at their nodes.
    """

    def __init__(self, mesh: SimplexMesh, taken: Bools) -> None:
        self._mesh, self._taken = mesh, taken
        self._cells = mesh.cells.copy()
        self._places: list[Floats] = []
        self._more: list[Ints] = []
        self._from: list[tuple[int, Floats]] = []
        self.moved: list[float] = []
        self._inner = np.ones(len(mesh.points), dtype=bool)
        cell, opposite = mesh.boundary_facets.T
        self._inner[mesh.cells[cell][np.arange(3) != opposite[:, None]]] = False

    def mesh(self) -> SimplexMesh:
        """Return the mesh with the cells divided so far."""
        points = np.concatenate([self._mesh.points, *(place[None] for place in self._places)])
        return SimplexMesh(points, np.concatenate([self._cells, *self._more]))

    def interpolated(self, values: Floats) -> Floats:
        """Return values (n, c) at nodes as (k, c) at the new ones, linear in the divided cells."""
        found = [at @ values[self._mesh.cells[cell]] for cell, at in self._from]
        return np.array(found).reshape(len(found), values.shape[1])

    def ends(self, met: Sequence[_Met]) -> list[Floats]:
        """Divide cells where cuts end; the places (k, 2) at which each of the cuts then ends.

        The least cost comes first and takes its cells from others. Of places that exclude each
        other at one cost none is taken: numbers of cells or the axes would have to choose.
        """
        left: list[_Place] = []
        for cut, meets in enumerate(met):
            for chord in meets.chords:
                for new in self._possible(cut, chord, meets):
                    known = [old for old in left if old.same_end(new)]
                    if all(np.abs(old.place - new.place).max() > new.close for old in known):
                        left.append(new)
        found: list[list[Floats]] = [[] for _ in met]
        while left:
            most = min(one.cost + one.close for one in left)
            equal = [one for one in left if one.cost <= most]
            taken = [one for one in equal if not any(map(one.excludes, equal))]
            for one in taken:
                found[one.cut].append(self._divide(one))
            left = [one for one in left if one.cost > most and not any(map(one.excludes, taken))]
        return [np.array(places) for places in found]

    def _possible(self, cut: int, chord: _Chord, met: _Met) -> Iterator[_Place]:
        """Find places for an end of a cut; it must not end on another part of itself."""
        corners = self._mesh.points[self._mesh.cells[chord.cell]]
        ahead, end = (chord.exit - chord.entry) @ corners, chord.end @ corners
        close = float(_ROUND_OFF * np.linalg.norm(ahead))
        for at in _places(chord, corners):
            off = (at - chord.end) @ corners
            cost = float(np.linalg.norm(off))
            # at the end itself the cells ahead are touched, and not met; a node there stays
            exact, at_node = cost <= close, (at > 0.0).sum() == 1
            if off @ ahead < -close * cost:
                cost *= _BEHIND
            cells = [] if exact and at_node else self._around(chord.cell, at)
            if cells is None or self._taken[cells].any():
                continue
            if at[at > 0.0].min() < (1.0 - _ROUND_OFF) * _LEAST:
                continue
            if exact or not self._joins(chord, cells, met):
                yield _Place(cut, end, chord.cell, at, at @ corners, set(cells), cost, close)

    def _divide(self, chosen: _Place) -> Floats:
        """Divide the cells of a place and return it, or the node that is there, in metres."""
        nodes, at = self._mesh.cells[chosen.cell], chosen.at
        self.moved.append(float(np.linalg.norm(chosen.place - chosen.end)))
        if (at > 0.0).sum() == 1:
            return self._mesh.points[nodes[at.argmax()]]
        replaced, number = nodes[at > 0.0], len(self._inner) + len(self._places)
        self._places.append(chosen.place)
        self._from.append((chosen.cell, at))
        for cell in chosen.cells:
            ends = np.intersect1d(self._cells[cell], replaced)
            parts = _parts(self._cells[cell], ends, number)
            self._cells[cell] = parts[0]
            self._more.append(parts[1:])
        return chosen.place

    def _joins(self, chord: _Chord, cells: list[int], met: _Met) -> bool:
        """Tell whether the cut is in some of the cells otherwise than on its way to its end."""
        nodes = {cell: set(self._mesh.cells[cell].tolist()) for cell in {*cells, chord.cell}}
        others = {cell for cell in cells if met.cells[cell]} - {chord.cell}
        enters = set(self._mesh.cells[chord.cell][chord.entry > 0.0].tolist())
        waiting = [cell for cell in others if enters <= nodes[cell]]
        others -= set(waiting)
        while waiting:
            here = nodes[waiting.pop()]
            beside = {
                cell
                for cell in others
                if len(shared := here & nodes[cell]) == 2 or met.nodes[list(shared)].any()
            }
            others -= beside
            waiting += beside
        return bool(others)

    def _around(self, cell: int, at: Floats) -> list[int] | None:
        """Find cells around a place in a cell; None on the outline of the body."""
        mesh = self._mesh
        match int((at > 0.0).sum()):
            case 1:
                node = mesh.cells[cell, at.argmax()]
                starts, cells = mesh.node_cells
                return (
                    cells[starts[node] : starts[node + 1]].tolist() if self._inner[node] else None
                )
            case 2:
                across = int(mesh.neighbours[cell, at.argmin()])
                return [cell, across] if across >= 0 else None
        return [cell]


def _parts(cell: Ints, replaced: Ints, node: int) -> Ints:
    """Find parts (k, 3) of a triangle, in each of which a new node takes place of a corner (k,)."""
    return np.where(cell == replaced[:, None], node, cell)


def _places(chord: _Chord, corners: Floats) -> Iterator[Floats]:
    """Compute barycentric coordinates of places in an element at which a cut may end."""
    way = chord.exit - chord.entry
    # of the way through the element, where all parts are large enough
    low, high = 0.0, 1.0
    for start, slope in zip(chord.entry, way, strict=True):
        if slope > 0.0:
            low = max(low, (_LEAST - start) / slope)
        elif slope < 0.0:
            high = min(high, (_LEAST - start) / slope)
        elif start < _LEAST:
            high = -1.0
    if low <= high:
        share = (chord.end - chord.entry) @ way / (way @ way)
        yield chord.entry + np.clip(share, low, high) * way
    yield chord.entry
    yield chord.exit
    yield from np.eye(3)
    end = chord.end @ corners
    for k in range(3):
        a, b = (corners[(k + turn) % 3] for turn in (1, 2))
        share = np.clip((end - a) @ (b - a) / ((b - a) @ (b - a)), _LEAST, 1.0 - _LEAST)
        foot = np.zeros(3)
        foot[(k + 1) % 3], foot[(k + 2) % 3] = 1.0 - share, share
        yield foot


def add_tip_points(mesh: SimplexMesh, cuts: Sequence[Cut]) -> tuple[SimplexMesh, Ints]:
    """Divide each triangle in which an open polyline ends into three.

    Ends on an edge, at a node or outside the body need nothing, as a split ends there anyway.

    Parameters
    ----------
    mesh : SimplexMesh
        Others than triangles in the plane are given back.
    cuts : sequence of Cut
        Others than polylines have no ends here.

    Returns
    -------
    mesh : SimplexMesh
        The same one if there is nothing to do.
    origin : (m,) int array
        Cell of the given mesh in which each cell lies.
    """
    origin = np.arange(len(mesh.cells))
    if mesh.dim != 2 or mesh.space != 2:
        return mesh, origin
    ends = [cut.vertices[[0, -1]] for cut in cuts if isinstance(cut, Polyline) and not cut.closed]
    for point in np.concatenate(ends) if ends else []:
        weights = np.einsum("eik,ek->ei", mesh.gradients, point - mesh.points[mesh.cells[:, 0]])
        weights[:, 0] += 1.0
        cell = int(weights.min(axis=1).argmax())
        if weights[cell].min() <= _AT_EDGE:
            continue
        parts = _parts(mesh.cells[cell], mesh.cells[cell], len(mesh.points))
        cells = np.concatenate([np.delete(mesh.cells, cell, axis=0), parts])
        origin = np.concatenate([np.delete(origin, cell), np.repeat(origin[cell], 3)])
        mesh = SimplexMesh(np.concatenate([mesh.points, point[None]]), cells)
    return mesh, origin
