"""Inheritance of the state of a body that is cut while it moves.

The parts of a piece start with the motion of that piece: every new dof node takes over the
value of the dof node that the same corner had before (a = 0 and ȧ = 0 in the thesis' terms).
The field does not change, so energy and momenta do not either.

Where cells are aggregated the inherited field is not in the space: nodes that follow a root cell
from now on are where it puts them. The velocity is the nearest one in the mass, so that every part
keeps its momenta; displacements of the other nodes stay. Kinetic energy is lost, strain energy
changes, both by what the field of the slivers was off the root's.
"""

import numpy as np

from verify.xfem.aggregation import AggregatedMass
from verify.xfem.arrays import Ints
from verify.xfem.body import DynamicBody, MotionState, check_state
from verify.xfem.errors import XfemError
from verify.xfem.phantom import PhantomMesh


def inherit_state(
    old: PhantomMesh, new: PhantomMesh, state: MotionState, body: DynamicBody | None = None
) -> MotionState:
    """State of motion of a body that has been cut further.

    Parameters
    ----------
    old, new : PhantomMesh
        On the same uncut mesh; the cuts of the old one come first in the new one, and may have
        grown.
    state : MotionState
        Of the old body.
    body : DynamicBody, optional
        The new one; needed if cells of it are aggregated.

    Raises
    ------
    XfemError
        As `ancestors`, if the state is not one of the old body, or the body is missing or another.
    """
    check_state(state, old.node_points.shape)
    source = ancestors(old, new)
    displacement = old.extend(state.displacement)[source]
    velocity = old.extend(state.velocity)[source]
    if new.aggregation is None:
        return MotionState(displacement, velocity, state.time)
    if body is None or body.force.phantom is not new or not isinstance(body.mass, AggregatedMass):
        raise XfemError("state of a body with aggregated cells; expected that body with its mass")
    own = new.node_corner
    velocity = body.mass.project(velocity, body.fixed, velocity[own])
    return MotionState(displacement[own], velocity, state.time)


def ancestors(old: PhantomMesh, new: PhantomMesh) -> Ints:
    """Corner of the old body from which each corner (N_corners,) of the new one comes.

    Corners are dof nodes where no cells are aggregated.

    Raises
    ------
    XfemError
        If the meshes differ, or the new pieces are not parts of the old ones.
    """
    same = new.mesh is old.mesh or (
        np.array_equal(new.mesh.cells, old.mesh.cells)
        and np.array_equal(new.mesh.points, old.mesh.points)
    )
    cuts = old.label.shape[1]
    if not same or new.label.shape[1] < cuts:
        raise XfemError(
            "the new body is not the old one cut further: expected the same mesh, and the cuts of "
            "the old body before any others"
        )
    piece = _parts_of(old, new, cuts)
    source = np.full(new.corners.node_count, -1)
    source[new.cells] = old.cells[piece]
    if (source[new.cells] != old.cells[piece]).any():
        where = int(np.argmax((source[new.cells] != old.cells[piece]).any(axis=1)))
        raise XfemError(
            f"the parts of cell {int(new.parent[where])} join what the old body has separated"
        )
    return source


def _parts_of(old: PhantomMesh, new: PhantomMesh, cuts: int) -> Ints:
    """(p,) piece of the old body of which each new piece is a part."""
    starts = np.searchsorted(old.parent, np.arange(len(old.mesh.cells) + 1))
    counts = np.diff(starts)
    piece = starts[new.parent]
    found = counts[new.parent] == 1
    for k in range(counts.max(initial=0)):
        # among several, the one that lies on the same side of every cut that made it
        candidate = np.minimum(starts[new.parent] + k, len(old.parent) - 1)
        valid = (k < counts[new.parent]) & ~found
        label = old.label[candidate]
        fits = ((label == 0) | (label == new.label[:, :cuts])).all(axis=1)
        piece = np.where(valid & fits, candidate, piece)
        found |= valid & fits
    if not found.all():
        where = int(new.parent[np.argmin(found)])
        raise XfemError(f"a piece of cell {where} is no part of any piece of the old body")
    return piece
