"""Initial fields where the exact one is unbounded: at the edge of a blade."""

from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from reference.exact import exact_of
from verify.errors import InputError
from verify.scene import load_scene
from verify.scene.tables import InitialField

CASES = Path(__file__).parents[2] / "cases"
HALF = 0.05  # m: of the square around the edge, whose upper half is looked at


def interpolation_error(cells: int, shift: float) -> float:
    """L2 error (m²/s) of the velocity between nodes at the start; shift 0: a node at the edge."""
    scene = load_scene(CASES / "benchmark/c5_blade_03.toml")
    exact = exact_of(scene)
    h = HALF / cells
    x, y = h * (np.arange(-cells - 1, cells + 2) + shift), h * np.arange(cells + 1)
    nodes = np.array([(a, b, 0.0025) for a in x for b in y])
    above = nodes + h * np.array([0.3, 0.3, 0.0])  # within an element, above the cut
    _, velocity = scene.initial.state(nodes, above, exact)
    linear = RegularGridInterpolator((x, y), velocity[:, 2].reshape(len(x), len(y)))
    points = np.random.default_rng(3).uniform((-HALF, 1e-9), HALF, (400_000, 2))
    at = np.column_stack([points, np.full(len(points), 0.0025)])
    true = exact.at(0.0).velocity(at, at)[:, 2]
    return float(np.sqrt(np.mean((linear(points) - true) ** 2) * 2 * HALF**2))


def test_no_velocity_at_a_node_at_the_edge_costs_no_more_than_the_order_of_interpolation():
    """|v| ~ r^-½: errors are of order ½ in h, at most twice as large with a node at the edge."""
    cells = np.array([12, 24, 48])
    beside, at_edge = (
        np.array([interpolation_error(n, shift) for n in cells]) for shift in (0.5, 0.0)
    )
    orders = -np.diff(np.log(at_edge)) / np.diff(np.log(cells))
    assert orders == pytest.approx(0.5, abs=0.1)
    assert (at_edge < 2.0 * beside).all(), at_edge / beside


def test_a_smooth_velocity_that_peaks_at_a_node_is_taken_as_it_is():
    """Five times as large as within the elements, but of a formula's kind: nothing is dropped."""
    points = np.column_stack([np.linspace(-1.0, 1.0, 5), np.zeros(5)])

    class Peak:
        def at(self, time):
            return self

        def velocity(self, points, near):
            return np.exp(-20.0 * points**2)

        displacement = velocity

    u, v = InitialField(kind="field", displacement="exact", velocity="exact").state(
        points, points + 0.25, Peak()
    )
    assert v == pytest.approx(np.exp(-20.0 * points**2), rel=1e-14)
    assert u == pytest.approx(v, rel=1e-14)


def test_a_node_almost_at_the_edge_is_refused():
    with pytest.raises(InputError, match="unbounded beside the node"):
        interpolation_error(12, -1e-5)
