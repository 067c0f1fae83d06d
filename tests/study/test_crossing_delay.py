"""Opening late: how late elements open behind a blade, and how much that is worth."""

import numpy as np
import pytest

from verify.compare.body import body_of
from verify.scene import load_scene
from verify.solvers import find_solver
from verify.study.budget.crossing_delay import mean_wait

SPEED = 0.6
PLATE = """title = "A stretched plate under a blade"
requirement = "It shall open behind the blade."
[geometry]
kind = "rectangle"
lower = [0.0, 0.0]
upper = [1.0, 0.5]
[mesh]
cells = [[16, 8], [32, 16], [64, 32]]
[material]
young = 1.0e4
poisson = 0.3
density = 1000.0
plane = "strain"
[analysis]
kind = "dynamic"
duration = 2.0
time_step = 0.025
outputs = 5
[initial]
kind = "equilibrium"
[[supports]]
where = "bottom"
displacement = [0.0, -0.01]
[[supports]]
where = "top"
displacement = [0.0, 0.01]
[[cuts]]
kind = "tool_path"
points = [[-0.05, 0.27], [1.1, 0.27]]
speed = 0.6
"""


def scene_of(folder, *changes):
    text = PLATE
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "plate.toml").write_text(text)
    return load_scene(folder / "plate.toml")


@pytest.mark.parametrize("level", [0, 1])
def test_a_place_waits_on_average_for_half_of_its_element(tmp_path, level):
    """In a row of halved squares the blade crosses chords a and h − a, each in c ÷ speed."""
    scene = scene_of(tmp_path)
    solution = find_solver("xfem").solve(scene, level, 0, scheme="implicit_euler")
    h = 1 / 16 / 2**level
    below = (0.27 % h) / h  # share of the square below the path
    chords = h * np.array([below, 1.0 - below])
    expected = (chords**2).sum() / chords.sum() / 2 / SPEED
    assert mean_wait(scene, body_of(scene), solution) == pytest.approx(expected, rel=1e-9)


@pytest.mark.fenicsx
def test_opening_late_is_an_error_of_first_order_in_the_delay(tmp_path):
    """The tip lags by v τ; ∂u/∂a is square integrable there, so the change of u is of order τ."""
    scene = scene_of(tmp_path, ("[[16, 8], [32, 16], [64, 32]]", "[[32, 16]]"))
    solver = find_solver("conforming")
    choice = {"scheme": "generalised_alpha", "spectral_radius": 0.5}
    intime = solver.solve(scene, 0, 0, **choice)
    changes = []
    for facets in (4, 2, 1):
        delay = facets / 32 / SPEED
        late = solver.solve(scene, 0, 0, delay=delay, **choice)
        np.testing.assert_array_equal(late.points, intime.points)
        changes.append(np.linalg.norm(late.displacement[2] - intime.displacement[2]))
    orders = np.log2(np.array(changes[:-1]) / changes[1:])
    assert (orders > 0.7).all(), orders
    assert (orders < 1.3).all(), orders
