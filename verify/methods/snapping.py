"""Meshes that conform to the cut: nodes move onto it, cells are split along it, or both.

Snapping: Nienhuys & van der Stappen, *A surgery simulation supporting cuts and finite element
deformation*, MICCAI 2001. Faces of the mesh that follow the cut are chosen, their nodes are moved
onto it, and the mesh is opened along them. Nodes move to their feet on the cut, inside the body or
along its boundary. No cell shrinks below a given share of its volume, so none turns inside out;
nodes leave neither the boundary of the body nor a cut onto which they were moved before. `NodalCut`
then goes exactly through the chosen nodes.

Subdivision, slivers included: `verify.xfem.clip` has the template that splits a simplex by a plane,
with the same diagonals on both sides of every quadrilateral face. It goes by ascending node number.
Nodes are numbered by their coordinates first, so that their numbers as given do not matter.
Bielser, Glardon, Teschner & Gross, *A state machine for real-time cutting of tetrahedral meshes*,
Graphical Models 66 (2004). With snapping of near nodes before it: Nienhuys & van der Stappen 2001;
Steinemann, Harders, Gross & Szekely, *Hybrid cutting of deformable solids*, IEEE VR 2006; and in
the plane SOFA's incision of triangles.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from verify.methods.cut_body import (
    Change,
    CutBody,
    OpenedMesh,
    conforming_to,
    facets_without_twin,
    make_body,
    whole_cells,
)
from verify.methods.tip_nodes import add_tip_points
from verify.xfem.arrays import Bools, Floats, Ints, XfemError
from verify.xfem.crossing import TipRule
from verify.xfem.cuts import Cut
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import cut_mesh
from verify.xfem.subdivision import subdivide

_REACH = 0.5  # element sizes: as in `verify.xfem.pieces`; farther off is another place
_AT_END = 1e-9  # element sizes


@dataclass(frozen=True)
class NodalCut:
    """A cut whose level set at the nodes of one mesh is given: zero at the nodes it goes through.

    Attributes
    ----------
    cut : Cut
        What it is everywhere else.
    points : (n, d) float array
        The nodes: this very array, not an equal one.
    values : (n,) float array
        In metres.
    """

    cut: Cut
    points: Floats
    values: Floats

    def level_set(self, points: Floats) -> Floats:
        """Return the nodal values at the nodes, the level set of the cut elsewhere.

        At single nodes through which the cut goes it is zero too, however far off they are.
        """
        if points is self.points:
            return self.values
        values = np.asarray(self.cut.level_set(points))
        on_cut = self.points[self.values == 0.0]
        if len(on_cut) and len(points):
            values = np.where(np.isin(_rows(points), _rows(on_cut)), 0.0, values)
        return values

    def depth(self, points: Floats) -> Floats:
        """Compute the depth of the cut itself."""
        return self.cut.depth(points)

    def through(self, nodes: NDArray) -> "NodalCut":
        """Return the cut that goes through these nodes (numbers or mask) as well."""
        values = self.values.copy()
        values[nodes] = 0.0
        return replace(self, values=values)

    @staticmethod
    def on(mesh: SimplexMesh, cuts: Iterable[Cut]) -> list["NodalCut"]:
        """Return cuts with their own values at the nodes of a mesh."""
        return [NodalCut(cut, mesh.points, np.asarray(cut.level_set(mesh.points))) for cut in cuts]


def _rows(points: Floats) -> NDArray:
    """Return each row as one item to compare, bit by bit."""
    rows = np.ascontiguousarray(points + 0.0)  # no negative zeros
    return rows.view(np.dtype((np.void, rows.itemsize * rows.shape[1]))).ravel()


@dataclass(frozen=True)
class CrossedEdges:
    """Edges that a cut crosses between its ends.

    Attributes
    ----------
    plus, minus : (k,) int array
        End nodes on the two sides.
    share : (k,) float array
        Where the cut crosses: 0 at the plus end, 1 at the minus end.
    """

    plus: Ints
    minus: Ints
    share: Floats

    def nearest_ends(self, threshold: float) -> Ints:
        """Find nodes nearer to a crossing than `threshold` of its edge; half: one for each edge."""
        near_plus = self.share <= threshold
        near_minus = (1.0 - self.share <= threshold) & ~near_plus
        return np.unique(np.concatenate([self.plus[near_plus], self.minus[near_minus]]))


def crossed_edges(mesh: SimplexMesh, cut: NodalCut) -> CrossedEdges:
    """Find edges with ends strictly on both sides that the cut crosses."""
    first, second = np.triu_indices(mesh.dim + 1, 1)
    sign = np.sign(cut.values)
    a, b = mesh.cells[:, first].ravel(), mesh.cells[:, second].ravel()
    mixed = sign[a] * sign[b] < 0
    a, b = a[mixed], b[mixed]
    ends = np.unique(np.stack([np.where(sign[a] > 0, a, b), np.where(sign[a] > 0, b, a)]), axis=1)
    plus, minus = ends
    above, below = cut.values[plus], -cut.values[minus]
    share = above / (above + below)
    at = mesh.points[plus] + share[:, None] * (mesh.points[minus] - mesh.points[plus])
    size = np.linalg.norm(mesh.points[plus] - mesh.points[minus], axis=1)
    inside = np.abs(cut.level_set(at)) <= _REACH * size
    inside &= cut.depth(at) >= -_AT_END * size
    return CrossedEdges(plus[inside], minus[inside], share[inside])


_STEPS = 5  # Newton steps; one is exact for a plane
_DIFFERENCE = 1e-5  # element sizes, of the difference quotient
_FLAT = 0.03  # sin² of 10°: boundary facets that differ less are one smooth surface
_GRAZING = 0.04  # squared sine of the angle between cut and boundary below which nothing slides


def free_directions(mesh: SimplexMesh, nodes: Ints) -> Floats:
    """(k, d, d) projectors onto the directions in which nodes may move without leaving the body.

    Everything inside; the tangents of a flat or smooth boundary; along a sharp edge; nothing in a
    corner.
    """
    space = mesh.space
    gram = np.zeros((len(mesh.points), space, space))
    cells, opposite = mesh.boundary_facets.T
    normals = mesh.gradients[cells, opposite]
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    on_facet = np.arange(mesh.dim + 1) != opposite[:, None]
    corners = mesh.cells[cells][on_facet].reshape(len(cells), mesh.dim)
    outer = normals[:, :, None] * normals[:, None, :]
    for k in range(mesh.dim):
        np.add.at(gram, corners[:, k], outer)
    gram = gram[nodes]
    total = np.trace(gram, axis1=1, axis2=2)
    values, vectors = np.linalg.eigh(gram)
    free = values <= _FLAT * np.maximum(total, 1.0)[:, None]
    return np.einsum("kim,km,kjm->kij", vectors, free.astype(float), vectors)


def feet_on_cut(
    cut: Cut, points: Floats, size: Floats, directions: Floats
) -> tuple[Floats, NDArray[np.bool_]]:
    """Find nearest points of a cut, in the directions allowed, and whether there is one.

    Parameters
    ----------
    cut : Cut
    points : (k, d) float array
    size : (k,) float array
        Element size at each; a foot farther than half of it is none.
    directions : (k, d, d) float array
        As from `free_directions`.
    """
    at = points.copy()
    found = np.ones(len(points), dtype=bool)
    for _ in range(_STEPS):
        value = cut.level_set(at)
        slope = np.einsum("kij,kj->ki", directions, _gradient(cut, at, _DIFFERENCE * size))
        squared = (slope**2).sum(axis=1)
        found &= squared > _GRAZING
        step = np.where(found, value / np.maximum(squared, _GRAZING), 0.0)
        at = at - step[:, None] * slope
    found &= np.linalg.norm(at - points, axis=1) <= 0.5 * size
    found &= np.abs(cut.level_set(at)) <= 1e-9 * size
    return np.where(found[:, None], at, points), found


def _gradient(cut: Cut, points: Floats, step: Floats) -> Floats:
    """Compute central differences (k, d) of the level set: of length one, or nearly."""
    columns = []
    for axis in range(points.shape[1]):
        ahead, behind = points.copy(), points.copy()
        ahead[:, axis] += step
        behind[:, axis] -= step
        columns.append((cut.level_set(ahead) - cut.level_set(behind)) / (2.0 * step))
    return np.stack(columns, axis=1)


_HALVINGS = 4


@dataclass(frozen=True)
class SnappedMesh:
    """A mesh of which some nodes were moved, and the cuts that go through them.

    Attributes
    ----------
    mesh : SimplexMesh
    cuts : list of NodalCut
    changes : list of Change
    """

    mesh: SimplexMesh
    cuts: list[NodalCut]
    changes: list[Change]


def snap_nodes(
    mesh: SimplexMesh,
    cuts: Sequence[Cut],
    threshold: float = 0.5,
    quality: float = 0.2,
    move: Literal["partly", "wholly"] = "partly",
) -> SnappedMesh:
    """Move nodes onto the cuts.

    Parameters
    ----------
    mesh : SimplexMesh
        A solid: triangles in the plane or tetrahedra.
    cuts : sequence of Cut
        One after the other.
    threshold : float
        Share of a crossed edge, in (0, ½]: a node nearer to the crossing than that is snapped. At
        one half no crossed edge is left.
    quality : float
        No cell is left with less than this share of its volume, in (0, 1).
    move : {"partly", "wholly"}
        What becomes of a node that cannot go all the way: it goes a part of it, and the cut goes
        through where it then is; or it stays, and is not snapped.

    Raises
    ------
    XfemError
        If the mesh is a membrane, or a parameter is outside its bounds.
    """
    if mesh.is_membrane:
        raise XfemError("snapping of a membrane in space; expected triangles in the plane or tets")
    if not 0.0 < threshold <= 0.5:
        raise XfemError(f"snapping threshold {threshold:g}; expected a share of an edge in (0, ½]")
    if not 0.0 < quality < 1.0:
        raise XfemError(f"snapping quality {quality:g}; expected a share of the volume in (0, 1)")
    if move not in ("partly", "wholly"):
        raise XfemError(f"snapping '{move}'; expected partly or wholly")
    size = _node_sizes(mesh)
    points = mesh.points.copy()
    chosen: list[Bools] = []
    pinned = np.zeros(len(points), dtype=bool)
    for cut in cuts:
        now = SimplexMesh(points, mesh.cells)
        wanted = np.zeros(len(points), dtype=bool)
        wanted[crossed_edges(now, NodalCut.on(now, [cut])[0]).nearest_ends(threshold)] = True
        at = np.flatnonzero(wanted & ~pinned)
        goal = points.copy()
        goal[at], _ = feet_on_cut(cut, points[at], size[at], free_directions(now, at))
        share = _bearable_shares(mesh, points, goal, quality, move == "wholly")
        if move == "wholly":
            wanted &= (share == 1.0) & (np.abs(cut.level_set(goal)) <= 1e-9 * size)
            goal = np.where(wanted[:, None], goal, points)
            share = _bearable_shares(mesh, points, goal, quality, True)
            wanted &= share == 1.0
        points = points + share[:, None] * (goal - points)
        pinned |= wanted
        chosen.append(wanted)
    moved = SimplexMesh(points, mesh.cells)
    nodal = [
        cut.through(nodes) for cut, nodes in zip(NodalCut.on(moved, cuts), chosen, strict=True)
    ]
    return SnappedMesh(moved, nodal, _moves(mesh, moved))


def take_near_nodes(snapped: SnappedMesh, threshold: float) -> SnappedMesh:
    """Let the cuts go through all nodes nearer than a share of a crossed edge, without a move."""
    mesh = snapped.mesh
    cuts, changes, size = [], list(snapped.changes), _node_sizes(mesh)
    for cut in snapped.cuts:
        cut = cut.through(crossed_edges(mesh, cut).nearest_ends(threshold))
        off = np.abs(cut.cut.level_set(mesh.points))
        taken = (cut.values == 0.0) & (off > 1e-12 * size)
        largest = float(off[taken].max(initial=0.0))
        changes.append(Change("node off the cut taken as on it", int(taken.sum()), largest, "m"))
        cuts.append(cut)
    return SnappedMesh(mesh, cuts, changes)


def _bearable_shares(
    mesh: SimplexMesh, points: Floats, goal: Floats, quality: float, all_or_none: bool
) -> Floats:
    """Return (n,) share of the way that each node can go, so that all cells keep their quality."""
    before = _signed(mesh, mesh.points)
    share = np.ones(len(points))
    floor = 1.0 if all_or_none else 0.5**_HALVINGS
    while True:
        at = points + share[:, None] * (goal - points)
        # a cell that an earlier cut has left at the limit may stay where it is
        limit = np.minimum(quality, (1.0 - 1e-12) * _signed(mesh, points) / before)
        bad = _signed(mesh, at) / before < limit
        if not bad.any():
            return share
        nodes = np.unique(mesh.cells[bad])
        share[nodes] = np.where(share[nodes] <= floor, 0.0, 0.5 * share[nodes])


def _signed(mesh: SimplexMesh, points: Floats) -> Floats:
    corners = points[mesh.cells]
    return np.linalg.det(corners[:, 1:] - corners[:, :1])


def _node_sizes(mesh: SimplexMesh) -> Floats:
    """Return the (n,) longest edge at each node, in metres."""
    first, second = np.triu_indices(mesh.dim + 1, 1)
    ends = mesh.cells[:, first], mesh.cells[:, second]
    length = np.linalg.norm(mesh.points[ends[0]] - mesh.points[ends[1]], axis=2)
    size = np.zeros(len(mesh.points))
    for nodes in ends:
        np.maximum.at(size, nodes, length)
    return size


def _moves(before: SimplexMesh, after: SimplexMesh) -> list[Change]:
    distance = np.linalg.norm(after.points - before.points, axis=1)
    volume = before.measures.sum()
    changed = abs(after.measures.sum() - volume) / volume
    return [
        Change("node moved onto the cut", int((distance > 0).sum()), float(distance.max()), "m"),
        Change(
            "volume of the body changed by moved nodes", int(changed > 1e-12), changed, "fraction"
        ),
    ]


def snapping(mesh: SimplexMesh, cuts: Sequence[Cut], quality: float = 0.2) -> CutBody:
    """Snap the nearer end of every crossed edge onto the cut, and open the mesh there.

    Parameters
    ----------
    mesh : SimplexMesh
    cuts : sequence of Cut
        An end inside an element goes back to the edges that are crossed before it.
    quality : float
        A node moves until a cell around it would keep less than this share of its volume. Where it
        cannot reach the cut, the cut goes through the node: reported as "taken as on it", with the
        distance.
    """
    start = perf_counter()
    snapped = take_near_nodes(snap_nodes(mesh, cuts, 0.5, quality), 0.5)
    moved = perf_counter()
    phantom = cut_mesh(snapped.mesh, snapped.cuts)
    assert len(phantom.cells) == len(mesh.cells)  # every crossed edge has an end on the cut
    phantom = whole_cells(phantom)
    seconds = {"snapping": moved - start, "cutting": perf_counter() - moved}
    return make_body(mesh, phantom, tuple(snapped.changes), seconds=seconds)


# Share of an edge below which a crossing is taken as at its end. A tetrahedron with two corners
# as near to the cut as that still has 1e-12 of its cell, above what counts as degenerate.
_NEAR = 1e-6


def subdivision(mesh: SimplexMesh, cuts: Sequence[Cut], tip: TipRule = "inside") -> CutBody:
    """Split all cut cells into simplices that conform to the cut; nodes doubled along it.

    Parameters
    ----------
    mesh : SimplexMesh
        A solid or a membrane.
    cuts : sequence of Cut
    tip : {"inside", "extended", "through", "nearest"}
        Treatment of cells in which a cut ends. An end of an open polyline in the plane needs
        none: it becomes a node, and the split ends there.

    Raises
    ------
    XfemError
        If a part is too flat for a finite element: two cuts nearer to each other than round-off
        bears.
    """
    start = perf_counter()
    tipped, origin = add_tip_points(mesh, cuts)
    uncut = SnappedMesh(tipped, NodalCut.on(tipped, cuts), _added(mesh, tipped))
    snapped = take_near_nodes(uncut, _NEAR)
    return _split(mesh, snapped, tip, origin, {"snapping": perf_counter() - start})


def snapping_subdivision(
    mesh: SimplexMesh,
    cuts: Sequence[Cut],
    tip: TipRule = "inside",
    threshold: float = 0.2,
    quality: float = 0.2,
) -> CutBody:
    """Snap nodes that are near the cut onto it, then split what the cut still goes through.

    Parameters
    ----------
    mesh : SimplexMesh
        Triangles in the plane or tetrahedra.
    cuts : sequence of Cut
    tip : {"inside", "extended", "through", "nearest"}
        As in `subdivision`.
    threshold : float
        Share of a crossed edge, in (0, ½]: nodes nearer to the crossing are snapped.
    quality : float
        A node is snapped only if every cell keeps this share of its volume.
    """
    start = perf_counter()
    tipped, origin = add_tip_points(mesh, cuts)
    snapped = take_near_nodes(snap_nodes(tipped, cuts, threshold, quality, "wholly"), _NEAR)
    snapped.changes.extend(_added(mesh, tipped))
    return _split(mesh, snapped, tip, origin, {"snapping": perf_counter() - start})


def _added(mesh: SimplexMesh, tipped: SimplexMesh) -> list[Change]:
    count = len(tipped.points) - len(mesh.points)
    return [Change("end of a cut made a node", count, 0.0, "m")]


def _split(
    mesh: SimplexMesh, snapped: SnappedMesh, tip: TipRule, origin: np.ndarray, seconds: dict
) -> CutBody:
    start = perf_counter()
    placed, cuts = _by_place(snapped)
    parts = subdivide(cut_mesh(placed, cuts, tip))
    try:
        outer = facets_without_twin(parts.points, parts.cells)
    except XfemError as error:
        raise XfemError(f"subdivision along these cuts leaves no valid mesh: {error}") from None
    opened = OpenedMesh(parts.points, parts.cells, outer)
    phantom = cut_mesh(opened, [])
    seconds["cutting"] = perf_counter() - start
    parents = origin[parts.cell_parent]
    return make_body(
        mesh,
        phantom,
        tuple(snapped.changes),
        conforming=conforming_to(opened, parents, parts.cut_facets),
        cell_origin=parents,
        seconds=seconds,
    )


def _by_place(snapped: SnappedMesh) -> tuple[SimplexMesh, list[NodalCut]]:
    """Find nodes numbered by their coordinates: the template's diagonals follow node numbers."""
    order = np.lexsort(snapped.mesh.points.T)
    number = np.empty_like(order)
    number[order] = np.arange(len(order))
    mesh = SimplexMesh(snapped.mesh.points[order], number[snapped.mesh.cells])
    return mesh, [NodalCut(cut.cut, mesh.points, cut.values[order]) for cut in snapped.cuts]
