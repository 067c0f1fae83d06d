"""Contacts of pieces, across faces of the mesh and inside a cell, and absorption by siblings.

Siblings are pieces of the same cell. A piece that one absorbs moves with it: the realised cut moves
to the faces of the cell. The result is a cut mesh like any other.
"""

from dataclasses import replace
from math import factorial

import numpy as np
from scipy.sparse import csr_array, triu

from verify.xfem.arrays import Bools, Floats, Ints
from verify.xfem.clip import facets_between
from verify.xfem.mesh import connected, equal_rows, facets_of
from verify.xfem.phantom import PhantomMesh


def face_contacts(phantom: PhantomMesh, near: bool = False) -> tuple[Ints, Ints]:
    """Find pairs of pieces (k,), (k,), of neighbouring cells, that share all dof nodes of a face.

    Parameters
    ----------
    phantom : PhantomMesh
    near : bool
        Leave out cells that have no node in common with a split one.
    """
    mesh, parent = phantom.mesh, phantom.parent
    pieces = np.arange(len(parent))
    if near:
        around = np.zeros(len(mesh.points), dtype=bool)
        around[mesh.cells[parent[phantom.split]]] = True
        pieces = np.flatnonzero(around[mesh.cells[parent]].any(axis=1))
    facets = np.sort(facets_of(phantom.cells[pieces]), axis=1)
    facet = connected(len(facets), *equal_rows(facets))
    starts = np.arange(len(pieces) + 1) * phantom.cells.shape[1]
    has = csr_array((np.ones(len(facet)), facet, starts), shape=(len(pieces), len(facets)))
    # not two by two: pieces that are one part have all their faces in common
    both = triu(has @ has.T, 1).tocoo()
    first, second = pieces[both.row], pieces[both.col]
    apart = parent[first] != parent[second]
    return first[apart], second[apart]


def sibling_contacts(phantom: PhantomMesh, cells: Ints) -> tuple[Ints, Ints, Floats]:
    """Find pairs of pieces (k,), (k,) in given cells, and the area (k,) of the cut between them.

    Each pair comes in both orders, and once for each facet of sub-simplices that they have in
    common; its area is in m^(d − 1).
    Pieces with a piece without volume between them do not appear.
    """
    sub = phantom.sub_cells
    wanted = np.zeros(len(phantom.mesh.cells), dtype=bool)
    wanted[cells] = True
    rows = np.flatnonzero(wanted[phantom.parent[sub.piece]])
    facets, first, second = facets_between(phantom.parent, sub.piece[rows], sub.points[rows])
    at = sub.zero_points.positions[facets]
    edges = at[:, 1:] - at[:, :1]
    # A = √det(E Eᵀ)/(d − 1)! with the edges E of the facet
    area = np.sqrt(np.maximum(np.linalg.det(edges @ edges.transpose(0, 2, 1)), 0.0))
    area /= factorial(edges.shape[1])
    return np.concatenate([first, second]), np.concatenate([second, first]), np.tile(area, 2)


def absorb(phantom: PhantomMesh, into: Ints) -> tuple[PhantomMesh, csr_array, Ints]:
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
    node_parent, node = renumber(phantom, used)
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
        sub_cells=replace(sub, piece=number[into[sub.piece]]),
        # the cut has moved past nodes, but unknowns stay on their sides
        kept_side=phantom.node_side[np.argsort(node)[np.count_nonzero(node < 0) :]],
    )
    row, corner = np.nonzero(node[phantom.cells[gone]] < 0)
    lost = phantom.cells[gone][row, corner]
    # an unknown that several absorbed pieces used takes the mean of what they follow
    share = 1.0 / np.bincount(lost, minlength=len(node))[lost]
    columns = node[phantom.cells[into[gone]][row, corner]]
    return treated, extension_of(node, lost, columns[:, None], share), node


def renumber(phantom: PhantomMesh, used: Bools) -> tuple[Ints, Ints]:
    """Give the unknowns that stay, N of N_old, new numbers.

    Each mesh node must keep an unknown; the first of them takes the node's number.

    Parameters
    ----------
    phantom : PhantomMesh
    used : (N_old,) bool array

    Returns
    -------
    node_parent : (N,) int array
        Mesh node of each.
    node : (N_old,) int array
        New number of each old unknown, −1 if it goes.
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
    return np.concatenate([np.arange(nodes), parent[~first]]), node


def extension_of(node: Ints, rows: Ints, columns: Ints, weights: Floats) -> csr_array:
    """Map new unknowns to the old ones (N,), of which some are kept and some follow others.

    Parameters
    ----------
    node : (N,) int array
        New number of each old unknown, −1 if it follows others.
    rows : (k,) int array
        Unknowns that follow others.
    columns, weights : (k, m) array
        Which new ones, and with what weights; entries of weight zero are left out.
    """
    kept = np.flatnonzero(node >= 0)
    entries = np.concatenate([np.ones(len(kept)), weights.ravel()])
    of = np.concatenate([kept, np.repeat(rows, columns.shape[1])])
    places = of, np.concatenate([node[kept], columns.ravel()])
    extension = csr_array((entries, places), shape=(len(node), int(node.max()) + 1))
    extension.eliminate_zeros()
    return extension
