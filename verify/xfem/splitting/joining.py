"""Unknowns that pieces share: identity by contact across faces, not by sign vectors.

A *slot* is a piece together with a node of its cell. Two slots at one node are the same unknown
when the pieces, in cells that share a face with that node, touch across the face, in an area (2D:
a length): what touches in a corner or an edge only is apart, as parts that turn about a hinge are
no body, and a piece without volume joins nothing. Tips, mouths, parallel, crossing and branching
cuts, cuts through nodes and along faces all follow from this one rule (formulation: "one set of
node values per piece of material connected inside the element").
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.xfem.mesh import SimplexMesh
from verify.xfem.splitting.clipping import staircase
from verify.xfem.splitting.joining_kernels import (
    join_across_faces,
    join_tied,
    number_groups,
    patch_around,
)
from verify.xfem.splitting.partition import Partition

__all__ = ["PatchSlots", "join_slots"]

_Ints = NDArray[np.int64]


@dataclass(frozen=True)
class PatchSlots:
    """Slots of all cells around the nodes of split cells.

    Attributes
    ----------
    cells : (c,) int array
        The cells of the patch, ascending.
    piece_cell : (p,) int array
        Place in `cells` of each piece of the patch: the pieces of the partition first, then the
        cells that are not split.
    group : (p, d + 1) int array
        Connected component of each slot.
    """

    cells: _Ints
    piece_cell: _Ints
    group: _Ints


def join_slots(mesh: SimplexMesh, partition: Partition, solid: NDArray[np.bool_]) -> PatchSlots:
    """Join the slots of tied pieces, and of all that touch, around the nodes of split cells.

    Parameters
    ----------
    mesh : SimplexMesh
    partition : Partition
    solid : (q,) bool array
        Pieces that have a volume; the others join nothing.
    """
    patch, place, piece_cell, starts, pieces = patch_around(
        partition.parent, mesh.cells, len(mesh.points)
    )
    # the slots of a group are a tree: each slot knows a smaller one, the first itself
    towards = np.arange(len(piece_cell) * (mesh.dim + 1))
    join_tied(partition.tied, mesh.dim + 1, towards)
    begin = 0
    while begin < len(patch):
        points = partition.points
        begin, asked = join_across_faces(
            begin,
            patch,
            mesh.cells,
            mesh.neighbours,
            place,
            starts,
            pieces,
            partition.label,
            solid,
            points.values,
            staircase(mesh.dim),
            points.table,
            towards,
        )
        # regions of a face may have edges that no sub-simplex has: their points are found now
        for cut, plus, minus in asked:
            points.find(int(cut), np.array([plus]), np.array([minus]))
    return PatchSlots(patch, piece_cell, number_groups(towards).reshape(-1, mesh.dim + 1))
