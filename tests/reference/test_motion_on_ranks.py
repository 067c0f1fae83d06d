"""Motion on two ranks: the fields, the energies and the account of one."""

import numpy as np
import pytest
from ranks_of_tests import on_ranks
from reference_scenes import needs_fenicsx

pytestmark = needs_fenicsx

_MOTIONS = """
import test_motion, test_solid_motion
from verify.compare.locate import SolutionField
from verify.solvers import find_solver

def plane(kinematics):
    "A square that is pulled, turned and damped: one cut open before, one at 0, one on the way."
    cuts = [test_motion.polyline("before", [-0.1, 0.8], [0.3, 0.8]),
            test_motion.polyline("slanted", [0.4, 0.75], [1.1, 0.65]),
            {**test_motion.MIDDLE, "opens_at": 0.025}]
    scene = test_motion.moving(
        cuts, kinematics, duration=0.05, outputs=3,
        supports=[{"where": "bottom", "displacement": [0.1, 0.0],
                   "history": [[0.0, 0.0], [0.03, 1.0]]},
                  {"where": "left", "displacement": [0.0], "components": ["x"]}],
        loads=[{"kind": "gravity", "acceleration": [0, -0.98]},
               {"kind": "traction", "where": "top", "traction": [100.0, 200.0],
                "history": [[0.0, 1.0], [0.02, 0.0]]}],
        initial={"kind": "equilibrium", "cuts": "closed"})
    damped = scene.analysis.model_copy(update={"damping": (1.0, 1e-3)})
    return scene.model_copy(update={"analysis": damped})

def space():
    "A cube that hangs at rest and is cut through at 0."
    return test_solid_motion.moving(
        [test_solid_motion.MIDDLE], duration=0.04,
        supports=[{"where": "top", "displacement": [0, 0, 0]}],
        loads=[{"kind": "gravity", "acceleration": [0.5, 0, -0.98]}],
        initial={"kind": "equilibrium", "cuts": "closed"})

answer = {}
for name, scene, schemes in [
    ("linear", plane("linear"), ["generalised_alpha"]),
    ("turning", plane("corotational"), ["energy_momentum"]),
    ("space", space(), ["energy_momentum"]),
]:
    points = np.random.default_rng(1).random((300, scene.dimension))
    for scheme in schemes:
        degree = 2 if name == "linear" else 1
        found = find_solver("conforming").solve(scene, 0, 0, scheme=scheme, degree=degree)
        fields = [SolutionField(found, t).displacement(points) for t in range(len(found.times))]
        # on all ranks alike: they need no talk to take the same steps
        sums = world.allgather(float(np.sum(found.displacement)))
        assert len(set(sums)) == 1
        answer[name, scheme] = found.ledger, np.array(fields), found.iterations
"""


@pytest.fixture(scope="module")
def answers(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ranks")
    return [on_ranks(count, _MOTIONS, folder) for count in (1, 2)]


def test_two_ranks_move_every_point_as_one_does(answers):
    one, two = answers
    assert len(one) == 3
    for motion, (_, fields, iterations) in one.items():
        assert np.abs(fields[-1] - fields[0]).max() > 1e-3, motion
        # Newton's residual is 1e-11 of the forces, and most steps end far below it
        assert two[motion][1] == pytest.approx(fields, abs=1e-10 * np.abs(fields).max()), motion
        assert two[motion][2] == iterations, motion


def test_two_ranks_keep_the_account_of_one(answers):
    one, two = answers
    for motion, (ledger, _, _) in one.items():
        energy = max(np.abs(ledger[name]).max() for name in ("kinetic", "strain", "gravity"))
        for name, column in ledger.items():
            size = np.abs(column).max() if "momentum" in name else energy
            assert two[motion][0][name] == pytest.approx(column, abs=1e-10 * size), (motion, name)
