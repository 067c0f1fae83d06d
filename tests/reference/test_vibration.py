"""Free vibration of cantilevers, whole and split, against converged values."""

import numpy as np
import pytest
from reference_scenes import needs_fenicsx, polyline, square
from scipy.sparse.linalg import eigsh

pytestmark = needs_fenicsx

CUTS = {
    "whole": ([], [0.65408379]),
    "split": ([polyline("a", (-0.1, 0.1), (1.1, 0.1))], [0.33435932, 0.33435932]),
    "half split": ([polyline("a", (0.5, 0.1), (1.1, 0.1))], [0.603212]),
}


def frequencies(cuts, count, size=0.05, graded=True):
    """Lowest angular frequencies, rad/s, of a beam of length 1 and depth 0.2."""
    from reference.linear_system import linear_system
    from reference.meshing import Grading, conforming_mesh, singular_points
    from reference.space import conforming_space

    scene = square(
        cuts,
        geometry={"kind": "rectangle", "lower": [0, 0], "upper": [1, 0.2]},
        material={"young": 1e4, "poisson": 0.3, "plane": "strain", "density": 1000.0},
        supports=[{"where": "left", "displacement": [0, 0]}],
    )
    points = singular_points(scene) if graded else np.zeros((0, 2))
    space = conforming_space(conforming_mesh(scene, Grading(size, points, 0.2)), 2)
    stiffness, mass, held = linear_system(scene, space, None)
    free = np.flatnonzero(~held)
    stiffness, mass = (one[free][:, free] for one in (stiffness, mass))
    squares = eigsh(stiffness, count, mass, sigma=0.0, return_eigenvectors=False)
    return np.sqrt(np.sort(squares))


@pytest.mark.parametrize("name", CUTS)
def test_cantilevers_swing_at_the_known_frequencies(name):
    cuts, known = CUTS[name]
    assert frequencies(cuts, len(known), 0.02) == pytest.approx(known, rel=1e-5)
