"""Forces on the volume and boundary of a cut body, and prescribed displacements.

A load takes the integrals of N_i over the pieces, exact if it is constant, not the lumped
V_piece/(d + 1) of the diagonal mass. The two differ on cut cells, and only the exact one passes
patch tests under load. Displacements are prescribed on dof nodes, each on its own side of the cuts.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import roots_jacobi

from verify.xfem.arrays import Bools, Floats, Ints, Sides, XfemError, finite_array, index_array
from verify.xfem.phantom import PhantomMesh
from verify.xfem.polar import SPINS


@cache
def simplex_rule(dim: int, degree: int) -> tuple[Floats, Floats]:
    """Make points and weights exact up to a degree: a conical product of Gauß rules.

    Parameters
    ----------
    dim : int
        Dimension of the simplex, 1 to 3.
    degree : int

    Returns
    -------
    barycentric : (q, dim + 1) float array
    weights : (q,) float array
        Their sum is 1: they multiply the volume.
    """
    count = degree // 2 + 1
    barycentric = np.ones((1, 1))
    weights = np.ones(1)
    for axis in range(dim):
        # the Jacobi weight (1 − t)^axis is the Jacobian of the collapse onto the new corner
        t, w = roots_jacobi(count, axis, 0.0)
        share, w = 0.5 * (1.0 + t), w / w.sum()
        old = (1.0 - share)[:, None, None] * barycentric
        new = np.broadcast_to(share[:, None, None], (count, len(weights), 1))
        barycentric = np.concatenate([old, new], axis=2).reshape(-1, axis + 2)
        weights = (w[:, None] * weights).ravel()
    return barycentric, weights


# points (q, d) and sides of every cut (q, cuts) to force densities (q, d)
Density = Callable[[Floats, Sides], Floats]
# corners (q, k, d) of parts of facets to the simplices in them that are loaded: of which each is
# (r,), and barycentric coordinates (r, k, k) of its corners there
LoadedPart = Callable[[Floats], tuple[Ints, Floats]]


def body_force(phantom: PhantomMesh, density: ArrayLike | Density, degree: int = 4) -> Floats:
    """Compute nodal forces (N, d) of a force per volume, in newtons (per metre of thickness in 2D).

    Parameters
    ----------
    phantom : PhantomMesh
    density : (d,) or (m, d) array_like or callable
        Force per volume in N/m³, e.g. ρg, of all cells of the uncut mesh or of each; a function
        of positions (q, d) and sides of the cuts (q, cuts) gives (q, d).
    degree : int
        Polynomial degree of density times shape function that is integrated exactly on each
        piece, if `density` is a function.

    Raises
    ------
    XfemError
        If the density has a wrong shape or is not finite, or the degree makes no sense.

    Examples
    --------
    >>> import verify.xfem as xfem
    >>> phantom = xfem.cut_mesh(xfem.rectangle_mesh((4, 4)), [xfem.Plane([0.6, 0.0], [1.0, 0.0])])
    >>> xfem.body_force(phantom, [0.0, -9.8]).sum(axis=0).round(12).tolist()
    [0.0, -9.8]
    """
    load = np.zeros_like(phantom.corners.node_points)
    if callable(density):
        piece, barycentric, share = phantom.solid_simplices
        volume = share * phantom.mesh.measures[phantom.parent[piece]]
        _integrate(phantom, load, piece, barycentric, volume, density, degree)
        return phantom.restrict(load)
    shapes = load.shape[1:], (len(phantom.mesh.cells), load.shape[1])
    given = np.atleast_2d(finite_array(density, "load density", *shapes))
    given = given if len(given) == 1 else given[phantom.parent]
    for axis, component in enumerate(given.T):
        force = phantom.shape_integrals * component[:, None]
        load[:, axis] = np.bincount(phantom.cells.ravel(), force.ravel(), len(load))
    return phantom.restrict(load)


def traction(
    phantom: PhantomMesh,
    facets: ArrayLike,
    density: ArrayLike | Density,
    degree: int = 4,
    loaded: LoadedPart | None = None,
) -> Floats:
    """Compute nodal forces (N, d) of a traction on boundary facets, in newtons (per metre in 2D).

    Parameters
    ----------
    phantom : PhantomMesh
    facets : (b, 2) array_like of int
        Pairs (cell, local node opposite to the facet) of the uncut mesh, such as rows of
        ``mesh.boundary_facets``.
    density : (d,) array_like or callable
        Force per area in pascal; a function as in `body_force`.
    degree : int
        As in `body_force`.
    loaded : callable, optional
        Gives the loaded part of the facets, divided where cuts cross them; default: all.

    Raises
    ------
    XfemError
        If a facet does not exist, or the density or the degree makes no sense.

    Examples
    --------
    >>> import verify.xfem as xfem
    >>> phantom = xfem.cut_mesh(xfem.rectangle_mesh((4, 4)), [xfem.Plane([0.0, 0.6], [0.0, 1.0])])
    >>> load = xfem.traction(phantom, phantom.mesh.boundary_facets, [2.0, 0.0])
    >>> load.sum(axis=0).round(12).tolist()
    [8.0, 0.0]
    """
    chosen = index_array(facets, "loaded facets")
    mesh = phantom.mesh
    if chosen.size == 0:
        chosen = chosen.reshape(0, 2)
    if chosen.ndim != 2 or chosen.shape[1] != 2:
        raise XfemError(f"loaded facets of shape {chosen.shape}; expected (b, 2)")
    if chosen.size and (
        chosen.min() < 0 or chosen[:, 0].max() >= len(mesh.cells) or chosen[:, 1].max() > mesh.dim
    ):
        raise XfemError("a loaded facet is not a pair (cell, local node) of the mesh")
    load = np.zeros_like(phantom.corners.node_points)
    if not callable(density):
        density = finite_array(density, "load density", load.shape[1:])
    for local in range(mesh.dim + 1):
        cells = chosen[chosen[:, 1] == local, 0]
        piece, corners, area = facet_parts(phantom, cells, local)
        if loaded is not None and len(piece):
            of, within = loaded(facet_places(phantom, piece, corners))
            piece, corners = piece[of], within @ corners[of]
            area = area[of] * np.abs(np.linalg.det(within))
        _integrate(phantom, load, piece, corners, area, density, degree)
    return phantom.restrict(load)


def facet_places(phantom: PhantomMesh, piece: Ints, corners: Floats) -> Floats:
    """Map barycentric corners (q, k, d + 1) in pieces (q,) to places (q, k, space), m."""
    places: Floats = corners @ phantom.mesh.points[phantom.mesh.cells[phantom.parent[piece]]]
    return places


def facet_parts(phantom: PhantomMesh, cells: Ints, local: int) -> tuple[Ints, Floats, Floats]:
    """Divide the facets of `cells` opposite to a corner into simplices of material.

    A facet that a cut crosses is divided by it. Pieces (q,), barycentric coordinates (q, d, d + 1)
    of the corners, and measures (q,). Where a zero point lies on the facet, its coordinate of the
    corner is s·0 + r·0 (`verify.xfem.clip`), exactly zero.
    """
    mesh = phantom.mesh
    others = [k for k in range(mesh.dim + 1) if k != local]
    # |∇λ| = 1/height and V = height·A/d
    height = 1.0 / np.linalg.norm(mesh.gradients[:, local], axis=1)
    area = mesh.measures * mesh.dim / height
    wanted = np.zeros(len(mesh.cells), dtype=bool)
    wanted[cells] = True
    piece, barycentric, _ = phantom.solid_simplices
    cell = phantom.parent[piece]
    here = np.flatnonzero(wanted[cell])
    found_piece, found_corners, found_area = [], [], []
    for opposite in range(mesh.dim + 1):
        rest = [k for k in range(mesh.dim + 1) if k != opposite]
        on_facet = here[(barycentric[here][:, rest, local] == 0.0).all(axis=1)]
        share = np.abs(np.linalg.det(barycentric[on_facet][:, rest][:, :, others]))
        found_piece.append(piece[on_facet])
        found_corners.append(barycentric[on_facet][:, rest])
        found_area.append(share * area[cell[on_facet]])
    return tuple(np.concatenate(x) for x in (found_piece, found_corners, found_area))  # type: ignore[return-value]


def _integrate(
    phantom: PhantomMesh,
    load: Floats,
    piece: Ints,
    corners: Floats,
    measure: Floats,
    density: Floats | Density,
    degree: int,
) -> None:
    """Add ∫ N_i f over simplices given by barycentric corners (q, k, d + 1) to the load.

    The density is constant, in each simplex or in all of them, or a function.
    """
    if len(piece) == 0:
        return
    if not isinstance(degree, int | np.integer) or degree < 0:
        raise XfemError(f"quadrature of degree {degree!r}; expected an integer, 0 or more")
    rule, weights = simplex_rule(corners.shape[1] - 1, degree if callable(density) else 1)
    nodes = phantom.mesh.points[phantom.mesh.cells[phantom.parent[piece]]]
    sides = phantom.piece_side[piece]
    for point, weight in zip(rule, weights, strict=True):
        shape = np.einsum("k,qki->qi", point, corners)
        if callable(density):
            given = density(np.einsum("qi,qij->qj", shape, nodes), sides)
            force = finite_array(given, "load density", (len(piece), load.shape[1]))
        else:
            force = np.atleast_2d(density)
        share = (weight * measure)[:, None] * shape
        np.add.at(load, phantom.cells[piece], share[:, :, None] * force[:, None])


# points (k, d) and sides (k, cuts) to displacements (k, d)
PrescribedField = Callable[[Floats, Sides], Floats]


_LOOSE = 1e-14  # square of the share of a rigid mode that supports hold at least


class UnsupportedBodyError(XfemError):
    """A free body can move rigidly, so that statics has no solution."""


@dataclass(frozen=True)
class Supports:
    """Fixed components of the dof nodes.

    Attributes
    ----------
    fixed : (N, d) bool array
    values : (N, d) float array
        Prescribed displacement in metres; zero where not fixed.

    Examples
    --------
    >>> import verify.xfem as xfem
    >>> phantom = xfem.cut_mesh(xfem.rectangle_mesh((4, 4)), [])
    >>> left = phantom.mesh.points[:, 0] == 0.0
    >>> supports = xfem.Supports.none(phantom).prescribe(phantom, left, 0.1, components=(0,))
    >>> int(supports.fixed.sum()), float(supports.values.max())
    (5, 0.1)
    """

    fixed: Bools
    values: Floats

    @staticmethod
    def none(phantom: PhantomMesh) -> "Supports":
        """Make supports that fix nothing."""
        shape = phantom.node_points.shape
        return Supports(np.zeros(shape, dtype=bool), np.zeros(shape))

    def prescribe(
        self,
        phantom: PhantomMesh,
        nodes: ArrayLike,
        values: ArrayLike | PrescribedField = 0.0,
        components: tuple[int, ...] | None = None,
    ) -> "Supports":
        """Add prescribed displacements.

        Parameters
        ----------
        phantom : PhantomMesh
        nodes : (k,) array_like of int, or (n,) of bool
            Nodes of the *uncut* mesh; every dof node there is prescribed. None may follow a
            root cell (aggregation): its value would be what the root says.
        values : float, (d,) array_like, or callable
            In metres. A function takes positions (k, d) and sides (k, cuts) of the dof nodes. So a
            field that jumps across a cut is evaluated on the right side.
        components : tuple of int, optional
            Components to fix; all by default.

        Raises
        ------
        XfemError
            If these supports are of another body, or nodes or components do not exist. If a node
            has material that follows a root cell, or values have a wrong shape or are not finite.
        """
        count, dim = len(phantom.mesh.points), self.fixed.shape[1]
        if self.fixed.shape != phantom.node_points.shape:
            raise XfemError(
                f"supports of shape {self.fixed.shape} on a body with unknowns of shape "
                f"{phantom.node_points.shape}"
            )
        chosen = np.asarray(nodes)
        if chosen.dtype == bool and chosen.shape != (count,):
            raise XfemError(f"node mask of shape {chosen.shape}; expected ({count},)")
        if chosen.dtype != bool:
            chosen = index_array(nodes, "supported nodes")
            if chosen.size and (chosen.min() < 0 or chosen.max() >= count):
                raise XfemError(f"supported node outside 0..{count - 1}")
        mark = np.zeros(count, dtype=bool)
        mark[chosen] = True
        following = phantom.corners.node_parent[phantom.corner_node < 0]
        if mark[following].any():
            raise XfemError(
                f"{int(mark[following].sum())} nodes of slivers at supported nodes follow a root "
                "cell, so that no value can be prescribed there; see `treat_slivers`: supported"
            )
        at = np.flatnonzero(mark[phantom.node_parent])
        axes = range(dim) if components is None else components
        if not isinstance(axes, Sequence) or any(axis not in range(dim) for axis in axes):
            raise XfemError(f"components {components}; expected some of 0..{dim - 1}")
        if len(at) == 0:
            return self
        field = (
            values(phantom.node_points[at], phantom.node_side[at]) if callable(values) else values
        )
        shapes = (), (dim,), (1,), (len(at), dim), (len(at), 1)
        given = np.broadcast_to(finite_array(field, "prescribed values", *shapes), (len(at), dim))
        fixed, prescribed = self.fixed.copy(), self.values.copy()
        for axis in axes:
            fixed[at, axis] = True
            prescribed[at, axis] = given[:, axis]
        return Supports(fixed, prescribed)


def check_fixed(fixed: Bools, shape: tuple[int, int]) -> None:
    """Check that fixed components are of a body with unknowns of a shape (N, d).

    Raises
    ------
    XfemError
        If they have another shape, or are not of type bool.
    """
    if np.shape(fixed) != shape or fixed.dtype != bool:
        raise XfemError(
            f"supports of shape {np.shape(fixed)} and type {fixed.dtype}; expected {shape}, bool"
        )


def check_bodies(
    phantom: PhantomMesh, supports: Supports, faces: tuple[Ints, Floats] | None = None
) -> None:
    """Check that no free body can move rigidly.

    Parameters
    ----------
    phantom : PhantomMesh
    supports : Supports
    faces : tuple of array, optional
        Dof nodes (f, k) and normal jumps (f, q, k, d) of faces that hold each other.

    Raises
    ------
    UnsupportedBodyError
        Naming the first such body by its size and position.
    XfemError
        If the supports are of another body, not of type bool, or a value is not finite.
    """
    check_fixed(supports.fixed, phantom.node_points.shape)
    finite_array(supports.values, "supports: values", phantom.node_points.shape)
    loose = loose_bodies(phantom, supports, np.arange(phantom.bodies.max() + 1))
    if len(loose) and faces is not None:
        loose = _loose_together(phantom, supports, loose, *faces)
    for body in loose:
        pieces = phantom.corners.bodies[phantom.cells[:, 0]] == body
        volume = phantom.volumes[pieces].sum()
        centre = phantom.volumes[pieces] @ phantom.piece_centroids[pieces] / volume
        unit = "m²" if supports.fixed.shape[1] == 2 else "m³"
        raise UnsupportedBodyError(
            f"a piece of {volume:.3g} {unit} around {np.round(centre, 6).tolist()} is not "
            "held: it can move as a rigid body; support it, or do not cut it off"
        )


def loose_bodies(phantom: PhantomMesh, supports: Supports, bodies: Ints) -> Ints:
    """Select from the given free bodies (k,), by number, the ones that can move rigidly."""
    found = []
    for body in bodies:
        nodes, modes = _modes_of(phantom, body)
        held = modes[supports.fixed[nodes]]
        if len(held) == 0 or np.linalg.eigvalsh(held.T @ held)[0] < _LOOSE:
            found.append(body)
    return np.array(found, dtype=np.int64)


def _loose_together(
    phantom: PhantomMesh, supports: Supports, loose: Ints, nodes: Ints, gaps: Floats
) -> Ints:
    """Return the body (1,) that moves most where loose bodies can move together, or none (0,)."""
    shape = (*supports.fixed.shape, len(loose), 3 if supports.fixed.shape[1] == 2 else 6)
    modes = np.zeros(shape)
    for place, body in enumerate(loose):
        own, of_body = _modes_of(phantom, body)
        modes[own, :, place] = of_body
    held = np.concatenate(
        [
            modes[supports.fixed],
            np.einsum("fqid,fidbm->fqbm", gaps, modes[nodes]).reshape(-1, *shape[2:]),
        ]
    ).reshape(-1, shape[2] * shape[3])
    values, vectors = np.linalg.eigh(held.T @ held)
    moves = np.abs(vectors[:, 0]).reshape(shape[2:]).max(axis=1)
    return loose[[int(moves.argmax())]] if values[0] < _LOOSE else loose[:0]


def _modes_of(phantom: PhantomMesh, body: int) -> tuple[Ints, Floats]:
    """Find dof nodes (k,) of a free body, and its rigid modes (k, d, modes), each of norm 1."""
    nodes = np.flatnonzero(phantom.bodies == body)
    points = phantom.node_points[nodes]
    modes = _rigid_modes((points - points.mean(axis=0)) / phantom.mesh.extent)
    return nodes, modes / np.linalg.norm(modes.reshape(-1, modes.shape[-1]), axis=0)


def _rigid_modes(points: Floats) -> Floats:
    """Return translations and infinitesimal rotations (k, d, modes) at points (k, d)."""
    count, dim = points.shape
    shifts = np.broadcast_to(np.eye(dim), (count, dim, dim))
    return np.concatenate([shifts, np.einsum("aij,kj->kia", SPINS[dim], points)], axis=2)
