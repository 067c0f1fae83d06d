"""A path that is played opens the same elements at the same steps as one that is judged."""

import numpy as np
import pytest
from thesis_stages import CASES, stage

from verify.scene import load_scene
from verify.simulator.semi_progressive import SemiProgressiveCutter
from verify.simulator.session import KnownWays
from verify.solvers.body_of_scene import Openings, cuts_of
from verify.xfem.phantom import cut_mesh


@pytest.mark.parametrize("name", ["block_cut_twice", "tetrahedron_four_edges", "square_dissected"])
def test_played_and_judged_open_the_same_elements_at_the_same_steps(name) -> None:
    """But where strokes meet: what one has left of an element is played piece by piece.

    A judged element opens as a whole, so for at most its crossing it is behind what is played.
    """
    scene, played = load_scene(CASES / f"{name}.toml"), stage(name)
    cuts = cuts_of(scene, 0.1)
    phantom = cut_mesh(played.mesh, cuts)
    opening = Openings(scene.cuts, cuts, [0.0] * len(cuts)).of_cells(phantom).times
    alone = (~np.isnan(opening)).sum(axis=1) == 1
    cutter = SemiProgressiveCutter(played.mesh)
    for path in played.strokes:
        cutter.begin(path)
    behind = 0
    steps = np.arange(0, max(cut.ends_at for cut in scene.cuts) / played.time_step + 2)
    for time in played.time_step * steps:
        cutter.advance(float(time))
        for k in range(len(cuts)):
            cells = np.arange(len(played.mesh.cells))
            there, here = cutter.body.split_by(cells, k), opening[:, k] <= time
            np.testing.assert_array_equal(there[alone], here[alone])
            assert (there | ~here).all()
            behind = max(behind, (there & ~here).sum())
    parts = [np.column_stack([one.parent, one.label]) for one in (phantom, cutter.phantom_mesh())]
    np.testing.assert_array_equal(*(np.unique(rows, axis=0) for rows in parts))
    assert (behind > 0) == (name != "tetrahedron_four_edges")


@pytest.mark.parametrize("name", ["block_cut_once", "square_dissected"])
def test_ahead_of_the_blade_they_open_alike_where_strokes_meet_too(name) -> None:
    """And the bodies are the same, unknown by unknown: played step by step, judged as a whole."""
    scene, played = load_scene(CASES / f"{name}.toml"), stage(name)
    cuts = cuts_of(scene, 0.1)
    whole = cut_mesh(played.mesh, cuts)
    opening = Openings(scene.cuts, cuts, [0.0] * len(cuts), "swept").of_cells(whole).times
    ways, cutter = KnownWays(played.mesh, played.strokes), SemiProgressiveCutter(played.mesh)
    for path in played.strokes:
        ways.open(cutter.begin(path))
    cells = np.arange(len(played.mesh.cells))
    steps = np.arange(0, max(cut.ends_at for cut in scene.cuts) / played.time_step + 2)
    for time in 0.31 * played.time_step + played.time_step * steps:
        cutter.advance(float(time))
        open_now = opening <= time
        for k in range(len(cuts)):
            np.testing.assert_array_equal(cutter.body.split_by(cells, k), open_now[:, k])
    assert cutter.body.node_count == whole.node_count
