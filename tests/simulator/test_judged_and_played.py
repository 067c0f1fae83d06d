"""A path that is played opens the same elements at the same steps as one that is judged."""

import numpy as np
import pytest
from thesis_stages import CASES, stage

from verify.errors import InputError
from verify.scene import Gravity, load_scene
from verify.simulator.semi_progressive import SemiProgressiveCutter
from verify.simulator.session import KnownWays, Session
from verify.simulator.stage import stage_of
from verify.solvers.body_of_scene import Openings, cuts_of
from verify.solvers.xfem import XfemSolver
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


@pytest.mark.parametrize(
    ("end", "apart"),
    [(0.1, 1e-12), (0.8, 2e-3)],  # s; judged, what a blade frees in a step moves from the next on
    ids=["before the cut", "after it"],
)
def test_the_step_of_the_player_is_judged_as_it_is_played(end, apart) -> None:
    scene = load_scene(CASES / "block_cut_once.toml")
    analysis = scene.analysis.model_copy(update={"duration": end, "outputs": 2})
    weight = Gravity(kind="gravity", acceleration=(0.7, -0.4, -9.8))
    scene = scene.model_copy(update={"analysis": analysis, "replay": None, "loads": [weight]})
    played = Session(stage_of(scene))
    last = played.run()[-1]
    judged = XfemSolver().solve(scene, 0, 0, scheme="real_time", tip="inside")
    assert judged.notes["mass"] == "sidewise"
    largest = [np.abs(one).max() for one in (played.displacement, judged.displacement[-1])]
    assert largest[1] == pytest.approx(largest[0], rel=apart)
    assert judged.ledger["strain"][-1] == pytest.approx(last.strain, rel=apart)


@pytest.mark.parametrize("step", [0, -1e-3, float("inf"), float("nan"), "fast"])
def test_a_step_that_is_none_is_refused(step) -> None:
    scene = load_scene(CASES / "block_cut_once.toml")
    with pytest.raises(InputError, match=rf"step {step}; expected a positive number of seconds"):
        XfemSolver().solve(scene, 0, 0, step=step)


def test_a_step_of_the_solver_replaces_that_of_the_scene() -> None:
    scene = load_scene(CASES / "block_cut_once.toml")
    analysis = scene.analysis.model_copy(update={"duration": 0.1, "outputs": 2})
    scene = scene.model_copy(update={"analysis": analysis})
    found = XfemSolver().solve(scene, 0, 0, scheme="real_time", step=1 / 60)
    assert found.iterations["steps"] == 6
    explicit = XfemSolver().solve(scene, 0, 0, scheme="symplectic_euler", step=1 / 60)
    assert explicit.iterations["steps"] > 6  # the critical step is smaller
