"""Initial fields where the exact one is unbounded: at the edge of a blade."""

from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from reference.exact import exact_of
from verify.scene import load_scene

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
    """|v| ~ r^-½: errors are of order ½ in h, at most twice as large with a node near the edge.

    The value of a node 0.01 elements behind the edge would make it eight times as large.
    """
    cells = np.array([12, 24, 48])
    beside = np.array([interpolation_error(n, 0.5) for n in cells])
    for shift in (0.0, -0.01, -0.05):
        near = np.array([interpolation_error(n, shift) for n in cells])
        orders = -np.diff(np.log(near)) / np.diff(np.log(cells))
        assert orders == pytest.approx(0.5, abs=0.1)
        assert (near < 2.0 * beside).all(), near / beside
