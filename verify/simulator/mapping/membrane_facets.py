"""The surface of a membrane: itself. A cut gives it two new rims, and no inner surface."""

import numpy as np

from verify.simulator.arrays.distinct import ranges
from verify.simulator.cutting.growing_body import GrowingBody
from verify.simulator.mapping.moving_surface import MovingSurface
from verify.xfem.arrays import Bools, Floats, Ints


def membrane_facets(body: GrowingBody, cells: Ints) -> tuple[Ints, Floats, Ints, Ints, Bools]:
    """Triangles of these elements: whole, or as the cuts have divided them.

    Returns for each, cell by cell: point numbers (q, 3), barycentric corners (q, 3, 3), piece,
    cell, and that it lies on no cut. They keep the direction of their element.
    """
    split = body.split_cells[cells]
    whole, divided = cells[~split], cells[split]
    of_cells = body.sub_range[divided]
    sub = ranges(of_cells)
    ids = np.concatenate([body.mesh.cells[whole], body.sub_points.rows[sub]])
    eye = np.broadcast_to(np.eye(3), (len(whole), 3, 3))
    at = np.concatenate([eye, body.sub_barycentric.rows[sub]])
    piece = np.concatenate([body.first_piece[whole], body.sub_piece.rows[sub]])
    cell = np.concatenate([whole, np.repeat(divided, of_cells[:, 1] - of_cells[:, 0])])
    turned = np.concatenate([np.zeros(len(whole), dtype=bool), body.sub_sign.rows[sub] < 0])
    ids[turned, :2] = ids[turned, 1::-1]
    at[turned, :2] = at[turned, 1::-1]
    order = np.argsort(cell, kind="stable")
    inner = np.zeros(len(cell), dtype=bool)
    return ids[order], at[order], piece[order], cell[order], inner


def rim_edges(body: GrowingBody, surface: MovingSurface) -> Ints:
    """Edges (k, 2) of a membrane's surface that a cut has made, along the facets' direction.

    Those are the edges of one facet only that do not lie on the edge of the uncut membrane. Costs
    what the whole surface does.
    """
    facets = surface.facets.rows[surface.used]
    edges = np.concatenate([facets[:, [0, 1]], facets[:, [1, 2]], facets[:, [2, 0]]])
    size = len(surface.material)
    keys, back = edges[:, 0] * size + edges[:, 1], edges[:, 1] * size + edges[:, 0]
    open_ = edges[~np.isin(keys, back)]
    return open_[~_on_outer_edge(body, surface, open_)]


def _on_outer_edge(body: GrowingBody, surface: MovingSurface, edges: Ints) -> Bools:
    """Whether an edge of the surface lies on an edge of the mesh that has one element only."""
    mesh = body.mesh
    nodes = np.where(
        surface.weights.rows[edges] != 0.0, body.node_parent.rows[surface.nodes.rows[edges]], -1
    ).reshape(len(edges), -1)
    ends = np.stack([np.where(nodes < 0, len(mesh.points), nodes).min(axis=1), nodes.max(axis=1)])
    along = ((nodes < 0) | (nodes == ends[0][:, None]) | (nodes == ends[1][:, None])).all(axis=1)
    cell, opposite = mesh.boundary_facets.T
    outer = np.sort(mesh.cells[cell[:, None], (opposite[:, None] + [1, 2]) % 3], axis=1)
    size = len(mesh.points)
    on_outer: Bools = along & np.isin(ends[0] * size + ends[1], outer @ [size, 1])
    return on_outer
