"""Body of a scene for the compact library: mesh, elasticity, density, and cuts as level sets.

Of cuts in motion, when they open what of a mesh.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import combinations, product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError, UnsupportedSceneError
from verify.geometry.simplices import measures
from verify.geometry.swept_shares import CutSimplices, SweptShares
from verify.methods.tip_nodes import with_tip_nodes
from verify.scene import (
    ArcCut,
    Box,
    CylinderCut,
    DiscCut,
    MeshFile,
    Polygon,
    PolygonCut,
    Rectangle,
    Scene,
    SphereCut,
    SweptCut,
    ToolPathCut,
    read_mesh,
)
from verify.scene.mesh_position import moved_mesh
from verify.solution import Regularisation
from verify.solvers.runs import grid_of, timeline_of
from verify.xfem.arrays import XfemError
from verify.xfem.crossing import TipRule
from verify.xfem.cuts import Cut, ImplicitCut, PolygonPatch, Polyline, ToolPath, TriangulatedSurface
from verify.xfem.element import Material, State, isotropic
from verify.xfem.mesh import SimplexMesh, box_mesh, rectangle_mesh
from verify.xfem.phantom import PhantomMesh

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]
_ARC_SEGMENTS_PER_CELL = 8


def background_mesh(scene: Scene, level: int) -> tuple[SimplexMesh, float]:
    """Make the uncut mesh of a level.

    Returns
    -------
    mesh : SimplexMesh
    size : float
        Its element size h: the longer side of a structured mesh's rectangles, the size asked for
        of an unstructured one, the mean edge of a given one over 2^level, m.

    Raises
    ------
    InputError
        If there is no such level, a mesh file is bad, or gmsh is needed and not installed.
    """
    if not 0 <= level < scene.mesh.count:
        raise InputError(f"mesh level {level}; expected 0..{scene.mesh.count - 1}")
    geometry = scene.geometry
    if isinstance(geometry, MeshFile):
        mesh = SimplexMesh(*read_mesh(scene))
        size = float(np.linalg.norm(mesh.edge_vectors, axis=2).mean()) / 2**level
        return SimplexMesh(*read_mesh(scene, level)) if level else mesh, size
    counts, size = grid_of(scene, level)
    if counts is not None:
        assert isinstance(geometry, Rectangle | Box)
        make = rectangle_mesh if isinstance(geometry, Rectangle) else box_mesh
        mesh = make(counts, geometry.lower, geometry.upper)
        if number := scene.mesh.position:
            mesh = SimplexMesh(*moved_mesh(mesh.points, mesh.cells, counts, number))
        return mesh, size
    try:
        from reference.meshing import background_mesh as unstructured
    except ImportError as error:
        raise InputError(
            f"mesh.pattern: 'unstructured' needs '{error.name}', which is not installed",
            str(scene.file or ""),
        ) from None
    assert isinstance(geometry, Rectangle | Polygon)
    points, cells = unstructured(geometry.outline(), size)
    return SimplexMesh(points, cells), size


def material_of(scene: Scene, mesh: SimplexMesh) -> Material:
    """Return the elasticity of the scene; of a membrane times its thickness, in N/m.

    Where materials differ by region, a cell of the mesh is of that at its centroid.
    """
    states: dict[str | None, State] = {"strain": "plane strain", "stress": "plane stress"}
    state = states.get(scene.material.plane, "solid")
    young, poisson, _ = moduli_of(scene, mesh.points[mesh.cells].mean(axis=1))
    if (thickness := scene.material.thickness) is None:
        return replace(isotropic(young, poisson, state), law=scene.material.model)
    sheet = isotropic(young, poisson, "plane stress")
    return Material(thickness * sheet.lam, thickness * sheet.mu)


def density_of(scene: Scene, mesh: SimplexMesh) -> float | NDArray[np.float64]:
    """Return the density in kg/m³; of a membrane times its thickness, in kg/m².

    One number, or one for each cell (m,) where materials differ by region.
    """
    density = moduli_of(scene, mesh.points[mesh.cells].mean(axis=1))[2]
    return density * (scene.material.thickness or 1.0)


def moduli_of(scene: Scene, points: NDArray[np.float64]) -> Any:
    """Compute Young's modulus, Poisson's ratio and density: numbers, or arrays (n,) at points."""
    material = scene.material
    if material.is_uniform:
        return material.young, material.poisson, material.density
    return material.at(points)


@contextmanager
def errors_of_scene(scene: Scene) -> Iterator[None]:
    """Turn errors of the library into `InputError` of a scene."""
    try:
        yield
    except XfemError as error:
        raise InputError(str(error), str(scene.file or scene.name)) from None


def cuts_of(scene: Scene, size: float) -> list[Cut]:
    """Return the cuts as the solver's own; an arc that ends is sampled finely against `size`."""
    return [_cut(cut, size) for cut in scene.cuts]


class ToCut(NamedTuple):
    """What the library is to cut, by what, by which rule, and what was done for that."""

    mesh: SimplexMesh
    cuts: list[Cut]
    rule: TipRule
    done: list[Regularisation]


def to_cut(mesh: SimplexMesh, cuts: list[Cut], tip: Any) -> ToCut:
    """Prepare a mesh for the tip rule `tip`.

    Raises
    ------
    UnsupportedSceneError
        If the rule is "partial" and the body a solid.
    """
    if tip != "partial":
        return ToCut(mesh, cuts, tip, [])
    if mesh.dim == 3:
        raise UnsupportedSceneError(
            "tip = 'partial' in a solid; it is offered for triangles, other tip rules are for both"
        )
    nodes = with_tip_nodes(mesh, cuts)
    if not len(nodes.moved):  # no cut ends inside
        return ToCut(mesh, cuts, "inside", [])
    kind, largest = "end of a cut made a node", float(nodes.moved.max(initial=0.0))
    said = Regularisation(kind, len(nodes.moved), largest, "m")
    return ToCut(nodes.mesh, list(nodes.cuts), "inside", [said])


def _cut(cut: Any, size: float) -> Cut:
    match cut:
        case PolygonCut():
            return PolygonPatch(cut.points)
        case DiscCut() | CylinderCut() | SphereCut():
            (surface,) = cut.pieces()
            return ImplicitCut(surface.level, None if surface.closed else surface.depth)
        case SweptCut():  # plane facets: the triangulation is the cut
            return TriangulatedSurface(*cut.facets())
        case ToolPathCut() if cut.dimension == 3:
            return ToolPath.of_tip(cut.points, cut.moments, cut.blade).sweep
        case ArcCut(sweep=360.0):
            (circle,) = cut.pieces()
            return ImplicitCut(circle.level)
    vertices = cut.vertices(size / _ARC_SEGMENTS_PER_CELL)
    closed = bool(np.array_equal(vertices[0], vertices[-1]))
    return Polyline(vertices[:-1] if closed else vertices, closed)


@dataclass(frozen=True)
class Opened:
    """When pieces (elements, or pairs of nodes of the facets of a finished mesh) open.

    Attributes
    ----------
    times, passed : (p, ...) array
        When each opens, and when the blade has passed all of it, s; NaN: never.
    shares : SweptShares or None
        Of the nodes that are let go; None where all of them is released at once.
    close : float
        Times that differ by no more are one, s.
    cut : (p,) int array or None
        Number of the cut that each is of, where each is of one.
    """

    times: _Floats
    passed: _Floats
    shares: SweptShares | None
    close: float = 0.0
    cut: _Ints | None = None

    def until(self, time: float, passed: bool = False) -> NDArray[np.bool_]:
        """Return which pieces are open at a time, or passed by then."""
        return np.asarray((self.passed if passed else self.times) <= time)

    def fade(self, place: _Ints) -> Callable[[_Ints, float], Callable[[float], _Floats]] | None:
        """Return what makes the factors of the forces that hold released dof nodes.

        Parameters
        ----------
        place : (N,) int array
            The node of the shares that each dof node is at.
        """
        shares, close = self.shares, self.close
        if shares is None:
            return None
        return lambda nodes, time: shares.fading(place[nodes], time, close).at

    def events(self) -> _Floats:
        """Return the times at which something opens, ascending, s."""
        return np.unique(self.times[~np.isnan(self.times)])


@dataclass(frozen=True)
class Openings:
    """The cuts of a moving scene in the order in which they open.

    A body that is cut further keeps its cuts: cuts that open first come first.

    Attributes
    ----------
    asked : list
        The cuts of the scene.
    cuts : list of Cut
        The same as level sets.
    times : list of float
        When each opens as a whole, s; of a tool path not read.
    rule : str
        One of `verify.solvers.runs.OPENINGS`.
    close : float
        Times that differ by no more are one, s.
    size : float
        Of the elements, m.
    """

    asked: list[Any]
    cuts: list[Cut]
    times: list[float]
    rule: str = "late"
    close: float = 0.0
    size: float = np.nan

    def of_cells(self, phantom: PhantomMesh) -> Opened:
        """Return when each cut opens each cell that it splits: (m, cuts).

        A cell is passed with all points at which the cut crosses an edge of it: it is then crossed
        through. Cuts that are no tool paths open all their cells at once.

        Parameters
        ----------
        phantom : PhantomMesh
            The mesh with all of them.
        """
        shares = self._none_swept(len(phantom.mesh.cells), by_node=False)
        times, passed = np.full((2, len(phantom.mesh.cells), len(self.asked)), np.nan)
        for k, cut in enumerate(self.asked):
            cells = np.unique(phantom.parent[phantom.label[:, k] != 0])
            if isinstance(cut, ToolPathCut):
                passage = shares.add(sections(phantom, cells, k), cut.passed_at)
                times[:, k], passed[:, k] = passage.let_go, passage.passed
            else:
                times[cells, k] = passed[cells, k] = self.times[k]
        return self._by_rule(times, passed, shares)

    def of_seams(self, seams: _Floats, node: _Ints) -> Opened:
        """Return when seams (k, d, space) open at each of their corners: (k, d).

        A tool path has passed a seam with all its corners, another cut opens it at once. A seam is
        of the cut to which its corners and its middle are nearest: nodes may be off it.

        Parameters
        ----------
        seams : (k, d, space) array
        node : (k, d) int array
            Number of the place of each corner.
        """
        count, corners, space = seams.shape
        shares = self._none_swept(count, by_node=True)
        if not count:
            return Opened(np.empty((0, corners)), np.empty((0, corners)), None)
        middles = seams.mean(axis=1, keepdims=True)
        places = np.concatenate([seams, middles], axis=1).reshape(-1, space)
        off = np.stack(
            [np.maximum(np.abs(cut.level_set(places)), -cut.depth(places)) for cut in self.cuts]
        )
        nearest = off.reshape(len(self.cuts), count, corners + 1).max(axis=2).argmin(axis=0)
        times, passed = np.tile(np.array(self.times)[nearest][:, None], (2, 1, corners))
        for k, cut in enumerate(self.asked):
            mine = np.flatnonzero(nearest == k)
            if isinstance(cut, ToolPathCut) and len(mine):
                shape = np.broadcast_to(np.eye(corners), (len(mine), corners, corners))
                simplices = CutSimplices(seams[mine], mine, node[mine], shape)
                passage = shares.add(simplices, cut.passed_at)
                times[mine], passed[mine] = passage.begins, passage.passed[mine, None]
        return replace(self._by_rule(times, passed, shares), cut=nearest)

    def _none_swept(self, pieces: int, by_node: bool) -> SweptShares:
        divisions = {"divisions": 1} if self.rule == "late" else {}
        return SweptShares(pieces, by_node=by_node, **divisions)

    def _by_rule(self, times: _Floats, passed: _Floats, shares: SweptShares) -> Opened:
        if self.rule == "late":
            return Opened(passed, passed, None)
        return Opened(times, passed, shares if shares.used else None, self.close)


def openings_of(scene: Scene, size: float, rule: str) -> Openings:
    """Return when the cuts of a moving scene open on a mesh of a size, in m, by a rule."""
    timeline = timeline_of(scene, kinks=False)
    order, cuts = np.argsort(timeline.opens, kind="stable"), cuts_of(scene, size)
    return Openings(
        [scene.cuts[k] for k in order],
        [cuts[k] for k in order],
        timeline.opens[order].tolist(),
        rule,
        timeline.close,
        size,
    )


def sections(phantom: PhantomMesh, cells: _Ints, k: int) -> CutSimplices:
    """Compute sections of cells by zero level of a cut, with the shape functions of their nodes.

    A node on the cut counts as above it: of cells that the cut touches in a node alone, those below
    it would have a section of no measure, those above it none. None of them has one.
    """
    nodes = phantom.mesh.cells[cells]
    value = phantom.level_sets[nodes, k]
    corners = nodes.shape[1]
    above = value >= 0.0
    owner, shapes = [], []
    for signs in product((False, True), repeat=corners):
        rows = np.flatnonzero((above == signs).all(axis=1))
        plus, minus = np.flatnonzero(signs), np.flatnonzero(~np.array(signs))
        # around the section: two edges that follow each other share a face
        edges = [(a, b) for n, a in enumerate(plus) for b in (minus if n % 2 == 0 else minus[::-1])]
        points = np.zeros((len(edges), len(rows), corners))
        for (a, b), shape in zip(edges, points, strict=True):
            share = value[rows, a] / (value[rows, a] - value[rows, b])
            shape[:, a], shape[:, b] = 1.0 - share, share
        for parts in combinations(range(1, len(edges)), corners - 2):
            if len(edges) == 4 and parts[1] - parts[0] != 1:
                continue  # a quadrilateral is two triangles
            owner.append(rows)
            shapes.append(points[[0, *parts]].transpose(1, 0, 2))
    row, shape = np.concatenate(owner), np.concatenate(shapes)
    points = shape @ phantom.mesh.points[nodes[row]]
    some = measures(points) > 0.0
    row = row[some]
    return CutSimplices(points[some], cells[row], nodes[row], shape[some])
