"""Supports and loads of a scene on a conforming mesh, side-aware at the cuts.

Supports are constrained unknowns, with the rigid motions of pieces that follow them (Horn's
quaternions). Loads are nodal forces: tractions act on parts of the boundary, which may end inside a
facet, and on the faces of cuts.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from reference.deformation import density
from reference.linear_solvers import rigid_motions
from reference.nodal_algebra import nodal_forces
from reference.space import ConformingSpace
from verify.errors import InputError
from verify.scene import BodyForce, CutFaces, Gravity, Scene, Traction, faces_of, is_uniform
from verify.scene.parts import Pieces, held_facets, held_nodes, pieces_on_part, shifted_ends
from verify.scene.physics import field_values
from verify.solution import Regularisation

_HELD = 1e-9  # lever of the supports over the size of the piece, below which it may turn
Array = NDArray[np.float64]
_OPEN = 1e-12  # of the spread of the points: what they leave open is turned as little as possible
_SMALL = 1e-2  # angle below which the linear response to a turn serves
Ints = NDArray[np.int64]
# marks of the faces of cuts in a measure, beyond the marks of loads on the boundary
_FACE = 1_000_000
_PART = 2_000_000  # and of facets in which loads end
_WHOLE = 1e-12  # of a facet: what may be left of one that is loaded as a whole
_DEGREE = 8  # of the rule over pieces of facets


def constrained_values(
    scene: Scene, space: ConformingSpace, exact: Any, share: float = 1.0
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Find unknowns that the supports hold, and their values.

    A discontinuous prescribed field is taken on the side of the cell that owns the node. A later
    support wins where two hold the same node. A `share` below 1 is a point on the way there: of
    displacements, and of the angle by which a support turns.

    Returns
    -------
    unknowns : (k,) int32 array
        Scalar unknowns, ascending.
    values : (k,) float array
        m.

    Raises
    ------
    InputError
        If a support holds no node, or a piece of the body is left a rigid motion.
    """
    d = space.dimension
    value = np.full((len(space.node_points), d), np.nan)
    for i, support in enumerate(scene.supports):
        nodes, near = nodes_on_part(scene, space, support.where, f"supports[{i}].where")
        points, held = space.node_points[nodes], list(support.held(d))
        if support.displacement == "exact":
            found = share * exact.displacement(points, near)[:, held]
        else:
            found = support.values(points, share)
        value[np.ix_(nodes, held)] = found
    _check_every_piece_is_held(scene, space, value)
    flat = value.ravel()
    unknowns = np.flatnonzero(~np.isnan(flat)).astype(np.int32)
    return unknowns, flat[unknowns]


def nodes_on_part(
    scene: Scene, space: ConformingSpace, where: str, key: str
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Find nodes (k,) that a support on a part holds, each on its own side of the cuts.

    Returns
    -------
    nodes : (k,) int array
    near : (k, d) array
        Centroid of a cell of each: on its side of the cuts, m.
    """
    if scene.geometry.holds_inside(where):
        every = space.cell_nodes, space.mesh.points[space.mesh.cells]
        chosen, _ = held_nodes(scene, where, space.node_points, every, key)
        return chosen, space.beside_nodes()[chosen]
    nodes, owner = space.boundary_nodes()
    of_facets, corners = space.boundary_facets
    facets = np.searchsorted(nodes, of_facets), corners
    chosen, _ = held_nodes(scene, where, space.node_points[nodes], facets, key)
    return nodes[chosen], space.centroids[owner[chosen]]


def support_ends(scene: Scene, space: ConformingSpace, size: float) -> list[Regularisation]:
    """Report where supports hold more than their parts; `size` is the element size, m."""
    corners = space.boundary_facets[1]
    ended = [s.where for s in scene.supports if not scene.geometry.holds_inside(s.where)]
    return shifted_ends([held_facets(scene.geometry, where, corners) for where in ended], size)


def _check_every_piece_is_held(
    scene: Scene, space: ConformingSpace, value: NDArray[np.float64]
) -> None:
    """Refuse a piece that its supports leave a rigid motion, naming the piece and the motion."""
    pieces = space.mesh.pieces
    node, component = np.nonzero(~np.isnan(value))
    for piece in range(pieces.max() + 1):
        corners = space.mesh.points[np.unique(space.mesh.cells[pieces == piece])]
        centre = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        size = float(np.ptp(corners, axis=0).max())
        mine = space.piece_of_node[node] == piece
        free = _free_motion(space.node_points[node[mine]] - centre, component[mine], size)
        if free:
            raise InputError(
                f"supports: the piece around ({', '.join(f'{x:.4g}' for x in centre)}) {free}; "
                "a static scene needs every piece held",
                str(scene.file or ""),
            )


def _free_motion(points: NDArray[np.float64], component: NDArray[np.int64], size: float) -> str:
    """Say which rigid motion is left when `component` (k,) is held at `points` (k, d)."""
    if not len(points):
        return "is held by no support (the cut frees it)"
    d = points.shape[1]
    motions = rigid_motions(points / size, np.zeros(d)).reshape(-1, *points.shape)
    modes = motions[:, np.arange(len(points)), component]
    # the left singular vectors are motions
    columns, values, _ = np.linalg.svd(modes, full_matrices=modes.shape[1] < len(modes))
    rank = int(np.count_nonzero(values > _HELD * values[0]))
    if rank == len(modes):
        return ""
    left = columns[:, rank:]
    if np.abs(left[d:]).max() > 1e-6:
        return "can still turn: its supports hold too few points or components"
    axis = "xyz"[int(np.argmax(np.abs(left[:d]).max(axis=1)))]
    return f"can still move in {axis}: its supports do not hold that component"


class RigidMotions:
    """Rigid motions of the pieces of a body that go with the nodes held in all components.

    Parameters
    ----------
    space : ConformingSpace
    unknowns : (k,) int array
        Constrained scalar unknowns, by nodes.
    """

    def __init__(self, space: ConformingSpace, unknowns: NDArray[np.int32]) -> None:
        self._points = space.node_points
        place = np.full(self._points.shape, -1, dtype=np.int64)
        place.ravel()[unknowns] = np.arange(len(unknowns))
        whole = (place >= 0).all(axis=1)
        owner = space.piece_of_node
        self._parts = []
        for piece in range(int(owner.max()) + 1):
            held = np.flatnonzero(whole & (owner == piece))
            if len(held):
                self._parts.append((np.flatnonzero(owner == piece), held, place[held]))

    def follow(self, displacement: Array, values: Array) -> Array | None:
        """Displacement (n, d) of pieces that go with the `values` (k,) of the constrained unknowns.

        None if no piece turns by more than a small angle.
        """
        moved = displacement.copy()
        turned = False
        for nodes, held, place in self._parts:
            now = self._points[held] + displacement[held]
            wanted = self._points[held] + values[place]
            one, two = now.mean(axis=0), wanted.mean(axis=0)
            rotation = best_rotation(now - one, wanted - two)
            if np.abs(rotation - np.eye(len(rotation))).max() < _SMALL:
                continue
            here = self._points[nodes] + displacement[nodes]
            moved[nodes] = two + (here - one) @ rotation.T - self._points[nodes]
            turned = True
        return moved if turned else None


def best_rotation(now: Array, wanted: Array) -> Array:
    """Compute the rotation (d, d) of centred points (k, d) that brings them nearest to others.

    By the singular values of their covariance (W. Kabsch, Acta Cryst. A 32, 1976, 922).
    """
    S = now.T @ wanted
    S += _OPEN * float(np.linalg.norm(now) * np.linalg.norm(wanted)) * np.eye(len(S))
    left, _, right = np.linalg.svd(S)
    left[:, -1] *= np.sign(np.linalg.det(left @ right))
    return np.asarray((left @ right).T)


class CutFacets(NamedTuple):
    """Facets of both faces of a cut.

    Attributes
    ----------
    cell, opposite : (f,) int arrays
        Cell of each, and the corner opposite to it.
    positive : (f,) bool array
        Whether its material is on the positive side of the cut.
    """

    cell: NDArray[np.int64]
    opposite: NDArray[np.int64]
    positive: NDArray[np.bool_]


class LoadedFacets(NamedTuple):
    """Facets that a traction acts on.

    Attributes
    ----------
    whole : (w,) int array
        Facets on all of which it acts, as rows of the mesh's `boundary`.
    ended : (e,) int array
        Facets in which it ends; in space also those on all of which a formula acts.
    pieces : Pieces
        Loaded parts of the latter; `facet` counts rows of `boundary`.
    """

    whole: Ints
    ended: Ints
    pieces: Pieces

    def opposite_to(self, space: ConformingSpace, corner: int) -> "LoadedFacets":
        """Return those in which it ends that are opposite to a corner of their cell."""
        rows = self.ended[space.mesh.boundary[self.ended, 1] == corner]
        pieces = self.pieces[np.isin(self.pieces.facet, rows)]
        return LoadedFacets(np.zeros(0, dtype=np.int64), rows, pieces)


def load_forces(scene: Scene, space: ConformingSpace, exact: Any, time: float = 0.0) -> Array:
    """Nodal forces (k,) of all loads of a scene at a time, N, without factors of histories."""
    import ufl

    v = ufl.TestFunction(space.function_space)
    return nodal_forces(load_form(scene, space, v, exact, time), space)


def load_form(scene: Scene, space: ConformingSpace, v: Any, exact: Any, time: float = 0.0) -> Any:
    """Sum up the linear form of all loads of a scene at a time for the test function `v`."""
    import ufl
    from dolfinx import fem

    exact = None if exact is None else exact.at(time)
    domain = space.function_space.mesh
    form = ufl.inner(fem.Constant(domain, np.zeros(space.dimension)), v) * ufl.dx
    thickness = scene.material.thickness or 1.0  # loads of a membrane are per volume and area too
    tractions: dict[int, NDArray[np.int32]] = {}
    parted: dict[int, list[tuple[int, Any]]] = {}
    for i, load in enumerate(scene.loads):
        if isinstance(load, Traction):
            loaded = loaded_facets(scene, space, load, f"loads[{i}].where")
            tractions[i] = _pairs(space, *space.mesh.boundary[loaded.whole].T)
            parted[i] = []
            for corner, pairs, given in _parted(space, loaded, load, exact, time):
                mark = _PART + 4 * i + corner
                tractions[mark] = pairs
                parted[i].append((mark, given))
    for i, load in enumerate(scene.loads):
        if isinstance(load, CutFaces):
            cell, opposite, positive = cut_facets_of(scene, space, load, f"loads[{i}]")
            tractions[_FACE + 2 * i] = _pairs(space, cell[positive], opposite[positive])
            tractions[_FACE + 2 * i + 1] = _pairs(space, cell[~positive], opposite[~positive])
    # all parts in one measure: DOLFINx takes one set of subdomains per form
    ds = ufl.Measure("ds", domain=domain, subdomain_data=list(tractions.items()))
    for i, load in enumerate(scene.loads):
        if isinstance(load, Gravity):
            acceleration = fem.Constant(domain, np.asarray(load.acceleration, dtype=float))
            form += density(scene.material, v) * ufl.inner(acceleration, v) * ufl.dx
        elif isinstance(load, BodyForce):
            force = (
                _sided_function(space, exact.body_force, (space.dimension,))
                if load.force == "exact"
                else thickness * _given(space, load.force, time)
            )
            form += ufl.inner(force, v) * ufl.dx
        elif isinstance(load, CutFaces):
            given = _given(space, load.components, time)
            one, other = ds(_FACE + 2 * i), ds(_FACE + 2 * i + 1)
            if load.traction is None:
                form -= given[0] * ufl.inner(ufl.FacetNormal(domain), v) * (one + other)
            else:
                form += ufl.inner(given, v) * one - ufl.inner(given, v) * other
        elif load.traction == "exact":
            stress = _sided_function(space, exact.stress, (space.dimension,) * 2)
            form += ufl.inner(stress * ufl.FacetNormal(domain), v) * ds(i)
        else:
            traction = thickness * _given(space, load.traction, time)
            form += ufl.inner(traction, v) * ds(i)
        for mark, given in parted.get(i, []):
            form += thickness * ufl.inner(given, v) * ds(mark)
    return form


def _parted(
    space: ConformingSpace, loaded: LoadedFacets, load: Traction, exact: Any, time: float
) -> Iterator[tuple[int, NDArray[np.int32], Any]]:
    """Facets in which a load ends, with their densities: corner opposite, pairs and a function.

    Facets of one function are opposite to the same corner: no cell has two of them.
    """
    from dolfinx import fem

    if not len(loaded.ended):
        return
    domain = space.function_space.mesh
    broken = fem.functionspace(domain, ("DG", space.degree, (space.dimension,)))
    for corner in np.unique(space.mesh.boundary[loaded.ended, 1]):
        mine = loaded.opposite_to(space, int(corner))
        values = density_on_whole(space, mine, load, exact, time)
        cell, opposite = space.mesh.boundary[mine.ended].T
        here = space.dolfinx_cell[cell] >= 0
        function = fem.Function(broken)
        at = space.broken_facet_dofs(broken, cell[here], opposite[here])
        function.x.array.reshape(-1, space.dimension)[at] = values[here]
        yield int(corner), _pairs(space, cell[here], opposite[here]), function


def _given(space: ConformingSpace, components: Any, time: float) -> Any:
    """Give components of a load as a constant, or interpolated if one is a formula."""
    from dolfinx import fem

    if is_uniform(components):
        given = np.asarray(components, dtype=float)
        return fem.Constant(space.function_space.mesh, given)
    values = lambda points, _near: field_values(components, points, time)  # noqa: E731
    return _sided_function(space, values, (len(components),))


def _pairs(
    space: ConformingSpace, cell: NDArray[np.int64], opposite: NDArray[np.int64]
) -> NDArray[np.int32]:
    """Compute DOLFINx's pairs of cell and local facet of facets opposite to corners of cells."""
    # facet i lies opposite corner i; other ranks integrate over their cells themselves
    pairs = np.column_stack([space.dolfinx_cell[cell], opposite])
    own = space.function_space.mesh.topology.index_map(space.mesh.cell_dimension).size_local
    pairs = pairs[(pairs[:, 0] >= 0) & (pairs[:, 0] < own)]
    return pairs[np.argsort(pairs[:, 0], kind="stable")].astype(np.int32).ravel()


def _sided_function(space: ConformingSpace, values: Any, shape: tuple[int, ...]) -> Any:
    """Interpolate an exact field by discontinuous polynomials, each cell on its own side."""
    from dolfinx import fem

    d = space.dimension
    degree = 4 if d == 2 else space.degree + 1  # in space quartics would take gigabytes
    broken = fem.functionspace(space.function_space.mesh, ("DG", degree, shape))
    here = np.flatnonzero(space.dolfinx_cell >= 0)
    nodes = np.asarray(broken.dofmap.list, dtype=np.int64)[space.dolfinx_cell[here]]
    points = broken.tabulate_dof_coordinates()[:, :d]
    near = np.empty_like(points)
    near[nodes] = space.centroids[here, None, :]
    function = fem.Function(broken)
    function.x.array[:] = values(points, near).ravel()
    return function


def cut_facets_of(scene: Scene, space: ConformingSpace, load: CutFaces, key: str) -> CutFacets:
    """Find the facets that a load on the faces of a cut acts on; none if it is still closed.

    Raises
    ------
    InputError
        If there are none in a static scene.
    """
    mesh = space.mesh
    cell, opposite = mesh.faces.T
    k = mesh.cell_dimension
    rest = np.array([[c for c in range(k + 1) if c != j] for j in range(k + 1)])
    corners = mesh.points[mesh.cells[cell[:, None], rest[opposite]]]
    middle = corners.mean(axis=1)
    found = faces_of(scene.cuts, middle)
    mine = found.cut == next(i for i, cut in enumerate(scene.cuts) if cut.name == load.cut)
    if not mine.any() and scene.analysis.kind == "static":
        raise InputError(f"{key}: cut '{load.cut}' has no face in the body", str(scene.file or ""))
    inside = np.sum((mesh.points[mesh.cells[cell, opposite]] - middle) * found.normal, axis=1)
    return CutFacets(cell[mine], opposite[mine], inside[mine] > 0.0)


def loaded_facets(scene: Scene, space: ConformingSpace, load: Traction, key: str) -> LoadedFacets:
    """Find the facets that a traction acts on.

    Raises
    ------
    InputError
        If there are none.
    """
    corners = space.boundary_facets[1]
    pieces = pieces_on_part(scene.geometry, load.where, corners)
    if not len(pieces.facet):
        raise InputError(f"{key}: no boundary facet lies in '{load.where}'", str(scene.file or ""))
    covered = pieces.covered(len(corners))
    # in space formulas are interpolated by too low a degree: a bump over two facets is 3 % off
    coarse = space.dimension == 3 and load.traction != "exact" and not is_uniform(load.traction)
    whole = (covered > 1.0 - _WHOLE) & (not coarse)
    ended = (covered > 0.0) & ~whole
    mine = pieces[ended[pieces.facet]]
    return LoadedFacets(np.flatnonzero(whole), np.flatnonzero(ended), mine)


def density_on_whole(
    space: ConformingSpace, loaded: LoadedFacets, load: Traction, exact: Any, time: float
) -> Array:
    """Force per area on whole facets that does the work of a traction on pieces of them.

    It is the polynomial of the space's degree with the same integrals against all shape functions.
    So the load acts on the piece itself, though forms are integrated over facets. All facets must
    be opposite to the same corner.

    Returns
    -------
    (e, q, d) array
        At the nodes of the facets in which the load ends, as `ConformingSpace.facet_nodes` has
        them, Pa.
    """
    import basix

    k = space.mesh.cell_dimension
    cell_type = {2: basix.CellType.interval, 3: basix.CellType.triangle}[k]
    at, weights = map(np.asarray, basix.make_quadrature(cell_type, _DEGREE))
    rule = np.column_stack([1.0 - at.sum(axis=1), at])
    weights = weights / weights.sum()
    edges = space.edges_of_facet(int(space.mesh.boundary[loaded.ended[0], 1]))
    shapes = _facet_shapes(rule, edges)
    mass = np.einsum("q,qa,qb->ab", weights, shapes, shapes)
    facet = np.searchsorted(loaded.ended, loaded.pieces.facet)
    within = rule @ loaded.pieces.barycentric
    points = within @ space.boundary_facets[1][loaded.pieces.facet]
    values = _values(space, loaded, load, exact, time, points)
    shapes, share = _facet_shapes(within, edges), loaded.pieces.share
    given = np.einsum("r,q,rqa,rqc->rac", share, weights, shapes, values)
    moments = np.zeros((len(loaded.ended), *given.shape[1:]))
    np.add.at(moments, facet, given)
    return np.asarray(np.linalg.solve(mass, moments))


def _values(
    space: ConformingSpace,
    loaded: LoadedFacets,
    load: Traction,
    exact: Any,
    time: float,
    points: Array,
) -> Array:
    """Force per area (r, q, d) at points (r, q, d) of the pieces, Pa."""
    if load.traction != "exact" and is_uniform(load.traction):
        return np.broadcast_to(np.asarray(load.traction, dtype=float), points.shape)
    flat = points.reshape(-1, points.shape[2])
    if load.traction != "exact":
        return np.asarray(load.values(flat, time)).reshape(points.shape)
    rows = loaded.pieces.facet
    near = np.repeat(space.centroids[space.mesh.boundary[rows, 0]], points.shape[1], axis=0)
    stress = exact.stress(flat, near).reshape(*points.shape, -1)
    normals = space.outward_normals(rows)
    return np.asarray(np.einsum("rqij,rj->rqi", stress, normals))


def _facet_shapes(barycentric: Array, edges: list[tuple[int, int]]) -> Array:
    """Compute shape functions (…, q) of a facet at barycentric coordinates (…, k).

    Functions of the corners, and in a quadratic space of the middles of edges.
    """
    if not edges:
        return barycentric
    middles = [4.0 * barycentric[..., i] * barycentric[..., j] for i, j in edges]
    corners = barycentric * (2.0 * barycentric - 1.0)
    return np.concatenate([corners, np.stack(middles, axis=-1)], axis=-1)
