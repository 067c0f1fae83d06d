"""One number for each point where cuts meet the mesh, and facets bisected at such points.

A zero point belongs to the simplex spanned by some mesh nodes (its support) and to the zero sets
of some cuts. If the support has one node more than there are cuts, these sets say which point it
is; otherwise the edge on which it was found does. Its number is the same in whatever order cuts
come.

Where a cut ends, a facet beside the end has a point on its edge that is not a vertex of it. All
facets along an edge share one record of points. So they are bisected alike, and no hanging vertex
is left on a surface. Edges on which elements meet lie on an edge of the mesh, or on the line in
which a cut crosses a face of it: the record is by these.
"""

from collections import defaultdict
from collections.abc import Iterator
from itertools import count
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.xfem.arrays import Bools, Floats, Ints, XfemError
from verify.xfem.zero_points import ZeroPoints


class GrowingArray:
    """Rows of equal shape.

    Parameters
    ----------
    rows : array
        The first rows; copied.

    Attributes
    ----------
    rows : array
        All rows so far, a view. It stays valid, but not complete, when more are appended.
    """

    def __init__(self, rows: NDArray[Any]) -> None:
        first = np.array(rows)
        self._store = np.empty((max(16, 2 * len(first)), *first.shape[1:]), dtype=first.dtype)
        self._store[: len(first)] = first
        self.rows = self._store[: len(first)]

    def __len__(self) -> int:
        return len(self.rows)

    def append(self, rows: NDArray[Any]) -> None:
        """Append rows (k, ...)."""
        begin = self.extend(len(rows))
        self.rows[begin:] = rows

    def extend(self, count: int) -> int:
        """Append rows without values; the number of the first."""
        begin, end = len(self.rows), len(self.rows) + count
        if end > len(self._store):
            store = np.empty((2 * end, *self._store.shape[1:]), dtype=self._store.dtype)
            store[:begin] = self.rows
            self._store = store
        self.rows = self._store[:end]
        return begin


class RowNumbers:
    """Rows of one length and their numbers."""

    def __init__(self) -> None:
        self._number: defaultdict[bytes, int] = defaultdict(count().__next__)

    def number(self, rows: Ints) -> tuple[Ints, Ints]:
        """Find numbers (k,) of rows (k, width), and where each new one comes first.

        New rows get the next numbers, in their order.
        """
        # equal rows often follow each other
        other = np.append(True, (rows[1:] != rows[:-1]).any(axis=1))[: len(rows)]
        keys = rows[other].view(f"V{8 * rows.shape[1]}").ravel().tolist()
        last = len(self._number) - 1
        found = np.fromiter(map(self._number.__getitem__, keys), np.int64, len(keys))
        found = found[np.cumsum(other) - 1]
        before = np.maximum.accumulate(np.concatenate([[last], found[:-1]]))
        return found, np.flatnonzero(found > before)


def distinct(values: Ints) -> Ints:
    """Find distinct values (q,), ascending: for a few thousand a sort beats numpy's hashing."""
    ordered = np.sort(values, axis=None)
    first = np.ones(len(ordered), dtype=bool)
    np.not_equal(ordered[1:], ordered[:-1], out=first[1:])
    return ordered[first]


def ranges(bounds: Ints) -> Ints:
    """List integers from the first up to the second bound of each row (k, 2), row after row."""
    counts = bounds[:, 1] - bounds[:, 0]
    ends = np.cumsum(counts)
    shift = np.repeat(bounds[:, 0] - ends + counts, counts)
    return np.arange(len(shift)) + shift


def of_lists(starts: Ints, items: Ints, rows: Ints) -> Ints:
    """Collect the integers of some lists, each of which begins where the one before ends."""
    return items[ranges(np.stack([starts[rows], starts[rows + 1]], axis=1))]


NODES, CUTS = 4, 3  # a point of a tetrahedron has at most that many
NONE = np.iinfo(np.int64).max  # no further node or cut
_WIDTH = NODES + CUTS


class PointNumbers:
    """Numbers of zero points: mesh nodes keep theirs, zero points follow.

    Attributes
    ----------
    nodes : int
        Number of mesh nodes.
    positions : GrowingArray
        (k, s) of the zero points, in metres.
    ends : GrowingArray
        (k, 2) numbers of the ends (plus, minus) of an edge on which each lies.
    cut : GrowingArray
        (k,) cut whose zero it is on that edge.
    met : (nodes, cuts) bool array
        Whether a cut runs exactly through a mesh node; of a growing cut that may change.
    """

    def __init__(self, nodes: int, space: int) -> None:
        self.nodes = nodes
        self.positions = GrowingArray(np.empty((0, space)))
        self.ends = GrowingArray(np.empty((0, 2), dtype=np.int64))
        self.cut = GrowingArray(np.empty(0, dtype=np.int64))
        self._table = RowNumbers()
        self.met = np.zeros((nodes, 0), dtype=bool)
        self._supports = GrowingArray(np.empty((0, _WIDTH), dtype=np.int64))

    @property
    def supports(self) -> Ints:
        """(k, 7) mesh nodes (4) and cuts (3) of each zero point, ascending, padded at the end."""
        return self._supports.rows

    def number(self, points: ZeroPoints, whole_nodes: Ints, cuts: Ints) -> Ints:
        """Find numbers of all points of a patch: its nodes, then its zero points.

        Parameters
        ----------
        points : ZeroPoints
            Of the patch.
        whole_nodes : int array
            Number in the whole mesh of each node of the patch.
        cuts : int array
            Number in the whole list of each cut of the patch.
        """
        local, ends = len(whole_nodes), points.ends
        numbers = np.concatenate([whole_nodes, np.full(len(ends), -1)])
        if len(ends) == 0:
            return numbers
        if (beyond := int(cuts.max()) + 1 - self.met.shape[1]) > 0:
            self.met = np.hstack([self.met, np.zeros((self.nodes, beyond), dtype=bool)])
        self.met[whole_nodes[:, None], cuts] = points.values[:local] == 0.0
        # ends that are zero points themselves come first
        while len(rest := np.flatnonzero(numbers[local:] < 0)):
            ready = rest[(numbers[ends[rest]] >= 0).all(axis=1)]
            own = numbers[ends[ready]]
            numbers[local + ready], new = self._number(own, cuts[points.cut[ready]])
            self.positions.append(points.positions[local + ready[new]])
            self.ends.append(own[new])
            self.cut.append(cuts[points.cut[ready[new]]])
        return numbers

    def _number(self, ends: Ints, cut: Ints) -> tuple[Ints, Ints]:
        """Find numbers (k,) of zero points of cuts (k,) on edges (k, 2), and the first new ones."""
        span, on = np.full((len(cut), NODES), NONE), np.full((len(cut), CUTS), NONE)
        span[:, :2], on[:, 0] = np.sort(ends, axis=1), cut
        if on_cuts := bool((ends >= self.nodes).any()):
            known = self.supports_of(ends)
            span = distinct_in_rows(known[:, :, :NODES].reshape(-1, 2 * NODES), NODES)
            first, second = known[:, 0, NODES:], known[:, 1, NODES:]
            common = np.where((first[:, :, None] == second[:, None, :]).any(axis=2), first, NONE)
            on = distinct_in_rows(np.hstack([on, common]), CUTS)
        key = np.hstack([span, on])
        if on_cuts:
            edge = (span < NONE).sum(axis=1) != (on < NONE).sum(axis=1) + 1
            key[edge] = -1
            key[edge, :3] = np.column_stack([cut, ends])[edge]
        number, new = self._table.number(key)
        on = on[new]
        if on_cuts:
            # a cut on which one end lies, and that runs exactly through the other
            others, ends = known[new, ::-1, NODES:], ends[new]
            at = np.nonzero((ends[:, :, None] < self.nodes) & (others < NONE))
            through = np.full(others.shape, NONE)
            through[at] = np.where(self.met[ends[at[:2]], others[at]], others[at], NONE)
            on = distinct_in_rows(np.hstack([on, through.reshape(-1, 2 * CUTS)]), CUTS)
        self._supports.append(np.hstack([span[new], on]))
        return self.nodes + number, new

    def supports_of(self, points: Ints) -> Ints:
        """Find mesh nodes and cuts (..., 7) of points (...), ascending, padded at the end."""
        found = np.full((*points.shape, _WIDTH), NONE)
        zero = points >= self.nodes
        found[..., 0] = points
        found[zero] = self.supports[points[zero] - self.nodes]
        return found

    def spans(self, nodes: Ints, points: Ints) -> Bools:
        """Tell whether each of some mesh nodes (q, c) spans the simplex of a point (q,).

        The weights of the others at the point are zero; its own may round to zero.
        """
        found = np.zeros(nodes.shape, dtype=bool)
        for spanned in self.supports_of(points)[:, :NODES].T:
            found |= nodes == spanned[:, None]
        return found


def distinct_in_rows(rows: Ints, most: int) -> Ints:
    """Find distinct integers of each row, ascending, at most so many, padded with `NONE`."""
    found = np.sort(rows, axis=1)
    again = found[:, 1:] == found[:, :-1]
    again &= found[:, 1:] < NONE
    if again.any():
        found[:, 1:][again] = NONE
        found.sort(axis=1)
    return found[:, :most]


_FACE = 3  # corners of a face
_SHORT = 1e-2  # of an edge: what has given a line its direction was too short to be trusted
_MOST = 10_000  # parts of a facet: each point bisects a few, those around its edge


class _Line(list[int]):
    """Numbers of the zero points on a line, and the direction along which they are ordered."""

    direction: Floats | None = None


class EdgePoints:
    """Which points lie inside which edges.

    Parameters
    ----------
    nodes : (n, s) float array
        Mesh nodes, in metres.
    points : PointNumbers
        Points where cuts meet that mesh.
    """

    def __init__(self, nodes: Floats, points: PointNumbers) -> None:
        self._nodes, self._points = nodes, points
        # nodes of edges that have a point, and of faces that have one inside
        self._crossed, self._faced = np.zeros((2, len(nodes)), dtype=bool)
        # zero points recorded, and those that are not the only one on an edge of the mesh
        self._recorded = GrowingArray(np.zeros(0, dtype=bool))
        self._crowded = GrowingArray(np.zeros(0, dtype=bool))
        # edges of the mesh; lines of cuts in faces by nodes and cut; edges in faces by their ends
        self._on_edges: defaultdict[int, _Line] = defaultdict(_Line)
        self._in_faces: defaultdict[tuple[int, ...], _Line] = defaultdict(_Line)
        self._turned = False

    def add(self, numbers: Ints) -> None:
        """Record points (by number; mesh nodes are ignored) on the lines on which they lie."""
        nodes, ends = self._points.nodes, self._points.ends.rows
        unheard = np.zeros(len(ends) - len(self._recorded), dtype=bool)
        self._recorded.append(unheard)
        self._crowded.append(unheard)
        unheard = ~self._recorded.rows
        self._recorded.rows[numbers[numbers >= nodes] - nodes] = True
        zero = np.flatnonzero(unheard & self._recorded.rows)
        supports = self._points.supports[zero]
        on_edge = supports[:, 2] == NONE
        edges = supports[on_edge, :2]
        self._crossed[edges] = True
        keys = (edges[:, 0] << 32 | edges[:, 1]).tolist()
        for key, number in zip(keys, (nodes + zero[on_edge]).tolist(), strict=True):
            points = self._on_edges[key]
            points.append(number)
            if len(points) > 1:
                self._crowded.rows[np.array(points) - nodes] = True
        # in a face, where the edge on which it was found may be a diagonal; then on cuts
        in_face = np.flatnonzero(~on_edge & (supports[:, _FACE] == NONE))
        self._faced[supports[in_face, :_FACE]] = True
        for k in in_face:
            face, cuts = tuple(supports[k, :_FACE].tolist()), supports[k, NODES:]
            lines = [tuple(np.sort(ends[zero[k]]).tolist())]
            lines += [(*face, cut) for cut in cuts[cuts < NONE].tolist()]
            for line in lines:
                self._in_faces[line].append(nodes + int(zero[k]))

    def bisect(self, facets: Ints, at: Floats) -> tuple[Ints, Floats, Ints]:
        """Bisect triangles at all recorded points on their edges; segments stay.

        Parameters
        ----------
        facets : (t, k) int array
            Numbers of points.
        at : (t, k, c) float array
            Coordinates of their corners, of any kind that is linear in a facet.

        Returns
        -------
        facets, at : (q, k), (q, k, c) arrays
        source : (q,) int array
            Given facet of which each is a part, ascending.

        Raises
        ------
        XfemError
            If points on a line are in no order.
        """
        every = np.arange(len(facets))
        if facets.shape[1] == 2 or not self._on_edges or len(facets) == 0:
            return facets, at, every
        suspects = self._suspects(facets)
        while True:
            self._turned = False
            parts = [self._parts(facets[t].tolist(), at[t]) for t in suspects]
            if not self._turned:  # else what came before was bisected in another order
                break
        count = np.ones(len(facets), dtype=np.int64)
        count[suspects] = [len(found) for found in parts]
        source = np.repeat(every, count)
        facets, at = facets[source], at[source]
        made = [part for found in parts for part in found]
        if made:
            looked = np.zeros(len(count), dtype=bool)
            looked[suspects] = True
            rows = looked[source]
            facets[rows], at[rows] = [ids for ids, _ in made], [place for _, place in made]
        return facets, at, source

    def _suspects(self, facets: Ints) -> Ints:
        """Find facets on the edges of which there may be points, ascending."""
        nodes, other = self._points.nodes, facets[:, [1, 2, 0]]
        low, high = np.minimum(facets, other), np.maximum(facets, other)
        zero = high >= nodes
        number = high[zero] - nodes
        suspect = np.zeros(facets.shape, dtype=bool)
        suspect[zero] = self._crowded.rows[number]
        if self._in_faces:
            suspect[zero] |= self._faced[self._points.supports[number, :2]].all(axis=1)
        at = np.nonzero(~zero)
        suspect[at] = self._crossed[low[at]] & self._crossed[high[at]]
        at = np.nonzero(~zero & suspect)
        suspect[at] = [key in self._on_edges for key in (low[at] << 32 | high[at]).tolist()]
        return np.flatnonzero(suspect.any(axis=1))

    def _parts(self, corners: list[int], at: Floats) -> list[tuple[list[int], Floats]]:
        """Bisect a triangle until no edge has a point inside."""
        rest = [(corners, at)]
        done: list[tuple[list[int], Floats]] = []
        while rest:
            if len(rest) + len(done) > _MOST:
                raise XfemError(f"points on the edges of facet {corners} are in no order")
            ids, at = rest.pop()
            for k in range(3):
                j = (k + 1) % 3
                if (found := self._between(ids[k], ids[j])) is None:
                    continue
                point, share = found
                for replaced in (k, j):
                    part = [point if n == replaced else ids[n] for n in range(3)]
                    if len(set(part)) == 3:  # else all three are on one line: nothing is left
                        places = at.copy()
                        places[replaced] = (1.0 - share) * at[k] + share * at[j]
                        rest.append((part, places))
                break
            else:
                done.append((ids, at))
        return done

    def _between(self, x: int, y: int) -> tuple[int, float] | None:
        """Find a recorded point strictly between two, and its share from x to y.

        The order on a line goes by projections on one direction: points that nearly coincide are in
        the same order for every facet.
        """
        for key, line in self._lines(x, y):
            others = [z for z in reversed(line) if z not in (x, y)]
            if not others:
                continue
            a, b = self._place(x), self._place(y)
            if key is not None and len(line) == 1 and max(x, y) < self._points.nodes:
                return line[0], self._share(a, b, line[0])  # the only one on a whole edge
            direction = line.direction
            if key is None or direction is None:
                direction = self._directed(line, *(key or (x, y)))
            start, end = (float(a @ direction), x), (float(b @ direction), y)
            for z in others:
                here = float(self._place(z) @ direction), z
                if (here > start) == (end > start) == (end > here):
                    return z, self._share(a, b, z)
        return None

    def _share(self, a: Floats, b: Floats, z: int) -> float:
        """Share from a to b at which a point lies between them."""
        along = b - a
        total = float(along @ along)
        share = float((self._place(z) - a) @ along) / total if total > 0.0 else 0.5
        return min(max(share, 0.0), 1.0)

    def _lines(self, x: int, y: int) -> Iterator[tuple[tuple[int, int] | None, _Line]]:
        """Lines on which an edge lies that may have points inside; the ends of an edge of the mesh.

        A line in a face holds no points on edges of the mesh, which are on the lines of these.
        """
        first, second = self._support(x), self._support(y)
        nodes = sorted({*first[:NODES], *second[:NODES]} - {NONE})
        if len(nodes) == 2:
            if (line := self._on_edges.get(nodes[0] << 32 | nodes[1])) is not None:
                yield (nodes[0], nodes[1]), line
        elif len(nodes) == _FACE:
            for cut in (first if x >= self._points.nodes else second)[NODES:]:
                line = self._in_faces.get((*nodes, cut))
                if line is not None and self._is_on(x, cut) and self._is_on(y, cut):
                    yield None, line
            if (line := self._in_faces.get((min(x, y), max(x, y)))) is not None:
                yield None, line

    def _support(self, number: int) -> list[int]:
        nodes = self._points.nodes
        if number < nodes:
            return [number]
        support: list[int] = self._points.supports[number - nodes].tolist()
        return support

    def _is_on(self, number: int, cut: int) -> bool:
        nodes = self._points.nodes
        if number < nodes:
            return bool(self._points.met[number, cut])
        return cut in self._points.supports[number - nodes, NODES:]

    def _directed(self, line: _Line, x: int, y: int) -> Floats:
        """Direction of a line: it leads from one end of the edge to the farthest point known.

        It is replaced once there is a point far beyond: a vector of length 1e-14 may point
        anywhere. An edge of the mesh has its own direction, from x to y.
        """
        begin, known = self._place(x), line.direction
        steps = np.array([self._place(z) for z in (y, *reversed(line))]) - begin
        lengths = (steps**2).sum(axis=1)
        far = int(lengths.argmax())
        if known is not None and known @ known >= _SHORT**2 * lengths[far]:
            return known
        direction: Floats = steps[far]
        if known is not None:
            self._turned = True
            direction = direction if direction @ known >= 0.0 else -direction
        line.direction = direction
        return direction

    def _place(self, number: int) -> Floats:
        nodes = len(self._nodes)
        if number < nodes:
            return np.asarray(self._nodes[number])
        return np.asarray(self._points.positions.rows[number - nodes])
