"""Orders and error bars: observed rates, extrapolation, what falls how fast, cost of a bar."""

from dataclasses import replace
from math import inf
from types import SimpleNamespace

import numpy as np
import pytest

from verify.compare.body import body_of
from verify.judge.convergence import (
    counted_order,
    error_fall,
    extrapolate,
    field_uncertainty,
    observed_order,
    observed_rate,
)
from verify.judge.intervals import time_to_accuracy
from verify.scene import Scene, load_scene
from verify.solution import Solution

H = [0.4, 0.2, 0.1, 0.05]


def rate(errors, widths=(0.0,) * 4, sizes=H):
    return observed_rate("xfem", "energy_norm", sizes, errors, widths[: len(errors)])


def test_on_a_way_of_a_blade_the_root_of_h_is_counted_on_whatever_the_elements():
    """The stress at its tip grows as 1/√r, wherever that is in the mesh: energy norm ∝ √h."""
    for order in (1, 2):
        solution = SimpleNamespace(order=order)
        assert counted_order(load_scene("benchmark/c5_blade_03"), solution) == 0.5
        assert counted_order(load_scene("statics/f3_inclined"), solution) == order


def test_a_power_law_has_its_order_without_uncertainty():
    found = rate([h**1.5 for h in H])
    assert found.order == pytest.approx(1.5)
    assert found.uncertainty == pytest.approx(0, abs=1e-12)
    assert found.reason == ""


def test_a_slope_that_still_changes_is_uncertain_by_its_change():
    found = rate([h + h**2 for h in H])
    assert found.uncertainty >= abs(found.pairwise[-1] - found.pairwise[-2])
    assert abs(found.order - 1) <= found.uncertainty


def test_the_uncertainty_of_the_errors_goes_into_the_order():
    exact, blurred = [h**2 for h in H], rate([h**2 for h in H], [0.1 * h**2 for h in H])
    assert blurred.uncertainty == pytest.approx(0.2 / 0.6931, rel=1e-3)
    assert rate(exact).uncertainty < blurred.uncertainty


def of_slopes(*slopes):
    """Errors on levels of half the size each, from 1 on."""
    return 2.0 ** -np.cumsum([0.0, *slopes])


@pytest.mark.parametrize(
    "errors, widths, reason",
    [
        ([1e-3, 1e-6, 1e-12, 1e-13], 0.0, "floor"),
        ([1e-1, 1e-2, 4e-3, 3e-3], 2e-3, "floor"),
        # steady slopes; each error is known to a fifth, the slope between two to .4 / log 2
        ([0.4, 0.2, 0.1], [0.08, 0.04, 0.02],
         "floor: slopes 1.00, 1.00, which the uncertainty of the comparison leaves open by 0.58"),
        (of_slopes(1.0, 0.95), 0.2 * of_slopes(1.0, 0.95), "floor"),  # nor is a fall within it one
        ([0.1, 0.2, 0.3, 0.4], 0.0, "diverging"),
        ([0.1, 0.05, 0.07, 0.01], 0.0, "oscillating"),
        # a tip that lies elsewhere in its element on every level
        (of_slopes(1.25, 1.99, 1.09), 0.0, "uneven"),
        (of_slopes(0.5, -0.2, 0.4), 0.0, "oscillating"),
        (of_slopes(0.29, 0.08, 0.01), 0.0, "slowing"),
        (of_slopes(0.10, -0.02), 0.0, "slowing"),
        (of_slopes(0.2, 0.9), 0.0, "rising"),
        (of_slopes(-0.1, 0.5), 0.0, "rising"),
        ([0.0, 1e-2, 2.5e-3], 0.0, "too few levels"),  # of an error of zero there is no slope
    ],
)  # fmt: skip
def test_an_order_that_means_nothing_is_not_given_but_explained(errors, widths, reason):
    widths = np.broadcast_to(widths, len(errors)).tolist()
    found = rate(list(errors), widths, sizes=H[: len(errors)])
    assert found.order is None
    assert found.reason.startswith(reason)


def test_slopes_that_fall_still_bound_the_order():
    # 0.08 → 0.01: the next may differ from 0.01 by 1.25 × 0.07
    found = rate(of_slopes(0.29, 0.08, 0.01).tolist())
    assert found.pairwise[-1] + found.uncertainty == pytest.approx(0.01 + 1.25 * 0.07)


def test_a_fall_that_the_comparison_cannot_explain_is_no_floor():
    """Slopes 0.36, 0.27 of errors that are known 190 times better: a rate of 0.45 is missed."""
    errors, width = (0.0987, 0.0767, 0.0638), 3.5e-4
    rate = observed_rate("a", "energy_norm", [0.08, 0.04, 0.02], errors, [width] * 3)
    assert rate.reason.startswith("slowing")
    assert rate.pairwise[-1] + rate.uncertainty < 0.45


def test_an_error_of_zero_on_an_early_level_leaves_the_order_of_the_others():
    sizes = [0.5**k for k in range(5)]
    errors = [0.0, *(size**2 for size in sizes[1:])]
    assert observed_rate("a", "m", sizes, errors, [0.0] * 5).order == pytest.approx(2.0)


@pytest.mark.parametrize("order", [0.5, 1.0, 2.0, 4.0])
@pytest.mark.parametrize("sizes", [(1, 0.5, 0.25), (1, 0.6, 0.4), (1, 0.5, 0.4)])
def test_the_order_of_a_power_law_is_found_for_any_refinement_ratios(order, sizes):
    h = np.array(sizes) ** order
    assert observed_order(h[0] - h[1], h[1] - h[2], sizes) == pytest.approx(order, abs=1e-6)


def test_a_clean_sequence_is_extrapolated_to_its_limit_and_brackets_it():
    sizes = [0.4, 0.2, 0.1]
    found = extrapolate([3 + h**2 for h in sizes], sizes, 2)
    assert found.extrapolated == pytest.approx(3, abs=1e-12)
    assert found.half_width == pytest.approx(1.6 * 0.01, rel=1e-6)
    assert found.reason == "observed order 2.00, safety factor 1.6"


@pytest.mark.parametrize(
    ("order", "factor"), [(1.81, 1.6), (1.79, 2.5), (2.4, 1.6), (5.0, 1.6), (0.3, 2.5)]
)
def test_the_window_of_orders_is_as_stated(order, factor):
    """Near from nine tenths of the formal order on; counted from ½ to the formal order."""
    sizes = np.array([0.4, 0.2, 0.1])
    found = extrapolate((3 + sizes**order).tolist(), sizes.tolist(), 2)
    fall = 2 ** np.clip(order, 0.5, 2.0)
    first, last = -np.diff(sizes**order)
    assert found.half_width == pytest.approx(factor * max(last, first / fall) / (fall - 1))


@pytest.mark.parametrize(
    ("values", "why"),
    [
        ([3.1, 2.98, 3.01], "no order"),  # oscillating
        ([3.00, 3.01, 3.03], "no order"),  # diverging
        ([3 + h**0.5 for h in (0.4, 0.2, 0.1)], "order 0.50 of 2"),  # a singularity
    ],
)
def test_a_sequence_without_its_formal_order_gets_a_larger_safety_factor(values, why):
    found = extrapolate(values, [0.4, 0.2, 0.1], 2)
    assert why in found.reason
    last = abs(values[-1] - values[-2])
    assert found.half_width >= 2.5 * last / (2**0.5 - 1) * (1 - 1e-9)
    if "no order" in why:
        assert found.half_width >= 3 * last / (2**0.5 - 1) * (1 - 1e-9)


def test_a_difference_that_is_small_by_accident_is_not_taken_for_an_error():
    # d₂ = 1e-9, d₁ = 0.1: an error that falls by 4 leaves a twelfth of d₁
    found = extrapolate([3.0, 3.1, 3.1 + 1e-9], [0.4, 0.2, 0.1], 2)
    assert found.half_width == pytest.approx(1.6 * 0.1 / 4 / 3)


def test_an_order_that_is_too_high_does_not_blow_up_a_bar():
    # K and energies of the tip and Griffith families: bars were 100 to 400 times the error;
    # order 4.9: the coarsest level is far from its asymptote
    errors = (6.6e-3, 2.3e-4, 1.2e-5)
    found = extrapolate([1 + e for e in errors], [0.4, 0.2, 0.1], 4)
    assert abs(errors[-1]) <= found.half_width < 20 * abs(errors[-1])


@pytest.mark.parametrize("share", [0.0, 0.1, 0.9])
def test_what_falls_like_the_facets_of_a_curve_is_bounded_whatever_the_elements_do(share):
    # elements of order 4 on facets of order 2, of which the coarse level has five, then nine, 17
    sizes, facets = [0.4, 0.2, 0.1], np.array([5, 9, 17])
    errors = (1 - share) * (5 / facets) ** 2 + share * np.array([1, 2**-4, 2**-8])
    falls = (facets[2] / facets[1]) ** 2
    found = extrapolate(list(2 + errors), sizes, 4, falls)
    # the coarser difference counts for numbers, in which errors may cancel
    assert errors[-1] <= found.half_width < 14 * errors[-1]
    field = field_uncertainty(list(-np.diff(errors)), sizes, 3, falls)
    assert errors[-1] <= field.half_width < 4 * errors[-1]


def test_levels_at_round_off_are_not_extrapolated():
    found = extrapolate([1.0, 1.0 + 2e-16, 1.0 - 2e-16], [0.4, 0.2, 0.1], 2)
    assert found.order is None
    assert found.half_width < 1e-12


@pytest.mark.parametrize("order", [0.5, 1.0, 2.0, 3.0])
def test_the_uncertainty_of_a_field_bounds_its_error_whatever_its_order(order):
    # u_h = u + h^p e with a fixed e: differences of levels are exact, so is the error
    sizes = np.array([0.4, 0.2, 0.1])
    error = sizes**order
    found = field_uncertainty(list(error[:-1] - error[1:]), list(sizes), 2)
    assert error[-1] <= found.half_width * (1 + 1e-9) <= 4 * error[-1]
    if order == 2.0:  # as counted on: the error itself, times the safety factor
        assert found.half_width == pytest.approx(1.6 * error[-1])


def on_an_arc(facets):
    turn = np.deg2rad(np.linspace(20.0, 70.0, facets + 1))
    ring = 0.6 * np.column_stack([np.cos(turn), np.sin(turn)])
    return SimpleNamespace(cut_facets=np.stack([ring[:-1], ring[1:]], axis=1))


def plate_with_an_arc():
    content = load_scene("statics/griffith_inside").model_dump(mode="json", by_alias=True)
    cut = {"kind": "arc", "centre": [0.0, 0.0], "radius": 0.6, "start": 10.0, "sweep": 90.0}
    return Scene.model_validate(content | {"cuts": [cut], "acceptance": []})


def test_facets_of_an_arc_fall_like_the_square_of_their_number():
    scene = plate_with_an_arc()
    body = body_of(scene)
    levels = [on_an_arc(n) for n in (20, 35)]
    # halved elements, but 35 facets instead of 40
    assert error_fall(scene, levels, [0.2, 0.1], body) == pytest.approx((35 / 20) ** 2, rel=1e-3)
    assert error_fall(scene, [levels[1]] * 2, [0.2, 0.1], body) == 2.0


def test_a_straight_cut_limits_nothing_and_time_steps_are_of_second_order():
    straight = SimpleNamespace(cut_facets=np.zeros((0, 2, 2)))
    for name, fall in (("statics/griffith_inside", inf), ("dynamics/freed_half", 4.0)):
        scene = load_scene(name)
        assert error_fall(scene, [straight] * 2, [0.2, 0.1], body_of(scene)) == fall


TRIANGLE = Solution(np.eye(3)[:, :2], np.array([[0, 1, 2]]), np.zeros((1, 3, 2)))
LEVELS = {
    level: replace(TRIANGLE, unknowns=10 * 4**level, timings={"solve": [3.0, 1.0, 2.0 + level]})
    for level in range(3)
}


def test_bounds_hold_for_the_limit_of_a_sequence_and_fall_with_the_level():
    values = [2 + 0.4 * 4.0**-k for k in range(3)]  # the limit is 2
    norms = [0.12, 0.03]  # of a field whose errors are .16, .04, .01
    metrics = {
        "strain_energy": {"values": values, "uncertainty": 0.03},
        "energy_norm": {"values": norms, "uncertainty": 0.0125},
    }
    rows = time_to_accuracy(LEVELS, metrics)
    assert [row["unknowns"] for row in rows.values()] == [10, 40, 160]
    assert [row["seconds"] for row in rows.values()] == [2.0, 3.0, 3.0]
    for k, row in enumerate(rows.values()):
        assert abs(values[k] - 2) <= row["strain_energy"] * values[-1] <= 0.44 / 4**k + 0.03
        assert 0.16 / 4**k <= row["energy_norm"] <= 0.16 / 4**k + 0.0126


@pytest.mark.parametrize("finest", [1.0, -1.0])
def test_the_bound_of_the_finest_level_is_its_own_half_width(finest):
    metrics = {"u": {"values": [1.3, 1.1, finest], "uncertainty": 0.02}}
    assert time_to_accuracy(LEVELS, metrics)["level 2"]["u"] == pytest.approx(0.02 / 0.98)
