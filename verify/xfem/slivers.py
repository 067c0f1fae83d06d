"""Policies for slivers: pieces with a small share in the volume of their cell.

Scaling by nodal blocks, which the iterative solver does anyway, bounds the condition number
whatever the slivers. What it does not cure is the compliance of a piece that hangs on a tiny share
of an element (like 1/ε in space under a force on it) and that such a piece inverts in motion. Two
policies do:

"drop"
    Its sibling across the cut absorbs it (`verify.xfem.absorption`): the realised cut
    moves to the nearest element faces. The halves stay separate, because no unknowns are joined.
    A sliver that holds together parts of the body that nothing else does is kept.
"merge"
    Cell aggregation (`verify.xfem.aggregation`): nodes that only slivers use follow the
    linear field of a root cell on their own side of the cut, u = C û. Everything stays in its
    place, every part of the body stays one of its own. A sliver that reaches no root is kept.

Ghost penalties are another remedy, see `verify.xfem.ghost_penalty`; measurements in
``docs/theory/slivers.md``.

A speck is a loose part of a thousandth of an element across: cuts that should meet in a point miss
it by a little, and enclose a part that nothing holds. That is no material that anybody meant to cut
out: it moves with the largest piece of its element, and is counted (`join_specks`).
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, identity
from scipy.sparse.csgraph import connected_components

from verify.xfem.absorption import absorb
from verify.xfem.aggregation import aggregate
from verify.xfem.contacts import face_contacts, sibling_contacts
from verify.xfem.errors import XfemError
from verify.xfem.supports import Supports, loose_bodies
from verify.xfem.virtual import VirtualMesh

__all__ = [
    "DEFAULT_POLICY",
    "DEFAULT_THRESHOLD",
    "SliverPolicy",
    "SliverReport",
    "Specks",
    "join_specks",
    "treat_slivers",
]

SliverPolicy = Literal["keep", "drop", "merge"]

DEFAULT_POLICY: SliverPolicy = "merge"
DEFAULT_THRESHOLD = 0.1

# Size across over that of an element, below which a loose part is a speck. Its volume is below the
# power d of this, which changes the energy of a body by less than a solution is accurate to.
_ACROSS = 1e-3

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]
_Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class SliverReport:
    """What was done to slivers.

    Attributes
    ----------
    policy : {"keep", "drop", "merge"}
    threshold : float
        Volume fraction below which a piece is a sliver.
    dropped : int
        Slivers that the sibling across the cut absorbed.
    aggregated : int
        Slivers with a node that follows a root cell.
    kept : int
        Slivers that were left alone: all with "keep"; those that hold parts together with "drop";
        with "merge" those whose nodes all belong to larger pieces too, to a support, or to no root.
    rootless : int
        Of those kept by "merge", slivers with a node of their own that reaches no root cell.
    largest : float
        Largest volume fraction, in its cell, of a dropped or aggregated sliver.
    volume_share : float
        Volume of all dropped or aggregated slivers over that of the body.
    extension : (N_old, N) csr_array
        Unknowns before the policy from those after it; its transpose carries nodal forces.
    node : (N_old,) int array
        Unknown after the policy of each one before, −1 if it is gone.
    """

    policy: SliverPolicy
    threshold: float
    dropped: int
    aggregated: int
    kept: int
    rootless: int
    largest: float
    volume_share: float
    extension: csr_array
    node: _Ints


def treat_slivers(
    virtual: VirtualMesh,
    policy: SliverPolicy = DEFAULT_POLICY,
    threshold: float = DEFAULT_THRESHOLD,
    held: _Bools | None = None,
) -> tuple[VirtualMesh, SliverReport]:
    """Apply a sliver policy to a cut mesh.

    Parameters
    ----------
    virtual : VirtualMesh
    policy : {"keep", "drop", "merge"}
    threshold : float
        Volume fraction in (0, ½) below which a piece is a sliver.
    held : (N,) bool array, optional
        Unknown nodes that a support is going to hold. Aggregation leaves them their unknown, so
        that a prescribed value is what they have; elsewhere a root decides.

    Raises
    ------
    XfemError
        If the policy is unknown, the threshold outside its bounds, or `held` of another body.
    """
    if policy not in ("keep", "drop", "merge"):
        raise XfemError(f"sliver policy '{policy}'; expected keep, drop or merge")
    if not (isinstance(threshold, float | np.floating) and 0.0 < threshold < 0.5):
        raise XfemError(f"sliver threshold {threshold!r}; expected a volume fraction in (0, 0.5)")
    virtual = virtual.corners
    kept_nodes = np.zeros(virtual.node_count, dtype=bool) if held is None else np.asarray(held)
    if kept_nodes.shape != (virtual.node_count,) or kept_nodes.dtype != bool:
        raise XfemError(
            f"held nodes: {kept_nodes.dtype} array of shape {kept_nodes.shape}; expected bool and "
            f"({virtual.node_count},)"
        )
    small = virtual.part_fraction < threshold
    # a cell of many pieces keeps its largest one whatever its size
    largest = np.isin(virtual.part, virtual.part[_largest_siblings(virtual)])
    small[largest] = False
    nothing = np.zeros_like(small)
    treated, dropped, following, rootless = virtual, nothing, nothing, nothing
    extension, node = csr_array(identity(virtual.node_count)), np.arange(virtual.node_count)
    if policy == "drop" and small.any():
        dropped = small & ~_bridges(virtual, small)
        treated, extension, node = absorb(virtual, _siblings(virtual, dropped))
    elif policy == "merge" and small.any():
        treated, roots = aggregate(virtual, small, kept_nodes)
        following, rootless = roots.following, roots.rootless
        if treated.aggregation is not None:
            extension, node = treated.aggregation.extension, treated.aggregation.node
    changed = dropped | following
    return treated, SliverReport(
        policy=policy,
        threshold=threshold,
        dropped=int(dropped.sum()),
        aggregated=int(following.sum()),
        kept=int((small & ~changed).sum()),
        rootless=int((rootless & ~following).sum()),
        largest=float(virtual.fraction[changed].max(initial=0.0)),
        volume_share=float(virtual.volumes[changed].sum() / virtual.volumes.sum()),
        extension=extension,
        node=node,
    )


def _bridges(virtual: VirtualMesh, small: _Bools) -> _Bools:
    """Which small pieces hold parts of the body together; the whole body only if need be."""
    suspects = _torn(face_contacts(virtual, near=True), small)
    return _torn(face_contacts(virtual), small) if suspects.any() else suspects


def _torn(contacts: tuple[_Ints, _Ints], removed: _Bools) -> _Bools:
    """Which of the removed pieces (p,) hold together several remaining parts, across faces.

    Removed pieces in contact count as one, and parts that touch in a node or an edge only as
    apart: they could turn about it.
    """
    first, second = contacts
    same = removed[first] == removed[second]
    ones = np.ones(int(same.sum()), dtype=np.int8)
    graph = coo_array((ones, (first[same], second[same])), shape=(len(removed), len(removed)))
    part = connected_components(graph, directed=False)[1]
    inner = np.where(removed[first], first, second)[~same]
    outer = np.where(removed[first], second, first)[~same]
    touched = np.unique(np.stack([part[inner], part[outer]]), axis=1)[0]
    several = np.bincount(touched, minlength=part.max(initial=0) + 1) > 1
    torn: _Bools = removed & several[part]
    return torn


def _largest_siblings(virtual: VirtualMesh) -> _Ints:
    """Return the largest piece of each cell."""
    parent, fraction = virtual.parent, virtual.part_fraction
    most = np.maximum.reduceat(fraction, np.flatnonzero(np.diff(parent, prepend=-1)))
    candidates = np.flatnonzero(fraction == most[parent])
    largest: _Ints = candidates[np.diff(parent[candidates], append=-1) != 0]
    return largest


def _siblings(virtual: VirtualMesh, small: _Bools) -> _Ints:
    """(p,) the sibling that absorbs each small piece: among the larger ones, most in contact."""
    largest = np.full(len(virtual.mesh.cells), -1)
    best = _largest_siblings(virtual)
    largest[virtual.parent[best]] = best
    into = np.arange(len(small))
    into[small] = largest[virtual.parent[small]]
    first, second, area = sibling_contacts(virtual, virtual.parent[small])
    share = virtual.part_fraction
    upward = small[first] & (share[second] > share[first])
    first, second, area = virtual.part[first[upward]], second[upward], area[upward]
    pairs, back = np.unique(np.stack([first, second]), axis=1, return_inverse=True)
    total = np.bincount(back.ravel(), area, minlength=pairs.shape[1])
    order = np.lexsort([total, pairs[0]])
    last = np.diff(pairs[0][order], append=-1) != 0
    into[pairs[0][order[last]]] = pairs[1][order[last]]
    into[small] = into[virtual.part[small]]
    return _followed_to_the_end(into)


def _followed_to_the_end(into: _Ints) -> _Ints:
    while True:
        further = into[into]
        if np.array_equal(further, into):
            return into
        into = further


@dataclass(frozen=True)
class Specks:
    """Specks that were joined to their neighbours.

    Attributes
    ----------
    count : int
    largest : float
        Volume of the largest over that of its elements.
    """

    count: int
    largest: float


def join_specks(virtual: VirtualMesh, supports: Supports) -> tuple[VirtualMesh, Specks]:
    """Join loose parts of less than a thousandth of an element across to the pieces beside them.

    Parameters
    ----------
    virtual : VirtualMesh
        Before a sliver policy.
    supports : Supports
        Of its unknowns: a part that they hold is left alone.

    Returns
    -------
    virtual : VirtualMesh
        The same object if there is no speck.
    specks : Specks
    """
    body = virtual.bodies[virtual.cells[:, 0]]
    share = np.bincount(body, virtual.fraction)
    small = np.flatnonzero(share <= _ACROSS**virtual.mesh.dim)
    specks = loose_bodies(virtual, supports, small)
    if not len(specks):
        return virtual, Specks(0, 0.0)
    is_speck = np.isin(body, specks)
    # the largest piece of each cell comes first; it is no speck, as fractions add up to one
    order = np.lexsort([-virtual.fraction, virtual.parent])
    first = order[np.diff(virtual.parent[order], prepend=-1) != 0]
    largest = np.empty(len(virtual.mesh.cells), dtype=np.int64)
    largest[virtual.parent[first]] = first
    into = np.arange(len(body))
    into[is_speck] = largest[virtual.parent[is_speck]]
    return absorb(virtual, into)[0], Specks(len(specks), float(share[specks].max()))
