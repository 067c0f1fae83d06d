"""Meshes of files that are another body than meant: overlaps, hanging nodes, gaps, doubled nodes.

Cells that share a facet are checked where a mesh is read; here parts are that share no node.
"""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from verify.errors import InputError
from verify.geometry.simplices import (
    boundary_facets,
    connected_cells,
    feet,
    inner_range,
    measures,
    unit_normals,
)
from verify.printable import place_text as _at
from verify.result import Notice, NoticeKind
from verify.scene import Gravity, MeshFile, Scene, Traction, read_mesh
from verify.scene.geometry import GROUP
from verify.scene.parts import pieces_on_part

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# Of the largest extent of the body. Points that are closer were meant to be one: single precision
# keeps 1e-7. Cells that overlap by less touch.
_CLOSE = 1e-6
_FLAT = 1e-9  # of the same: what lies in the plane of a triangle
# A gap is at most as wide as coordinates of three digits leave it, and narrow beside its facets.
_GAP, _NARROW = 1e-3, 0.1
_INSIDE = 1e-6  # of a group: what may be left of it inside the body, as round-off
_PARTS = {1: ("nodes", ""), 2: ("lines", "m"), 3: ("triangles", "m²"), 4: ("tetrahedra", "m³")}
_LISTED = 5


def check_overlaps(scene: Scene, points: Array, cells: Ints) -> None:
    """Refuse a mesh whose cells overlap, wherever they are.

    Raises
    ------
    InputError
        With the number of cells, and a place.
    """
    skin = _Skin(points, cells)
    held = skin.overlapped()
    if not len(held):
        return
    where, middle = str(scene.file or scene.name), points[cells[held[0]]].mean(axis=0)
    raise InputError(
        f"geometry.file: cells overlap in {len(held)} cells, one at {_at(middle)}: a second copy, "
        "or parts that reach into one another; expected each place of the body once", where
    )  # fmt: skip


def mesh_warning(scene: Scene) -> str:
    """Warn of parts of a mesh file that touch or nearly touch and are not joined, or say ""."""
    if not isinstance(scene.geometry, MeshFile):
        return ""
    skin = _Skin(*read_mesh(scene))
    pairs, (hanging, near) = skin.coincident(), skin.unjoined()
    said = []
    if len(pairs):
        said.append(f"{len(pairs)} pairs of nodes coincide, one at {_at(skin.points[pairs[0, 0]])}")
    if len(hanging):
        said.append(f"{len(hanging)} nodes hang on facets, one at {_at(skin.points[hanging[0]])}")
    if len(near):
        said.append(
            f"{len(near)} nodes lie before facets within {_GAP:g} of the body, one at "
            f"{_at(skin.points[near[0]])}"
        )
    if not said:
        return ""
    return (
        f"'{scene.geometry.file}' is not joined where {'; '.join(said)}: the body is apart there; "
        "merge nodes (weld = 1e-6 in [geometry] joins those within 1e-6 m) or mesh it anew if it "
        "is not meant to be"
    )


def body_notes(scene: Scene) -> list[str]:
    """Say what was done to the mesh of a file, and list its groups with measure and extent."""
    if not isinstance(given := scene.geometry, MeshFile):
        return []
    body, used, said = given.body(), _used_groups(scene), _done_to_the_mesh(scene, given)
    for name, group in body.groups.items():
        parts = {**group.parts, **({0: body.points[body.cells[group.cells]]} if len(group.cells)
                                   else {})}  # fmt: skip
        words = []
        for key in sorted(parts, key=lambda c: c or 9, reverse=True):
            what, power = _PARTS[parts[key].shape[1]]
            size = f", {measures(parts[key]).sum():.3g} {power}" if power else ""
            words.append(f"{len(parts[key])} {what}{size}")
        places = np.concatenate([part.reshape(-1, scene.dimension) for part in parts.values()])
        if not len(places):
            continue
        ends = zip(places.min(axis=0), places.max(axis=0), strict=True)
        box = " × ".join(f"[{low:.3g}, {high:.3g}]" for low, high in ends)
        unused = "" if name in used else " (unused)"
        said.append(f"{GROUP}{name}: {', '.join(words)}, in {box} m{unused}")
    return [*said, *filter(None, [_wave_time(scene, given)])]


def mesh_warnings(scene: Scene) -> list[str]:
    """Warn of all that makes the body of a mesh file another than meant."""
    if not isinstance(body := scene.geometry, MeshFile):
        return []
    said = (_pieces, _unit, _inner, _unused)
    return list(filter(None, [mesh_warning(scene), *(one(scene, body) for one in said)]))


def _pieces(scene: Scene, body: MeshFile) -> str:
    """Warn of a body in pieces that share no facet, or say ""."""
    points, cells = read_mesh(scene)
    piece = connected_cells(cells)
    count = np.bincount(piece)
    if len(count) == 1:
        return ""
    own = cells[piece == count.argmin()]
    return (
        f"'{body.file}' is in {len(count)} pieces that share no facet, "
        f"the least of {len(own)} cells around {_at(points[own].mean(axis=(0, 1)))}"
    )


def _unit(scene: Scene, body: MeshFile) -> str:
    """Warn of a body that would hang longer than twice its size, or say ""."""
    pulls = [np.linalg.norm(one.acceleration) for one in scene.loads if isinstance(one, Gravity)]
    size, material = body.body().size, scene.material
    stretch = sum(pulls) * (material.density or 0.0) * size / (2.0 * material.young)
    if stretch <= 1.0:
        return ""
    return (
        f"hung up, the body would stretch by ρgL/2E = {stretch:.2g} of its length L = {size:.3g} m;"
        " is the file in metres? [geometry] scale = 1e-3 reads millimetres"
    )


def _wave_time(scene: Scene, body: MeshFile) -> str:
    """Say how long a shear wave takes through the body, its slowest natural time, or ""."""
    material = scene.material
    if material.density is None:
        return ""
    shear = material.young / (2.0 * (1.0 + material.poisson))
    time = body.body().size * np.sqrt(material.density / shear)
    return f"a shear wave crosses the body in {time:.3g} s"


def _unused(scene: Scene, body: MeshFile) -> str:
    """Warn of groups that the case does not use, or say ""."""
    if not (left := [name for name in body.body().groups if name not in _used_groups(scene)]):
        return ""
    names = ", ".join(f"'{name}'" for name in left[:_LISTED]) + (", …" if left[_LISTED:] else "")
    return f"groups of '{body.file}' that the case does not use: {names}"


def _inner(scene: Scene, body: MeshFile) -> str:
    """Warn of a group, at which a support or traction acts, of which much is no boundary, or ""."""
    skin = _Skin(*read_mesh(scene))
    boundary = skin.points[skin.facets]
    acting = {f"supports[{i}]": one.where for i, one in enumerate(scene.supports)}
    acting |= {f"loads[{i}]": one.where for i, one in enumerate(scene.loads)
               if isinstance(one, Traction)}  # fmt: skip
    said = []
    for key, where in acting.items():
        if not body.is_part(where) or body.holds_inside(where):
            continue
        group = body.body().group(where.removeprefix(GROUP))
        if 1 in group.parts:
            nodes = group.parts[1][:, 0]
            away = cKDTree(boundary.reshape(-1, scene.dimension)).query(nodes)[0]
            if count := np.count_nonzero(away):
                said.append(
                    f"{key}: {count} of {len(nodes)} nodes of '{where}' are inside the body, and "
                    "left out"
                )
        elif boundary.shape[1] in group.parts:
            pieces = pieces_on_part(body, where, boundary)
            on = measures(boundary) @ pieces.covered(len(boundary))
            inside = 1.0 - on / measures(group.parts[boundary.shape[1]]).sum()
            if inside > _INSIDE:
                said.append(f"{key}: {inside:.1%} of '{where}' is inside the body, and left out")
        elif not group.parts:
            said.append(f"{key}: of the cells of '{where}' their part of the boundary alone counts")
    return "; ".join(said)


def _used_groups(scene: Scene) -> set[str]:
    places = [*scene.supports, *scene.loads, *scene.material.regions]
    texts = [getattr(one, "where", "") for one in places]
    return {text.removeprefix(GROUP) for text in texts if text.startswith(GROUP)}


def mesh_notices(scene: Scene) -> list[Notice]:
    """Return the warnings of a mesh file and what was done to it, for the record of a case."""
    if not isinstance(body := scene.geometry, MeshFile):
        return []
    said = {
        NoticeKind.WARNING: [mesh_warning(scene), _unit(scene, body), _inner(scene, body)],
        NoticeKind.ADEQUACY: _done_to_the_mesh(scene, body),
    }
    return [Notice(kind, "mesh file", None, x) for kind, texts in said.items() for x in texts if x]


def _done_to_the_mesh(scene: Scene, body: MeshFile) -> list[str]:
    notes = list(body.body().notes)
    if times := scene.mesh.refine:
        notes.append(
            f"levels are refined uniformly up to {times} times; a curved boundary stays as the "
            "file has it"
        )
    return [f"of the mesh file, {note}" for note in notes]


class _Skin:
    """Facets of a mesh (of a membrane: edges) that one cell alone has.

    Parameters
    ----------
    points : (n, d) array
    cells : (m, k) int array
    """

    def __init__(self, points: Array, cells: Ints) -> None:
        self.points, self.cells = points, cells
        self.membrane = cells.shape[1] == points.shape[1]
        self.size = float(np.ptp(points, axis=0).max())
        self.facets, self.behind, corner = boundary_facets(cells)  # (f, k − 1), (f,)
        self.opposite = cells[self.behind, corner]

    @cached_property
    def nodes(self) -> Ints:
        """Nodes of the skin; of a membrane, which may be closed, all."""
        return np.arange(len(self.points)) if self.membrane else np.unique(self.facets)

    def coincident(self) -> Ints:
        """Pairs (p, 2) of nodes of the skin at one place."""
        if not len(self.nodes):
            return np.zeros((0, 2), dtype=np.int64)
        tree = cKDTree(self.points[self.nodes])
        return self.nodes[tree.query_pairs(_CLOSE * self.size, output_type="ndarray")]

    def unjoined(self) -> tuple[Ints, Ints]:
        """Nodes that lie on a facet of which they are no corner, and nodes close before one."""
        if not len(self.facets):
            return self.facets, self.facets
        corners = self.points[self.facets]
        middle = corners.mean(axis=1)
        reach = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
        tree = cKDTree(self.points[self.nodes])
        near = tree.query_ball_point(middle, (1 + 2 * _NARROW) * reach + _CLOSE * self.size)
        which = np.repeat(np.arange(len(near)), [len(one) for one in near])
        node = self.nodes[np.concatenate([*near, []]).astype(np.int64)]
        other = (self.facets[which] != node[:, None]).all(axis=1)
        which, node = which[other], node[other]
        foot = _feet(self.points[node], corners[which])
        away = np.linalg.norm(self.points[node] - foot, axis=1)
        to_corner = np.linalg.norm(corners[which] - self.points[node, None], axis=2).min(axis=1)
        close = _CLOSE * self.size
        on = (away <= close) & (to_corner > close)
        edge = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)[which]
        before = (away > close) & (away <= np.minimum(_GAP * self.size, _NARROW * edge))
        before &= self._faces(which, self.points[node] - foot, away)
        before[before] = ~self._neighbours(which[before], node[before])
        return np.unique(node[on]), np.unique(node[before])

    def _faces(self, which: Ints, way: Array, length: Array) -> NDArray[np.bool_]:
        """Whether ways (n, d) of a length (n,) point out of the material behind facets (n,)."""
        inner = self.points[self.opposite[which]]
        out = _feet(inner, self.points[self.facets[which]], bounded=False) - inner
        return np.sum(out * way, axis=1) > 0.5 * length * np.linalg.norm(out, axis=1)

    def _neighbours(self, which: Ints, node: Ints) -> NDArray[np.bool_]:
        """Whether a facet (n,) has a corner on a facet of a node (n,)."""
        count, k = len(self.points), self.facets.shape[1]
        joined = np.unique([self.facets[:, a] * count + self.facets[:, b]
                            for a in range(k) for b in range(k) if a != b])  # fmt: skip
        asked = self.facets[which] * count + node[:, None]
        return np.asarray(np.isin(asked, joined).any(axis=1))

    def overlapped(self) -> Ints:
        """Cells (c,) through which edges or cells run that are no part of them.

        Two bodies that overlap have an edge of one inside a cell of the other, or one holds the
        other. Of a membrane all edges are tested, in space the edges of the skin.
        """
        from verify.compare.cell_tree import build_cell_tree, morton_order, pairs_met

        rims = self.cells if self.membrane else self.facets
        k = rims.shape[1]
        pairs = np.concatenate([rims[:, [a, b]] for b in range(k) for a in range(b)])
        edges = np.unique(pairs.min(axis=1) * len(self.points) + pairs.max(axis=1))
        nodes = np.divmod(edges, len(self.points))
        inner = np.unique(self.behind)
        middle = self.points[self.cells[inner]].mean(axis=1)
        starts, ends = (np.concatenate([self.points[end], middle]) for end in nodes)
        own = np.concatenate([np.full(len(edges), -1), inner])
        order = morton_order(0.5 * (starts + ends))  # near ones find their cells faster
        corners = self.points[self.cells]
        normals, offsets = self._half_spaces(corners)
        tree = build_cell_tree(corners.min(axis=1), corners.max(axis=1), surface=self.membrane)

        def by_boxes(row: Ints, low: Array, high: Array, box: Ints) -> NDArray[np.bool_]:
            least, most = np.minimum(starts, ends)[row], np.maximum(starts, ends)[row]
            return np.asarray(((least <= high[box]) & (most >= low[box])).all(axis=1))

        found = [own[:0]]
        for row, cell in pairs_met(tree, corners, order, by_boxes):
            first, last = (
                np.einsum("nkd,nd->nk", normals[cell], place[row]) - offsets[cell]
                for place in (starts, ends)
            )
            low, high = inner_range(first, last)
            found.append(cell[(low < high) & (cell != own[row])])
        return np.unique(np.concatenate(found))

    def _half_spaces(self, corners: Array) -> tuple[Array, Array]:
        """Return normals (m, k, d) and offsets (m, k) of cells smaller by `_CLOSE`."""
        normals, offsets = [], []
        for k in range(corners.shape[1]):
            facet, opposite = np.delete(corners, k, axis=1), corners[:, k]
            way = opposite - _feet(opposite, facet, bounded=False)
            way /= np.linalg.norm(way, axis=1, keepdims=True)
            normals.append(way)
            offsets.append(np.sum(way * facet[:, 0], axis=1) + _CLOSE * self.size)
        if self.membrane:
            across = unit_normals(corners)
            height = np.sum(across * corners[:, 0], axis=1)
            normals += [across, -across]
            offsets += [sign * height - _FLAT * self.size for sign in (1.0, -1.0)]
        return np.stack(normals, axis=1), np.stack(offsets, axis=1)


def _feet(points: Array, facets: Array, bounded: bool = True) -> Array:
    """Nearest points (n, d) on segments or triangles (n, k, d), or on their line or plane."""
    if facets.shape[1] == 2:
        start, end = facets[:, 0], facets[:, 1]
        if bounded:
            return feet(points, start, end)
        along = end - start
        share = np.sum((points - start) * along, axis=1) / np.sum(along**2, axis=1)
        return np.asarray(start + share[:, None] * along)
    normal = unit_normals(facets)
    height = np.sum((points - facets[:, 0]) * normal, axis=1)
    foot = points - height[:, None] * normal
    if not bounded:
        return np.asarray(foot)
    outside, best = np.zeros(len(points), dtype=bool), foot.copy()
    least = np.full(len(points), np.inf)
    for k in range(3):
        start, end = facets[:, k], facets[:, (k + 1) % 3]
        outside |= np.sum(np.cross(end - start, foot - start) * normal, axis=1) < 0.0
        on_edge = feet(points, start, end)
        away = np.linalg.norm(points - on_edge, axis=1)
        nearer = away < least
        best[nearer], least[nearer] = on_edge[nearer], away[nearer]
    return np.where(outside[:, None], best, foot)
