"""A scene on one mesh level as arrays: mesh, boundary, held nodes, loads.

Two meshes are offered. The *background* mesh ignores the cuts; it is the one that unfitted
methods cut through. The *conforming* mesh is the background mesh with the cuts imprinted and
opened (nodes doubled); any plain finite element program can solve on it.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from verify.compare.hooke import hooke
from verify.compare.splitting import measures
from verify.errors import InputError, UnsupportedSceneError
from verify.exchange.quadrature import simplex_rule
from verify.scene import (
    BodyForce,
    Box,
    CutFaces,
    Gravity,
    Material,
    Polygon,
    PolylineCut,
    Rectangle,
    Scene,
    Support,
    Traction,
    is_uniform,
)
from verify.scene.parts import copies_on_part, on_part
from verify.solvers.body_of_scene import background_mesh

__all__ = ["HeldNodes", "Load", "Problem", "problem_of"]

Array = NDArray[np.float64]
_POINTS_PER_DIRECTION = 4  # degree 7: an exact field's traction is smooth on a facet


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
    support : Support, optional
        What the scene says: its ``values(points, factor)`` are those of a factor in time.
    """

    nodes: NDArray[np.int64]
    components: tuple[int, ...]
    values: Array
    across: list[tuple[int, Array, Array]] = field(default_factory=list)
    support: Support | None = None


@dataclass(frozen=True)
class Load:
    """A dead load on facets (Pa) or cells (N/m³).

    Attributes
    ----------
    simplices : (k, d) or (k, d + 1) int array
        Nodes of the facets or cells that are loaded.
    uniform : (d,) array or None
        Its value, if it is the same everywhere.
    points, weights, values : (k, q, d), (k, q), (k, q, d) arrays
        Its values at quadrature points; the weights contain the measure.
    barycentric : (q, k) array
        The quadrature points in each simplex.
    history : list of (time, factor), optional
        By what the load is multiplied in time; see `verify.scene.history`.
    """

    simplices: NDArray[np.int64]
    uniform: Array | None
    points: Array
    weights: Array
    values: Array
    barycentric: Array
    history: list[tuple[float, float]] | None = None


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
            shares = np.einsum("kq,qi,kqc->kic", load.weights, load.barycentric, load.values)
            np.add.at(force, load.simplices, shares)
        return force

    def free_pieces(self) -> Array:
        """Centroids (k, d) of the pieces of the body that are held in too few components.

        A piece has 3 rigid motions in the plane and 6 in space; one that is held in fewer
        components has no static answer, and direct solvers do not always notice. On a background
        mesh the body is one piece, whatever the cuts.
        """
        m, corners = self.cells.shape
        cell = np.repeat(np.arange(m), corners)
        link = coo_array((np.ones(m * corners), (cell, self.cells.ravel())))
        _, node_piece = connected_components(link.T @ link, directed=False)
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


def problem_of(scene: Scene, level: int, conforming: bool = False) -> Problem:
    """Lay out `scene` on mesh `level`.

    Parameters
    ----------
    scene : Scene
    level : int
        0 is the coarsest.
    conforming : bool
        Whether the mesh shall conform to the cuts; not offered for meshes given in space.

    Raises
    ------
    UnsupportedSceneError
        If a conforming mesh of the scene is not offered, a support or load is another field at
        every time, or a load acts on the faces of a cut.
    InputError
        If a support or load acts nowhere, or a mesh file is bad.
    """
    exact = _exact(scene)
    if any(isinstance(load, CutFaces) for load in scene.loads):
        raise UnsupportedSceneError("loads on the faces of a cut are not exported")
    if reason := _at_every_time(scene, exact):
        raise UnsupportedSceneError(reason)
    background, size = background_mesh(scene, level)
    points, cells, facet_cell = background.points, background.cells, background.boundary_facets
    cut_facets = np.zeros((0, scene.cell_dimension, scene.dimension))
    if conforming and scene.cuts:
        points, cells, facet_cell, cut_facets = _opened(scene, level, points, cells)
    corners = np.ones((len(facet_cell), cells.shape[1]), dtype=bool)
    corners[np.arange(len(facet_cell)), facet_cell[:, 1]] = False
    boundary = cells[facet_cell[:, 0]][corners].reshape(len(facet_cell), -1)
    mesh = _Mesh(points, cells, boundary, facet_cell[:, 0], conforming)
    return Problem(
        scene=scene,
        level=level,
        size=size,
        points=points,
        cells=cells,
        boundary=boundary,
        conforming=conforming,
        cut_facets=cut_facets,
        held=[_held(scene, mesh, i, support, exact) for i, support in enumerate(scene.supports)],
        loads=[_load(scene, mesh, i, exact) for i in range(len(scene.loads))],
    )


@dataclass(frozen=True)
class _Mesh:
    points: Array
    cells: NDArray[np.int64]
    boundary: NDArray[np.int64]
    boundary_cell: NDArray[np.int64]
    conforming: bool

    def centroids(self, cells: NDArray[np.int64]) -> Array:
        centroids: Array = self.points[self.cells[cells]].mean(axis=1)
        return centroids

    def held(self, scene: Scene, where: str, key: str) -> NDArray[np.int64]:
        """Nodes of the boundary that lie on a part, each on its own side of the cuts."""
        nodes, number = np.unique(self.boundary, return_inverse=True)
        middle = np.repeat(self.points[self.boundary].mean(axis=1), self.boundary.shape[1], axis=0)
        beside = number.ravel(), middle
        chosen: NDArray[np.int64] = nodes[
            copies_on_part(scene, where, self.points[nodes], beside, key)
        ]
        return chosen

    def on(self, scene: Scene, where: str, key: str) -> NDArray[np.bool_]:
        """(n,) nodes of the boundary that lie on a part."""
        nodes = np.unique(self.boundary)
        mark = np.zeros(len(self.points), dtype=bool)
        mark[nodes[on_part(scene, where, self.points[nodes], key)]] = True
        return mark


def _opened(
    scene: Scene, level: int, points: Array, cells: NDArray[np.int64]
) -> tuple[Array, NDArray[np.int64], NDArray[np.int64], Array]:
    """Imprint polylines on the mesh as it is; else mesh the cut body anew, about as fine."""
    from reference.meshing import imprint, open_cut

    polylines = [cut.vertices() for cut in scene.cuts if isinstance(cut, PolylineCut)]
    if scene.dimension == 2 and len(polylines) == len(scene.cuts):
        mesh = open_cut(*imprint(points, cells, polylines))
    elif isinstance(scene.geometry, Rectangle | Polygon | Box):
        from verify.solvers.conforming_meshes import peer_mesh

        mesh = peer_mesh(scene, level, "imprinted")
    else:
        raise UnsupportedSceneError(
            "a conforming mesh of a mesh file is offered for plane scenes with polyline cuts only"
        )
    return mesh.points, mesh.cells, mesh.boundary, mesh.realised_cut


def _exact(scene: Scene) -> Any:
    if scene.exact is None:
        return None
    from reference.exact import exact_solution

    return exact_solution(scene.exact.solution, scene.exact.parameters, scene.material)


def _at_every_time(scene: Scene, exact: Any) -> str | None:
    """Say what no list of values and factors holds, if there is such a thing."""
    moves = exact is not None and exact.moves
    for i, support in enumerate(scene.supports):
        if support.timed or (moves and support.displacement == "exact"):
            return f"supports[{i}] is another field at every time, which is not laid out as arrays"
    for i, load in enumerate(scene.loads):
        if not isinstance(load, Gravity) and (load.timed or (moves and load.exact)):
            return f"loads[{i}] is another field at every time, which is not laid out as arrays"
    return None


def _held(scene: Scene, mesh: _Mesh, i: int, support: Support, exact: Any) -> HeldNodes:
    nodes = mesh.held(scene, support.where, f"supports[{i}].where")
    components = support.held(scene.dimension)
    if support.displacement != "exact":
        values = support.values(mesh.points[nodes])
        return HeldNodes(nodes, components, values, support=support)
    at = mesh.points[nodes]
    columns = list(components)
    if mesh.conforming:  # a node on the cut belongs to the side of its own cells
        owner = np.zeros(len(mesh.points), dtype=np.int64)
        owner[mesh.cells.ravel()] = np.repeat(np.arange(len(mesh.cells)), mesh.cells.shape[1])
        values = exact.displacement(at, mesh.centroids(owner[nodes]))[:, columns]
        return HeldNodes(nodes, components, values, support=support)
    values = exact.displacement(at)[:, columns]
    across = _across(mesh, nodes, columns, values, exact)
    return HeldNodes(nodes, components, values, across, support)


def _across(
    mesh: _Mesh, nodes: NDArray[np.int64], columns: list[int], values: Array, exact: Any
) -> list[tuple[int, Array, Array]]:
    """Values continued from the other side, for nodes of boundary facets that a cut crosses."""
    row = np.full(len(mesh.points), -1, dtype=np.int64)
    row[nodes] = np.arange(len(nodes))
    d = mesh.boundary.shape[1]
    pairs = np.vstack([mesh.boundary[:, [a, b]] for a in range(d) for b in range(d) if a != b])
    pairs = np.unique(pairs[(row[pairs] >= 0).all(axis=1)], axis=0)
    far = exact.displacement(mesh.points[pairs[:, 0]], mesh.points[pairs[:, 1]])[:, columns]
    scale = float(np.abs(values).max(initial=0.0))
    differs = np.abs(far - values[row[pairs[:, 0]]]).max(axis=1, initial=0.0) > 1e-12 * scale
    return [
        (int(node), mesh.points[other], value)
        for (node, other), value in zip(pairs[differs], far[differs], strict=True)
    ]


def _load(scene: Scene, mesh: _Mesh, i: int, exact: Any) -> Load:
    load = scene.loads[i]
    assert not isinstance(load, CutFaces)  # refused
    if isinstance(load, Traction):
        chosen = mesh.on(scene, load.where, f"loads[{i}].where")[mesh.boundary].all(axis=1)
        simplices, cells = mesh.boundary[chosen], mesh.boundary_cell[chosen]
        if not len(simplices):
            text = f"loads[{i}].where: no boundary facet lies in '{load.where}'"
            raise InputError(text, str(scene.file or ""))
        given: Any = load.traction
    else:
        simplices, cells = mesh.cells, np.arange(len(mesh.cells))
        given = load.force if isinstance(load, BodyForce) else _weight(scene, load)
    barycentric, weights = simplex_rule(simplices.shape[1] - 1, _POINTS_PER_DIRECTION)
    corners = mesh.points[simplices]
    points = np.einsum("qi,kic->kqc", barycentric, corners)
    # a membrane's forces per volume and area count times its thickness
    measured = measures(corners)[:, None] * weights * (scene.material.thickness or 1.0)
    history = getattr(load, "history", None)
    if isinstance(load, Gravity) and not scene.material.is_uniform:
        values = np.broadcast_to(_weights(scene, load, corners.mean(axis=1))[:, None], points.shape)
        return Load(simplices, None, points, measured, values, barycentric, history)
    if isinstance(load, Gravity) or is_uniform(given):
        constant = np.asarray(given, dtype=float)
        values = np.broadcast_to(constant, points.shape)
        return Load(simplices, constant, points, measured, values, barycentric, history)
    # a point of a conforming mesh belongs to the side of its own cell; else to its own
    near = np.repeat(mesh.centroids(cells), len(weights), axis=0) if mesh.conforming else None
    flat = points.reshape(-1, points.shape[2])
    if given != "exact":
        values = load.values(flat).reshape(points.shape)
    elif isinstance(load, Traction):
        stress = exact.stress(flat, near).reshape(*points.shape, points.shape[2])
        normals = _outward_normals(corners, mesh.centroids(cells))
        values = np.einsum("kqij,kj->kqi", stress, normals)
    else:
        values = exact.body_force(flat, near).reshape(points.shape)
    return Load(simplices, None, points, measured, values, barycentric, history)


def _weight(scene: Scene, load: Gravity) -> Array:
    assert scene.material.density is not None  # the scene has checked it
    return scene.material.density * np.asarray(load.acceleration, dtype=float)


def _weights(scene: Scene, load: Gravity, centroids: Array) -> Array:
    """Weight (m, d) of the material at each cell's centroid, N/m³."""
    return scene.material.at(centroids).density[:, None] * np.asarray(load.acceleration)


def _lame(material: Material) -> tuple[float, float]:
    law = hooke(material)
    return float(law.lame), float(law.shear)


def _outward_normals(corners: Array, inside: Array) -> Array:
    """Return the unit normals (k, d) of facets (k, d, d), away from the points `inside` (k, d)."""
    edges = corners[:, 1:] - corners[:, :1]
    if corners.shape[2] == 2:
        normals = np.column_stack([edges[:, 0, 1], -edges[:, 0, 0]])
    else:
        normals = np.cross(edges[:, 0], edges[:, 1])
    outward = np.einsum("kc,kc->k", normals, corners[:, 0] - inside)
    normals = normals * np.sign(outward)[:, None]
    unit: Array = normals / np.linalg.norm(normals, axis=1)[:, None]
    return unit
