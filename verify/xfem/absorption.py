"""A cut mesh in which some pieces are absorbed by siblings, pieces of the same cell.

A piece that is absorbed moves with its sibling: the realised cut moves to the faces of the cell.
The result is a cut mesh like any other.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from verify.xfem.phantom import PhantomMesh

_Ints = NDArray[np.int64]


def absorb(phantom: PhantomMesh, into: _Ints) -> tuple[PhantomMesh, csr_array, _Ints]:
    """Let pieces absorb siblings.

    Parameters
    ----------
    phantom : PhantomMesh
    into : (p,) int array
        Piece that absorbs each piece; itself if it stays. A piece that absorbs must stay.

    Returns
    -------
    treated : PhantomMesh
    extension : (N, N_new) csr_array
        Old unknowns from the new ones: those that are gone follow what has absorbed theirs. Its
        transpose carries nodal forces the other way.
    node : (N,) int array
        New number of each old dof node, −1 if only absorbed pieces used it.

    Raises
    ------
    ValueError
        If a piece is to be absorbed by one that does not stay, or by one of another cell.
    """
    if not np.array_equal(into[into], into):
        raise ValueError("a piece is absorbed by one that does not stay")
    if not np.array_equal(phantom.parent[into], phantom.parent):
        raise ValueError("a piece is absorbed by one of another cell")
    stays = into == np.arange(len(into))
    number = np.cumsum(stays) - 1
    used = np.zeros(phantom.node_count, dtype=bool)
    used[phantom.cells[stays]] = True
    node_parent, node, old_of_new = renumber(phantom, used)
    gone = np.flatnonzero(~stays)
    fraction = phantom.fraction.copy()
    np.add.at(fraction, into[gone], phantom.fraction[gone])
    sub = phantom.sub_cells
    treated = replace(
        phantom,
        cells=node[phantom.cells[stays]],
        parent=phantom.parent[stays],
        fraction=fraction[stays],
        label=phantom.label[stays],
        node_parent=node_parent,
        node_side=phantom.node_side[old_of_new],
        sub_cells=replace(sub, piece=number[into[sub.piece]]),
    )
    return treated, _extension(phantom, into, node, len(node_parent)), node


def renumber(phantom: PhantomMesh, used: NDArray[np.bool_]) -> tuple[_Ints, _Ints, _Ints]:
    """Mesh node of each new unknown; new number of each old one, -1 if not used; old of new.

    Each mesh node must keep an unknown; the first of them takes the node's number.
    """
    kept = np.flatnonzero(used)
    parent = phantom.node_parent[kept]
    order = np.argsort(parent, kind="stable")
    kept, parent = kept[order], parent[order]
    first = np.diff(parent, prepend=-1) != 0
    nodes = len(phantom.mesh.points)
    node = np.full(phantom.node_count, -1)
    node[kept[first]] = parent[first]
    node[kept[~first]] = nodes + np.arange(int((~first).sum()))
    old_of_new = np.empty(len(kept), dtype=np.int64)
    old_of_new[node[kept]] = kept
    return np.concatenate([np.arange(nodes), parent[~first]]), node, old_of_new


def _extension(phantom: PhantomMesh, into: _Ints, node: _Ints, count: int) -> csr_array:
    kept = np.flatnonzero(node >= 0)
    gone = np.flatnonzero(into != np.arange(len(into)))
    row, corner = np.nonzero(node[phantom.cells[gone]] < 0)
    lost = phantom.cells[gone][row, corner]
    # an unknown that several absorbed pieces used takes the mean of what they follow
    share = 1.0 / np.bincount(lost, minlength=len(node))[lost]
    columns = node[phantom.cells[into[gone]][row, corner]]
    return csr_array(
        (
            np.concatenate([np.ones(len(kept)), share]),
            (np.concatenate([kept, lost]), np.concatenate([node[kept], columns])),
        ),
        shape=(len(node), count),
    )
