"""Cost of a growing incision: unknowns and elements that each method adds.

In the plane a cut through n triangles in a row crosses n + 1 edges. XFEM (and virtual nodes)
enrich the n + 2 nodes of the strip, two fewer for each end inside the body, whose edge stays
closed; subdivision adds two nodes on each of the n + 1 edges, and one for each end.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.methods.catalogue import cut_by
from verify.methods.nodal_cut import NodalCut, crossed_edges
from verify.xfem.cuts import Cut, Polyline
from verify.xfem.errors import XfemError
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import cut_mesh

__all__ = ["IncisionCount", "count_incisions", "growing_incisions"]

_Floats = NDArray[np.float64]


@dataclass(frozen=True)
class IncisionCount:
    """Cost of one incision.

    Attributes
    ----------
    cut_cells : int
        Cells that the cut goes through.
    nodes : dict of str to int
        Nodes (displacement vectors) that each method adds; negative if it removes more. ``xfem``
        is the number of enrichments.
    elements : dict of str to int
        Elements that each method adds; of XFEM the pieces beyond one per cell.
    """

    cut_cells: int
    nodes: dict[str, int]
    elements: dict[str, int]


def growing_incisions(
    mesh: SimplexMesh, path: Polyline, cut_cells: Sequence[int]
) -> list[Polyline]:
    """Beginnings of a path that cut the given numbers of cells through.

    Parameters
    ----------
    mesh : SimplexMesh
        Triangles in the plane.
    path : Polyline
        Open.
    cut_cells : sequence of int
        Positive. Each beginning ends half way between two crossed edges. A path that passes
        through nodes, or curves so much that it crosses an edge twice, cuts a few cells less.

    Raises
    ------
    XfemError
        If the path is closed, or does not cut so many cells.
    """
    if path.closed or mesh.dim != 2 or mesh.space != 2:
        raise XfemError("an incision grows along an open path on triangles in the plane")
    edges = crossed_edges(mesh, NodalCut.on(mesh, [path])[0])
    ends = mesh.points[edges.plus], mesh.points[edges.minus]
    arcs = np.sort(_arc_lengths(path, ends[0] + edges.share[:, None] * (ends[1] - ends[0])))
    if min(cut_cells) < 1 or max(cut_cells) > len(arcs) - 1:
        raise XfemError(
            f"incisions of {min(cut_cells)} to {max(cut_cells)} cut cells; the path cuts "
            f"{len(arcs) - 1}"
        )
    whole = _vertex_arcs(path)[-1]
    stops = np.append(arcs, max(whole, arcs[-1]))
    return [_beginning(path, 0.5 * float(stops[n] + stops[n + 1])) for n in cut_cells]


def count_incisions(
    mesh: SimplexMesh, incisions: Sequence[Sequence[Cut]], methods: Sequence[str]
) -> list[IncisionCount]:
    """Count what each method adds for each set of cuts.

    Parameters
    ----------
    mesh : SimplexMesh
    incisions : sequence of sequence of Cut
    methods : sequence of str
        Names of `verify.methods.catalogue.METHODS`, or ``xfem``.
    """
    counts = []
    for cuts in incisions:
        phantom = cut_mesh(mesh, cuts)
        nodes, elements = {}, {}
        for method in methods:
            if method == "xfem":
                nodes[method] = phantom.node_count - len(mesh.points)
                elements[method] = len(phantom.cells) - len(mesh.cells)
                continue
            size = cut_by(method, mesh, cuts).counts
            nodes[method] = size.nodes - size.nodes_before
            elements[method] = size.elements - size.elements_before
        through = int((np.bincount(phantom.parent, minlength=len(mesh.cells)) > 1).sum())
        counts.append(IncisionCount(through, nodes, elements))
    return counts


def _vertex_arcs(path: Polyline) -> _Floats:
    lengths = np.linalg.norm(np.diff(path.vertices, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(lengths)])


def _arc_lengths(path: Polyline, points: _Floats) -> _Floats:
    """(k,) distance along the path to the foot of each point."""
    start, along = path.vertices[:-1], np.diff(path.vertices, axis=0)
    to_point = points[:, None] - start
    share = np.clip((to_point * along).sum(-1) / (along**2).sum(-1), 0.0, 1.0)
    distance = np.linalg.norm(to_point - share[..., None] * along, axis=-1)
    nearest, row = distance.argmin(axis=1), np.arange(len(points))
    arcs = _vertex_arcs(path)
    return arcs[nearest] + share[row, nearest] * np.diff(arcs)[nearest]


def _beginning(path: Polyline, length: float) -> Polyline:
    arcs = _vertex_arcs(path)
    last = int(np.searchsorted(arcs, length)) - 1
    last = min(max(last, 0), len(arcs) - 2)
    share = min((length - arcs[last]) / (arcs[last + 1] - arcs[last]), 1.0)
    end = path.vertices[last] + share * (path.vertices[last + 1] - path.vertices[last])
    return Polyline(np.concatenate([path.vertices[: last + 1], end[None]]))
