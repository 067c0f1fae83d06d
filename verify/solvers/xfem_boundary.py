"""The boundary of a cut body, as supports and tractions need it."""

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.scene import Scene
from verify.scene.parts import on_part
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import PhantomMesh

__all__ = ["boundary_nodes", "facet_parts", "facets_on", "own_corners"]

_Ints = NDArray[np.int64]


def boundary_nodes(mesh: SimplexMesh) -> _Ints:
    """Nodes of the boundary of the uncut mesh, ascending."""
    cells, opposite = mesh.boundary_facets.T
    on_facet = np.ones((len(cells), mesh.dim + 1), dtype=bool)
    on_facet[np.arange(len(cells)), opposite] = False
    return np.unique(mesh.cells[cells][on_facet])


def facets_on(scene: Scene, mesh: SimplexMesh, where: str, key: str) -> _Ints:
    """Boundary facets (k, 2), as cell and opposite node, whose nodes all lie on a part.

    Raises
    ------
    InputError
        If there is none.
    """
    nodes = boundary_nodes(mesh)
    mark = np.zeros(len(mesh.points), dtype=bool)
    mark[nodes[on_part(scene, where, mesh.points[nodes], key)]] = True
    facets = mesh.boundary_facets
    inside = mark[mesh.cells[facets[:, 0]]]
    inside[np.arange(len(facets)), facets[:, 1]] = True
    chosen: _Ints = facets[inside.all(axis=1)]
    if not len(chosen):
        raise InputError(f"{key}: no boundary facet lies in '{where}'", str(scene.file or ""))
    return chosen


def own_corners(phantom: PhantomMesh) -> NDArray[np.bool_]:
    """(N,) whether the node of an unknown lies in the material that the unknown moves.

    Behind a cut it does not: the unknown belongs to a node that is beyond.
    """
    piece, barycentric, _ = phantom.solid_simplices
    own = np.zeros(phantom.corners.node_count, dtype=bool)
    simplex, vertex = np.nonzero(barycentric.max(axis=2) == 1.0)
    own[phantom.cells[piece[simplex], barycentric[simplex, vertex].argmax(axis=1)]] = True
    return own[phantom.node_corner]


def facet_parts(phantom: PhantomMesh) -> tuple[_Ints, NDArray[np.float64]]:
    """Boundary facets, of those that are cut the parts, each for every unknown that moves it.

    Returns
    -------
    unknowns : (k,) int array
        Dof nodes at the nodes of a facet, on the side of the part; nodes that follow a root
        cell have none.
    points : (k, space) array
        Centroid of the part, m.
    """
    mesh = phantom.mesh
    piece, in_cell, _ = phantom.solid_simplices
    facets = mesh.boundary_facets
    outer = np.zeros(len(mesh.cells), dtype=bool)
    outer[facets[:, 0]] = True
    mine = outer[phantom.parent[piece]]
    piece, cell, in_cell = piece[mine], phantom.parent[piece[mine]], in_cell[mine]
    unknowns, points = [], []
    corners = mesh.dim + 1
    for local in range(corners):
        wanted = np.zeros(len(mesh.cells), dtype=bool)
        wanted[facets[facets[:, 1] == local, 0]] = True
        here = np.flatnonzero(wanted[cell])
        rest = [k for k in range(corners) if k != local]
        for opposite in range(corners):
            side = [k for k in range(corners) if k != opposite]
            on_facet = here[(in_cell[here][:, side, local] == 0.0).all(axis=1)]
            middle = in_cell[on_facet][:, side].mean(axis=1)
            nodes = mesh.points[mesh.cells[cell[on_facet]]]
            centroid = np.einsum("ki,kij->kj", middle, nodes)
            unknowns.append(phantom.cells[piece[on_facet]][:, rest].ravel())
            points.append(np.repeat(centroid, mesh.dim, axis=0))
    node = phantom.corner_node[np.concatenate(unknowns)]
    return node[node >= 0], np.concatenate(points)[node >= 0]
