"""Single elements, crushed to a plane, a line or a point, or reflected: every scheme goes on."""

import numpy as np
import pytest
from cut_bodies import DENSITY, material
from time_schemes import SCHEMES

from verify.xfem.body import DynamicBody
from verify.xfem.energy_balance import run
from verify.xfem.internal_force import InternalForce
from verify.xfem.mass import side_wise_mass
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import cut_mesh

CORNERS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.1], [0.2, 0.9, 0.3], [0.1, 0.2, 0.8]])
ELEMENTS = {
    "triangle": SimplexMesh(CORNERS[:3, :2], np.array([[0, 1, 2]])),
    "sheet": SimplexMesh(CORNERS[:3], np.array([[0, 1, 2]])),
    "tetrahedron": SimplexMesh(CORNERS, np.array([[0, 1, 2, 3]])),
}
# diagonals of the deformation gradient about the centre
CRUSHED = {
    "plane": [1.0, 1.0, 0.0],
    "line": [1.0, 0.0, 0.0],
    "point": [0.0, 0.0, 0.0],
    "reflection": [1.0, 1.0, -1.0],
    "reflection of the first axis": [-1.0, 1.0, 1.0],
    "reflection in the centre": [-1.0, -1.0, -1.0],
    "next to nothing": [1e-200, 1e-200, 1e-200],
}


def _body(name):
    v = cut_mesh(ELEMENTS[name], [])
    return DynamicBody(InternalForce(v, material(v.mesh.dim)), side_wise_mass(v, DENSITY))


@pytest.mark.parametrize("how", CRUSHED)
@pytest.mark.parametrize("name", ELEMENTS)
@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_crushed_or_reflected_element_moves_on_with_a_rotation_and_a_closed_account(
    scheme, name, how
):
    body = _body(name)
    X = body.force.phantom.node_points
    space = X.shape[1]
    diagonal = CRUSHED[how][-space:] if how == "reflection" else CRUSHED[how][:space]
    state = body.rest()
    state.displacement[:] = (X - X.mean(axis=0)) * (np.array(diagonal) - 1.0)
    account = run(scheme(body, 1e-3), body, state, 20)
    R = body.force.rotations[0]
    assert np.abs(R.T @ R - np.eye(space)).max() < 1e-14
    assert np.linalg.det(R) == pytest.approx(1.0, abs=1e-14)
    # half a turn stores nothing: there energies are round-off of that of a strain of one
    size = max(account.mechanical.max(), 1e-12 * float(body.force.elements.mu[0]))
    assert np.ptp(account.balance - account.unbalanced) < 1e-12 * size
    assert np.abs(account.unbalanced).max() < 1e-9 * size
    assert np.isfinite(state.displacement).all()
