"""An initial field that jumps across a cut, on meshes whose nodes lie anywhere."""

import numpy as np
import pytest

from reference.exact import exact_of
from verify.scene import load_scene
from verify.solvers import find_solver


@pytest.mark.parametrize("position", [0, 2, 6, 9, 15])
def test_a_node_that_the_cut_has_not_doubled_starts_with_the_field_on_its_own_side(position):
    """Just behind the blade, where the field has parted already: the node's pieces lie on both."""
    scene = load_scene("benchmark/c5_blade_03")
    mesh = scene.mesh.model_copy(update={"position": position})
    scene = scene.model_copy(update={"mesh": mesh})
    found = find_solver("xfem").solve(scene, 0, 0)
    _, which, count = np.unique(
        found.points.round(12), axis=0, return_inverse=True, return_counts=True
    )
    alone = (count[which.ravel()] == 1) & (np.abs(found.points[:, 1]) > 1e-9)
    points = found.points[alone]
    wanted = exact_of(scene).at(0.0).displacement(points, points)
    assert (np.abs(wanted[:, 2]) > 1e-4).any()
    np.testing.assert_allclose(found.displacement[0][alone], wanted, atol=1e-12)
