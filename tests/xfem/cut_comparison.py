"""Two cut meshes are the same up to the numbering of pieces and unknowns."""

import numpy as np

from verify.xfem.virtual import VirtualMesh

__all__ = ["assert_same_cut"]


def assert_same_cut(first: VirtualMesh, second: VirtualMesh) -> None:
    """Same pieces (cell and sides), same volumes, and a one-to-one map between the unknowns."""
    order = [np.lexsort([*v.label.T, v.parent]) for v in (first, second)]
    a, b = order
    np.testing.assert_array_equal(first.parent[a], second.parent[b])
    np.testing.assert_array_equal(first.label[a], second.label[b])
    # both are sums of the same positive products, in another order
    np.testing.assert_allclose(first.fraction[a], second.fraction[b], rtol=1e-13)
    assert first.node_count == second.node_count
    pairs = np.unique(np.stack([first.cells[a].ravel(), second.cells[b].ravel()]), axis=1)
    assert len(pairs[0]) == first.node_count
    for column in pairs:
        assert len(np.unique(column)) == first.node_count
    np.testing.assert_array_equal(first.node_parent[pairs[0]], second.node_parent[pairs[1]])
    np.testing.assert_array_equal(first.node_side[pairs[0]], second.node_side[pairs[1]])
