"""Time steps of the reference: halved with its elements, whatever cuts them short."""

from itertools import pairwise

import numpy as np
import pytest
from reference_scenes import needs_fenicsx, polyline
from test_motion import MIDDLE, moving, solved

from reference.dynamics_step import Stepper

pytestmark = needs_fenicsx

SLANTED = polyline("slanted", [0.21, -0.1], [0.83, 1.1])
PATH = {"kind": "tool_path", "name": "path", "points": [[-0.1, 0.33], [0.71, 0.62]]}
JERK = {"kind": "traction", "where": "top", "traction": [3.0, 1.0]}
COARSE = {"size": 0.4, "degree": 1}
# a pressure wave takes 0.11 s across an element of the reference on level 0
SCENES = {
    "outputs closer than its step": {"outputs": 18},
    "a step longer than the gap": {"outputs": 12, "time_step": 0.077},
    "a step of its own": {
        "outputs": 3, "time_step": 0.2, "reference": {**COARSE, "time_step": 0.03},
    },
    "a gap of no whole number of steps": {"outputs": 4, "time_step": 0.0371},
    "cuts that open between outputs": {
        "cuts": [{**MIDDLE, "opens_at": 0.0713}, {**SLANTED, "opens_at": 0.3001}],
        "outputs": 8,
    },
    "loads that jump between outputs": {
        "loads": [{**JERK, "history": [[0.0, 0.0], [0.137, 0.0], [0.137, 1.0], [0.31, 0.2]]}],
        "outputs": 9,
    },
    "a blade on its way": {"cuts": [{**PATH, "times": [0.013, 0.29]}], "outputs": 7},
}  # fmt: skip


@pytest.mark.parametrize("name", SCENES)
def test_every_level_of_the_reference_halves_every_step_of_the_one_before(name, monkeypatch):
    scene = moving(**{"reference": COARSE, "time_step": None} | SCENES[name])
    taken = []

    def step(stepper, state):
        taken.append(state.time)
        state.time += stepper.size

    # which steps are taken does not depend on the motion: nothing is solved
    monkeypatch.setattr(Stepper, "step", lambda one, state: step(one, state))
    monkeypatch.setattr("reference.dynamics_step.Ledger.record", lambda *_: None)
    begun = []
    for level in range(3):
        taken.clear()
        solved(scene, "reference", level)
        begun.append(np.array([*taken, scene.analysis.duration]))
    largest = scene.reference.time_step or scene.analysis.time_step or 1.0
    assert np.diff(begun[0]).max() <= largest * (1 + 1e-9)
    for coarse, fine in pairwise(begun):
        middles = 0.5 * (coarse[1:] + coarse[:-1])
        expected = np.sort(np.concatenate([coarse, middles]))
        assert fine == pytest.approx(expected, abs=1e-9)
