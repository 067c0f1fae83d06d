"""Dense loops in vectors do what numpy does with whole matrices, and leave alone what is beside."""

import numpy as np
import pytest
from numba import njit

from verify.accelerated.dense_tiles import (
    COLUMNS,
    ROWS,
    add_run,
    padded,
    project_columns,
    substitute,
    subtract_columns,
    subtract_product,
)
from verify.xfem.lanes.shuffles import address

ROUND_OFF = 1e-13  # of sums of some fifty products of numbers of size one


@njit
def _product(target, at, factor, left, right, rows, columns, depth):
    subtract_product(
        address(target.reshape(-1)), at, target.shape[1], address(factor.reshape(-1)), left, right,
        factor.shape[1], rows, columns, depth,
    )  # fmt: skip


@njit
def _substitute(columns, at, rows, factor):
    substitute(address(columns.reshape(-1)), at, columns.shape[1], rows, address(factor))


@njit
def _add_run(target, place, source, at, count):
    add_run(address(target), place, address(source), at, count)


@njit
def _take(target, at, columns, begin, rows, factors):
    flat = columns.reshape(-1)
    subtract_columns(
        address(target), at, address(flat), begin, columns.shape[1], rows, address(factors)
    )


@njit
def _project(numbers, at, columns, begin, rows, products):
    flat = columns.reshape(-1)
    project_columns(
        address(numbers), at, address(flat), begin, columns.shape[1], rows, address(products)
    )


@pytest.mark.parametrize("vectors", range(1, 9))
@pytest.mark.parametrize("depth", [0, 1, 37])
def test_a_product_is_taken_from_its_rows_and_columns_only(vectors, depth):
    rng = np.random.default_rng(vectors)
    factor, target = rng.normal(size=(40, 90)), rng.normal(size=(14, 72))
    rows, columns = vectors * ROWS, 3 * COLUMNS
    wanted = target.copy()
    left, right = factor[:depth, 9 : 9 + rows], factor[:depth, 3 : 3 + columns]
    wanted[1 : 1 + columns, 5 : 5 + rows] -= right.T @ left
    _product(target, 72 + 5, factor, 9, 3, rows, columns, depth)
    assert np.abs(target - wanted).max() < ROUND_OFF


def test_substitution_solves_with_the_triangle():
    rng = np.random.default_rng(1)
    lower = np.tril(rng.normal(size=(COLUMNS, COLUMNS))) + 4.0 * np.eye(COLUMNS)
    rows = [[1.0 / lower[i, i] if i == j else lower[i, j] for j in range(i + 1)]
            for i in range(COLUMNS)]  # fmt: skip
    right = rng.normal(size=(COLUMNS, 40))
    wanted = right.copy()
    wanted[:, 8:24] = np.linalg.solve(lower, right[:, 8:24])
    _substitute(right, 8, 16, np.concatenate(rows))
    assert np.abs(right - wanted).max() < ROUND_OFF


@pytest.mark.parametrize("count", range(20))
def test_a_run_of_any_length_is_added_and_nothing_behind_it(count):
    rng = np.random.default_rng(count)
    target, source = rng.normal(size=40), rng.normal(size=30)
    wanted = target.copy()
    wanted[5 : 5 + count] += source[7 : 7 + count]
    _add_run(target, 5, source, 7, count)
    np.testing.assert_array_equal(target, wanted)


def test_columns_are_combined_and_projected_upon():
    rng = np.random.default_rng(3)
    columns, numbers, factors = (rng.normal(size=n) for n in ((6, 48), 48, COLUMNS))
    wanted = numbers.copy()
    wanted[8:32] -= factors @ columns[1 : 1 + COLUMNS, 16:40]
    _take(numbers, 8, columns, 48 + 16, 24, factors)
    assert np.abs(numbers - wanted).max() < ROUND_OFF
    products = np.empty(COLUMNS)
    _project(numbers, 8, columns, 48 + 16, 24, products)
    assert np.abs(products - columns[1 : 1 + COLUMNS, 16:40] @ numbers[8:32]).max() < ROUND_OFF


@pytest.mark.parametrize(("length", "full"), [(0, 0), (1, 8), (8, 8), (9, 16)])
def test_lengths_are_rounded_up_to_whole_vectors(length, full):
    assert padded(length) == full
