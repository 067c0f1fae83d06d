"""What to do with slivers: pieces with a small share in the volume of their cell.

Scaling by nodal blocks, which the iterative solver does anyway, bounds the condition number
whatever the slivers. What it does not cure is the compliance of a piece that hangs on a tiny share
of an element (like 1/ε in space under a force on it) and that such a piece inverts in motion. Two
policies do, both by letting a larger piece absorb the sliver (`verify.xfem.slivers.absorption`):

"drop"
    Its sibling across the cut absorbs it: the realised cut moves to the nearest element faces.
    The halves stay separate, because no unknowns are joined.
"merge"
    The neighbour on its own side of the cut absorbs it (cell agglomeration): the realised cut
    stays, the displacement of the sliver is the neighbour's, continued. A sliver without such a
    neighbour is a body of its own, and is dropped.

A sliver that holds together parts of the body that nothing else does is kept, and counted. Ghost
penalties are another remedy, see `verify.xfem.slivers.ghost_penalty`; measurements in
``docs/xfem-slivers.md``.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from verify.xfem.errors import XfemError
from verify.xfem.slivers.absorption import Absorption, absorb
from verify.xfem.slivers.piece_contacts import Bridges, face_contacts, sibling_contacts
from verify.xfem.virtual import VirtualMesh

__all__ = ["DEFAULT_POLICY", "DEFAULT_THRESHOLD", "SliverPolicy", "SliverReport", "treat_slivers"]

SliverPolicy = Literal["keep", "drop", "merge"]

DEFAULT_POLICY: SliverPolicy = "merge"
DEFAULT_THRESHOLD = 0.1

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]


@dataclass(frozen=True)
class SliverReport:
    """What was done to slivers.

    Attributes
    ----------
    policy : {"keep", "drop", "merge"}
    threshold : float
        Volume fraction below which a piece is a sliver.
    dropped, merged : int
        Slivers that the sibling across the cut, or the neighbour on the same side, absorbed.
    kept : int
        Slivers that were left alone: all with "keep", else those that hold parts together.
    largest : float
        Largest volume fraction, in its cell, of an absorbed sliver.
    volume_share : float
        Volume of all absorbed slivers over that of the body.
    absorption : Absorption
        Where pieces and unknowns went.
    """

    policy: SliverPolicy
    threshold: float
    dropped: int
    merged: int
    kept: int
    largest: float
    volume_share: float
    absorption: Absorption


def treat_slivers(
    virtual: VirtualMesh,
    policy: SliverPolicy = DEFAULT_POLICY,
    threshold: float = DEFAULT_THRESHOLD,
) -> tuple[VirtualMesh, SliverReport]:
    """Apply a sliver policy to a cut mesh.

    Parameters
    ----------
    virtual : VirtualMesh
    policy : {"keep", "drop", "merge"}
    threshold : float
        Volume fraction in (0, ½) below which a piece is a sliver.

    Raises
    ------
    XfemError
        If the policy is unknown or the threshold outside its bounds.
    """
    if policy not in ("keep", "drop", "merge"):
        raise XfemError(f"sliver policy '{policy}'; expected keep, drop or merge")
    if not (isinstance(threshold, float | np.floating) and 0.0 < threshold < 0.5):
        raise XfemError(f"sliver threshold {threshold!r}; expected a volume fraction in (0, 0.5)")
    small = virtual.fraction < threshold
    # a cell of many pieces keeps its largest one whatever its size
    small[_largest_siblings(virtual)] = False
    into = np.arange(len(virtual.cells))
    crosswise = np.zeros(len(into), dtype=bool)
    if policy != "keep" and small.any():
        contacts = face_contacts(virtual, near=True)
        absorbed = small & ~_bridges(virtual, contacts, small)
        if policy == "merge":
            into = _neighbours(virtual, contacts, absorbed)
        crosswise = absorbed & (into == np.arange(len(into)))
        into[crosswise] = _siblings(virtual, crosswise)[crosswise]
        into = _roots(into)  # a sibling may itself have gone to its neighbour
    gone = into != np.arange(len(into))
    treated, absorption = absorb(virtual, into)
    return treated, SliverReport(
        policy=policy,
        threshold=threshold,
        dropped=int(crosswise.sum()),
        merged=int((gone & ~crosswise).sum()),
        kept=int((small & ~gone).sum()),
        largest=float(virtual.fraction[gone].max(initial=0.0)),
        volume_share=float(virtual.volumes[gone].sum() / virtual.volumes.sum()),
        absorption=absorption,
    )


def _bridges(
    virtual: VirtualMesh, contacts: tuple[_Ints, _Ints], small: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Which small pieces hold parts of the body together; the whole body only if need be."""
    suspects = Bridges(virtual, contacts).among(small)
    if not suspects.any():
        return suspects
    return Bridges(virtual, face_contacts(virtual)).among(small)


def _largest_siblings(virtual: VirtualMesh) -> _Ints:
    """Return the largest piece of each cell."""
    parent, fraction = virtual.parent, virtual.fraction
    most = np.maximum.reduceat(fraction, np.flatnonzero(np.diff(parent, prepend=-1)))
    candidates = np.flatnonzero(fraction == most[parent])
    largest: _Ints = candidates[np.diff(parent[candidates], append=-1) != 0]
    return largest


def _siblings(virtual: VirtualMesh, small: NDArray[np.bool_]) -> _Ints:
    """(p,) the sibling that absorbs each small piece: among the larger ones, most in contact."""
    largest = np.full(len(virtual.mesh.cells), -1)
    best = _largest_siblings(virtual)
    largest[virtual.parent[best]] = best
    into = np.arange(len(small))
    into[small] = largest[virtual.parent[small]]
    first, second, area = sibling_contacts(virtual, virtual.parent[small])
    upward = small[first] & (virtual.fraction[second] > virtual.fraction[first])
    first, second, area = first[upward], second[upward], area[upward]
    pairs, back = np.unique(np.stack([first, second]), axis=1, return_inverse=True)
    total = np.bincount(back.ravel(), area, minlength=pairs.shape[1])
    order = np.lexsort([total, pairs[0]])
    last = np.diff(pairs[0][order], append=-1) != 0
    into[pairs[0][order[last]]] = pairs[1][order[last]]
    return into


def _neighbours(
    virtual: VirtualMesh, contacts: tuple[_Ints, _Ints], small: NDArray[np.bool_]
) -> _Ints:
    """(p,) the neighbour that absorbs each small piece: the largest, layer by layer inwards."""
    first, second = np.concatenate(contacts), np.concatenate(contacts[::-1])
    into = np.arange(len(small))
    open_ = small.copy()
    while True:
        meets = open_[first] & ~open_[second]
        one, other = first[meets], second[meets]
        if len(one) == 0:
            return into
        order = np.lexsort([virtual.volumes[other], one])
        last = np.diff(one[order], append=-1) != 0
        into[one[order[last]]] = other[order[last]]
        open_[one] = False


def _roots(into: _Ints) -> _Ints:
    """Follow chains to their ends."""
    while True:
        further = into[into]
        if np.array_equal(further, into):
            return into
        into = further
