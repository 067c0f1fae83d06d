"""A part of the boundary is the same part on every mesh, for every solver and for the reference."""

import importlib
import sys
from types import SimpleNamespace

import numpy as np
import pytest
import scenes
from reference_scenes import needs_fenicsx

from verify.exchange import export_case, problem_of
from verify.foreign.installing import PROGRAMS
from verify.judge.convergence import shifted_ends
from verify.methods import METHODS
from verify.result import Regularisation, SolveRecord, Status
from verify.solvers import find_solver
from verify.solvers.body_of_scene import background_mesh, cuts_of
from verify.solvers.boundary_conditions import loads_of

pytestmark = needs_fenicsx

SEED = 27
TRACTION = np.array([0.7, -0.4, 0.9])
SIDED = ("subdivision", "virtual_node")  # that realise a straight cut as it is asked


def clipped(polygon, normal, offset):
    """Part of a polygon or segment (k, d) where normal · x < offset (Sutherland and Hodgman)."""
    found, count = [], len(polygon)
    for k, (a, b) in enumerate(zip(polygon, np.roll(polygon, -1, axis=0), strict=True)):
        inside, beyond = normal @ a < offset, normal @ b < offset
        if inside:
            found.append(a)
        if inside != beyond and not (count == 2 and k == 1):
            found.append(a + (offset - normal @ a) / (normal @ (b - a)) * (b - a))
    return np.array(found)


def integrals(polygon):
    """Measure, and first moments (d,), of a convex polygon or a segment."""
    if len(polygon) < 2:
        return 0.0, np.zeros(3)
    if len(polygon) == 2:
        length = np.linalg.norm(polygon[1] - polygon[0])
        return length, length * polygon.mean(axis=0)
    fans = [polygon[[0, k, k + 1]] for k in range(1, len(polygon) - 1)]
    areas = [0.5 * np.linalg.norm(np.cross(f[1] - f[0], f[2] - f[0])) for f in fans]
    return sum(areas), sum(a * f.mean(axis=0) for a, f in zip(areas, fans, strict=True))


class Drawn:
    """A load on a part of the upper face that ends anywhere, and a cut through it or none."""

    def __init__(self, d, number):
        rng = np.random.default_rng([SEED, d, number])
        self.d, self.rng = d, rng
        if d == 2:
            low, high = rng.uniform(0.1, 0.45), rng.uniform(0.5, 0.9)
            self.limits = [(np.array([1.0, 0.0]), high), (np.array([-1.0, 0.0]), -low)]
        else:  # two lines across the middle of the face, at any angle
            normals = [np.r_[rng.normal(size=2), 0.0] for _ in range(2)]
            self.limits = [
                (n, float(n @ np.r_[rng.uniform(0.3, 0.7, 2), 1.0] + 0.1)) for n in normals
            ]
        axes = "xyz"[:d]
        ends = [
            " + ".join(f"({n!r})*{x}" for n, x in zip(normal.tolist(), axes, strict=True))
            + f" < {offset!r}"
            for normal, offset in self.limits
        ]
        self.where = " and ".join([f"{axes[-1]} > 0.999999", *ends])
        # through the middle of the body, a little inclined; every other scene has none
        self.across = np.r_[1.0, rng.uniform(-0.2, 0.2, d - 1)]
        self.offset = self.across @ np.full(d, 0.5) + rng.uniform(-0.1, 0.1)
        self.cut = self._cut() if number % 2 else None

    def _cut(self):
        at = (
            [[-0.1, -0.1], [1.1, -0.1], [1.1, 1.1], [-0.1, 1.1]] if self.d == 3 else [[-0.1], [1.1]]
        )
        points = [[(self.offset - self.across[1:] @ p) / self.across[0], *p] for p in at]
        kind = "polygon" if self.d == 3 else "polyline"
        return {"kind": kind, "points": np.array(points, dtype=float).tolist()}

    def scene(self, cells):
        return scenes.scene(
            [] if self.cut is None else [self.cut],
            self.d,
            mesh={"cells": [[n] * self.d for n in cells]},
            supports=[{"where": w, "displacement": [0.0] * self.d} for w in ("left", "right")],
            loads=[
                {"kind": "traction", "where": self.where, "traction": TRACTION[: self.d].tolist()}
            ],
            reference={"size": 0.5},
        )

    def work(self, gradient, shift, side=0):
        """Work on u = gradient x + shift, which may be there on one side of the cut only."""
        corners = [[0, 1], [1, 1]] if self.d == 2 else [[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
        part = np.array(corners, dtype=float)
        for normal, offset in self.limits:
            part = clipped(part, normal, offset)
        if side:
            part = clipped(part, -side * self.across, -side * self.offset)
        measure, moment = integrals(part)
        return TRACTION[: self.d] @ (gradient @ moment[: self.d] + measure * shift)

    def check(self, forces, points, near, sided=True):
        """Hold the work of nodal forces at points, by material beside them, against the exact."""
        gradient, shift = self.rng.normal(size=(self.d, self.d)), self.rng.normal(size=self.d)
        field = points @ gradient.T + shift
        for side in (0, 1, -1) if self.cut and sided else (0,):
            there = side * (near @ self.across - self.offset) >= 0.0
            done = float(np.sum(forces[there] * field[there]))
            assert done == pytest.approx(self.work(gradient, shift, side), rel=1e-12, abs=1e-13)


@pytest.mark.parametrize("number", range(4))
@pytest.mark.parametrize(("d", "cells"), [(2, (3, 7)), (3, (1, 3))])
def test_a_load_is_that_of_its_piece_for_every_way_to_cut(d, cells, number):
    drawn = Drawn(d, number)
    scene = drawn.scene(cells)
    for level in range(len(cells)):
        mesh, size = background_mesh(scene, level)
        for method in (*SIDED, "snapping") if drawn.cut else ("uncut",):
            body = METHODS[method](mesh, cuts_of(scene, size)).phantom
            forces = loads_of(scene, body, None)
            drawn.check(forces, body.node_points, body.node_piece_points, method in SIDED)
        problem = problem_of(scene, level)
        drawn.check(problem.nodal_forces(), problem.points, problem.points, sided=False)


@pytest.mark.parametrize(("number", "degree"), [(0, 2), (1, 1), (3, 2)])
@pytest.mark.parametrize(("d", "cells"), [(2, (7,)), (3, (2,))])
def test_a_load_is_that_of_its_piece_on_conforming_meshes(d, cells, number, degree):
    from reference.boundary_conditions import load_forces
    from reference.space import conforming_space
    from verify.solvers.conforming_meshes import peer_mesh, reference_mesh

    drawn = Drawn(d, number)
    scene = drawn.scene(cells)
    for mesh in (peer_mesh(scene, 0, "imprinted"), reference_mesh(scene, 0)[0]):
        space = conforming_space(mesh, degree)
        forces = load_forces(scene, space, None).reshape(-1, d)
        drawn.check(forces, space.node_points, space.beside_nodes())


@pytest.fixture
def program(monkeypatch):
    """Modules of the programs that cut elements themselves."""
    monkeypatch.syspath_prepend(str(PROGRAMS))
    yield SimpleNamespace(
        body=importlib.import_module("cut_body"), files=importlib.import_module("exchange_files")
    )
    for name in ("cut_body", "split_cells", "exchange_files"):
        sys.modules.pop(name, None)


@pytest.mark.parametrize("d", (2, 3))
def test_a_program_that_cuts_elements_loads_and_holds_each_side_for_itself(d, program, tmp_path):
    drawn = Drawn(d, 1)
    scene = drawn.scene([3])
    side = " + ".join(f"({a!r})*{x}" for a, x in zip(drawn.across.tolist(), "xyz", strict=False))
    # the side of the cut on which there is something of the part
    below = drawn.work(np.zeros((d, d)), np.eye(d)[0], -1) != 0.0
    end = f"{side} {'<' if below else '>'} {float(drawn.offset)!r}"
    support = {"where": f"{drawn.where} and {end}"}
    held_side = scene.supports[0].model_copy(update=support)
    scene = scene.model_copy(update={"supports": [held_side]})
    export_case(scene, tmp_path, [0])
    case = program.files.Case(tmp_path, 0)
    body = program.body.CutBody(case)
    sign = np.sign(body.phi @ (case.points @ drawn.across - drawn.offset))
    near = np.zeros((body.count, d))
    for s, way in enumerate((-1, 1)):  # a value beyond the cut belongs to the other side
        moved = case.points - drawn.across * (case.points @ drawn.across - drawn.offset)[:, None]
        beyond = body.phi * way < 0
        shown = np.where(beyond[:, None], moved + 0.1 * sign * way * drawn.across, case.points)
        near[body.group[s]] = np.where(
            (body.group[0] != body.group[1])[:, None], shown, case.points
        )
    place = np.zeros((body.count, d))
    place[body.group] = case.points
    drawn.check(program.body.forces(case, body), place, near)
    held, _ = program.body.prescribed(case, body)
    assert held.any()
    assert ((near[held.any(axis=1)] @ drawn.across < drawn.offset) == below).all()


def test_a_program_loads_and_holds_the_part_between_two_cuts_for_itself(program, tmp_path):
    """On facets with one end beside a cut and the other beside none, or beside another cut."""
    rng = np.random.default_rng(3)
    for trial in range(6):
        low, high = 0.25 + 0.1 * rng.random(2), 0.7 + 0.1 * rng.random(2)
        lines = [[[-0.1, a], [1.1, b]] for a, b in (low, high)]
        ends = np.sort(0.4 + 0.25 * rng.random(2))
        middle = f"x < 1e-9 and y > {ends[0]} and y < {ends[1]}"
        scene = scenes.scene(
            [{"kind": "polyline", "name": str(k), "points": p} for k, p in enumerate(lines)],
            mesh={"cells": [[5, 11 + trial]]},
            supports=[
                {"where": where, "displacement": [0.1 * k, 0.0]}
                for k, where in enumerate(("bottom", middle, "top"))
            ],
            loads=[{"kind": "traction", "where": "right", "traction": [1.0, -2.0]}],
        )
        export_case(scene, tmp_path / str(trial), [0])
        case = program.files.Case(tmp_path / str(trial), 0)
        body, answer = program.body.divided(case)
        force = program.body.forces(case, body)
        held, value = program.body.prescribed(case, body)
        height = np.zeros(body.count)
        height[body.group] = case.points[:, 1]
        middles = answer.points[answer.cells].mean(axis=1)
        over = [a + (b - a) * (middles[:, 0] + 0.1) / 1.2 for (_, a), (_, b) in lines]
        part = (middles[:, 1] > over[0]).astype(int) + (middles[:, 1] > over[1])
        at = [a + (b - a) * 1.1 / 1.2 for (_, a), (_, b) in lines]
        bounds = [0.0, *at, 1.0]
        for k in range(3):
            mine = np.zeros(len(answer.points), dtype=bool)
            mine[answer.cells[part == k]] = True
            groups = np.unique(answer._groups[mine])
            length, centre = bounds[k + 1] - bounds[k], 0.5 * (bounds[k + 1] + bounds[k])
            load = length * np.array([1.0, -2.0])
            np.testing.assert_allclose(force[groups].sum(axis=0), load)
            np.testing.assert_allclose(height[groups] @ force[groups], centre * load)
            assert held[groups].any()
            np.testing.assert_allclose(value[groups, 0][held[groups, 0]], 0.1 * k)


PARTED = {
    "mesh": {"cells": [[5, 5]]},
    "material": {"young": 1.0, "poisson": 0.0, "plane": "strain"},
    "supports": [{"where": "left", "displacement": [0.0, 0.0]}],
    "loads": [
        {"kind": "traction", "where": "x > 0.999999 and y < 0.5", "traction": [1.0, 0.0]},
    ],
    "reference": {"size": 0.25},
}


@pytest.mark.parametrize("solver", ["xfem", *SIDED, "snapping", "conforming", "reference"])
def test_a_load_that_reaches_to_a_cut_stretches_its_own_half_only(solver):
    scene = scenes.scene([{"kind": "polyline", "points": [[-0.1, 0.5], [1.1, 0.5]]}], **PARTED)
    energy = find_solver(solver).solve(scene, 0, 0).ledger["strain"][-1]
    assert energy == pytest.approx(0.25, rel=1e-8)


def energies(scene, solver, levels):
    return [
        float(find_solver(solver).solve(scene, level, 0).ledger["strain"][-1]) for level in levels
    ]


def test_the_shift_of_an_end_is_reported_in_metres_and_in_elements():
    scene = scenes.scene(
        mesh={"cells": [[4, 4], [8, 8]]},
        supports=[{"where": "x < 1e-6 and y < 0.55", "displacement": [0.0, 0.0]}],
        loads=[{"kind": "traction", "where": "right", "traction": [1.0, 0.5]}],
        reference={"size": 0.2, "levels": 3},
    )
    for solver in ("xfem", "subdivision", "conforming"):
        for level, shift in enumerate((0.2, 0.075)):
            solution = find_solver(solver).solve(scene, level, 0)
            said = {r.unit: r.size for r in solution.regularisations if "support" in r.kind}
            assert said == pytest.approx({"m": shift, "h": shift * 4 * 2**level})
    held = find_solver("reference").solve(scene, 0, 0)
    assert not [r for r in held.regularisations if "support" in r.kind]


def test_levels_on_which_an_end_shifts_have_no_order():
    def solved(size, *shifts):
        kind = "support holds more than its part, to the edge of a facet"
        moved = [Regularisation(kind, 3, shift, unit) for shift, unit in shifts]
        return SolveRecord("case", "xfem", 0, Status.SOLVED, size=size, regularisations=moved)

    ended = [solved(0.2, (0.1, "m"), (0.5, "h")), solved(0.1)]
    assert shifted_ends(ended) == "supports hold 0.5, 0 h beyond where their parts end"
    assert not shifted_ends([solved(0.2), solved(0.1)])


def test_the_reference_on_a_given_mesh_ends_supports_and_loads_where_they_end(tmp_path):
    """Its energies rise under refinement to those of the same body meshed anew."""
    import meshio

    from reference.meshing import structured_triangles

    points, cells = structured_triangles([0.0, 0.0], [1.0, 1.0], [4, 4])
    place = np.pad(points, ((0, 0), (0, 1)))
    meshio.Mesh(place, [("triangle", cells)]).write(tmp_path / "body.vtu")
    load = {"kind": "traction", "where": "x > 0.999999 and y < 0.63", "traction": [1.0, 0.5]}
    parts = {"supports": [{"where": "x < 0.1", "displacement": [0.0, 0.0]}], "loads": [load]}
    given = scenes.scene(
        geometry={"kind": "file", "file": "body.vtu"}, mesh={"pattern": "given"},
        reference={"degree": 1}, **parts,
    )  # fmt: skip
    given.came_from(tmp_path / "case.toml", "given")
    anew = scenes.scene(reference={"size": 0.25, "levels": 3}, **parts)
    found, (finest,) = energies(given, "reference", range(4)), energies(anew, "reference", [1])
    assert found == sorted(found)
    assert found[-1] < finest
    assert finest - found[-1] < 0.35 * (finest - found[0])
    said = find_solver("reference").solve(given, 0, 0).regularisations
    assert not [r for r in said if "support" in r.kind]
