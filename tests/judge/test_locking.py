"""Notice of linear elements that lock, beside the error that they have then."""

import re

import pytest
import scenes

from verify.compare.hooke import law_of, strain_energy
from verify.judge.notices import locking_notices
from verify.scene import load_scene
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
    assert all("% too much" in one.text for one in notices)
    assert [(one.about, one.solver) for one in notices] == [("locking", "xfem")] * warned
    if warned:
        pressure = find_solver("reference").solve(scene, 0, repetitions=0)
        assert end(solution) < 0.75 * end(pressure)


@pytest.mark.heavy
@pytest.mark.fenicsx
@pytest.mark.parametrize("poisson", [0.49, 0.499])
def test_the_share_that_the_notice_names_is_what_a_plate_with_a_cut_stores_too_much(poisson):
    """Against quadratic elements with a pressure: 0.13 and 0.49; it names 0.14 and 0.43."""
    scene = load_scene("material/nearly_incompressible")
    moduli = scene.material.model_copy(update={"poisson": poisson})
    scene = scene.model_copy(update={"material": moduli})
    law = law_of(scene)
    reference = strain_energy(find_solver("reference").solve(scene, 1), law)
    solution = find_solver("xfem").solve(scene, 2, repetitions=0)
    (notice,) = locking_notices(scene, {"xfem": {2: solution}})
    named = float(re.search(r"some (\S+) %", notice.text)[1]) / 100
    assert named == pytest.approx(strain_energy(solution, law) / reference - 1.0, rel=0.25)
