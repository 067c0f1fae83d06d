import numpy as np
import pytest

from verify.assess.richardson import extrapolate, field_uncertainty, observed_order


@pytest.mark.parametrize("order", [0.5, 1.0, 2.0, 4.0])
@pytest.mark.parametrize("sizes", [(1, 0.5, 0.25), (1, 0.6, 0.4), (1, 0.5, 0.4)])
def test_the_order_of_a_power_law_is_found_for_any_refinement_ratios(order, sizes):
    h = np.array(sizes) ** order
    assert observed_order(h[0] - h[1], h[1] - h[2], sizes) == pytest.approx(order, abs=1e-6)


def test_a_clean_sequence_is_extrapolated_to_its_limit_and_brackets_it():
    sizes = [0.4, 0.2, 0.1]
    found = extrapolate([3 + h**2 for h in sizes], sizes, theoretical=2)
    assert found.extrapolated == pytest.approx(3, abs=1e-12)
    assert found.half_width == pytest.approx(1.25 * 0.01, rel=1e-6)
    assert "1.25" in found.reason


@pytest.mark.parametrize(
    "values",
    [
        [3.1, 2.98, 3.01],  # oscillating
        [3.00, 3.01, 3.03],  # diverging
        [3.0, 3.1, 3.1 + 1e-9],  # too good to be true
        [3 + h**0.5 for h in (0.4, 0.2, 0.1)],  # a singularity where order 2 was expected
    ],
)
def test_a_sequence_without_a_sane_order_gets_the_safety_factor_three(values):
    found = extrapolate(values, [0.4, 0.2, 0.1], theoretical=2)
    assert "safety factor 3" in found.reason
    # order 2 halving h leaves at most a third of the last difference; three times that
    assert found.half_width >= (1 - 1e-12) * abs(values[-1] - values[-2])


def test_a_singular_sequence_brackets_its_limit_although_order_two_was_expected():
    sizes = [0.4, 0.2, 0.1]
    found = extrapolate([3 + h**0.5 for h in sizes], sizes, theoretical=2)
    assert abs(found.value - 3) <= found.half_width


def test_levels_whose_differences_grow_are_not_given_the_benefit_of_their_element():
    sizes = [0.4, 0.2, 0.1]
    growing = extrapolate([3.00, 3.01, 3.03], sizes, theoretical=3)
    assert growing.half_width >= 3 * 0.02 * (1 - 1e-12)
    assert "grow" in growing.reason
    assert field_uncertainty([0.01, 0.02], sizes, 3).half_width >= 3 * 0.02 * (1 - 1e-12)


def test_a_functional_may_converge_with_twice_the_order_of_its_element():
    sizes = [0.4, 0.2, 0.1]
    found = extrapolate([1 + h**3.9 for h in sizes], sizes, 2, best=4)
    assert "observed order 3.90, safety factor 1.25" in found.reason
    assert abs(found.value - 1) <= found.half_width <= 1.5 * abs(found.value - 1)


@pytest.mark.parametrize(
    "errors",
    [
        (6.6e-3, 2.3e-4, 1.2e-5),  # order 4.9: the coarsest level is far from its asymptote
        (4.0e-3, -1.2e-5, -2.7e-6),  # one level is right by accident
        (5.5e-4, 4.7e-4, 5.2e-5),  # the first difference is small by accident
    ],
)
def test_one_odd_order_does_not_blow_up_a_bar_where_the_field_converges_as_it_should(errors):
    # K and energies of the tip and Griffith families: bars were 100 to 400 times the error
    values, sizes = [1 + e for e in errors], [0.4, 0.2, 0.1]
    found = extrapolate(values, sizes, 2, best=4, second=4)
    assert abs(errors[-1]) <= found.half_width < 20 * abs(errors[-1])
    assert "as of the field" in found.reason
    careful = extrapolate(values, sizes, 2, best=4)
    assert found.half_width < careful.half_width


@pytest.mark.parametrize("share", [0.0, 0.1, 0.9])
def test_what_falls_like_the_facets_of_a_curve_is_bounded_whatever_the_elements_do(share):
    # elements of order 4 on facets of order 2, of which the coarse level has five, then nine, 17
    sizes, facets = [0.4, 0.2, 0.1], np.array([5, 9, 17])
    errors = (1 - share) * (5 / facets) ** 2 + share * np.array([1, 2**-4, 2**-8])
    falls = (facets[2] / facets[1]) ** 2
    found = extrapolate(list(2 + errors), sizes, 2, best=4, falls=falls)
    assert errors[-1] <= found.half_width < 4 * errors[-1]
    field = field_uncertainty(list(-np.diff(errors)), sizes, 3, falls=falls)
    assert errors[-1] <= field.half_width < 4 * errors[-1]


def test_levels_at_round_off_are_not_extrapolated():
    found = extrapolate([1.0, 1.0 + 2e-16, 1.0 - 2e-16], [0.4, 0.2, 0.1], theoretical=2)
    assert found.order is None
    assert found.half_width < 1e-12


@pytest.mark.parametrize("order", [0.5, 1.0, 2.0, 3.0])
def test_the_uncertainty_of_a_field_bounds_its_error_whatever_its_order(order):
    # u_h = u + h^p e with a fixed e: differences of levels are exact, so is the error
    sizes = np.array([0.4, 0.2, 0.1])
    error = sizes**order
    found = field_uncertainty(list(error[:-1] - error[1:]), list(sizes), theoretical=2)
    assert error[-1] <= found.half_width * (1 + 1e-9) <= 4 * error[-1]
    if order == 2.0:  # as counted on: the error itself, times the safety factor
        assert found.half_width == pytest.approx(1.25 * error[-1])
