import pytest

from verify.assess.rates import observed_rate

H = [0.4, 0.2, 0.1, 0.05]


def rate(errors, widths=(0.0,) * 4, sizes=H):
    return observed_rate("xfem", "energy_norm", sizes, errors, widths[: len(errors)])


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


@pytest.mark.parametrize(
    "errors, widths, reason",
    [
        ([1e-3, 1e-6, 1e-12, 1e-13], (0.0,) * 4, "floor"),
        ([1e-1, 1e-2, 4e-3, 3e-3], (2e-3,) * 4, "floor"),
        ([0.1, 0.2, 0.3, 0.4], (0.0,) * 4, "diverging"),
        ([0.1, 0.05, 0.07, 0.01], (0.0,) * 4, "oscillating"),
    ],
)
def test_an_order_that_means_nothing_is_not_given_but_explained(errors, widths, reason):
    found = rate(errors, widths)
    assert found.order is None
    assert found.reason.startswith(reason)


def test_slopes_that_jump_by_half_their_size_are_no_order():
    # a tip that lies elsewhere in its element on every level: 1.25, 1.99, 1.09 were seen
    errors = [1.0, 2**-1.25, 2 ** -(1.25 + 1.99), 2 ** -(1.25 + 1.99 + 1.09)]
    rate = observed_rate("xfem", "displacement_l2", [8, 4, 2, 1], errors, [0.0] * 4)
    assert rate.order is None
    assert rate.reason.startswith("oscillating")
    assert len(rate.pairwise) == 3


def test_steady_slopes_that_the_comparison_leaves_open_are_not_called_oscillating():
    # 1.00, 1.00; each error is known to a fifth, the slope between two to .4 / log 2 = .58
    errors = [0.4, 0.2, 0.1]
    rate = observed_rate("xfem", "jump_l2", [4, 2, 1], errors, [0.2 * e for e in errors])
    assert rate.order is None
    assert rate.reason == (
        "floor: slopes 1.00, 1.00, which the uncertainty of the comparison leaves open by 0.58"
    )


@pytest.mark.parametrize(
    "slopes, reason",
    [
        ([0.29, 0.08, 0.01], "slowing"),
        ([0.10, -0.02], "slowing"),
        ([0.2, 0.9], "rising"),
        ([-0.1, 0.5], "rising"),
        ([0.5, -0.2, 0.4], "oscillating"),
    ],
)
def test_slopes_that_only_fall_or_only_rise_are_not_called_oscillating(slopes, reason):
    errors = [1.0]
    for slope in slopes:
        errors.append(errors[-1] * 2**-slope)
    found = rate(errors, sizes=H[: len(errors)])
    assert found.order is None
    assert found.reason.startswith(reason)


def test_slopes_that_fall_still_bound_the_order():
    # 0.08 → 0.01: the next may differ from 0.01 by 1.25 × 0.07
    errors = [1.0, 2**-0.29, 2**-0.37, 2**-0.38]
    found = rate(errors)
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


def test_an_error_of_zero_on_the_first_of_three_levels_leaves_no_two_slopes():
    rate = observed_rate("a", "m", [1.0, 0.5, 0.25], [0.0, 1e-2, 2.5e-3], [0.0] * 3)
    assert rate.order is None
    assert rate.reason.startswith("too few levels")
