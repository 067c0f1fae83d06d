"""Features that come close: touching, too close to mesh apart, or apart and resolved."""

import numpy as np
import pytest
from reference_scenes import arc, areas, energy_of, needs_fenicsx, polyline, square

from reference.meshing import Grading, conforming_mesh, singular_points
from verify.errors import InputError
from verify.solvers import find_solver

pytestmark = needs_fenicsx


def graded(scene, level=0):
    grading = Grading(1 / 12, singular_points(scene), 0.5, strip=1.0)
    return conforming_mesh(scene, grading.halved(level))


LINE = polyline("a", (0.2, 0.5), (0.8, 0.5))
CIRCLE = arc("a", (0.5, 0.2), 0.2)
BOTH, EDGE = "cut 'a' and cut 'b'", "cut 'a' and the boundary"
NEAR = r" .* within 1e-0[78] m.* resolves 1e-06 m"
REFUSED = [
    ([polyline("a", (0.4, 0.5), (1 - 1e-8, 0.5))], "boundary" + NEAR),
    ([LINE, polyline("b", (0.5, 0.5 + 1e-7), (0.5, 0.8))], BOTH + NEAR),
    ([arc("a", (0.5, 0.2 + 1e-8), 0.2, 250.0, 50.0)], EDGE + NEAR),
    ([arc("a", (0.3, 0.5), 0.1, -30.0, 90.0), arc("b", (0.5 + 1e-8, 0.5), 0.1, 150.0, 90.0)],
     BOTH + NEAR),
    ([arc("a", (0.5, 0.5), 0.2, 0.0, 180.0), polyline("b", (0.5, 0.7 + 1e-8), (0.5, 0.9))],
     BOTH + NEAR),
    # almost on each other, along all of their length
    ([LINE, polyline("b", (0.2, 0.5), (0.8, 0.5001))], BOTH + " lie within 1e-06 m of each other"),
    # half of this circle used to be taken for the boundary, and stayed uncut without a word
    ([CIRCLE], EDGE + " touch tangentially"),
    ([arc("a", (0.5, 0.3), 0.2, 30.0, 60.0), polyline("b", (0.2, 0.5), (0.8, 0.5))],
     BOTH + " touch tangentially"),
    ([arc("a", (0.3, 0.5), 0.1, 200.0, 320.0), arc("b", (0.6, 0.5), 0.2, 20.0, 320.0)],
     BOTH + " touch tangentially"),
]  # fmt: skip


@pytest.mark.parametrize(("cuts", "said"), REFUSED)
def test_what_cannot_be_meshed_apart_is_refused_with_names_and_distance(cuts, said):
    with pytest.raises(InputError, match=said):
        graded(square(cuts))


def test_a_strip_between_two_cuts_is_as_many_cells_wide_as_the_level_says():
    apart = 1e-3
    scene = square([LINE, polyline("b", (0.3, 0.5 + apart), (0.7, 0.5 + apart))])
    for level, rows in ((0, 1), (1, 2)):
        mesh = graded(scene, level)
        middle = mesh.points[mesh.cells].mean(axis=1)
        strip = (np.abs(middle - [0.5, 0.5 + apart / 2]) < [0.15, apart / 2]).all(axis=1)
        area = areas(mesh)[strip].mean()
        # triangles of side gap/rows, up to a third more: gmsh keeps sizes on average only
        assert area < 1.3 * np.sqrt(3) / 4 * (apart / rows) ** 2
        assert areas(mesh).sum() == pytest.approx(1.0, rel=1e-12)


def test_a_cut_that_ends_in_a_support_opens_there_and_its_levels_approach_each_other():
    held = [{"where": "bottom", "displacement": [0, 0]}]
    push = [{"kind": "traction", "where": "right", "traction": [1, 0]}]
    scene = square([polyline("a", (0.4, -0.1), (0.4, 0.6))], supports=held, loads=push)
    values = [energy_of(scene, level=level) for level in range(3)]
    assert abs(values[2] - values[1]) < 0.2 * abs(values[1] - values[0]) < 1e-3 * values[2]
    # an uncut body is stiffer: the mouth on the support is not closed
    assert values[2] > 1.02 * energy_of(square(supports=held, loads=push), level=1)


def needle(angle, poisson=0.3, **changes):
    """Give a square with a tongue of material between the legs of a hairpin."""
    hairpin = polyline("a", (0.2, 0.5), (0.8, 0.5), (0.2, 0.5 + 0.6 * np.tan(angle)))
    material = {"young": 1.0, "poisson": poisson, "plane": "strain", "density": 1.0}
    return square([hairpin], material=material, **changes)


TURNING = {"kinematics": "corotational"}
MOVING = {"kind": "dynamic", "duration": 0.2, "time_step": 0.1, "outputs": 2}
HUNG = {"analysis": MOVING, "initial": {"kind": "equilibrium", "cuts": "open"}}


@pytest.mark.parametrize(
    "scene",
    [
        needle(2e-3),
        pytest.param(needle(1.2e-3, 0.47), id="with a pressure"),
        pytest.param(needle(1.2e-3, analysis=TURNING), id="finite rotation"),
        pytest.param(
            needle(1.2e-3, **{**HUNG, "analysis": MOVING | TURNING}),
            id="start of a motion at finite rotation",
        ),
        pytest.param(
            needle(1.2e-3, analysis=MOVING | {"duration": 4e5, "time_step": 2e5}),
            id="a step so long that inertia holds nothing",
        ),
    ],
)
def test_a_needle_too_slender_for_round_off_is_named_by_its_place(scene):
    """Its bending stiffness falls with the cube of its width."""
    with pytest.raises(InputError, match=r"around \(0\.\d+, 0\.5\d*\).*slender"):
        find_solver("reference").solve(scene, 0, 0)


def test_its_inertia_holds_a_needle_in_a_motion():
    scene = needle(1.2e-3, analysis=MOVING)
    ledger = find_solver("reference").solve(scene, 0, 0).ledger
    assert ledger["kinetic"][-1] > 0
    assert np.ptp(ledger["total"]) < 1e-8 * ledger["kinetic"][-1]  # what a step leaves unsolved
