"""Opening times of the facets of a mesh that conforms to all cuts; meshes before and after."""

import numpy as np
from numpy.typing import NDArray

from reference.meshing import ConformingMesh, open_cut
from reference.space import ConformingSpace
from verify.errors import InputError
from verify.geometry.nearest import distance_to_pieces
from verify.scene import Scene, ToolPathCut

Array = NDArray[np.float64]


def opening_times(scene: Scene, mesh: ConformingMesh, delay: float = 0.0) -> Array:
    """Give the times (f,) from which on each of `mesh.cut_facets` is open, s.

    Those of a cut open with it. One on a tool path opens when the blade has passed all of it, the
    last of its corners. A facet belongs to the cut that it is closest to: one on a curved cut is
    off by its own sagitta, and cuts do not lie on each other.

    Parameters
    ----------
    scene : Scene
    mesh : ConformingMesh
        With all final cuts open.
    delay : float
        By which facets on tool paths open late, s.
    """
    corners = mesh.realised_cut
    places = np.concatenate([corners, corners.mean(axis=1, keepdims=True)], axis=1)
    points = places.reshape(-1, mesh.dimension)
    off = [
        distance_to_pieces(points, cut.pieces()).reshape(places.shape[:2]).max(axis=1)
        for cut in scene.final_cuts
    ]
    times = np.zeros(len(corners))
    for i, cut in enumerate(scene.cuts):
        mine = np.argmin(off, axis=0) == i
        if isinstance(cut, ToolPathCut):
            passed = cut.passed_at(corners[mine].reshape(-1, mesh.dimension))
            times[mine] = passed.reshape(corners[mine].shape[:2]).max(axis=1) + delay
        else:
            times[mine] = cut.opens_at
    return times


def partly_opened(mesh: ConformingMesh, opened: NDArray[np.bool_]) -> ConformingMesh:
    """Give a mesh with all cuts open again, with some facets open only; cells stay in order.

    Parameters
    ----------
    mesh : ConformingMesh
    opened : (f,) bool array
        Whether each of `mesh.cut_facets` is.
    """
    if opened.all():
        return mesh
    points = np.empty((int(mesh.parent.max()) + 1, mesh.dimension))
    points[mesh.parent] = mesh.points
    return open_cut(points, mesh.parent[mesh.cells], mesh.cut_facets[opened])


def inherit(closed: ConformingSpace, opened: ConformingSpace, field: Array) -> Array:
    """Carry nodal values (n, d) over to the same mesh with more of its cuts open.

    Every copy of a node starts with the value that the node had: nothing jumps when a cut
    opens, so energy and momentum go on.

    Raises
    ------
    InputError
        If the two are not the same cells.
    """
    same = closed.cell_nodes.shape == opened.cell_nodes.shape and np.allclose(
        closed.node_points[closed.cell_nodes],
        opened.node_points[opened.cell_nodes],
        rtol=0.0,
        atol=1e-12 * float(np.ptp(closed.node_points, axis=0).max()),
    )
    if not same:
        raise InputError("the opened mesh does not have the cells of the closed one")
    values = np.empty((len(opened.node_points), field.shape[1]))
    values[opened.cell_nodes] = field[closed.cell_nodes]
    return values
