"""Worth of grading in space: accuracy for unknowns, on a penny-shaped cut."""

import numpy as np
import pytest
from reference_scenes import needs_fenicsx
from solid_scenes import EXACT, cube, disc

pytestmark = needs_fenicsx

ENERGY = 32.244473884  # of the cube with E = 1, ν = 0.3 and a unit penny under unit tension


def penny():
    """Give a penny of radius 1 in a cube of side 4 whose whole surface moves exactly."""
    return cube(
        [disc(1.0, (0.0, 0.0, 0.0))],
        geometry={"kind": "box", "lower": [-2, -2, -2], "upper": [2, 2, 2]},
        supports=EXACT,
        loads=[],
        exact={
            "solution": "penny",
            "parameters": {"centre": [0, 0, 0], "normal": [0, 0, 1], "a": 1.0, "tension": 1.0},
        },
    )


def miss(mesh):
    """Unknowns of quadratic elements, and the share of the energy that they miss."""
    from reference.elasticity import solve_linear
    from reference.exact import exact_solution
    from reference.space import conforming_space

    scene = penny()
    exact = exact_solution(scene.exact.solution, scene.exact.parameters, scene.material)
    found = solve_linear(scene, conforming_space(mesh, 2), exact)
    return found.displacement.size, abs(found.strain_energy / ENERGY - 1)


def uniform(size):
    from reference.meshing import Grading, conforming_mesh

    return miss(conforming_mesh(penny(), Grading(size, np.zeros((0, 3)))))


def level(number):
    """Take a level of the sequence that the reference goes through by itself."""
    from verify.solvers.conforming_meshes import reference_mesh

    return miss(reference_mesh(penny(), number)[0])


def test_the_second_level_of_the_reference_beats_uniform_elements_of_as_many_unknowns():
    (many, even), (few, graded) = uniform(0.28), level(1)
    assert few < many
    assert graded < even / 2.5


@pytest.mark.heavy
def test_the_second_level_of_the_reference_beats_a_million_uniform_unknowns():
    (many, even), (few, graded) = uniform(0.106), level(1)
    assert many > 0.8e6
    assert few < 0.1 * many
    assert graded < even
