"""Policies for slivers: pieces with a small share in the volume of their cell.

Scaling by nodal blocks, which the iterative solver does anyway, bounds the condition number
whatever the slivers. What it does not cure is the compliance of a piece that hangs on a tiny share
of an element (like 1/ε in space under a force on it) and that such a piece inverts in motion. Two
policies do:

"drop"
    Its sibling across the cut absorbs it (`verify.xfem.slivers.absorption`): the realised cut
    moves to the nearest element faces. The halves stay separate, because no unknowns are joined.
    A sliver that holds together parts of the body that nothing else does is kept.
"merge"
    Cell aggregation (`verify.xfem.slivers.aggregation`): nodes that only slivers use follow the
    linear field of a root cell on their own side of the cut, u = C û. Everything stays in its
    place, every part of the body stays one of its own. A sliver that reaches no root is kept.

Ghost penalties are another remedy, see `verify.xfem.slivers.ghost_penalty`; measurements in
``docs/theory/slivers.md``.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, identity

from verify.xfem.errors import XfemError
from verify.xfem.slivers.absorption import absorb
from verify.xfem.slivers.aggregation import aggregate
from verify.xfem.slivers.piece_contacts import Bridges, face_contacts, sibling_contacts
from verify.xfem.virtual import VirtualMesh

__all__ = ["DEFAULT_POLICY", "DEFAULT_THRESHOLD", "SliverPolicy", "SliverReport", "treat_slivers"]

SliverPolicy = Literal["keep", "drop", "merge"]

DEFAULT_POLICY: SliverPolicy = "merge"
DEFAULT_THRESHOLD = 0.1

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
        dropped = small & ~_bridges(virtual, face_contacts(virtual, near=True), small)
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


def _bridges(virtual: VirtualMesh, contacts: tuple[_Ints, _Ints], small: _Bools) -> _Bools:
    """Which small pieces hold parts of the body together; the whole body only if need be."""
    suspects = Bridges(virtual, contacts).among(small)
    if not suspects.any():
        return suspects
    return Bridges(virtual, face_contacts(virtual)).among(small)


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
