"""Sub-simplices and contacts of cut-cell parts, against slower ways that share no code."""

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from verify.xfem.cuts import Plane
from verify.xfem.join import join_parts
from verify.xfem.pieces import split_cells
from verify.xfem.structured_meshes import box_mesh, rectangle_mesh


@pytest.mark.parametrize("dim", [2, 3])
def test_parts_share_dof_nodes_where_points_of_a_common_face_lie_in_both(dim) -> None:
    rng = np.random.default_rng(dim)
    mesh = rectangle_mesh((4, 4)) if dim == 2 else box_mesh((2, 2, 2))
    for _ in range(6):
        cuts = [Plane(rng.uniform(0.3, 0.7, dim), rng.normal(size=dim)) for _ in range(5 - dim)]
        partition = split_cells(mesh, cuts)
        joined = join_parts(mesh, partition, partition.fraction > 0.0)
        cell = joined.cells[joined.piece_cell]
        label = np.zeros((len(cell), len(cuts)), dtype=int)
        label[: len(partition.label)] = partition.label
        slots = np.arange(joined.group.size).reshape(joined.group.shape)
        pairs = []
        for here, opposite in np.argwhere(mesh.neighbours > np.arange(len(mesh.cells))[:, None]):
            there = mesh.neighbours[here, opposite]
            nodes = np.delete(mesh.cells[here], opposite)
            # many of them near corners and edges, where contacts may be small
            weights = rng.dirichlet(np.full(dim, 0.3), 4000)
            at = weights @ partition.points.values[nodes]
            for side in np.unique(np.sign(at), axis=0):
                fits = ((label == 0) | (label == side)).all(axis=1)
                touching = [slots[fits & (cell == one)] for one in (here, there)]
                assert all(len(found) <= 1 for found in touching)
                if all(len(found) for found in touching):  # both are cells of the patch
                    pairs += [
                        [
                            found[0, mesh.cells[one] == node].item()
                            for found, one in zip(touching, (here, there), strict=True)
                        ]
                        for node in nodes
                    ]
        row, column = np.transpose(pairs)
        graph = coo_array((np.ones(len(row)), (row, column)), shape=(slots.size, slots.size))
        count, part = connected_components(graph, directed=False)
        # each sampled contact is one of the joins, and there are no others
        assert count == joined.group.max() + 1
        assert len(np.unique(np.stack([part, joined.group.ravel()]), axis=1).T) == count
