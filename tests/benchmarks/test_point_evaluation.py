"""Speed of a solution asked at points, beside that of finding the nearest of points."""

from time import process_time

import numpy as np
import pytest
from scipy.spatial import cKDTree

from reference.meshing.imprint import imprint, structured_tetrahedra, structured_triangles
from reference.meshing.opening import open_cut
from verify.compare.locate import SolutionField
from verify.solution import Solution

COUNT = 100_000


def plane(n=180):
    points, cells = structured_triangles((0.0, 0.0), (1.0, 1.0), (n, n))
    mesh = open_cut(*imprint(points, cells, [np.array([[-0.1, 0.31], [0.7, 0.64]])]))
    return Solution(mesh.points, mesh.cells, mesh.points[None] ** 2)


def solid(n=24):
    points, cells = structured_tetrahedra((0, 0, 0), (1, 1, 1), (n, n, n))
    return Solution(points, cells, points[None] ** 2)


def best_of(call, times=3):
    seconds = []
    for _ in range(times):
        start = process_time()
        call()
        seconds.append(process_time() - start)
    return min(seconds)


@pytest.mark.timing
@pytest.mark.parametrize("body", [plane, solid])
def test_points_are_evaluated_about_as_fast_as_nearest_nodes_are_found(body):
    solution = body()
    places = np.random.default_rng(5).random((COUNT, solution.dimension))
    near = places + 1e-6
    field = SolutionField(solution)
    field.displacement(places[:10], near[:10])  # compiles
    tree = cKDTree(solution.points)
    nearest = best_of(lambda: tree.query(places))
    sided = best_of(lambda: field.displacement(places, near))
    rate = COUNT / sided
    print(f"{len(solution.cells)} cells: {rate:.3g} points/s, {sided / nearest:.2f} of cKDTree's")
    # cKDTree finds about 5e5 (space) to 2e6 nodes a second in meshes of this size, on one core
    # of a usual machine: five times its time leaves more than 1e5 points a second
    assert sided < 5 * nearest
