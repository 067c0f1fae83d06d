"""Small things that the tests of the methods share: plates, supports, exact doubled nodes."""

import numpy as np

from verify.methods import METHODS, cut_by
from verify.xfem.element import isotropic
from verify.xfem.loads_and_supports import Supports, body_force
from verify.xfem.statics import solve_static

CUTTING = [name for name in METHODS if name != "uncut"]
MATERIAL = {2: isotropic(1.0, 0.3, "plane strain"), 3: isotropic(1.0, 0.3, "solid")}


def held_at(phantom, where):
    """Supports that hold all unknowns on the boundary of the body where a condition holds."""
    facets = phantom.mesh.boundary_facets
    local = np.arange(phantom.mesh.dim + 1) != facets[:, 1:]
    boundary = np.unique(phantom.mesh.cells[facets[:, 0]][local])
    return Supports.none(phantom).prescribe(phantom, boundary[where(phantom.mesh.points[boundary])])


def hang(method, mesh, cuts, where, **parameters):
    """Cut a body, hold it, load it by a uniform force: body and its equilibrium."""
    body = cut_by(method, mesh, cuts, **parameters)
    force = np.array([0.3, -1.0, 0.2])[: mesh.dim]
    load = body_force(body.phantom, force)
    supports = held_at(body.phantom, where)
    return body, solve_static(body.resisting, MATERIAL[mesh.dim], supports, load)


def at_places(body, displacement, side_of):
    """(position, side) → displacement of all nodes, as sorted rows."""
    shown = body.conforming
    values = shown.interpolation @ displacement
    centres = shown.points[shown.cells].mean(axis=1)
    side = np.zeros(len(shown.points))
    for k in range(shown.cells.shape[1]):
        side[shown.cells[:, k]] = side_of(centres)
    rows = np.column_stack([np.round(shown.points, 9), side, values])
    return rows[np.lexsort(rows[:, : shown.points.shape[1] + 1].T)]
