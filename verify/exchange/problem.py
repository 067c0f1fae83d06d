"""A scene on one mesh level as arrays: mesh, boundary, held nodes, loads.

Two meshes are offered. The *background* mesh ignores the cuts; it is the one that unfitted
methods cut through. The *conforming* mesh is the background mesh with the cuts imprinted and
opened (nodes doubled); any plain finite element program can solve on it.
"""

from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference.exact import ExactSolution, exact_of
from verify.compare.hooke import hooke
from verify.errors import UnsupportedSceneError
from verify.geometry.simplices import connected, measures, nearest_cut
from verify.scene import (
    Box,
    CutFaces,
    Gravity,
    Material,
    Polygon,
    PolylineCut,
    Rectangle,
    Scene,
    Support,
    ToolPathCut,
    Traction,
)
from verify.scene.parts import HeldFacets, Pieces, pieces_on_part
from verify.scene.physics import PrescribedMotion
from verify.solvers.body_of_scene import background_mesh
from verify.solvers.boundary_conditions import Boundary, ForceDensity, is_moving
from verify.xfem.loads_and_supports import simplex_rule

Array = NDArray[np.float64]


@dataclass(frozen=True)
class HeldNodes:
    """Prescribed displacements; where two supports hold the same node, the later one wins.

    Attributes
    ----------
    nodes : (k,) int array
    components : tuple of int
        Indices of the components held.
    values : (k, len(components)) array
        m.
    across : list of (node, side point (d,), values)
        Background mesh only: for a node of a boundary facet that a cut crosses, the value of the
        prescribed field on the other side of the cut, continued to the node.
    ended : list of (nodes of a facet, corners (r, d, d) of simplices, m)
        Facets in which the part ends, and what of each lies on it: where a cut crosses one, a side
        is held if that lies on it.
    support : Support, optional
        What the scene says: its ``values(points, factor)`` are those of a factor in time.
    """

    nodes: NDArray[np.int64]
    components: tuple[int, ...]
    values: Array
    across: list[tuple[int, Array, Array]] = field(default_factory=list)
    ended: list[tuple[NDArray[np.int64], Array]] = field(default_factory=list)
    support: Support | None = None


@dataclass(frozen=True)
class Load:
    """A dead load on facets (Pa) or cells (N/m³).

    Attributes
    ----------
    simplices : (k, d) or (k, d + 1) int array
        Nodes of the facets or cells that are loaded; a facet in which the load ends is there once
        for each of the simplices that are loaded of it.
    uniform : (d,) array or None
        Its value, if it is the same everywhere.
    points, weights, values : (k, q, d), (k, q), (k, q, d) arrays
        Its values at quadrature points; the weights contain the measure.
    barycentric : (k, q, corners) array
        The quadrature points in each facet or cell.
    corners : (k, corners, d) array, optional
        Of what is loaded, m; None if that is all of each facet or cell.
    history : list of (time, factor), optional
        By what the load is multiplied in time; see `verify.scene.physics`.
    """

    simplices: NDArray[np.int64]
    uniform: Array | None
    points: Array
    weights: Array
    values: Array
    barycentric: Array
    history: list[tuple[float, float]] | None = None
    corners: Array | None = None


@dataclass(frozen=True)
class Problem:
    """A scene on one mesh level.

    Attributes
    ----------
    scene : Scene
    level : int
    size : float
        Element size h of the level, m.
    points : (n, d) array
        m; doubled on the cuts if `conforming`.
    cells : (m, d + 1) int array
    boundary : (b, d) int array
        Nodes of the facets on the outer boundary; the faces of a cut are not among them.
    conforming : bool
    cut_facets : (f, d, d) array
        Corners of the facets along the cuts, if `conforming`.
    held : list of HeldNodes
    loads : list of Load
    """

    scene: Scene
    level: int
    size: float
    points: Array
    cells: NDArray[np.int64]
    boundary: NDArray[np.int64]
    conforming: bool
    cut_facets: Array
    held: list[HeldNodes]
    loads: list[Load]

    def cut_opens(self) -> Array:
        """Time (f,) in s from which on each of `cut_facets` is open.

        When its cut opens; on a tool path, when the blade has passed all of the facet.
        """
        cuts = self.scene.cuts
        nearest = nearest_cut(self.cut_facets, [cut.pieces() for cut in self.scene.final_cuts])
        times = np.zeros(len(self.cut_facets))
        for i, cut in enumerate(cuts):
            mine = self.cut_facets[nearest == i]
            if isinstance(cut, ToolPathCut):
                passed = cut.passed_at(mine.reshape(-1, mine.shape[2]))
                times[nearest == i] = passed.reshape(mine.shape[:2]).max(axis=1)
            else:
                times[nearest == i] = cut.opens_at
        return times

    def prescribed(self) -> tuple[NDArray[np.bool_], Array]:
        """Which components (n, d) of which nodes are held, and their values (n, d), m."""
        mark, value = np.zeros(self.points.shape, dtype=bool), np.zeros(self.points.shape)
        for support in self.held:
            at = np.ix_(support.nodes, support.components)
            mark[at], value[at] = True, support.values
        return mark, value

    def nodal_forces(self) -> Array:
        """Consistent forces (n, d) of all loads on linear elements, N (per metre in 2D)."""
        force = np.zeros(self.points.shape)
        for load in self.loads:
            shares = np.einsum("kq,kqi,kqc->kic", load.weights, load.barycentric, load.values)
            np.add.at(force, load.simplices, shares)
        return force

    def free_pieces(self) -> Array:
        """Centroids (k, d) of the pieces of the body that are held in too few components.

        A piece has 3 rigid motions in the plane and 6 in space; one that is held in fewer
        components has no static answer, and direct solvers do not always notice. On a background
        mesh the body is one piece, whatever the cuts.
        """
        starts = np.repeat(self.cells[:, 0], self.cells.shape[1])
        node_piece = connected(len(self.points), starts, self.cells.ravel())
        held = np.bincount(node_piece, self.prescribed()[0].sum(axis=1))
        loose = np.flatnonzero(held < (3 if self.points.shape[1] == 2 else 6))
        cell_piece, middle = node_piece[self.cells[:, 0]], self.points[self.cells].mean(axis=1)
        return np.array([middle[cell_piece == k].mean(axis=0) for k in loose]).reshape(
            -1, self.points.shape[1]
        )

    def material_number(self) -> NDArray[np.int64]:
        """Return the number (m,) of each cell's material: 0, or 1 + that of a region."""
        return self.scene.material.number_at(self.points[self.cells].mean(axis=1))

    def lame(self) -> tuple[Any, Any]:
        """Lamé constants λ, μ in Pa; in plane stress the λ of the plane problem.

        Two numbers; where materials differ by region (m, 1) arrays, one row for each cell, which
        multiply what an element has at its quadrature points.
        """
        material = self.scene.material
        pairs = np.array([_lame(one) for one in material.each])
        if material.is_uniform:
            return float(pairs[0, 0]), float(pairs[0, 1])
        lam, mu = pairs[self.material_number()].T
        return lam[:, None], mu[:, None]

    def density(self) -> Any:
        """Density in kg/m³, NaN if there is none: a number, or (m, 1) like `lame`."""
        material = self.scene.material
        each = np.array([np.nan if one.density is None else one.density for one in material.each])
        return float(each[0]) if material.is_uniform else each[self.material_number()][:, None]


def _lame(material: Material) -> tuple[float, float]:
    law = hooke(material)
    return float(law.lame), float(law.shear)


_WHOLE = 1e-12  # of a facet: what may be left of one that is loaded as a whole
_DEGREE = 7  # of the rule for loads that vary: an exact field's traction is smooth on a facet


def problem_of(
    scene: Scene, level: int, conforming: bool = False, models: Collection[str] = ("hooke",)
) -> Problem:
    """Lay out `scene` on mesh `level`.

    Parameters
    ----------
    scene : Scene
    level : int
        0 is the coarsest.
    conforming : bool
        Whether the mesh shall conform to the cuts; not offered for meshes given in space.
    models : collection of str
        ``material.model`` that the solver knows.

    Raises
    ------
    UnsupportedSceneError
        If the material is of another model, a conforming mesh of the scene is not offered, a
        support or load is another field at every time, or a load acts on the faces of a cut.
    InputError
        If a support or load acts nowhere, or a mesh file is bad.
    """
    if (model := scene.material.model) not in models:
        raise UnsupportedSceneError(f"material.model '{model}'; expected {', '.join(models)}")
    exact = exact_of(scene)
    if any(isinstance(load, CutFaces) for load in scene.loads):
        raise UnsupportedSceneError("loads on the faces of a cut are not exported")
    if reason := _at_every_time(scene, exact):
        raise UnsupportedSceneError(reason)
    background, size = background_mesh(scene, level)
    boundary = Boundary(background.points, background.cells, background.boundary_facets)
    cut_facets = np.zeros((0, scene.cell_dimension, scene.dimension))
    if conforming and scene.cuts:
        boundary, cut_facets = _opened(scene, level, boundary)
    held = [_held(scene, boundary, i, conforming, exact) for i in range(len(scene.supports))]
    loads = [_load(scene, boundary, i, conforming, exact) for i in range(len(scene.loads))]
    mesh = boundary.points, boundary.cells, boundary.corners
    return Problem(scene, level, size, *mesh, conforming, cut_facets, held, loads)


def _opened(scene: Scene, level: int, background: Boundary) -> tuple[Boundary, Array]:
    """Imprint polylines on the mesh as it is; else mesh the cut body anew, about as fine."""
    from reference.meshing import imprint, open_cut

    polylines = [cut.vertices() for cut in scene.cuts if isinstance(cut, PolylineCut)]
    if scene.dimension == 2 and len(polylines) == len(scene.cuts):
        mesh = open_cut(*imprint(background.points, background.cells, polylines))
    elif isinstance(scene.geometry, Rectangle | Polygon | Box):
        from verify.solvers.conforming_meshes import peer_mesh

        mesh = peer_mesh(scene, level, "imprinted")
    else:
        raise UnsupportedSceneError(
            "a conforming mesh of a mesh file is offered for plane scenes with polyline cuts only"
        )
    return Boundary(mesh.points, mesh.cells, mesh.boundary), mesh.realised_cut


def _at_every_time(scene: Scene, exact: ExactSolution | None) -> str | None:
    """Say what no list of values and factors holds, if there is such a thing."""
    moves = exact is not None and exact.moves
    timed = {
        f"supports[{i}]": support.timed or (moves and support.displacement == "exact")
        for i, support in enumerate(scene.supports)
    }
    timed |= {f"loads[{i}]": is_moving(load, exact) for i, load in enumerate(scene.loads)}
    for name, every in timed.items():
        if every:
            return f"{name} is another field at every time, which is not laid out as arrays"
    return None


def _held(scene: Scene, boundary: Boundary, i: int, conforming: bool, exact: Any) -> HeldNodes:
    """Find the nodes that a support holds, each on its own side of the cuts."""
    support, points = scene.supports[i], boundary.points
    nodes, by = boundary.held(scene, support.where, f"supports[{i}].where")
    ended = [] if conforming else _ended(boundary, by, scene, support.where)
    field = exact if support.displacement == "exact" else None
    near = None
    if conforming:  # a node on the cut belongs to the side of its own cells
        owner = np.zeros(len(points), dtype=np.int64)
        owner[boundary.cells.ravel()] = np.repeat(
            np.arange(len(boundary.cells)), boundary.cells.shape[1]
        )
        near = _centroids(boundary, owner[nodes])
    motion = PrescribedMotion(support, points[nodes], near, field)
    components, values = support.held(scene.dimension), motion.values(1.0)
    across = []
    if field is not None and not conforming:
        across = _across(boundary, nodes, support, values, field)
    return HeldNodes(nodes, components, values, across, ended, support)


def _ended(
    boundary: Boundary, by: HeldFacets, scene: Scene, where: str
) -> list[tuple[NDArray[np.int64], Array]]:
    """Facets in which a part ends, and the simplices of each that lie on it."""
    if not len(by.ended):
        return []
    pieces = pieces_on_part(scene.geometry, where, boundary.places)
    places = pieces.places(boundary.places)
    return [(boundary.corners[facet], places[pieces.facet == facet]) for facet in by.ended]


def _across(
    boundary: Boundary, nodes: NDArray[np.int64], support: Support, values: Array, exact: Any
) -> list[tuple[int, Array, Array]]:
    """Values continued from the other side, for nodes of boundary facets that a cut crosses."""
    points, corners = boundary.points, boundary.corners
    row = np.full(len(points), -1, dtype=np.int64)
    row[nodes] = np.arange(len(nodes))
    d = corners.shape[1]
    pairs = np.vstack([corners[:, [a, b]] for a in range(d) for b in range(d) if a != b])
    pairs = np.unique(pairs[(row[pairs] >= 0).all(axis=1)], axis=0)
    node, other = pairs.T
    far = PrescribedMotion(support, points[node], points[other], exact).values(1.0)
    scale = float(np.abs(values).max(initial=0.0))
    differs = np.abs(far - values[row[node]]).max(axis=1, initial=0.0) > 1e-12 * scale
    return [(int(node[k]), points[other[k]], far[k]) for k in np.flatnonzero(differs)]


def _load(scene: Scene, boundary: Boundary, i: int, conforming: bool, exact: Any) -> Load:
    load = scene.loads[i]
    assert not isinstance(load, CutFaces)  # refused
    normals = None
    if isinstance(load, Traction):
        pieces = boundary.loaded(scene, load.where, f"loads[{i}].where")
        simplices, cells = boundary.corners[pieces.facet], boundary.facets[pieces.facet, 0]
        normals = boundary.outward_normals(pieces.facet)
    else:
        simplices, cells = boundary.cells, np.arange(len(boundary.cells))
        pieces = Pieces.whole(cells, simplices.shape[1])
    rule, weights = simplex_rule(simplices.shape[1] - 1, _DEGREE)
    barycentric = rule[:, ::-1] @ pieces.barycentric  # collapsed onto the first corner
    corners = boundary.points[simplices]
    points = barycentric @ corners
    # a membrane's forces per volume and area count times its thickness
    measured = (measures(corners) * pieces.share)[:, None] * weights
    measured = measured * (scene.material.thickness or 1.0)
    density = ForceDensity(scene, load, exact)
    if (uniform := density.uniform(_centroids(boundary, cells))) is None:
        each = len(weights)
        # a point of a conforming mesh belongs to the side of its own cell; else to its own
        near = np.repeat(_centroids(boundary, cells), each, axis=0) if conforming else None
        normals = None if normals is None else np.repeat(normals, each, axis=0)
        values = density.at(points.reshape(-1, points.shape[2]), near, normals)
        values = values.reshape(points.shape)
    else:  # one, or one for each cell
        values = np.broadcast_to(uniform[..., None, :], points.shape)
        uniform = uniform if uniform.ndim == 1 else None
    history = None if isinstance(load, Gravity) else load.history
    ends = bool((pieces.share < 1.0 - _WHOLE).any())
    loaded = pieces.barycentric @ corners if ends else None
    return Load(simplices, uniform, points, measured, values, barycentric, history, loaded)


def _centroids(boundary: Boundary, cells: NDArray[np.int64]) -> Array:
    return np.asarray(boundary.points[boundary.cells[cells]].mean(axis=1))
