"""Nodes of a boundary that a support on a part of it holds."""

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.scene.held_facets import HeldFacets, held_facets
from verify.scene.parts import on_part
from verify.scene.scene import Scene

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


def held_nodes(
    scene: Scene, where: str, places: Array, facets: tuple[Ints, Array], key: str
) -> tuple[Ints, HeldFacets]:
    """Find the nodes of the boundary that a support on the part `where` holds.

    Those of the facets that it holds, each on its own side of the cuts; and those on the part at
    whose place no facet is held: a part may be a corner or an edge of the body.

    Parameters
    ----------
    scene : Scene
    where : str
        Name of a part, ``boundary``, or an inequality.
    places : (n, d) array
        Places of the nodes of the boundary, m; equal to the last bit for the copies of one.
    facets : (q, j) int array and (q, k, d) array
        Nodes of each facet, numbers in `places`, and its corners, m.
    key : str
        Key of the scene that names the part, for the message.

    Returns
    -------
    nodes : (h,) int array
        Ascending.
    found : HeldFacets

    Raises
    ------
    InputError
        If there is none.
    """
    found = held_facets(scene.geometry, where, facets[1])
    mark = np.zeros(len(places), dtype=bool)
    mark[facets[0][found.held]] = True
    mark |= points_apart(scene, where, places, mark)
    if not mark.any():
        raise no_node(scene, where, key)
    return np.flatnonzero(mark), found


def no_node(scene: Scene, where: str, key: str) -> InputError:
    """Error of a support on a part that holds nothing."""
    return InputError(f"{key}: no node of the boundary lies in '{where}'", str(scene.file or ""))


def points_apart(
    scene: Scene, where: str, places: Array, held: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Tell which nodes (n,) of the boundary lie on a part where it holds none (n,) by a facet."""
    _, place = np.unique(places, axis=0, return_inverse=True)
    taken = np.zeros(len(places), dtype=bool)
    taken[place.ravel()[held]] = True
    size = float(np.ptp(places, axis=0).max(initial=0.0))
    return np.asarray(on_part(scene.geometry, where, places, size) & ~taken[place.ravel()])
