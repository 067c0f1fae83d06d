"""References that come with cases: of their physics, small, and solved again by a heavy test."""

import numpy as np
import pytest

from verify.runner.directory import Job
from verify.runner.references import BESIDE, bundle_of_case
from verify.scene import case_folder, load_scene
from verify.solution import read_solution
from verify.solvers import find_solver

BUNDLES = sorted(case_folder().rglob(f"{BESIDE}/*.zip"))
CASES = [path.parent.parent / f"{path.stem}.toml" for path in BUNDLES]


def test_each_is_that_of_its_case_and_all_are_small():
    assert CASES
    assert sum(path.stat().st_size for path in BUNDLES) < 20e6
    for case in CASES:
        scene = load_scene(case)
        bundle = bundle_of_case(scene)
        assert bundle is not None, f"{case}: its physics is another than that of its bundle"
        assert bundle.levels(scene) == scene.reference.levels


@pytest.mark.heavy
@pytest.mark.fenicsx
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.stem)
def test_each_level_is_what_the_reference_solves(case, tmp_path):
    """On the same mesh; the solves of another version of FEniCSx differ by their round-off."""
    scene, solver = load_scene(case), find_solver("reference")
    bundle = bundle_of_case(scene)
    for level in range(scene.reference.levels):
        bundle.take(scene, Job(scene.name, "reference", level, 1, "any", tmp_path))
        kept, made = read_solution(tmp_path / "solution"), solver.solve(scene, level, 0)
        np.testing.assert_allclose(made.points, kept.points, atol=1e-12)
        for name in ("displacement", "velocity", "acceleration"):
            field = getattr(kept, name)
            if field is None:  # at finite rotation there is no acceleration
                continue
            largest = np.abs(field).max()  # an acceleration rings in the finest mode
            tolerance = 1e-5 if name == "acceleration" else 1e-6
            np.testing.assert_allclose(getattr(made, name), field, atol=tolerance * largest)
        energies = {"kinetic", "strain", "gravity"} & kept.ledger.keys()  # at rest strain alone
        largest = max(np.abs(kept.ledger[name]).max() for name in energies)
        for name, column in kept.ledger.items():
            if "momentum" in name or "impulse" in name:  # sums of the velocities above
                continue
            np.testing.assert_allclose(made.ledger[name], column, atol=1e-6 * largest)
