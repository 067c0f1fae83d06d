"""Points on edges, and facets bisected at them: no hanging vertex is left on a surface.

Where a cut ends, a facet beside the end has a point on its edge that is not a vertex of it. All
facets along an edge ask the same record of points, so that they are bisected alike. Edges on which
elements meet lie on an edge of the mesh, or on the line in which a cut crosses a face of it: the
record is by these.
"""

from collections import defaultdict
from collections.abc import Iterator

import numpy as np

from verify.simulator.point_numbers import NODES, NONE, GrowingArray, PointNumbers
from verify.xfem.arrays import Floats, Ints
from verify.xfem.errors import XfemError

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
        """Facets on the edges of which there may be points, ascending."""
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

        The order on a line is that of projections on one direction: points that nearly coincide are
        in the same order for every facet.
        """
        for key, line in self._lines(x, y):
            others = [z for z in reversed(line) if z not in (x, y)]
            if not others:
                continue
            direction = line.direction
            if key is None or direction is None:
                direction = self._directed(line, *(key or (x, y)))
            a, b = self._place(x), self._place(y)
            start, end = (float(a @ direction), x), (float(b @ direction), y)
            for z in others:
                c = self._place(z)
                here = float(c @ direction), z
                if (here > start) == (end > start) == (end > here):
                    total = float((b - a) @ (b - a))
                    share = float((c - a) @ (b - a)) / total if total > 0.0 else 0.5
                    return z, min(max(share, 0.0), 1.0)
        return None

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

        It is replaced once there is a point far beyond: what is 1e-14 long may point anywhere. That
        of an edge of the mesh is the edge's, from x to y.
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
