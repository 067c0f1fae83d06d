"""Loads and supports that vary in space, by formulas in the case."""

import numpy as np
import pytest
import scenes

from verify.errors import InputError
from verify.scene import parse_expression

POINTS = np.random.default_rng(3).uniform(-1, 1, (50, 3))


def test_a_support_moves_by_its_formula_times_the_factor_of_its_history():
    moved = [{"where": "left", "displacement": ["0.1*y", 0.0]}]
    support = scenes.scene(supports=moved).supports[0]
    points = np.array([[0.0, 0.5], [0.0, 1.0]])
    np.testing.assert_allclose(support.values(points, 0.5), [[0.025, 0], [0.05, 0]], atol=1e-17)
    rates = support.velocities(points, 0.5, 2.0, 0.0)
    np.testing.assert_allclose(rates, [[0.1, 0], [0.2, 0]], atol=1e-17)


@pytest.mark.parametrize(
    "text",
    [
        "x*sin(3*t) + y", "sqrt(1 + t*x**2)", "hypot(x, 2*t)", "abs(x - t)", "(1 + t)**(x + t)",
        "x/(2 + t*y)", "cos(t)**3 - t", "x", "t**2",
    ],
)  # fmt: skip
def test_the_rate_of_a_formula_is_its_derivative_by_the_time(text):
    """Python computes the same value."""
    expression, step = parse_expression(text, 2, timed=True), 1e-6
    points = POINTS[:, :2]
    expected = (expression(points, 0.7 + step) - expression(points, 0.7 - step)) / (2 * step)
    x, y = points.T
    value = eval(text, {"x": x, "y": y, "t": 0.7, **vars(np)})
    np.testing.assert_allclose(expression(points, 0.7), value + 0.0 * x, rtol=1e-14, atol=1e-15)
    # second differences of 1e-12, round-off of 1e-16 over 1e-6
    np.testing.assert_allclose(expression.rate(points, 0.7), expected, atol=1e-8)


def test_what_stands_still_has_no_rate_where_its_slope_is_infinite():
    at = np.array([[0.0, 0.0]])
    for text in ("sqrt(x)*t", "x**0.5", "hypot(x, y)", "abs(x) + t"):
        rate = parse_expression(text, 2, timed=True).rate(at, 0.0)
        assert rate == pytest.approx(1.0 if "+ t" in text else 0.0)
    with pytest.raises(InputError, match=r"no finite rate at 0 s at \(0, 0\)"):
        parse_expression("sqrt(t)", 2, timed=True).rate(at, 0.0)


MOTION = {"material": scenes.soft(density=1.0), "analysis": {"kind": "dynamic", "duration": 1.0}}
