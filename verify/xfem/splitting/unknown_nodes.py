"""Numbers of the unknown nodes of a cut mesh, and on which side of the cuts each lies."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from verify.xfem.mesh import SimplexMesh
from verify.xfem.splitting.joining import PatchSlots
from verify.xfem.splitting.split import Partition

__all__ = ["node_sides", "number_groups"]

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]


def number_groups(
    mesh: SimplexMesh, partition: Partition, slots: PatchSlots, solid: NDArray[np.bool_]
) -> tuple[_Ints, _Ints]:
    """Mesh node (N,) of each unknown node, and the unknown node of each group of slots.

    The first unknown nodes are the nodes of the mesh, each with the material in which it lies.

    Parameters
    ----------
    mesh : SimplexMesh
    partition : Partition
    slots : PatchSlots
    solid : (p,) bool array
        Pieces that have a volume; groups without any get the number -1.
    """
    nodes = mesh.cells[slots.cells[slots.piece_cell]]
    pieces = len(partition.parent)
    alive = np.ones(len(nodes), dtype=bool)
    alive[:pieces] = solid
    groups = slots.group.max(initial=-1) + 1
    node_of = np.full(groups, -1)
    node_of[slots.group[alive]] = nodes[alive]

    # the material in which a node lies keeps the node's number
    home = np.ones(nodes.shape, dtype=bool)
    sign = np.where(partition.points.values[nodes[:pieces]] >= 0.0, 1, -1)
    label = partition.label[:, None, :]
    home[:pieces] = ((label == 0) | (label == sign)).all(axis=2)
    is_home = np.zeros(groups, dtype=bool)
    is_home[slots.group[home & alive[:, None]]] = True

    inner = np.zeros(len(mesh.points), dtype=bool)
    inner[mesh.cells[np.unique(partition.parent)]] = True
    used = np.flatnonzero(node_of >= 0)
    used = used[inner[node_of[used]]]
    used = used[np.lexsort([used, ~is_home[used], node_of[used]])]
    first = np.diff(node_of[used], prepend=-1) != 0
    number = np.full(groups, -1)
    number[used[first]] = node_of[used[first]]
    number[used[~first]] = len(mesh.points) + np.arange(int((~first).sum()))
    # around nodes that touch no split cell the patch is not complete, but nothing is cut either
    outer = np.flatnonzero((node_of >= 0) & ~inner[node_of])
    number[outer] = node_of[outer]
    return np.concatenate([np.arange(len(mesh.points)), node_of[used[~first]]]), number


def node_sides(values: _Floats, cells: _Ints, label: NDArray[np.int8]) -> NDArray[np.int8]:
    """Side (N, cuts) of each unknown: of its labelled pieces if they agree, else of its node.

    Parameters
    ----------
    values : (N, cuts) float array
        Level sets at the mesh nodes of the unknowns, in metres.
    cells : (p, d + 1) int array
        Unknown nodes of each piece.
    label : (p, cuts) int8 array
        Its sides, as in `VirtualMesh`.
    """
    side = np.zeros(values.shape, dtype=np.int8)
    _write_sides(values, cells, label, side)
    return side


@njit(cache=True)
def _write_sides(values, cells, label, side):
    disagreed = 2
    for p in range(len(cells)):
        for cut in range(label.shape[1]):
            if label[p, cut] == 0:
                continue
            for node in cells[p]:
                if side[node, cut] == 0:
                    side[node, cut] = label[p, cut]
                elif side[node, cut] != label[p, cut]:
                    side[node, cut] = disagreed
    for node in range(len(values)):
        for cut in range(label.shape[1]):
            if side[node, cut] == 0 or side[node, cut] == disagreed:
                side[node, cut] = 1 if values[node, cut] >= 0.0 else -1
