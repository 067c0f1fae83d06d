"""A packed solution comes back: mesh and cuts bit by bit, fields to the digits that are kept."""

import lzma
from dataclasses import fields

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.spatial import Delaunay

from verify.errors import InputError
from verify.result import Regularisation
from verify.runner.packing import packed, unpacked
from verify.solution import ContactPressure, Solution

EDGES = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]


def quadratic(d, rng, space=None):
    """Nodes in any order, edges that bend, and two middles on one edge, as beside a crack's end."""
    corners = rng.standard_normal((12, d))
    cells = Delaunay(corners).simplices
    if space:
        corners = np.column_stack([corners, corners[:, 0] ** 2])
    number, points, rows = {}, list(corners), []
    for row, cell in enumerate(cells):
        middles = []
        for one, other in EDGES[: 3 * (d - 1)]:
            ends = (*sorted((cell[one], cell[other])), row == 0)
            if ends not in number:
                number[ends] = len(points)
                bend = 1e-3 * rng.standard_normal(corners.shape[1]) * (len(points) % 3 == 0)
                points.append(0.5 * (corners[ends[0]] + corners[ends[1]]) + bend)
            middles.append(number[ends])
        rows.append([*cell, *middles])
    order = rng.permutation(len(points))
    return np.array(points)[np.argsort(order)], order[np.array(rows)]


def moving(points, cells, order, rng, **more):
    t, k = 3, {3: 3, 6: 3, 4: 4, 10: 4}[cells.shape[1]] - 1
    shape = (t, *points.shape)
    scale = np.array([1e-9, 0.0, 7.0])[:, None, None]
    return Solution(
        points, cells, scale * rng.standard_normal(shape), np.array([0.0, 0.1, 0.3]), order,
        rng.standard_normal((5, k, points.shape[1])),
        velocity=1e5 * scale * rng.standard_normal(shape), acceleration=rng.standard_normal(shape),
        ledger={"strain": rng.random(t)}, unknowns=7,
        regularisations=[Regularisation("dropped", 2, 1e-9, "slivers")], **more,
    )  # fmt: skip


def plain(value):
    """Return a value in a form that can be compared."""
    if isinstance(value, ContactPressure | Regularisation):
        return vars(value)
    return value.toarray() if isinstance(value, csr_array) else value


def cases():
    rng = np.random.default_rng(11)
    bodies = {
        "plane": quadratic(2, rng), "space": quadratic(3, rng), "membrane": quadratic(2, rng, True),
    }  # fmt: skip
    linear = rng.standard_normal((9, 3))
    bodies["linear"] = linear, Delaunay(linear).simplices.astype(np.int64)
    for name, (points, cells) in bodies.items():
        count = len(points)
        contact = ContactPressure(
            rng.random((4, points.shape[1])), rng.random(4), rng.random((3, 4))
        )
        more = [
            {"mass": "consistent", "size": 0.25}, {"mass": rng.random(count), "contact": contact},
            {"mass": csr_array(np.diag(rng.random(count))), "cell_sides": cells[:, 0] - 3},
        ]  # fmt: skip
        for entry in more:
            order = 1 if name == "linear" else 2
            yield pytest.param(
                moving(points, cells, order, rng, **entry), id=f"{name}-{len(entry)}"
            )


@pytest.mark.parametrize("solution", list(cases()))
def test_what_is_packed_comes_back(solution):
    found = unpacked(packed(solution, inertia=True))
    rounded = {"displacement", "velocity", "acceleration"}
    for name in rounded:
        one, other = getattr(found, name), getattr(solution, name)
        off, largest = (np.abs(values).max(axis=(1, 2)) for values in (one - other, other))
        assert (off <= 2.0**-21 * largest).all()
        assert (off > 0.0).any()
    for entry in fields(Solution):
        if entry.name not in rounded:
            one, other = getattr(found, entry.name), getattr(solution, entry.name)
            np.testing.assert_equal(plain(one), plain(other), entry.name)


def test_packing_again_changes_nothing():
    """Rounded fields stay as they are, and the bytes are the same."""
    for case in cases():
        once = packed(case.values[0], inertia=True)
        assert packed(unpacked(once), inertia=True) == once


def test_accelerations_are_left_out_unless_asked():
    solution = next(cases()).values[0]
    assert unpacked(packed(solution, inertia=False)).acceleration is None


@pytest.mark.parametrize(
    "damage", [lambda data: data[:-20], lambda data: lzma.compress(b"no arrays"), lambda data: b""]
)
def test_what_is_no_packed_solution_is_one_error(damage):
    good = packed(next(cases()).values[0], inertia=True)
    with pytest.raises(InputError, match="not a packed solution"):
        unpacked(damage(good))


def test_what_unpacks_to_far_more_than_it_should_is_refused():
    with pytest.raises(InputError, match="far too large"):
        unpacked(lzma.compress(bytes(2**27)))
