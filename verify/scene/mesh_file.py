"""The body of a mesh file: simplices, groups of them, and what had to be done to get them.

Files have more than simplices: elements of higher order are taken by their corners, others are
split. A split face has its diagonal at its corner of the least number, and a cell all its simplices
at its own: so neighbours fit, whatever they are (Dompierre, Labbé, Vallet, Camarero 1999).
"""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.geometry.simplices import boundary_facets, on_simplices, oriented, places_of
from verify.printable import place_text
from verify.read_mesh import RawMesh, base_of, dimension_of, read_raw
from verify.scene.strict import nearest

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]

_PLANE = 1e-9  # of a plane body: what its z coordinates may differ by, as round-off
_INSIDE = 1e-12  # of the body: a point on the facet between two groups is in both
_CELL = {2: "triangle", 3: "tetra"}
# corners of the faces of cells that are no simplices, in the order of VTK
_FACES = {
    "quad": [[0, 1], [1, 2], [2, 3], [3, 0]],
    "pyramid": [[0, 1, 2, 3], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]],
    "wedge": [[0, 1, 2], [3, 4, 5], [0, 1, 4, 3], [1, 2, 5, 4], [2, 0, 3, 5]],
    "hexahedron": [
        [0, 1, 2, 3], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7],
    ],
}  # fmt: skip
_CORNERS = {
    "vertex": 1, "line": 2, "triangle": 3, "quad": 4, "tetra": 4, "pyramid": 5, "wedge": 6,
    "hexahedron": 8,
}  # fmt: skip


@dataclass(frozen=True)
class Group:
    """A named part of a mesh file.

    Attributes
    ----------
    cells : (q,) int array
        Cells of the body in it.
    parts : dict
        Simplices (p, c, d) in it of fewer corners c than the cells have, m, by c.
    """

    cells: Ints
    parts: dict[int, Array]


@dataclass(frozen=True)
class FileBody:
    """The body that a mesh file holds.

    Attributes
    ----------
    points : (n, d) array
        Nodes that some cell uses, m.
    cells : (m, d + 1) array
        Simplices of positive orientation; of a membrane triangles (m, 3), oriented as they were.
    groups : dict of Group
    notes : tuple of str
        What was done to the mesh of the file, in words.
    """

    points: Array
    cells: Ints
    groups: dict[str, Group]
    notes: tuple[str, ...]

    @property
    def size(self) -> float:
        """Longest side of its bounding box, m."""
        return float(np.ptp(self.points, axis=0).max())

    def group(self, name: str) -> Group:
        """Return the group of that name; InputError if there is none."""
        if name not in self.groups:
            known = nearest(name, self.groups) or "; the file has no groups"
            raise InputError(f"no group '{name}' in the mesh file{known}")
        return self.groups[name]

    def corners_of(self, name: str) -> list[Array]:
        """Simplices (p, c, d) of a group on the boundary; if it has none there, its cells, m."""
        group = self.group(name)
        return [*group.parts.values()] or [self.points[self.cells[group.cells]]]

    def on(self, name: str, points: Array, tolerance: float) -> Bools:
        """Tell which points (n, d) of the boundary lie on a group, to a tolerance, m."""
        found = np.zeros(len(points), dtype=bool)
        for corners in self.corners_of(name):
            found |= on_simplices(points, corners, tolerance)
        return found

    def inside(self, name: str, points: Array) -> Bools:
        """Tell which points (n, d) lie in the cells of a group; InputError if it has none."""
        cells = self.group(name).cells
        if not len(cells):
            raise InputError(f"group '{name}' of the mesh file has no cells of the body")
        return on_simplices(points, self.points[self.cells[cells]], _INSIDE * self.size)


def read_body(
    path: Path, dimension: int, membrane: bool = False, scale: float = 1.0, weld: float = 0.0
) -> FileBody:
    """Read the body of a mesh file; once, as long as the file stays what it is.

    Parameters
    ----------
    path : Path
    dimension : int
        Of space, 2 or 3.
    membrane : bool
        Whether its cells are triangles in space.
    scale : float
        Metres per unit of the file.
    weld : float
        Nodes as close as that become one, m.

    Raises
    ------
    InputError
        If the file is missing, unreadable or degenerate, has other cells, or if cells overlap that
        share a facet.
    """
    if not path.is_file():
        raise InputError(f"geometry.file: no mesh file '{path}'")
    stat = path.stat()
    return _read(path, (stat.st_mtime_ns, stat.st_size), dimension, membrane, scale, weld)


@lru_cache(maxsize=8)
def _read(
    path: Path, version: tuple[int, int], d: int, membrane: bool, scale: float, weld: float
) -> FileBody:
    del version  # a key of the cache
    raw, where = read_raw(path), str(path)
    notes: list[str] = []
    k = 2 if membrane else d
    _refuse_kinds(raw, k, where)
    points = _coordinates(raw, d, scale, where)
    blocks = [_simplices(kind, cells) for kind, cells in raw.blocks]
    for _, given in raw.blocks:
        if given.size and not (given.min() >= 0 and given.max() < len(points)):
            raise InputError(f"a cell names a node outside 0..{len(points) - 1}", where)
    notes += _notes_on_kinds(raw, k)
    if weld:
        points, blocks, count = _welded(points, blocks, k, weld, where)
        notes.append(f"{count} nodes are joined to others within {weld:g} m")
    own = [i for i, (kind, _) in enumerate(raw.blocks) if dimension_of(kind) == k]
    cells = np.concatenate([blocks[i][0] for i in own])
    members = _members(raw, blocks, own)
    cells, members = _without_copies(cells, members)
    used, compact = np.unique(cells, return_inverse=True)
    named = np.unique(np.concatenate([cells.ravel() for _, cells in raw.blocks]))
    if len(raw.points) > len(named):
        notes.append(f"{len(raw.points) - len(named)} nodes are in no cell and left out")
    body, cells = points[used], compact.reshape(cells.shape).astype(np.int64)
    if not np.isfinite(body).all():
        raise InputError("has coordinates that are not finite", where)
    cells, turned = _oriented(body, cells, where)
    if turned and not membrane:
        notes.append(f"{turned} of {len(cells)} cells are turned: their volume was negative")
    _refuse_overlaps(body, cells, not membrane, where)
    groups = {
        name: Group(members.get(name, np.zeros(0, dtype=np.int64)), parts)
        for name, parts in _parts(raw, blocks, points, k, cells, used).items()
    }
    return FileBody(body, cells, groups, tuple(notes))


def _refuse_kinds(raw: RawMesh, k: int, where: str) -> None:
    """Refuse cells of a higher dimension than the body, and a mesh without cells of its own."""
    kinds = {kind: dimension_of(kind) for kind, cells in raw.blocks if len(cells)}
    strange = sorted(kind for kind, dim in kinds.items() if dim is None or dim > k)
    if strange or k not in kinds.values():
        found = ", ".join(strange or sorted(kinds)) or "no cells"
        hint = ""
        if k == 3 and not strange and 2 in kinds.values():
            hint = "; with cells = 'surface' its triangles are a membrane"
        expected = f"{_CELL[k]}s, or cells that are split into them"
        raise InputError(f"has {found}; expected {expected}{hint}", where)


def _coordinates(raw: RawMesh, d: int, scale: float, where: str) -> Array:
    """Return the coordinates (n, d) of a body, m."""
    points = scale * np.asarray(raw.points, dtype=float)
    if points.ndim != 2 or points.shape[1] not in (d, 3) or not len(points):
        raise InputError(f"has points of shape {points.shape}; expected {d} coordinates", where)
    if d == 2 and points.shape[1] == 3:
        own = np.unique(np.concatenate([cells.ravel() for _, cells in raw.blocks]))
        own = own[(own >= 0) & (own < len(points))]
        *sides, height = np.ptp(points[own], axis=0)
        if height > _PLANE * max(sides):
            text = f"not plane: its z coordinates differ by {height:.3g} m"
            raise InputError(f"{text}; expected a body in a plane of constant z", where)
    return np.ascontiguousarray(points[:, :d])


def _simplices(kind: str, cells: Ints) -> tuple[Ints, Ints]:
    """Return simplices of cells, and of which cell (row) each is."""
    base = base_of(kind)
    cells = np.asarray(cells, dtype=np.int64).reshape(len(cells), -1)[:, : _CORNERS[base]]
    if base not in _FACES:
        return cells, np.arange(len(cells))
    least, found, parents = cells.min(axis=1), [], []
    for face in _FACES[base]:
        rows = np.flatnonzero((cells[:, face] != least[:, None]).all(axis=1))
        nodes = cells[rows][:, face]
        first = nodes.argmin(axis=1)[:, None]
        nodes = np.take_along_axis(nodes, (first + np.arange(len(face))) % len(face), axis=1)
        for i in range(1, max(2, len(face) - 1)):
            part = nodes[:, [0, i, i + 1]] if len(face) > 2 else nodes
            found.append(np.column_stack([least[rows], part]))
            parents.append(rows)
    simplices, parent = np.concatenate(found), np.concatenate(parents)
    ordered = np.sort(simplices, axis=1)
    whole = (np.diff(ordered, axis=1) > 0).all(axis=1)  # a corner may be given twice
    order = np.argsort(parent[whole], kind="stable")
    return simplices[whole][order], parent[whole][order]


def _notes_on_kinds(raw: RawMesh, k: int) -> list[str]:
    notes = []
    for kind in dict.fromkeys(kind for kind, _ in raw.blocks):
        own = [cells for one, cells in raw.blocks if one == kind and len(cells)]
        count, base = sum(map(len, own)), base_of(kind)
        if dimension_of(kind) != k or not count:
            continue
        if base in _FACES:
            notes.append(f"{count} cells '{base}' are split into {_CELL[k]}s")
        if own[0].shape[1] > _CORNERS[base]:
            notes.append(f"{count} cells '{kind}' are taken by their corners")
    return notes


def _welded(
    points: Array, rows: list[tuple[Ints, Ints]], k: int, weld: float, where: str
) -> tuple[Array, list[tuple[Ints, Ints]], int]:
    """Join nodes closer than `weld`; refuse it where a cell would lose a corner."""
    if not np.isfinite(points).all():
        raise InputError("has coordinates that are not finite", where)
    _, first, label = np.unique(places_of(points, weld), return_index=True, return_inverse=True)
    target = first[label]
    joined = [(target[simplices], parent) for simplices, parent in rows]
    for simplices, _ in joined:
        lost = np.flatnonzero((np.diff(np.sort(simplices, axis=1), axis=1) == 0).any(axis=1))
        if simplices.shape[1] == k + 1 and lost.size:
            text = f"geometry.weld: {weld:g} m joins corners of one cell ({lost.size} cells)"
            raise InputError(f"{text}; expected less than the shortest edge", where)
    return points, joined, len(points) - len(first)


def _members(raw: RawMesh, rows: list[tuple[Ints, Ints]], own: list[int]) -> dict[str, Ints]:
    """Return the cells of the body in each group."""
    start = dict(zip(own, np.cumsum([0, *(len(rows[i][0]) for i in own)]), strict=False))
    found = {}
    for name, given in raw.groups.items():
        chosen = [
            start[block] + np.flatnonzero(np.isin(rows[block][1], members))
            for block, members in given
            if block in start
        ]
        if chosen:
            found[name] = np.unique(np.concatenate(chosen)).astype(np.int64)
    return found


def _without_copies(cells: Ints, members: dict[str, Ints]) -> tuple[Ints, dict[str, Ints]]:
    """Leave out copies of a cell that stand for another group of it; refused later if not."""
    _, first, place = np.unique(
        np.sort(cells, axis=1), axis=0, return_index=True, return_inverse=True
    )
    place, rng = place.ravel(), np.random.default_rng(0)
    sign = np.zeros(len(cells), dtype=np.int64)  # of the set of groups that a cell is in
    for rows in members.values():
        sign[rows] ^= rng.integers(2**62)
    distinct = np.unique(np.column_stack([place, sign]), axis=0)
    if len(first) == len(cells) or len(distinct) < len(cells):
        return cells, members
    kept, number = np.sort(first), np.zeros(len(cells), dtype=np.int64)
    number[kept] = np.arange(len(kept))
    target = number[first[place]]
    return cells[kept], {name: np.unique(target[rows]) for name, rows in members.items()}


def _parts(
    raw: RawMesh, rows: list[tuple[Ints, Ints]], points: Array, k: int, cells: Ints, used: Ints
) -> dict[str, dict[int, Array]]:
    """Return, of every group, its simplices of lower dimension than the body, by corners."""
    found: dict[str, dict[int, Array]] = {}
    for name, given in raw.groups.items():
        parts: dict[int, list[Array]] = {}
        for block, members in given:
            simplices, parent = rows[block]
            if simplices.shape[1] <= k:
                chosen = simplices[np.isin(parent, members)]
                parts.setdefault(simplices.shape[1], []).append(points[chosen])
        found[name] = {c: np.concatenate(some) for c, some in parts.items()}
    for name, nodes in raw.nodes.items():
        inside = np.isin(used, nodes)
        facets = boundary_facets(cells)[0]
        whole = facets[inside[facets].all(axis=1)]
        own = found.setdefault(name, {})
        own.setdefault(1, points[used[inside]][:, None])
        if len(whole):
            own.setdefault(k, points[used[whole]])
    return found


def _oriented(points: Array, cells: Ints, where: str) -> tuple[Ints, int]:
    """Swap two corners of every cell of negative orientation; refuse cells without volume."""
    edges = points[cells[:, 1:]] - points[cells[:, :1]]
    membrane = edges.shape[1] < edges.shape[2]
    normals = np.cross(edges[:, 0], edges[:, 1]) if membrane else None
    volume = np.linalg.det(edges) if normals is None else np.linalg.norm(normals, axis=1)
    size = np.linalg.norm(edges, axis=2).max(axis=1) ** edges.shape[1]
    flat = np.flatnonzero(~(np.abs(volume) > 1e-14 * size))
    if flat.size:
        at = place_text(points[cells[flat[0]]].mean(axis=0))
        text = f"{flat.size} cells without volume, first cell {flat[0]} at {at}"
        raise InputError(text, where)
    return oriented(points, cells), int((volume < 0).sum())


def _refuse_overlaps(points: Array, cells: Ints, oriented: bool, where: str) -> None:
    """Refuse cells on the same side of a facet that they share; of a membrane, the same cell twice.

    Cells of positive orientation on either side of a facet name its corners in opposite turns.
    """
    facets = [np.delete(cells, i, axis=1) for i in range(cells.shape[1])] if oriented else [cells]
    rows = []
    for i, facet in enumerate(facets):
        pairs = [(a, b) for b in range(facet.shape[1]) for a in range(b)]
        swaps = sum((facet[:, a] > facet[:, b]).astype(np.int64) for a, b in pairs)
        side = (swaps + i) % 2 if oriented else np.zeros(len(facet), dtype=np.int64)
        rows.append(np.column_stack([np.sort(facet, axis=1), side]))
    asked = np.concatenate(rows)
    order = np.lexsort(asked.T)
    same = np.flatnonzero((asked[order[1:]] == asked[order[:-1]]).all(axis=1))
    if same.size:
        pair = np.sort(order[same[0] : same[0] + 2] % len(cells))
        at = place_text(points[cells[pair[0]]].mean(axis=0))
        text = f"cells {pair[0]} and {pair[1]} overlap: they are on the same side of a facet"
        more = f", as are {same.size - 1} pairs more" if same.size > 1 else ""
        raise InputError(f"{text}, around {at}{more}; folded, or given twice", where)
