"""Motion of bodies without a cut: every way to cut is then one method, that of the uncut mesh."""

import numpy as np

from verify.scene import load_scene
from verify.solvers import find_solver


def test_an_uncut_bar_moves_alike_by_every_method():
    """But for springs on edges: they are another material, and their bar swings too."""
    scene = load_scene("controls/prestrained_bar")
    expected = find_solver("xfem").solve(scene, 0, 0)
    scale = np.abs(expected.displacement).max()
    assert scale > 0.0
    for name in ("subdivision", "snapping", "virtual_node", "uncut"):
        found = find_solver(name).solve(scene, 0, 0)
        np.testing.assert_array_equal(found.points, expected.points)
        assert np.abs(found.displacement - expected.displacement).max() < 1e-9 * scale, name
    found = find_solver("mass_spring").solve(scene, 0, 0)
    assert np.isfinite(found.displacement).all()
    assert np.ptp(found.displacement, axis=0).max() > 0.1 * np.abs(found.displacement).max()
