"""Prescribed displacements on dof nodes, each on its own side of the cuts."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from verify.xfem.arrays import Bools, Floats, Ints, Sides, finite_array, index_array
from verify.xfem.errors import XfemError
from verify.xfem.phantom import PhantomMesh
from verify.xfem.polar import SPINS

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
        """No support at all."""
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
            In metres. A function is called with the positions (k, d) and the sides (k, cuts) of the
            dof nodes, so that a field that jumps across a cut is evaluated on the right side.
        components : tuple of int, optional
            Components to fix; all by default.

        Raises
        ------
        XfemError
            If these supports are of another body, nodes or components do not exist, a node has
            material that follows a root cell, or values have a wrong shape or are not finite.
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


def check_bodies(phantom: PhantomMesh, supports: Supports) -> None:
    """Check that no free body can move rigidly.

    Raises
    ------
    UnsupportedBodyError
        Naming the first such body by its size and position.
    XfemError
        If the supports are of another body, not of type bool, or a value is not finite.
    """
    check_fixed(supports.fixed, phantom.node_points.shape)
    finite_array(supports.values, "supports: values", phantom.node_points.shape)
    for body in loose_bodies(phantom, supports, np.arange(phantom.bodies.max() + 1)):
        pieces = phantom.corners.bodies[phantom.cells[:, 0]] == body
        volume = phantom.volumes[pieces].sum()
        centre = phantom.volumes[pieces] @ phantom.piece_centroids[pieces] / volume
        unit = "m²" if supports.fixed.shape[1] == 2 else "m³"
        raise UnsupportedBodyError(
            f"a piece of {volume:.3g} {unit} around {np.round(centre, 6).tolist()} is not "
            "held: it can move as a rigid body; support it, or do not cut it off"
        )


def loose_bodies(phantom: PhantomMesh, supports: Supports, bodies: Ints) -> Ints:
    """Those of the given free bodies, by number (k,), that can move rigidly."""
    points, scale = phantom.node_points, phantom.mesh.extent
    found = []
    for body in bodies:
        nodes = np.flatnonzero(phantom.bodies == body)
        modes = _rigid_modes((points[nodes] - points[nodes].mean(axis=0)) / scale)
        held = modes[supports.fixed[nodes]]
        size = np.linalg.norm(modes.reshape(-1, modes.shape[-1]), axis=0)
        gram = (held / size).T @ (held / size)
        if len(held) == 0 or np.linalg.eigvalsh(gram)[0] < _LOOSE:
            found.append(body)
    return np.array(found, dtype=np.int64)


def _rigid_modes(points: Floats) -> Floats:
    """(k, d, modes) translations and infinitesimal rotations at points (k, d)."""
    count, dim = points.shape
    shifts = np.broadcast_to(np.eye(dim), (count, dim, dim))
    return np.concatenate([shifts, np.einsum("aij,kj->kia", SPINS[dim], points)], axis=2)
