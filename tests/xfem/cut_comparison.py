"""Two cut meshes are the same up to the numbering of pieces and unknowns."""

import numpy as np

from verify.xfem.phantom import PhantomMesh


def _parts(phantom: PhantomMesh):
    """Cell, sides, volume fraction and unknowns of parts: pieces that no cut keeps apart are one.

    A cut that has gone on since may have ended in a cell, with others, and divided it further.
    """
    first, number = np.unique(phantom.part, return_inverse=True)
    least, most = (np.full((len(first), phantom.label.shape[1]), k, np.int8) for k in (9, -9))
    np.minimum.at(least, number, phantom.label)
    np.maximum.at(most, number, phantom.label)
    label = np.where(least == most, least, 0)
    order = np.lexsort([*label.T, phantom.parent[first]])
    share = phantom.part_fraction[first]
    return phantom.parent[first][order], label[order], share[order], phantom.cells[first][order]


def assert_same_cut(first: PhantomMesh, second: PhantomMesh) -> None:
    """Same parts (cell and sides), same volumes, and a one-to-one map between the unknowns."""
    (parent, label, share, cells), other = _parts(first), _parts(second)
    np.testing.assert_array_equal(parent, other[0])
    np.testing.assert_array_equal(label, other[1])
    # both are sums of the same positive products, in another order
    np.testing.assert_allclose(share, other[2], rtol=1e-13)
    assert first.node_count == second.node_count
    pairs = np.unique(np.stack([cells.ravel(), other[3].ravel()]), axis=1)
    assert len(pairs[0]) == first.node_count
    for column in pairs:
        assert len(np.unique(column)) == first.node_count
    np.testing.assert_array_equal(first.node_parent[pairs[0]], second.node_parent[pairs[1]])
    np.testing.assert_array_equal(first.node_side[pairs[0]], second.node_side[pairs[1]])
