"""K_I, K_II, K_III and openings along fronts in space, against closed forms."""

from functools import cache

import numpy as np
import pytest
from fourth_order import difference
from reference_scenes import needs_fenicsx
from solid_scenes import EXACT, cube, disc

from reference.exact import exact_solution
from reference.fracture import CircularFront, StraightFront, front_intensity
from reference.fracture.tips import mode_field
from reference.meshing import imprint_polygons, open_cut, structured_tetrahedra
from verify.errors import InputError
from verify.scene import Material
from verify.solution import Solution
from verify.solvers import find_solver

SOLID = Material(young=1.0, poisson=0.3)
FRONT = StraightFront([0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])


def prism_field(intensity, points, middles):
    """Displacement of the plane tip fields and of mode III in a prism cut on x < 0, y = 0."""
    k_1, k_2, k_3 = intensity
    plane = Material(young=1.0, poisson=0.3, plane="strain")
    tip = exact_solution("tip", {"tip": [0.0, 0.0], "intensity": [k_1, k_2]}, plane)
    field = np.zeros((len(points), 3))
    field[:, :2] = tip.displacement(points[:, :2], middles[:, :2])
    y = np.where(np.abs(points[:, 1]) < 1e-12, np.sign(middles[:, 1]) * 1e-300, points[:, 1])
    r, angle = np.hypot(points[:, 0], y), np.arctan2(y, points[:, 0])
    field[:, 2] = k_3 * 2 / tip.law.shear * np.sqrt(r / (2 * np.pi)) * np.sin(angle / 2)
    return field


@cache
def prism(intensity, n=16):
    """Give the exact field at the nodes of P2 elements on a box cut along x < 0, y = 0."""
    grid = structured_tetrahedra((-1, -1, 0), (1, 1, 1), (n, n, n // 4))
    plane = np.array([[-2, 0, -1], [0, 0, -1], [0, 0, 2], [-2, 0, 2.0]])
    mesh = open_cut(*imprint_polygons(*grid, [plane]))
    corner = mesh.points[mesh.cells]
    middles = corner.mean(axis=1)
    ends = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]
    # each cell has nodes of its own: the field is the same where the material holds together
    nodes = np.concatenate([corner, *[0.5 * (corner[:, [i]] + corner[:, [j]]) for i, j in ends]], 1)
    points = nodes.reshape(-1, 3)
    near = np.repeat(middles, 10, axis=0)
    field = prism_field(intensity, points, near)
    return Solution(
        points, np.arange(len(points)).reshape(-1, 10), field[None], order=2,
        cut_facets=mesh.realised_cut,
    )  # fmt: skip


@pytest.mark.parametrize("intensity", [(1, 0, 0), (0.7, -0.4, 0.5)])
def test_the_three_modes_are_told_apart_in_the_exact_fields_of_a_prism(intensity):
    field = prism(intensity)
    found = front_intensity(field, SOLID, FRONT, [0.4, 0.6, 0.8], stations=2)
    # the interpolant's gradient is off by (h/r)² √r of K/E' at h = 1/8: percents next to the front
    # only, where the fields change sign
    assert found.modes == pytest.approx(np.tile(intensity, (2, 1)), abs=6e-3)
    # Irwin's (K_I² + K_II²)/E' + K_III²/2μ with E' = 1/0.91 and μ = 1/2.6; 1/2μ is 1.3
    expected = 0.91 * (intensity[0] ** 2 + intensity[1] ** 2) + 1.3 * intensity[2] ** 2
    assert found.release == pytest.approx([expected] * 2, abs=1.3 * 2 * 6e-3)
    assert found.spread.max() < 6e-3


def test_stations_closer_than_the_elements_along_a_front_have_its_factors():
    """Hats of 0.19 m between nodes 0.25 m apart are those of the nodes, not of the arc length."""
    field = prism((0.7, -0.4, 0.5))
    front = StraightFront([0.0, 0.0, 0.21], [0.0, 0.0, 0.93], [1.0, 0.0, 0.0])
    found = front_intensity(field, SOLID, front, [0.4, 0.6, 0.8], stations=3, fitted=False)
    assert found.modes == pytest.approx(np.tile([0.7, -0.4, 0.5], (3, 1)), abs=2e-2)


def test_a_station_that_no_node_is_near_is_refused():
    front = StraightFront([0.0, 0.0, 0.26], [0.0, 0.0, 0.49], [1.0, 0.0, 0.0])
    with pytest.raises(InputError, match="no node of the mesh"):
        front_intensity(prism((1, 0, 0)), SOLID, front, [0.6], stations=3, fitted=False)


def test_the_intensity_does_not_depend_on_the_axes():
    field = prism((0.7, -0.4, 0.5), 8)
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    turned = Solution(field.points @ turn.T, field.cells, field.displacement @ turn.T, order=2)
    front = StraightFront(turn @ [0, 0, 0], turn @ [0, 0, 1], turn @ [1, 0, 0])
    one = front_intensity(field, SOLID, FRONT, [0.7])
    two = front_intensity(turned, SOLID, front, [0.7])
    assert two.modes == pytest.approx(one.modes, abs=1e-10)


@pytest.mark.parametrize("mode", [1, 2, 3])
def test_the_curved_fields_are_what_differences_in_space_say(mode):
    # around a circle: gradient of the displacement, divergence of the stress, and the misfit of
    # the strains, by central differences of fields given in fixed axes
    radius = 1.3
    front = CircularFront([0, 0, 0], [0, 0, 1], radius)
    rng = np.random.default_rng(2)
    turn = rng.uniform(0, 2 * np.pi, 5)
    ahead, across = rng.uniform(-0.3, 0.3, 5), rng.uniform(0.05, 0.3, 5)
    points = np.column_stack(
        [(radius + ahead) * np.cos(turn), (radius + ahead) * np.sin(turn), across]
    )
    law = exact_solution("linear", {"matrix": np.zeros((3, 3)).tolist()}, SOLID).law

    def displacement(x):
        at = front.coordinates(x)
        r, angle = np.hypot(at.ahead, at.across), np.arctan2(at.across, at.ahead)
        local = np.zeros((len(x), 3))
        if mode == 3:
            local[:, 2] = 2 / law.shear * np.sqrt(r / (2 * np.pi)) * np.sin(angle / 2)
        else:
            plane = Material(young=1.0, poisson=0.3, plane="strain")
            k = [1.0, 0.0] if mode == 1 else [0.0, 1.0]
            tip = exact_solution("tip", {"tip": [0.0, 0.0], "intensity": k}, plane)
            local[:, :2] = tip.displacement(np.column_stack([at.ahead, at.across]))
        return np.einsum("nij,ni->nj", at.axes, local)

    def in_space(name, x):
        at = front.coordinates(x)
        tensor = getattr(mode_field(mode, SOLID, at.ahead, at.across, front.curvature), name)
        return at.axes.swapaxes(1, 2) @ tensor @ at.axes

    at = front.coordinates(points)
    field = mode_field(mode, SOLID, at.ahead, at.across, front.curvature)
    assert difference(displacement, points, 1e-3) == pytest.approx(
        in_space("gradient", points), abs=1e-6
    )
    divergence = np.einsum("nijj->ni", difference(lambda x: in_space("stress", x), points, 1e-3))
    local = np.einsum("nij,nj->ni", at.axes, divergence)
    assert local == pytest.approx(field.divergence, abs=1e-5)

    def misfit(x):
        gradient, stress = in_space("gradient", x), in_space("stress", x)
        trace = np.trace(stress, axis1=1, axis2=2)[:, None, None] * np.eye(3)
        return 0.5 * (gradient + gradient.swapaxes(1, 2)) - (1.3 * stress - 0.3 * trace)

    slope = np.einsum("nijk,nk->nij", difference(misfit, points, 1e-3), at.axes[:, 0])
    assert at.axes @ slope @ at.axes.swapaxes(1, 2) == pytest.approx(field.misfit, abs=1e-5)


def test_each_station_sees_its_own_intensity_whichever_others_are_asked_for():
    """A field whose K_I rises along the front: nodal sums are shared out by hats."""
    field = prism((1, 0, 0))
    rising = Solution(
        field.points, field.cells, field.displacement * (1 + field.points[:, 2:]), order=2,
        cut_facets=field.cut_facets,
    )  # fmt: skip
    three = front_intensity(rising, SOLID, FRONT, [0.5], stations=3).modes[:, 0]
    flat = front_intensity(field, SOLID, FRONT, [0.5], stations=3).modes[:, 0]
    # linear along the front: a hat's mean is the value at its middle
    assert three / flat == pytest.approx(1 + np.array([0.25, 0.5, 0.75]), rel=0.02)


@pytest.mark.heavy
class TestThePenny:
    """A penny of radius 1 in a cube of side 4 with the exact field on its surface."""

    pytestmark = needs_fenicsx
    INTENSITY = 2 / np.sqrt(np.pi)
    FRONT = CircularFront([0, 0, 0], [0, 0, 1], 1.0)

    @staticmethod
    def solve(level, size=1.0, **changes):
        scene = cube(
            [disc(1.0, (0.0, 0.0, 0.0))],
            geometry={"kind": "box", "lower": [-2, -2, -2], "upper": [2, 2, 2]},
            exact={"solution": "penny", "parameters": {"a": 1.0, "tension": 1.0}},
            reference={"size": size},
            **{"supports": EXACT, "loads": [], **changes},
        )
        return find_solver("reference").solve(scene, level, repetitions=0)

    def test_at_4999_a_free_face_leaves_the_intensity_as_exact_as_at_a_third(self):
        """Displacements all around give the crack's volume: K_I is 2 % off, as is the volume."""
        sides = ["left", "right", "front", "back", "bottom"]
        material = Material(young=1.0, poisson=0.4999)
        field = self.solve(
            0,
            0.5,
            material={"young": 1.0, "poisson": 0.4999, "density": 1.0},
            supports=[{"where": side, "displacement": "exact"} for side in sides],
            loads=[{"kind": "traction", "where": "top", "traction": "exact"}],
        )
        found = front_intensity(field, material, self.FRONT, [0.4, 0.55], stations=4)
        assert found.modes[:, 0] / self.INTENSITY == pytest.approx(np.ones(4), abs=1e-3)

    def test_its_energy_is_known_to_a_thousandth(self):
        field = self.solve(0, 0.34)
        assert field.ledger["strain"][0] == pytest.approx(32.244473884, rel=1e-3)
        found = front_intensity(field, SOLID, self.FRONT, [0.3, 0.4, 0.5], stations=8)
        assert found.modes[:, 0] / self.INTENSITY == pytest.approx(np.ones(8), abs=3e-3)
