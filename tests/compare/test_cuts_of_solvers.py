"""Realised cuts of solvers at random places, against distances and lengths of one's own."""

import numpy as np
import pytest
from cut_meshes import scene

from verify.compare.body import body_of
from verify.compare.errors import Rules
from verify.compare.hooke import law_of
from verify.judge.cut_errors import measured_cut, with_cut
from verify.judge.quantities import Measured
from verify.result import SolveRecord, Status
from verify.solvers.interface import find_solver

PLANE = ("xfem", "subdivision", "virtual_node", "snapping")


def measured(cut, cells, solver, **parameters):
    """The record of a solve with one cut, and the facets."""
    case = scene([cut], mesh={"cells": [[cells, cells]]})
    solution, body = find_solver(solver).solve(case, 0, 0, **parameters), body_of(case)
    rules = Rules(body, 1 / cells)
    one = Measured(solution, body, law_of(case), case, measured_cut(solution, body, rules))
    record, _ = with_cut(SolveRecord("case", solver, 0, Status.SOLVED), one, rules)
    return record, solution.cut_facets


def lengths(facets):
    return np.linalg.norm(facets[:, 1] - facets[:, 0], axis=1)


def samples(facets, count=12):
    """Points on all facets."""
    weights = np.random.default_rng(0).dirichlet(np.ones(facets.shape[1]), count)
    weights = np.vstack([weights, np.eye(facets.shape[1])])
    return np.einsum("qk,fkd->fqd", weights, facets).reshape(-1, facets.shape[2])


@pytest.mark.parametrize("seed", range(2))
def test_a_closed_cut_inside_an_element_is_said_to_be_missing(seed):
    random = np.random.default_rng(seed)
    angle = np.sort(random.uniform(0, 2 * np.pi, random.integers(3, 6)))
    # the lower triangle of a square of 1/6, whose inscribed circle has the radius 0.29/6
    corners = np.array([3.3, 2.68]) / 6 + 0.02 * np.column_stack([np.cos(angle), np.sin(angle)])
    corners = np.vstack([corners, corners[:1]])
    perimeter = np.linalg.norm(np.diff(corners, axis=0), axis=1).sum()
    for solver in PLANE:
        record, facets = measured({"kind": "polyline", "points": corners.tolist()}, 6, solver)
        assert len(facets) == 0
        assert record.cut.missing == pytest.approx(perimeter, rel=1e-6)
        assert "cut missing at ends" in [one.kind for one in record.regularisations]


@pytest.mark.parametrize("seed", range(2))
def test_what_is_missing_less_what_is_too_much_is_the_difference_of_lengths(seed):
    random = np.random.default_rng(seed)
    middle, angle = random.uniform(0.4, 0.6, 2), random.uniform(0, np.pi)
    half = random.uniform(0.05, 0.25) * np.array([np.cos(angle), np.sin(angle)])
    cut = {"kind": "polyline", "points": [(middle - half).tolist(), (middle + half).tolist()]}
    for tip in ("inside", "through", "nearest"):
        record, facets = measured(cut, 9, "xfem", tip=tip)
        longer = 2 * np.linalg.norm(half) - lengths(facets).sum()
        found = record.cut.missing - record.cut.surplus
        assert found == pytest.approx(longer, abs=0.1 * record.cut.element)
        assert record.cut.lateral < 1e-12
        if tip == "inside":
            assert record.cut.surplus == 0.0
        stated = {one.kind for one in record.regularisations}
        assert ("cut missing at ends" in stated) == (record.cut.missing > 1e-10)


@pytest.mark.parametrize("seed", range(2))
def test_a_resolved_arc_is_in_facets_within_the_limit(seed):
    random = np.random.default_rng(seed)
    centre, radius = random.uniform(-0.1, 0.1, 2), random.uniform(0.4, 0.7)
    cut = {"kind": "arc", "centre": centre.tolist(), "radius": radius}
    for solver in PLANE[:3]:
        record, facets = measured(cut, 8, solver)
        off = np.abs(np.linalg.norm(samples(facets) - centre, axis=1) - radius).max()
        assert record.cut.lateral == pytest.approx(off, rel=0.1)
        assert record.cut.continued
        assert "cut beside where it was asked" not in {o.kind for o in record.regularisations}
        assert not record.cut.under_resolved
