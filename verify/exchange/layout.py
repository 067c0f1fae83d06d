"""Layout of a scene as a `Problem`: its mesh, what is held and what is loaded, as arrays."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference.exact import ExactSolution, exact_of
from verify.compare.splitting import measures
from verify.errors import UnsupportedSceneError
from verify.exchange.problem import HeldNodes, Load, Problem
from verify.scene import (
    Box,
    CutFaces,
    Gravity,
    Polygon,
    PolylineCut,
    Rectangle,
    Scene,
    Support,
    Traction,
)
from verify.scene.parts import HeldFacets, Pieces, pieces_on_part
from verify.scene.physics import PrescribedMotion
from verify.solvers.body_of_scene import background_mesh
from verify.solvers.boundary_of_scene import Boundary
from verify.solvers.loads_of_scene import ForceDensity, is_moving
from verify.xfem.loads import simplex_rule

Array = NDArray[np.float64]
_WHOLE = 1e-12  # of a facet: what may be left of one that is loaded as a whole
_DEGREE = 7  # of the rule for loads that vary: an exact field's traction is smooth on a facet


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
    return Problem(
        scene=scene,
        level=level,
        size=size,
        points=boundary.points,
        cells=boundary.cells,
        boundary=boundary.corners,
        conforming=conforming,
        cut_facets=cut_facets,
        held=[_held(scene, boundary, i, conforming, exact) for i in range(len(scene.supports))],
        loads=[_load(scene, boundary, i, conforming, exact) for i in range(len(scene.loads))],
    )


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
    uniform = density.uniform(_centroids(boundary, cells))
    if uniform is None:
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
