"""Notice of linear elements that lock, beside the error that they have then."""

import pytest
import scenes

from verify.judge.notices import locking_notices
from verify.solvers import find_solver


def cook(poisson, plane="strain"):
    """Cook's panel of Young's modulus 1 under a unit shear force, clamped on the left."""
    return scenes.scene(
        [],
        geometry={"kind": "polygon", "corners": [[0, 0], [48, 44], [48, 60], [0, 44]]},
        mesh={"pattern": "unstructured", "sizes": [6.0]},
        material={"young": 1.0, "poisson": poisson, "plane": plane},
        supports=[{"where": "x < 1e-6", "displacement": [0.0, 0.0]}],
        loads=[{"kind": "traction", "where": "x > 48 - 1e-6", "traction": [0.0, 1 / 16]}],
    )


def end(solution):
    """Mean rise of the loaded end."""
    return solution.displacement[0, solution.points[:, 0] > 48 - 1e-6, 1].mean()


@pytest.mark.fenicsx
@pytest.mark.parametrize(
    ("poisson", "plane", "warned"),
    [(0.499975, "strain", True), (0.3, "strain", False), (0.499975, "stress", False)],
)
def test_linear_elements_that_lock_are_warned_of(poisson, plane, warned):
    """Whose end rises by less than three quarters of what elements with a pressure give."""
    scene = cook(poisson, plane)
    solution = find_solver("xfem").solve(scene, 0, repetitions=0)
    notices = locking_notices(scene, {"xfem": {0: solution}})
    assert [(one.about, one.solver) for one in notices] == [("locking", "xfem")] * warned
    if warned:
        pressure = find_solver("reference").solve(scene, 0, repetitions=0)
        assert end(solution) < 0.75 * end(pressure)
