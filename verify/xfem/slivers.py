"""Policies for slivers: pieces with a small share in the volume of their cell.

Scaling by nodal blocks, which the iterative solver does anyway, bounds the condition number
whatever the slivers. It does not cure the compliance of a piece attached by a tiny share ε of an
element, in space like 1/ε. Nor does it keep such a piece from inverting in motion. Two policies do:

"drop"
    Its sibling across the cut absorbs it (`verify.xfem.contacts`): the realised cut
    moves to the nearest element faces. The halves stay separate, because no unknowns are joined.
    A sliver that holds together parts of the body that nothing else does is kept.
"merge"
    Cell aggregation (`verify.xfem.aggregation`): nodes that only slivers use follow the linear
    field of a root cell on their own side of the cut, u = C û. Everything stays in its place, and
    parts of the body stay apart. A sliver that reaches no root is kept.

Ghost penalties are another remedy, see `verify.xfem.ghost_penalty`; measurements in
``docs/theory/slivers.md``.

A fragment is a loose part of less than a thousandth of an element across: cuts that should meet in
a point miss it by a little, and enclose a part without support. Nobody meant to cut it out: it
moves with the largest piece of its element, and is counted (`join_fragments`).
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.sparse import csr_array, identity

from verify.xfem.aggregation import aggregate
from verify.xfem.arrays import Bools, Ints, XfemError, check_choice
from verify.xfem.contacts import absorb, face_contacts, sibling_contacts
from verify.xfem.loads_and_supports import Supports, loose_bodies
from verify.xfem.mesh import connected
from verify.xfem.phantom import PhantomMesh

SliverPolicy = Literal["keep", "drop", "merge"]

DEFAULT_POLICY: SliverPolicy = "merge"
DEFAULT_THRESHOLD = 0.1

# Size across over the size of an element, below which a loose part is a fragment. Its volume is
# below the power d of this share, which changes the energy by less than the error of a solution.
_ACROSS = 1e-3


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
        Volume of all dropped or aggregated slivers over the volume of the body.
    extension : (N_old, N) csr_array
        Unknowns before the policy from unknowns after it; its transpose carries nodal forces.
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
    node: Ints


def treat_slivers(
    phantom: PhantomMesh,
    policy: SliverPolicy = DEFAULT_POLICY,
    threshold: float = DEFAULT_THRESHOLD,
    supported: Bools | None = None,
) -> tuple[PhantomMesh, SliverReport]:
    """Apply a sliver policy to a cut mesh.

    Parameters
    ----------
    phantom : PhantomMesh
        If it has been aggregated, it is treated anew, from its corners.
    policy : {"keep", "drop", "merge"}
    threshold : float
        Volume fraction in (0, ½) below which a piece is a sliver.
    supported : (N,) bool array, optional
        Dof nodes that a support is going to hold. Aggregation leaves them their unknown, so that
        they take their prescribed value.

    Returns
    -------
    treated : PhantomMesh
    report : SliverReport

    Raises
    ------
    XfemError
        If the policy is unknown, the threshold outside its bounds, or `supported` of another body.

    Examples
    --------
    >>> import verify.xfem as xfem
    >>> cut = xfem.Plane([0.501, 0.0], [1.0, 0.0])
    >>> phantom = xfem.cut_mesh(xfem.rectangle_mesh((4, 4)), [cut])
    >>> treated, report = xfem.treat_slivers(phantom)
    >>> report.policy, report.aggregated, phantom.node_count - treated.node_count
    ('merge', 8, 5)
    """
    check_choice(policy, SliverPolicy, "sliver policy")
    if not (isinstance(threshold, float | np.floating) and 0.0 < threshold < 0.5):
        raise XfemError(f"sliver threshold {threshold!r}; expected a volume fraction in (0, 0.5)")
    phantom = phantom.corners
    kept_nodes = (
        np.zeros(phantom.node_count, dtype=bool) if supported is None else np.asarray(supported)
    )
    if kept_nodes.shape != (phantom.node_count,) or kept_nodes.dtype != bool:
        raise XfemError(
            f"supported nodes: {kept_nodes.dtype} array of shape {kept_nodes.shape}; expected "
            f"bool and ({phantom.node_count},)"
        )
    small = phantom.part_fraction < threshold
    # a cell of many pieces keeps its largest one whatever its size
    largest = np.isin(phantom.part, phantom.part[_largest_siblings(phantom)])
    small[largest] = False
    nothing = np.zeros_like(small)
    treated, dropped, following, rootless = phantom, nothing, nothing, nothing
    extension, node = csr_array(identity(phantom.node_count)), np.arange(phantom.node_count)
    if policy == "drop" and small.any():
        dropped = small & ~_bridges(phantom, small)
        treated, extension, node = absorb(phantom, _siblings(phantom, dropped))
    elif policy == "merge" and small.any():
        treated, following, rootless = aggregate(phantom, small, kept_nodes)
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
        largest=float(phantom.fraction[changed].max(initial=0.0)),
        volume_share=float(phantom.volumes[changed].sum() / phantom.volumes.sum()),
        extension=extension,
        node=node,
    )


def _bridges(phantom: PhantomMesh, small: Bools) -> Bools:
    """Tell which small pieces hold parts of the body together; the whole body only if need be."""
    suspects = _torn(face_contacts(phantom, near=True), small)
    return _torn(face_contacts(phantom), small) if suspects.any() else suspects


def _torn(contacts: tuple[Ints, Ints], removed: Bools) -> Bools:
    """Tell which of the removed pieces (p,) hold together several remaining parts, across faces.

    Removed pieces in contact count as one, and parts that touch in a node or an edge only as
    apart: they could turn about it.
    """
    first, second = contacts
    same = removed[first] == removed[second]
    part = connected(len(removed), first[same], second[same])
    inner = np.where(removed[first], first, second)[~same]
    outer = np.where(removed[first], second, first)[~same]
    touched = np.unique(np.stack([part[inner], part[outer]]), axis=1)[0]
    several = np.bincount(touched, minlength=part.max(initial=0) + 1) > 1
    torn: Bools = removed & several[part]
    return torn


def _largest_siblings(phantom: PhantomMesh) -> Ints:
    """Return the largest piece of each cell."""
    parent, fraction = phantom.parent, phantom.part_fraction
    most = np.maximum.reduceat(fraction, np.flatnonzero(np.diff(parent, prepend=-1)))
    candidates = np.flatnonzero(fraction == most[parent])
    largest: Ints = candidates[np.diff(parent[candidates], append=-1) != 0]
    return largest


def _siblings(phantom: PhantomMesh, small: Bools) -> Ints:
    """Choose the sibling (p,) that absorbs each small piece: a larger one, most in contact."""
    largest = np.full(len(phantom.mesh.cells), -1)
    best = _largest_siblings(phantom)
    largest[phantom.parent[best]] = best
    into = np.arange(len(small))
    into[small] = largest[phantom.parent[small]]
    first, second, area = sibling_contacts(phantom, phantom.parent[small])
    share = phantom.part_fraction
    upward = small[first] & (share[second] > share[first])
    first, second, area = phantom.part[first[upward]], second[upward], area[upward]
    pairs, back = np.unique(np.stack([first, second]), axis=1, return_inverse=True)
    total = np.bincount(back.ravel(), area, minlength=pairs.shape[1])
    order = np.lexsort([total, pairs[0]])
    last = np.diff(pairs[0][order], append=-1) != 0
    into[pairs[0][order[last]]] = pairs[1][order[last]]
    into[small] = into[phantom.part[small]]
    while not np.array_equal(further := into[into], into):
        into = further
    return into


@dataclass(frozen=True)
class Fragments:
    """Fragments that were joined to their neighbours.

    Attributes
    ----------
    count : int
    largest : float
        Volume of the largest over the volume of its elements.
    """

    count: int
    largest: float


def join_fragments(phantom: PhantomMesh, supports: Supports) -> tuple[PhantomMesh, Fragments]:
    """Join loose parts of less than a thousandth of an element across to the pieces beside them.

    Parameters
    ----------
    phantom : PhantomMesh
        Before a sliver policy.
    supports : Supports
        Of its unknowns: a part that they hold is left alone.

    Returns
    -------
    phantom : PhantomMesh
        The same object if there is no fragment.
    fragments : Fragments
    """
    body = phantom.bodies[phantom.cells[:, 0]]
    share = np.bincount(body, phantom.fraction)
    small = np.flatnonzero(share <= _ACROSS**phantom.mesh.dim)
    fragments = loose_bodies(phantom, supports, small)
    if not len(fragments):
        return phantom, Fragments(0, 0.0)
    is_fragment = np.isin(body, fragments)
    # the largest piece of each cell comes first; it is no fragment, as fractions add up to one
    order = np.lexsort([-phantom.fraction, phantom.parent])
    first = order[np.diff(phantom.parent[order], prepend=-1) != 0]
    largest = np.empty(len(phantom.mesh.cells), dtype=np.int64)
    largest[phantom.parent[first]] = first
    into = np.arange(len(body))
    into[is_fragment] = largest[phantom.parent[is_fragment]]
    return absorb(phantom, into)[0], Fragments(len(fragments), float(share[fragments].max()))
