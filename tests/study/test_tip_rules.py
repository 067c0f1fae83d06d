"""The default rule for the ends of cuts is the one that docs/theory/xfem.md chooses.

``python tests/study/tip_rules.py`` prints the tables. Quick tests take some scenes and meshes.
"""

import numpy as np
import pytest
from tip_rules import (
    ADVANCE,
    RULES,
    TOLERANCE,
    interval,
    jumps,
    known,
    measured,
    meshes_of,
    parts,
    plane_scenes,
    resisting,
    space_scenes,
    step_of,
    weighed,
    work_on_faces,
)

from reference.exact import exact_of
from verify.solvers import find_solver
from verify.solvers.body_of_scene import background_mesh
from verify.xfem.body import DynamicBody, MotionState
from verify.xfem.energy_balance import run
from verify.xfem.explicit import CentralDifferences

DEFAULT = {2: "partial", 3: "inside"}


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_default_of_the_solver_is_the_rule_that_was_chosen(dimension):
    scene = (plane_scenes if dimension == 2 else space_scenes)()[0]
    one, other = (
        find_solver("xfem").solve(scene, 0, 0, **given)
        for given in ({}, {"tip": DEFAULT[dimension]})
    )
    assert one.notes["tip"] == DEFAULT[dimension]
    assert np.array_equal(one.displacement, other.displacement)


@pytest.mark.parametrize("dimension", [2, 3])
def test_no_default_parts_a_body_that_the_cut_leaves_whole(dimension):
    assert parts(DEFAULT[dimension], dimension) == 0.0
    assert parts("through", dimension) > 0.5  # the meshes can tell


def test_work_on_the_faces_is_the_energy_that_the_closed_form_has():
    scene = space_scenes()[5]
    assert work_on_faces(exact_of(scene), scene, 40) == pytest.approx(
        exact_of(scene).strain_energy(scene), rel=1e-5
    )


@pytest.mark.parametrize("number", [2, 9, 15])
def test_nodes_at_ends_cost_a_third_less_than_any_rule_that_parts_no_body(number):
    scene = plane_scenes()[number]
    row = measured(scene, known(scene), meshes_of(scene)[::5], 1)
    assert row.error["partial"] < row.error["inside"] / 1.5
    assert -0.6 < row.shift["partial"] < -0.2  # as conforming elements: −0.38 ± 0.13
    assert row.step["partial"] > 0.15 * row.step["inside"]


def free_motion(rule):
    """Largest change of the energy of a free cut square over that in play, in 500 steps."""
    scene = plane_scenes()[3]
    force, mass = resisting(scene, *background_mesh(scene, 0), rule)
    body = DynamicBody(force, mass)
    x, y = force.phantom.node_points.T
    moved = np.stack([0.1 * x * y, 0.05 * np.sin(x)], axis=1)
    state = MotionState(moved, np.zeros_like(moved))
    scheme = CentralDifferences(body, 0.5 * step_of(force, mass))
    account = run(scheme, body, state, 500)
    return float(np.ptp(account.balance) / account.kinetic.max())


@pytest.mark.parametrize("rule", ["inside", "partial"])
def test_a_free_body_keeps_its_energy(rule):
    """Linear, at half the critical step: to round-off of 500 steps."""
    assert free_motion(rule) < 1e-12


@pytest.mark.heavy
@pytest.mark.parametrize("dimension", [2, 3])
def test_the_whole_study_chooses_the_default(dimension):
    """By the rule: least work of those that are not excluded, and no tie."""
    scenes = (plane_scenes if dimension == 2 else space_scenes)()
    timed = 4 if dimension == 2 else 1
    rows = [measured(one, known(one), meshes_of(one), timed) for one in scenes]
    found = weighed(rows, dimension)
    left = [
        rule
        for rule in RULES[dimension]
        if parts(rule, dimension) == 0.0 and found[rule]["worst"] <= 1.0 + TOLERANCE
    ]
    for kind in ("solve", "explicit"):
        works = {rule: found[rule]["works"][kind] for rule in left}
        least = min(works, key=lambda rule: np.median(works[rule]))
        assert least == DEFAULT[dimension]
        for rule in left:
            if rule != least:
                assert interval(works[rule] - works[least])[0] > 1.0


@pytest.mark.heavy
@pytest.mark.parametrize("number", [0, 1, 3, 6])
def test_the_end_of_a_growing_crack_advances_more_evenly_with_a_node_at_it(number):
    scene = plane_scenes()[number]
    found = jumps(scene, *meshes_of(scene)[6 + number])
    assert ADVANCE <= found["partial"] < found["inside"]
