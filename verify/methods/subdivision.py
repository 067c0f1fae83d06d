"""Cutting by subdivision: cells are split into simplices along the cut, slivers and all.

The template that splits a simplex by a plane, with the same diagonals on both sides of every
quadrilateral face, is that of `verify.xfem.clip` (by ascending node number; nodes
are numbered by their coordinates first, so that their numbers as given do not matter). Bielser,
Glardon, Teschner & Gross, *A state machine for real-time cutting of tetrahedral meshes*, Graphical
Models 66 (2004); with snapping of near nodes before it: Nienhuys & van der Stappen 2001,
Steinemann, Harders, Gross & Szekely, *Hybrid cutting of deformable solids*, IEEE VR 2006, and in
the plane SOFA's incision of triangles.
"""

from collections.abc import Sequence
from time import perf_counter

import numpy as np

from verify.methods.cut_body import Change, CutBody, make_body
from verify.methods.opening import OpenedMesh, conforming_to, facets_without_twin
from verify.methods.snapping import NodalCut, SnappedMesh, snap_nodes, take_near_nodes
from verify.methods.tip_nodes import add_tip_points
from verify.xfem.crossing import TipRule
from verify.xfem.cuts import Cut
from verify.xfem.errors import XfemError
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import cut_mesh
from verify.xfem.subdivision import subdivide

# Share of an edge below which a crossing is taken as at its end. A tetrahedron with two corners
# as near to the cut as that still has 1e-12 of its cell, above what counts as degenerate.
_NEAR = 1e-6


def subdivision(mesh: SimplexMesh, cuts: Sequence[Cut], tip: TipRule = "inside") -> CutBody:
    """Split all cut cells into simplices that conform to the cut; nodes doubled along it.

    Parameters
    ----------
    mesh : SimplexMesh
        A solid or a membrane.
    cuts : sequence of Cut
    tip : {"inside", "through", "nearest"}
        Treatment of cells in which a cut ends. An end of an open polyline in the plane needs
        none: it becomes a node, and the split ends there.

    Raises
    ------
    XfemError
        If a part is too flat for a finite element: two cuts nearer to each other than round-off
        bears.
    """
    start = perf_counter()
    tipped, origin = add_tip_points(mesh, cuts)
    uncut = SnappedMesh(tipped, NodalCut.on(tipped, cuts), _added(mesh, tipped))
    snapped = take_near_nodes(uncut, _NEAR)
    return _split(mesh, snapped, tip, origin, {"snapping": perf_counter() - start})


def snapping_subdivision(
    mesh: SimplexMesh,
    cuts: Sequence[Cut],
    tip: TipRule = "inside",
    threshold: float = 0.2,
    quality: float = 0.2,
) -> CutBody:
    """Snap nodes that are near the cut onto it, then split what the cut still goes through.

    Parameters
    ----------
    mesh : SimplexMesh
        Triangles in the plane or tetrahedra.
    cuts : sequence of Cut
    tip : {"inside", "through", "nearest"}
        As in `subdivision`.
    threshold : float
        Share of a crossed edge, in (0, ½]: nodes nearer to the crossing are snapped.
    quality : float
        A node is snapped only if every cell keeps this share of its volume.
    """
    start = perf_counter()
    tipped, origin = add_tip_points(mesh, cuts)
    snapped = take_near_nodes(snap_nodes(tipped, cuts, threshold, quality, "wholly"), _NEAR)
    snapped.changes.extend(_added(mesh, tipped))
    return _split(mesh, snapped, tip, origin, {"snapping": perf_counter() - start})


def _added(mesh: SimplexMesh, tipped: SimplexMesh) -> list[Change]:
    count = len(tipped.points) - len(mesh.points)
    return [Change("end of a cut made a node", count, 0.0, "m")]


def _split(
    mesh: SimplexMesh, snapped: SnappedMesh, tip: TipRule, origin: np.ndarray, seconds: dict
) -> CutBody:
    start = perf_counter()
    placed, cuts = _by_place(snapped)
    parts = subdivide(cut_mesh(placed, cuts, tip))
    try:
        outer = facets_without_twin(parts.points, parts.cells)
    except XfemError as error:
        raise XfemError(f"subdivision along these cuts leaves no valid mesh: {error}") from None
    opened = OpenedMesh(parts.points, parts.cells, outer)
    phantom = cut_mesh(opened, [])
    seconds["cutting"] = perf_counter() - start
    parents = origin[parts.cell_parent]
    return make_body(
        mesh,
        phantom,
        tuple(snapped.changes),
        conforming=conforming_to(opened, parents, parts.cut_facets),
        cell_origin=parents,
        seconds=seconds,
    )


def _by_place(snapped: SnappedMesh) -> tuple[SimplexMesh, list[NodalCut]]:
    """Nodes numbered by their coordinates: the template's diagonals follow node numbers."""
    order = np.lexsort(snapped.mesh.points.T)
    number = np.empty_like(order)
    number[order] = np.arange(len(order))
    mesh = SimplexMesh(snapped.mesh.points[order], number[snapped.mesh.cells])
    return mesh, [NodalCut(cut.cut, mesh.points, cut.values[order]) for cut in snapped.cuts]
