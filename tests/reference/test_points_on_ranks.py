"""Values at points after a solve on several ranks: each asks its share, all get those of one."""

import numpy as np
import pytest
from ranks_of_tests import on_ranks
from reference_scenes import needs_fenicsx

pytestmark = needs_fenicsx

_SHARES = """
from solid_scenes import cube, polygon
from verify.compare.locate import SolutionField
from verify.solvers import find_solver

cut = polygon("a", (-1, -1, 0.5), (0.6, -1, 0.5), (0.6, 2, 0.5), (-1, 2, 0.5))
scene = cube([cut], mesh={"cells": [[4, 4, 4]]})
solution = find_solver("conforming").solve(scene, 0, 0)
points = np.random.default_rng(1).random((500, 3))
points[:200, 2] = 0.5  # on the faces of the cut, asked for from both sides
near = points + [0, 0, 0.01] * np.where(np.arange(500) % 2, 1, -1)[:, None]
mine = np.array_split(np.arange(500), world.size)[world.rank]
found = world.gather(SolutionField(solution).displacement(points[mine], near[mine]))
answer = np.concatenate(found or [points])
"""


def test_shares_of_points_on_two_ranks_have_the_values_of_one(tmp_path):
    one, two = (on_ranks(count, _SHARES, tmp_path) for count in (1, 2))
    assert two == pytest.approx(one, abs=1e-10 * np.abs(one).max())
    # the faces move apart: points at the cut were asked on their own side
    assert np.abs(one[:200:2].mean(axis=0) - one[1:200:2].mean(axis=0)).max() > 1e-3
