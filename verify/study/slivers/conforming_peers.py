"""The same cuts in meshes that conform to them: the peers of a method that cuts through cells.

"conforming"
    The cut cells are split, slivers and all: in the plane by the reference's own code, which
    shares nothing with the solver's, in space by subdivision.
"conforming snapped"
    Nodes within a quarter of a crossed edge are moved onto the cut first
    (`verify.methods.subdivision.snapping_subdivision`).
"snapped"
    Nodes are moved onto the cut and doubled there; no cell is split (`verify.methods.snapping`).
"""

from collections.abc import Sequence

import numpy as np

from reference.meshing import imprint, open_cut
from verify.methods.snapping import snapping
from verify.methods.subdivision import snapping_subdivision
from verify.xfem.cuts import Plane
from verify.xfem.mesh import SimplexMesh
from verify.xfem.subdivision import subdivide
from verify.xfem.virtual import VirtualMesh, cut_mesh

__all__ = ["PEERS", "conforming_peer"]

PEERS = ("conforming", "conforming snapped", "snapped")
_SNAP = 0.25  # of a crossed edge: nodes as near as that to the crossing are moved onto the cut
_ON = 1e-10  # edges: the mesh generator takes nodes as near as that to lie on the cut


def conforming_peer(mesh: SimplexMesh, cuts: Sequence[Plane], kind: str) -> VirtualMesh:
    """Return the body with its cuts opened in the mesh itself.

    Raises
    ------
    ValueError
        If there is no such kind or the mesh does not exist (a cell without volume, or the
        generator would make that of another cut).
    """
    if kind == "conforming":
        return cut_mesh(_split(mesh, cuts), [])
    if kind == "conforming snapped":
        return snapping_subdivision(mesh, cuts, threshold=_SNAP).virtual
    if kind == "snapped":
        return snapping(mesh, cuts).virtual
    raise ValueError(f"conforming mesh '{kind}'; expected one of {', '.join(PEERS)}")


def _split(mesh: SimplexMesh, cuts: Sequence[Plane]) -> SimplexMesh:
    if mesh.dim == 3:
        divided = subdivide(cut_mesh(mesh, cuts))
        return SimplexMesh(divided.points, divided.cells)
    _refuse_nearly_touching(mesh, cuts)
    opened = open_cut(*imprint(mesh.points, mesh.cells, [_line(cut) for cut in cuts]))
    return SimplexMesh(opened.points, opened.cells)


def _refuse_nearly_touching(mesh: SimplexMesh, cuts: Sequence[Plane]) -> None:
    """Nodes and points of other cuts that are near enough to be taken as on a cut, but are not."""
    places = np.concatenate([mesh.points, *(cut.point[None] for cut in cuts)])
    edge = np.linalg.norm(mesh.edge_vectors[0, 0])
    for cut in cuts:
        height = np.abs(cut.level_set(places)) / edge
        near = height[(height > 1e-4 * _ON) & (height <= _ON)]
        if near.size:
            raise ValueError(
                f"nodes, or another cut, lie {near.min():.1e} edges from a cut: the mesh generator "
                "takes them to lie on it, and makes a mesh of another cut"
            )


def _line(cut: Plane) -> np.ndarray:
    """(2, 2) points of the cut, both outside of the unit square."""
    along = np.array([-cut.normal[1], cut.normal[0]])
    return cut.point + np.outer([-2.0, 2.0], along)
