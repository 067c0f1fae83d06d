"""Two cut meshes are the same up to the numbering of pieces and unknowns."""

import numpy as np

from verify.xfem.phantom import PhantomMesh


def _parts(phantom: PhantomMesh, sides):
    """Cell, sides, volume fraction and unknowns of parts: pieces that no cut keeps apart are one.

    A cut that has gone on since may have ended in a cell, with others, and divided it further.
    """
    first, number = np.unique(phantom.part, return_inverse=True)
    least, most = (np.full((len(first), sides.shape[1]), k, sides.dtype) for k in (9, -9))
    np.minimum.at(least, number, sides)
    np.maximum.at(most, number, sides)
    label = np.where(least == most, least, 0)
    parent, share = phantom.parent[first], phantom.part_fraction[first]
    rows = np.lexsort([*label.T, parent])
    return parent[rows], label[rows], share[rows], phantom.cells[first][rows]


def same_cut(first: PhantomMesh, second: PhantomMesh, order=None, atol=0.0) -> bool:
    """Whether parts (cell and sides) and their volumes are the same, and unknowns one to one.

    The cuts of the second may be those of the first in another order: then it is not the same by
    which of them a cell is divided, but on which sides its parts are.
    """
    sides = [first.label, second.label]
    if order is not None:
        sides = [first.piece_side, second.piece_side[:, np.argsort(order)]]
    mine, other = (_parts(v, side) for v, side in zip((first, second), sides, strict=True))
    if not all(np.array_equal(a, b) for a, b in zip(mine[:2], other[:2], strict=True)):
        return False
    pairs = np.unique(np.stack([mine[3].ravel(), other[3].ravel()]), axis=1)
    one_to_one = all(len(np.unique(column)) == pairs.shape[1] for column in pairs)
    # both are sums of the same positive products, in another order
    return one_to_one and np.allclose(mine[2], other[2], rtol=1e-13, atol=atol)


def assert_same_cut(first: PhantomMesh, second: PhantomMesh) -> None:
    """Same parts, volumes and unknowns, each of the same node and side."""
    assert same_cut(first, second)
    assert first.node_count == second.node_count
    pairs = np.stack([_parts(one, one.label)[3].ravel() for one in (first, second)])
    np.testing.assert_array_equal(first.node_parent[pairs[0]], second.node_parent[pairs[1]])
    np.testing.assert_array_equal(first.node_side[pairs[0]], second.node_side[pairs[1]])
