"""State of a body that is cut while it moves, and the tie forces behind the cut.

The parts of a piece start with the motion of that piece. Every new dof node takes over the value of
the dof node that the same corner had before: a = 0 and ȧ = 0 in the terms of the thesis. The field
does not change, so energy and momenta do not either.

Where cells are aggregated the inherited field is not in the space: nodes that follow a root cell
from now on move to where it puts them. The velocity is the nearest one in the norm of the mass, so
that every part keeps its momenta; displacements of the other nodes stay. Kinetic energy is lost and
strain energy changes, as the field of the slivers differed from the root's.

The cut *releases* an old dof node that becomes several new ones. Each new one gets a *tie force*
r_i = M_i a + f_int + f_visc − f_ext, with the acceleration a of before; it is a dead force. So no
acceleration jumps; Σ r_i = 0, as the old node was in balance. The force fades with a factor from 1
to 0 and takes the energy that the cut sets free (Menouillard & Belytschko, Int. J. Numer. Meth.
Engng 81, 2010, for nodes of a mesh). Its couple δ × r turns a body; that is accounted for. Without
it (a factor of 0) the energy stays as waves of the length of an element.

In aggregated cells all this holds for the corners, u = C û, and Cᵀr acts on the dof nodes. Forces
by which slivers follow their roots, and penalty forces, act on all parts of a node together. They
are no part of r: they change with the space, not by the cut.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.xfem.aggregation import AggregatedMass
from verify.xfem.arrays import Bools, Floats, Ints, XfemError
from verify.xfem.body import DynamicBody, MotionState, check_state
from verify.xfem.mesh import cells_at
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
    own, mass = new.node_corner, body.mass
    moment = mass.aggregation.restriction @ mass.of_corners.apply(velocity)
    velocity = body.free_mass.solve(moment, np.where(body.fixed, velocity[own], 0.0))
    return MotionState(displacement[own], velocity, state.time)


def ancestors(old: PhantomMesh, new: PhantomMesh) -> Ints:
    """Find the corner of the old body from which each corner (N_corners,) of the new one comes.

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
    """Find the piece (p,) of the old body of which each new piece is a part."""
    piece, found = _fitting(old, new.parent, new.label[:, :cuts])
    if not found.all():
        # a cut that opens earlier elsewhere may open later here: what it leaves whole of a piece is
        # on one side of those that were open before, and no longer divided by them
        rows = np.flatnonzero(~found)
        sides = np.where(new.label == 0, _sides(new), new.label)[rows, :cuts]
        piece[rows], found[rows] = _fitting(old, new.parent[rows], sides)
    if not found.all():
        where = int(new.parent[np.argmin(found)])
        raise XfemError(f"a piece of cell {where} is no part of any piece of the old body")
    return piece


def _fitting(old: PhantomMesh, parent: Ints, sides: NDArray[Any]) -> tuple[Ints, Bools]:
    """Find for parts (q,) of cells the old piece on the same sides (q, cuts), and if there is."""
    starts = np.searchsorted(old.parent, np.arange(len(old.mesh.cells) + 1))
    counts = np.diff(starts)
    piece = starts[parent]
    found = counts[parent] == 1
    for k in range(counts.max(initial=0)):
        # among several, the one that lies on the same side of every cut that made it
        candidate = np.minimum(starts[parent] + k, len(old.parent) - 1)
        valid = (k < counts[parent]) & ~found
        label = old.label[candidate]
        fits = ((label == 0) | (label == sides)).all(axis=1)
        piece = np.where(valid & fits, candidate, piece)
        found |= valid & fits
    return piece, found


def _sides(phantom: PhantomMesh) -> Ints:
    """Tell on which side (p, cuts) of each cut, ±1, the most of each piece lies."""
    piece, barycentric, volume = phantom.solid_simplices
    nodes = phantom.mesh.cells[phantom.parent[piece]]
    middle = np.einsum("sn,snc->sc", barycentric.mean(axis=1), phantom.level_sets[nodes])
    above = np.zeros(phantom.label.shape)
    np.add.at(above, piece, volume[:, None] * np.sign(middle))
    return np.where(above >= 0.0, 1, -1)


@dataclass(frozen=True)
class Release:
    """Tie forces of one release.

    Attributes
    ----------
    nodes : (k,) int array
        Corners: dof nodes where no cells are aggregated.
    forces : (k, d) float array
        At the release, in newtons.
    factor : callable
        Factors (k,) at a time, from 1 to 0.
    cut : (k,) int array
        Number of the cut that has released each.
    spread : float
        Share of the largest force that was spread over the parts of a node, so that they sum up
        to zero: by this accelerations jump.
    """

    nodes: Ints
    forces: Floats
    factor: Callable[[float], Floats]
    cut: Ints
    spread: float = 0.0

    def handed_on(self, source: Ints, weights: Floats, time: float) -> "Release | None":
        """Carry these forces over to a body that is cut further; None if none is left.

        The parts of a node share its force in proportion to masses. Any shares would do: the
        release of the node itself is found with these forces in place.

        Parameters
        ----------
        source : (N,) int array
            Old dof node of each new one.
        weights : (N,) float array
            Masses of the new ones.
        time : float
            In s.
        """
        left = self.factor(time) > 0.0
        if not left.any():
            return None
        place = np.full(int(source.max(initial=-1)) + 1, -1)
        place[self.nodes[left]] = np.flatnonzero(left)
        nodes = np.flatnonzero(place[source] >= 0)
        row = place[source[nodes]]
        share = weights[nodes] / np.bincount(row, weights[nodes], len(left))[row]
        forces = share[:, None] * self.forces[row]
        factor = _Rows(self.factor, row)
        if isinstance(self.factor, _Rows):
            factor = _Rows(self.factor.factor, self.factor.row[row])
        return Release(nodes, forces, factor, self.cut[row])


@dataclass(frozen=True)
class _Rows:
    """Some of the factors, in any order."""

    factor: Callable[[float], Floats]
    row: Ints

    def __call__(self, time: float) -> Floats:
        return self.factor(time)[self.row]


@dataclass(frozen=True)
class TieForces:
    """Forces (N, d) of all that is being released, at a time.

    Attributes
    ----------
    phantom : PhantomMesh
        Whose dof nodes they act on.
    releases : tuple of Release
    """

    phantom: PhantomMesh
    releases: tuple[Release, ...]

    def __call__(self, time: float) -> Floats:
        """Sum the forces at a time."""
        total = np.zeros((self.phantom.corners.node_count, self.phantom.mesh.space))
        for one in self.releases:
            total[one.nodes] += one.factor(time)[:, None] * one.forces
        return self.phantom.restrict(total)

    def still(self, time: float) -> "TieForces | None":
        """Keep the releases whose forces act at a time or later; None if none does."""
        releases = tuple(one for one in self.releases if one.factor(time).any())
        if len(releases) == len(self.releases):
            return self
        return TieForces(self.phantom, releases) if releases else None

    def work_by_cut(self, change: Floats, time: float, cuts: int) -> Floats:
        """Work (cuts,) in J that the forces of each cut take, as they are at a time.

        Parameters
        ----------
        change : (N, d) float array
            Of the displacement, m.
        time : float
            In s.
        cuts : int
            Number of cuts.
        """
        taken, change = np.zeros(cuts), self.phantom.extend(change)
        for one in self.releases:
            done = (change[one.nodes] * one.forces).sum(axis=1)
            taken -= np.bincount(one.cut, one.factor(time) * done, cuts)
        return taken


def acceleration_at_corners(body: DynamicBody, state: MotionState) -> Floats:
    """Return the acceleration (N_corners, d) of a body at its corners, of supports where held."""
    found = body.free_mass.solve(-_resisting(body, state), body.held_acceleration(state.time))
    return body.force.phantom.extend(found)


def tie_forces(
    old: DynamicBody,
    state: MotionState,
    acceleration: Floats,
    new: DynamicBody,
    source: Ints,
    fading: Callable[[Ints, float], Callable[[float], Floats]],
    parting: Callable[[PhantomMesh, Ints, Ints], Ints],
) -> TieForces | None:
    """Find the tie forces of nodes that a further cut has released.

    Parameters
    ----------
    old : DynamicBody
        Of unknowns at all corners; its tie forces are handed on.
    state : MotionState
        Of it.
    acceleration : (N_old, d) float array
        `acceleration_at_corners` of it.
    new : DynamicBody
        Of unknowns at all corners, without tie forces yet.
    source : (N,) int array
        Old corner of each new one.
    fading : callable
        Given some new corners and the time, makes the factors of the forces that hold them.
    parting : callable
        Given the new mesh, some of its corners and the old ones that they were: the number of the
        cut that has parted each; `parting_cuts` or what does the same.

    Returns
    -------
    TieForces or None
        All that still hold the new body.
    """
    time, weights, phantom = state.time, new.mass.weights, new.force.phantom
    before = old.tie.releases if isinstance(old.tie, TieForces) else ()
    kept = [one.handed_on(source, weights, time) for one in before]
    releases = tuple(one for one in kept if one is not None)
    nodes = np.flatnonzero(np.bincount(source, minlength=old.shape[0])[source] > 1)
    if len(nodes):
        inherited = MotionState(state.displacement[source], state.velocity[source], time)
        forces = new.mass.apply(acceleration[source]) + _resisting(new.near(nodes), inherited)
        forces -= TieForces(phantom, releases)(time)
        spread = _balance(forces, nodes, source, new.fixed | old.fixed[source], weights)
        forces[new.fixed] = 0.0
        cut = parting(phantom, nodes, source[nodes])
        releases += (Release(nodes, forces[nodes], fading(nodes, time), cut, spread),)
    return TieForces(phantom, releases) if releases else None


def _balance(forces: Floats, nodes: Ints, source: Ints, held: Bools, weights: Floats) -> float:
    """Make the forces (N, d) on the parts of each node sum to zero; parts share by their mass.

    The sum is round-off in general. Exceptions: loads or masses (EVS, GEVS) that are shared out
    anew, as at hooks; slivers that follow others or are penalised. Supported components are left
    out. Return the largest that is spread, as a share of the largest force.
    """
    largest, most = float(np.abs(forces[nodes]).max(initial=0.0)), 0.0
    number = np.unique(source[nodes], return_inverse=True)[1]
    share = weights[nodes] / np.bincount(number, weights[nodes])[number]
    for axis in range(forces.shape[1]):
        total = np.bincount(number, forces[nodes, axis])
        total[np.bincount(number, held[nodes, axis]) > 0.0] = 0.0
        forces[nodes, axis] -= share * total[number]
        most = max(most, float(np.abs(total).max(initial=0.0)))
    return most / largest if largest > 0.0 else 0.0


def parting_cuts(phantom: PhantomMesh, nodes: Ints, parent: Ints) -> Ints:
    """Find the first cut (k,) that has some pieces of a parent's nodes on one side, others beyond.

    Where several cuts part them only together it is the first that any piece lies beside.
    """
    row = np.full(phantom.node_count, -1)
    row[nodes] = np.arange(len(nodes))
    some = cells_at(phantom.cells, row >= 0)
    at, label = row[phantom.cells[some]], phantom.label[some]
    piece, corner = np.nonzero(at >= 0)
    number = np.unique(parent, return_inverse=True)[1]
    found, parts = np.zeros(len(nodes), dtype=np.int64), np.zeros(len(nodes), dtype=bool)
    for cut in reversed(range(label.shape[1])):
        there = [np.zeros(len(nodes), dtype=bool) for _ in range(2)]
        for side, here in zip((1, -1), there, strict=True):
            here[at[piece, corner][label[piece, cut] == side]] = True
        above, below = there[0] & ~there[1], there[1] & ~there[0]
        apart = (np.bincount(number, above) > 0) & (np.bincount(number, below) > 0)
        beside = np.bincount(number, there[0] | there[1]) > 0
        first = apart[number] | beside[number] & ~parts
        found[first], parts = cut, parts | apart[number]
    return found


def _resisting(body: DynamicBody, state: MotionState) -> Floats:
    """Sum internal and viscous less external forces (N, d) of a state."""
    at = body.force.configuration(state.displacement)
    internal, _ = body.force.evaluate_at(at)
    return internal + body.viscous(state.velocity, at) - body.external(state.time)
