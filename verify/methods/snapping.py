"""Cutting by snapping: nodes move onto the cut and are doubled there; no cell is split.

Nienhuys & van der Stappen, *A surgery simulation supporting cuts and finite element
deformation*, MICCAI 2001: faces of the mesh are chosen that follow the cut, their nodes are
repositioned onto it, and the mesh is opened along them.
"""

from collections.abc import Sequence
from time import perf_counter

from verify.methods.cut_body import CutBody, make_body
from verify.methods.snapped_mesh import snap_nodes, take_near_nodes
from verify.methods.whole_cells import whole_cells
from verify.xfem.cuts import Cut
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import cut_mesh


def snapping(mesh: SimplexMesh, cuts: Sequence[Cut], quality: float = 0.2) -> CutBody:
    """Snap the nearer end of every crossed edge onto the cut, and open the mesh there.

    Parameters
    ----------
    mesh : SimplexMesh
    cuts : sequence of Cut
        An end inside an element goes back to the edges that are crossed before it.
    quality : float
        A node goes only as far as every cell keeps this share of its volume. Where it cannot reach
        the cut, the cut goes through the node: reported as "taken as on it", with the distance.
    """
    start = perf_counter()
    snapped = take_near_nodes(snap_nodes(mesh, cuts, 0.5, quality), 0.5)
    moved = perf_counter()
    phantom = cut_mesh(snapped.mesh, snapped.cuts)
    assert len(phantom.cells) == len(mesh.cells)  # every crossed edge has an end on the cut
    phantom = whole_cells(phantom)
    seconds = {"snapping": moved - start, "cutting": perf_counter() - moved}
    return make_body(mesh, phantom, tuple(snapped.changes), seconds=seconds)
