"""Cut-off teeth and corners are in the errors: against an integration of one's own."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import scenes
from cut_meshes import scene

from verify.compare.body import body_of
from verify.compare.errors import Rules, error_history, spread_of
from verify.compare.hooke import law_of
from verify.compare.motion import ExactMotion
from verify.geometry.planar import inside_polygon
from verify.judge.cut_errors import are_mixed, measured_cut, with_cut, with_other_errors
from verify.judge.quantities import Measured
from verify.report.tables import cuts_table
from verify.result import CUT, CaseResult, ReferenceRecord, SolveRecord, Status
from verify.solution import Solution
from verify.solvers.interface import find_solver
from verify.xfem import box_mesh, rectangle_mesh

LIFT = 0.1
TOOTH = [[-0.1, 0.53], [0.55, 0.53], [0.72, 0.73], [0.74, 0.53], [1.1, 0.53]]


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize(("share", "what"), [(0.8, "missing"), (1.25, "too much"), (1.0, "")])
def test_how_much_of_a_cut_is_missing_or_too_much_is_a_length_or_an_area(d, share, what):
    """A straight cut that begins as asked and ends at a share of its length; in space a strip."""
    start, way = np.array([0.21, 0.33, 0.2][:d]), np.array([0.4, 0.21, 0.05][:d])
    across, n = np.array([0.0, 0.1, 0.55]), 40
    ends = [start, start + way]
    corners = ends if d == 2 else [*ends, start + way + across, start + across]
    cut = {"kind": "polyline" if d == 2 else "polygon", "points": np.array(corners).tolist()}
    case = scenes.scene([cut], d)
    at = start + share * np.linspace(0.0, 1.0, n + 1)[:, None] * way
    facets = np.stack([at[:-1], at[1:]], axis=1)
    if d == 3:
        aside = facets + across
        both = np.concatenate([facets, aside], axis=1)
        facets = np.concatenate([both[:, [0, 1, 2]], both[:, [2, 3, 1]]])
    mesh = rectangle_mesh((6, 6)) if d == 2 else box_mesh((6, 6, 6))
    still = np.zeros((1, *mesh.points.shape))
    solution = Solution(mesh.points, mesh.cells, still, cut_facets=facets)
    body, rules = body_of(case), Rules(body_of(case), 1 / 6)
    one = Measured(solution, body, law_of(case), case, measured_cut(solution, body, rules))
    record, _ = with_cut(SolveRecord("case", "any", 0, Status.SOLVED), one, rules)
    whole = np.linalg.norm(way) if d == 2 else np.linalg.norm(np.cross(way, across))
    entries = [(x.kind, x.unit, x.size) for x in record.regularisations]
    if not what:
        assert (entries, record.notes) == ([], {})
        return
    ((kind, unit, size),) = entries
    assert (kind, unit) == (f"cut {what} at ends", "m" if d == 2 else "m²")
    assert size == pytest.approx(abs(share - 1.0) * whole, rel=0.05)
    assert f"{size:.3g} {unit} of it {what}" in record.notes[CUT]


class Lifted:
    """What is above a line moves up, what is below it stays."""

    def __init__(self, points):
        self._below = np.vstack([points, [[1.1, -1.0], [-0.1, -1.0]]])

    def displacement(self, points, near=None):
        up = ~inside_polygon(points if near is None else near, self._below)
        return np.column_stack([np.zeros(len(points)), LIFT * up])

    def gradient(self, points, near=None):
        return np.zeros((len(points), 2, 2))


def lifted_scene(points, cells):
    held = [{"where": "top", "displacement": [0.0, LIFT]},
            {"where": "bottom", "displacement": [0.0, 0.0]}]  # fmt: skip
    cut = {"kind": "polyline", "points": np.asarray(points).tolist()}
    return scene([cut], supports=held, mesh={"cells": [[cells, cells]]})


def judged(points, cells, solver):
    """The record of a solve, its judged L2 error with that of its integration, the solution."""
    case, truth = lifted_scene(points, cells), Lifted(points)
    solution, body, law = find_solver(solver).solve(case, 0, 0), body_of(case), law_of(case)
    rules = Rules(body, 1 / cells)
    one = Measured(solution, body, law, case, measured_cut(solution, body, rules))
    record, other = with_cut(SolveRecord("case", solver, 0, Status.SOLVED), one, rules)
    exact = ExactMotion(truth)
    record = with_other_errors(record, other, exact, [None], rules, law)
    found = error_history(one.motion, exact, [None], rules, law).reported()
    return record, spread_of(found["displacement_l2"], 2), solution


def integrated(points, solution, limit, count=150):
    """Relative L2 error of the stored field, that beyond `limit` from the cut, and the wrong area.

    Wrong is what moves with another part than its own.
    """
    boxes = np.stack(np.meshgrid(*[np.arange(count)] * 2), axis=-1).reshape(-1, 2)
    x = (boxes + np.random.default_rng(1).uniform(0, 1, boxes.shape)) / count
    corners = solution.points[solution.cells]
    u = np.full(x.shape, np.nan)
    for cell, (a, b, c) in zip(solution.cells, corners, strict=True):
        near = np.flatnonzero(((x >= np.minimum(np.minimum(a, b), c))
                               & (x <= np.maximum(np.maximum(a, b), c))).all(axis=1))  # fmt: skip
        place = np.linalg.solve(np.column_stack([b - a, c - a]), (x[near] - a).T)
        share = np.vstack([1 - place.sum(axis=0), place])
        here = (share >= -1e-12).all(axis=0)
        u[near[here]] = share[:, here].T @ solution.displacement[-1][cell]
    true = Lifted(points).displacement(x)
    off = np.sum((u - true) ** 2, axis=1)
    away = np.full(len(x), np.inf)
    for a, b in pairwise(np.asarray(points, dtype=float)):
        share = np.clip((x - a) @ (b - a) / np.sum((b - a) ** 2), 0.0, 1.0)
        away = np.minimum(away, np.linalg.norm(x - a - share[:, None] * (b - a), axis=1))
    whole = np.sum(true**2)
    error, deep = (np.sqrt(part.sum() / whole) for part in (off, off[away > limit]))
    return error, deep, np.mean(off > (0.5 * LIFT) ** 2)


@pytest.mark.parametrize("solver", ["xfem", "snapping"])
def test_a_tooth_inside_an_element_is_in_the_error(solver):
    record, found, solution = judged(TOOTH, 8, solver)
    expected, _, area = integrated(TOOTH, solution, record.cut.limit)
    assert 0.13 < expected < 0.16
    assert found.norm.relative == pytest.approx(expected, rel=0.03)
    assert record.cut.swept == pytest.approx(area, rel=0.06)
    assert not record.cut.continued
    assert record.cut.missing == record.cut.surplus == 0.0
    assert record.cut.lateral > 0.1
    assert record.cut.errors["displacement_l2"] < 1e-10  # as it was judged before
    assert "there without continuation" in record.notes[CUT]
    assert "cut beside where it was asked" in {one.kind for one in record.regularisations}


def test_where_a_cut_lies_is_said_in_a_body_of_any_size():
    """A tooth that is cut off is 0.2 of the body, be that 10 µm."""
    size = 1e-5
    cut = {"kind": "polyline", "points": (size * np.asarray(TOOTH)).tolist()}
    body = {"kind": "rectangle", "lower": [0.0, 0.0], "upper": [size, size]}
    case = scene([cut], geometry=body, mesh={"cells": [[8, 8]]})
    solution, body, law = find_solver("xfem").solve(case, 0, 0), body_of(case), law_of(case)
    rules = Rules(body, size / 8)
    one = Measured(solution, body, law, case, measured_cut(solution, body, rules))
    record, other = with_cut(SolveRecord("case", "xfem", 0, Status.SOLVED), one, rules)
    assert record.cut.lateral > 0.1 * size
    assert "there without continuation" in record.notes[CUT]
    assert other is not None


def zigzag(random):
    x = np.sort(random.uniform(0.1, 0.9, random.integers(2, 6)))
    kinks = np.column_stack([x, random.uniform(0.3, 0.7, len(x))])
    return np.vstack([[-0.1, 0.47], kinks, [1.1, 0.52]])


@pytest.mark.parametrize("seed", range(3))
def test_the_error_of_a_random_zigzag_is_that_of_the_stored_field(seed):
    """All of it but strips beside facets that are within the limit."""
    points = zigzag(np.random.default_rng(seed))
    for solver in ("xfem", "virtual_node", *(["conforming"] if seed == 0 else [])):
        record, found, solution = judged(points, 7, solver)
        whole, deep, area = integrated(points, solution, record.cut.limit)
        assert record.cut.swept == pytest.approx(area, rel=0.1, abs=1e-3)
        error, known = found.norm.relative, found.integration_error
        if record.cut.continued:  # what is left out is a strip of an element's twelfth
            assert record.cut.swept < record.cut.limit
            assert error < 1e-10
        else:
            assert 0.98 * deep - known <= error <= 1.02 * whole + known
            assert CUT in record.notes
        if solver == "conforming":
            assert record.cut.lateral < 1e-12


def test_levels_with_and_without_continuation_make_no_order_and_the_report_shows_them():
    solves = []
    for level, cells in enumerate((4, 8)):
        record, _, _ = judged(TOOTH, cells, "xfem")
        solves.append(replace(record, level=level, size=1 / cells))
    within = replace(solves[1].cut, limit=solves[1].cut.lateral)
    assert not are_mixed(solves)
    assert are_mixed([solves[0], replace(solves[1], cut=within)])
    case = {"case": "a", "title": "", "requirement": "", "scene_hash": "", "scene": {}}
    result = CaseResult(**case, reference=ReferenceRecord(), solves=solves, rates=[], verdicts=[])
    table = cuts_table(result)
    assert table is not None
    assert [row[1].text for row in table.rows] == ["0", "1"]
    assert all("partly without" in row[7].text for row in table.rows)
    assert cuts_table(replace(result, solves=[])) is None
