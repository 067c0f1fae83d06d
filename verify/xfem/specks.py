"""Loose parts of a cut body that are as small as round-off.

Cuts that should meet in a point miss it by a little, and enclose a part that nothing holds. A part
of a thousandth of an element across is no material that anybody meant to cut out. It moves with the
largest piece of its element, and is counted.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.xfem.slivers.absorption import absorb
from verify.xfem.supports import Supports, loose_bodies
from verify.xfem.virtual import VirtualMesh

__all__ = ["Specks", "join_specks"]

_Floats = NDArray[np.float64]

# Size across over that of an element, below which a loose part is a speck. Its volume is below the
# power d of this, which changes the energy of a body by less than a solution is accurate to.
_ACROSS = 1e-3


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
