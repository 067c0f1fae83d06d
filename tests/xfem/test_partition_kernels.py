"""The kernels that divide, bisect and join pieces equal their numpy twins, on whatever comes."""

import numpy as np
import pytest
from degenerate_strokes import body, strokes
from partition_twins import bisected, crossed, divided, joined

from verify.xfem.splitting import bisection, split
from verify.xfem.splitting.joining import join_slots
from verify.xfem.splitting.split import split_cells

# products of the same factors, taken in another order: a few ulp
ROUND_OFF = 4e-15


def in_order(points, *others):
    """Rows in an order of their sorted points, so that sets of simplices can be compared."""
    first = np.lexsort([*(x for x in others if x.ndim == 1), *np.sort(points, axis=1).T])
    return points[first], *(x[first] for x in others)


@pytest.fixture
def checked(monkeypatch):
    """Replace the kernels by ones that are checked at every call; count the calls."""
    calls = {"crossed": 0, "divided": 0, "bisected": 0}
    finders = []

    def check_crossed(points, piece, label, values, cut):
        given = crossed_edges(points, piece, label, values, cut)
        for mine, twin in zip(given, crossed(points, piece, label, values, cut), strict=True):
            np.testing.assert_array_equal(mine, twin)
        calls["crossed"] += len(given[0])
        return given

    def check_divided(simplices, values, cut, active, below, stairs, edges):
        mine, kept = divide_simplices(simplices, values, cut, active, below, stairs, edges)
        twin = divided(simplices, values, cut, active, below, finders[-1].find)
        for a, b in zip(mine, twin, strict=True):
            np.testing.assert_allclose(a, b, rtol=ROUND_OFF, atol=1e-16)
        calls["divided"] += len(mine[0]) - kept
        return mine, kept

    def check_bisected(count, numbers, ends, r, s, points, barycentric, fraction, source, first):
        before = points[:count].copy(), barycentric[:count].copy(), fraction[:count].copy()
        after = bisect_along(
            count, numbers, ends, r, s, points, barycentric, fraction, source, first
        )
        if after >= 0:
            twin = in_order(*bisected(numbers, ends, r, s, 0, *before))
            mine = in_order(points[:after], barycentric[:after], fraction[:after])
            np.testing.assert_array_equal(np.sort(mine[0], axis=1), np.sort(twin[0], axis=1))
            assert fraction[:after].sum() == pytest.approx(twin[2].sum(), rel=1e-14)
            solid = mine[2] > 0.0
            np.testing.assert_allclose(mine[2][solid], twin[2][solid], rtol=ROUND_OFF)
            calls["bisected"] += after - count
        return after

    class Noted(split.ZeroPoints):
        def __init__(self, *given):
            super().__init__(*given)
            finders.append(self)

    crossed_edges, divide_simplices = split.crossed_edges, split.divide_simplices
    bisect_along = bisection.bisect_along
    monkeypatch.setattr(split, "ZeroPoints", Noted)
    monkeypatch.setattr(split, "crossed_edges", check_crossed)
    monkeypatch.setattr(split, "divide_simplices", check_divided)
    monkeypatch.setattr(bisection, "bisect_along", check_bisected)
    return calls


@pytest.mark.parametrize("dim", [2, 3])
def test_pieces_and_joins_of_degenerate_cuts_are_those_of_the_twins(dim, checked) -> None:
    for seed in range(25):
        rng = np.random.default_rng([dim, seed, 1])
        mesh = body(rng, dim)
        cuts = [path.sweep for path in strokes(rng, mesh, 3)]
        partition = split_cells(mesh, cuts)
        slots = join_slots(mesh, partition, partition.fraction > 0.0)
        if len(partition.parent):
            np.testing.assert_array_equal(slots.group, joined(mesh, partition))
        # where a sub-simplex is thick enough for its determinant to have a sign, that is it
        determinant = np.linalg.det(partition.sub_barycentric)
        thick = np.abs(determinant) > 1e-12
        np.testing.assert_array_equal(np.sign(determinant[thick]), partition.sub_sign[thick])
    assert min(checked.values()) > 10
