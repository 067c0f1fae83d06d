"""Cost of the end of a cut: another end, wherever it falls in an element, and with nodes there."""

from functools import cache

import numpy as np
import pytest
from griffith_ends import Crack, crack_scene
from tip_advance import tip_advances

from reference.exact import exact_solution
from verify.compare.body import body_of

ANGLES, PLACES = (20.0, -35.0), range(6)
RULES = ("inside", "through")
COARSE = 16
levels = pytest.mark.parametrize("count", [COARSE, pytest.param(32, marks=pytest.mark.heavy)])


def ends_at(place, angle, size):
    """Ends at fractions place/6 and place/6 + 1/12 of an element's width, at changing heights."""
    shift = size * np.array([place / 6, place / 6 + 1 / 12])
    slope = np.tan(np.deg2rad(angle))
    x = np.array([-0.9375 - shift[1], 0.9375 + shift[0]])
    height = size * (0.1 + 0.37 * place)
    return np.stack([x, height + slope * x], axis=1)


@cache
def cracks(count):
    """All cracks, each with its answers by the conforming elements and by XFEM's rules.

    On the coarse mesh an angle has every third place.
    """
    found = []
    for number, angle in enumerate(ANGLES):
        for place in PLACES[number::3] if count == COARSE else PLACES:
            ends = ends_at(place, angle, 4.0 / count)
            crack = Crack(crack_scene(ends, angle, {"cells": [[count, count]]}))
            answers = {rule: crack.solve("xfem", tip=rule) for rule in RULES}
            found.append((crack, {"conforming": crack.solve("conforming"), **answers}))
    return found


def of(rule, count):
    return [(crack, answers[rule]) for crack, answers in cracks(count)]


def test_the_derivative_by_an_end_is_held_at_the_outline_and_singular_as_the_crack_says():
    """Beside the end it is the derivative of the crack in an infinite plate, by differences."""
    scene = crack_scene(ends_at(1, 20.0, 0.25), 20.0, {"cells": [[16, 16]]})
    parameters = scene.exact.parameters
    crack = exact_solution("griffith", parameters, scene.material)
    outline = body_of(scene).loops[0]
    first, second = tip_advances(crack, outline)[:2]
    share = np.linspace(0.0, 1.0, 57)[:, None]
    next_corner = np.roll(outline, -1, axis=0)
    sides = np.concatenate([p + share * (q - p) for p, q in zip(outline, next_corner, strict=True)])
    inside = np.random.default_rng(2).uniform(-1.0, 1.0, (50, 2))
    for one in (first, second):
        held = np.abs(one.displacement(sides)).max()
        assert held < 0.01 * np.abs(one.displacement(inside)).max()
    tip, along = crack.singular_points[1], np.diff(crack.singular_points, axis=0)[0]
    along /= np.linalg.norm(along)
    turn = np.linspace(-3.0, 3.0, 13)
    around = np.stack([np.cos(turn), np.sin(turn)], axis=1) @ np.stack(
        [along, [-along[1], along[0]]]
    )
    step = 1e-7

    def advanced(by):
        centre = np.array(parameters["centre"]) + 0.5 * by * along
        moved = {**parameters, "a": parameters["a"] + 0.5 * by, "centre": centre.tolist()}
        return exact_solution("griffith", moved, scene.material)

    points = tip + 1e-4 * around
    wanted = (advanced(step).displacement(points) - advanced(-step).displacement(points)) / step / 2
    found = first.displacement(points) + second.displacement(points)
    # regular terms are smaller there by the root of 1e-4
    assert np.abs(found - wanted).max() < 0.02 * np.abs(wanted).max()


@levels
@pytest.mark.parametrize("rule", ["conforming", *RULES])
def test_the_energy_says_the_same_of_the_ends_as_the_displacement(rule, count):
    """Two measurements that share nothing but the answer. Both are of first order in h: ends that
    are 1.2 elements short have released (1.2 h)²/4a, 0.1 elements on the coarse level, less."""
    differ = [one.released - (one.ends @ crack.modes).sum() for crack, one in of(rule, count)]
    assert np.abs(differ).max() < 0.5 * 16 / count  # elements, both ends together


@levels
def test_conforming_elements_with_a_node_at_the_end_shorten_it_by_a_third_of_an_element_too(count):
    shifts = np.array([one.ends[:, 0] for _, one in of("conforming", count)])
    assert np.all((shifts > -0.55) & (shifts < -0.25))
    assert np.mean(shifts) == pytest.approx(-0.37, abs=0.05)


def test_ends_on_nodes_of_the_mesh_cost_xfem_what_they_cost_conforming_elements():
    scene = crack_scene([[-1.0, 0.0], [1.0, 0.0]], 0.0, {"cells": [[16, 16]]})
    crack = Crack(scene)
    one, other = crack.solve("xfem"), crack.solve("conforming")
    assert one.error == pytest.approx(other.error, rel=1e-9)


LIMIT = 1.15
MESHES = {"structured": {"cells": [[16, 16]]}, "unstructured": {"sizes": [0.25]}}


@pytest.mark.parametrize(
    "seed, pattern",
    [(0, "structured"), (1, "unstructured"),
     *(pytest.param(n, p, marks=pytest.mark.heavy) for n in range(2, 24) for p in MESHES)],
)  # fmt: skip
def test_cracks_in_general_position_are_within_the_limit(seed, pattern):
    """Nodes at the ends: errors in L2 and in energy over the errors of the conforming mesh."""
    random = np.random.default_rng(seed)
    angle, centre = random.uniform(-80.0, 80.0), random.uniform(-0.12, 0.12, 2)
    turn = np.deg2rad(angle)
    along = random.uniform(0.8, 1.1) * np.array([np.cos(turn), np.sin(turn)])
    mesh = MESHES[pattern] | {"pattern": pattern}
    crack = Crack(crack_scene([centre - along, centre + along], angle, mesh))
    conforming, found = crack.solve("conforming"), crack.solve("xfem", tip="partial")
    assert found.error < LIMIT * conforming.error
    # the outline is held: E_h − E = ‖e‖²
    assert found.released / conforming.released < LIMIT**2
