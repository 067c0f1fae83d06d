"""Free vibration of cantilevers, whole and split, against converged values."""

import numpy as np
import pytest
from reference_scenes import needs_fenicsx, polyline, square

from verify.errors import InputError
from verify.scene import Material

pytestmark = needs_fenicsx

TISSUE = Material(young=1e4, poisson=0.3, plane="strain", density=1000.0)
CUTS = {
    "whole": ([], [0.65408379]),
    "split": ([polyline("a", (-0.1, 0.1), (1.1, 0.1))], [0.33435932, 0.33435932]),
    "half split": ([polyline("a", (0.5, 0.1), (1.1, 0.1))], [0.603212]),
}


def cantilever(cuts, size=0.05, graded=True):
    """Give the space and the unknowns held of a beam of length 1 and depth 0.2."""
    from reference.boundary_values import constrained_values
    from reference.meshing import Grading, conforming_mesh, singular_points
    from reference.space import conforming_space

    scene = square(
        cuts,
        geometry={"kind": "rectangle", "lower": [0, 0], "upper": [1, 0.2]},
        supports=[{"where": "left", "displacement": [0, 0]}],
    )
    points = singular_points(scene) if graded else np.zeros((0, 2))
    space = conforming_space(conforming_mesh(scene, Grading(size, points, 0.2)), 2)
    return space, constrained_values(scene, space, None)[0]


@pytest.mark.parametrize("name", CUTS)
def test_cantilevers_swing_at_the_known_frequencies(name):
    from reference.vibration import lowest_frequencies

    cuts, known = CUTS[name]
    found = lowest_frequencies(TISSUE, *cantilever(cuts, 0.02), len(known))
    assert found.frequencies == pytest.approx(known, rel=1e-5)
    assert found.residual < 1e-7


def test_grading_to_the_clamp_is_what_makes_a_frequency_exact():
    from reference.vibration import lowest_frequencies

    errors = [
        lowest_frequencies(TISSUE, *cantilever([], 0.04, graded), 1).frequencies[0] / 0.65408379 - 1
        for graded in (True, False)
    ]
    assert 0 < 20 * errors[0] < errors[1]  # both from above


def test_a_free_body_has_three_motions_without_a_frequency():
    from reference.vibration import lowest_frequencies

    space, _ = cantilever([], 0.1)
    found = lowest_frequencies(TISSUE, space, np.zeros(0, dtype=np.int32), 4).frequencies
    assert found[:3].max() < 1e-3 * found[3]


def test_a_quick_step_is_bounded_by_the_smallest_cell():
    from reference.vibration import largest_frequency

    # ω is a wave across the smallest cell: it doubles with the mesh, and the held unknowns,
    # which have no frequency, do not enter
    found = [largest_frequency(TISSUE, *cantilever([], size, False)) for size in (0.1, 0.05)]
    assert found[1] / found[0] == pytest.approx(2.0, rel=0.25)
    space, _ = cantilever([], 0.05, False)
    free = largest_frequency(TISSUE, space, np.zeros(0, dtype=np.int32))
    assert found[1] <= free * (1 + 1e-9)


def test_vibration_without_a_density_is_refused():
    from reference.vibration import lowest_frequencies

    weightless = Material(young=1.0, poisson=0.3, plane="strain")
    with pytest.raises(InputError, match="density is missing"):
        lowest_frequencies(weightless, *cantilever([], 0.1), 1)


def test_a_body_in_space_has_six_motions_without_a_frequency_and_swings_as_long_bars_do():
    from reference.meshing import open_cut, structured_tetrahedra
    from reference.space import conforming_space
    from reference.vibration import largest_frequency, lowest_frequencies

    material = Material(young=1e4, poisson=0.0, density=1000.0)
    mesh = open_cut(
        *structured_tetrahedra((0, 0, 0), (1, 0.2, 0.1), (5, 1, 1)),
        np.zeros((0, 3), dtype=np.int64),
    )
    space = conforming_space(mesh, 2)
    free = lowest_frequencies(material, space, np.zeros(0, dtype=np.int32), 7)
    assert free.modes.shape == (7, len(space.node_points), 3)
    assert free.frequencies[5] < 1e-4 * free.frequencies[6]
    # held across, the bar can only stretch: a quarter wave, exactly, as nothing contracts
    held = np.zeros(space.node_points.shape, dtype=bool)
    held[:, 1:] = True
    held[space.node_points[:, 0] < 1e-12, 0] = True
    unknowns = np.flatnonzero(held).astype(np.int32)
    quarter = lowest_frequencies(material, space, unknowns, 1).frequencies[0]
    assert quarter == pytest.approx(0.5 * np.pi * np.sqrt(10.0), rel=1e-5)
    assert largest_frequency(material, space, unknowns) > 10 * quarter
