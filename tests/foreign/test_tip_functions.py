"""Tip functions of GetFEM: the cells that show them, and the orders that they are there for."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest

from verify.cli import main
from verify.foreign import foreign_solver, state_of
from verify.foreign.installing import PROGRAMS
from verify.scene import load_scene
from verify.study.measured_scenes import measurements, variant_of


@pytest.fixture
def tip_mesh(monkeypatch):
    for folder in (PROGRAMS, PROGRAMS / "getfem"):
        monkeypatch.syspath_prepend(str(folder))
    import cut_body
    import split_cells
    import tip_mesh

    def made(points, cells, cut, tips):
        content = {"cuts": [{"kind": "polyline", "points": cut}]}
        case = SimpleNamespace(points=points, cells=cells, content=content, problem={"size": 0.25})
        body = cut_body.CutBody(case, wholly=True)
        side = np.where(body.side == 0, 2, (body.side + 1) // 2)
        split = split_cells.SplitMesh(points, cells, body.phi, body.cut, side, body.group)
        areas = SimpleNamespace(tips=np.array(tips), elements=np.ones(len(cells), dtype=bool))
        return tip_mesh.TipMesh(case, body, split, areas)

    yield made
    for name in ("cut_body", "split_cells", "tip_mesh", "exchange_files"):
        sys.modules.pop(name, None)


def square(count):
    """Positive triangles of the unit square, their inner nodes moved about."""
    line = np.linspace(0.0, 1.0, count + 1)
    points = np.array(np.meshgrid(line, line, indexing="ij")).reshape(2, -1).T
    inner = ((points > 0) & (points < 1)).all(axis=1)
    points[inner] += 0.15 / count * np.random.default_rng(2).uniform(-1, 1, (inner.sum(), 2))
    corner = np.arange((count + 1) ** 2).reshape(count + 1, -1)
    a, b, c, d = (corner[i : count + i, j : count + j].ravel()
                  for i, j in ((0, 0), (1, 0), (1, 1), (0, 1)))  # fmt: skip
    return points, np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


@pytest.mark.parametrize("angle", [0.0, 77.0])
def test_the_cells_fill_the_body_fit_together_and_end_at_the_tips(tip_mesh, angle):
    along = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    cut = [0.47, 0.52] + 0.31 * np.array([-along, along])
    mesh = tip_mesh(*square(4), cut.tolist(), cut)
    corners = mesh.points[mesh.cells]
    areas = 0.5 * np.linalg.det(corners[:, 1:] - corners[:, :1])
    assert areas.min() > 0.0
    assert areas.sum() == pytest.approx(1.0, rel=1e-12)
    for tip in cut:
        assert (np.linalg.norm(mesh.points - tip, axis=1) < 1e-9).sum() == 1
    edges = np.sort(mesh.cells[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    alone = np.unique(edges, axis=0, return_counts=True)
    border = mesh.points[alone[0][alone[1] == 1]]
    length = np.linalg.norm(border[:, 1] - border[:, 0], axis=1).sum()
    assert length == pytest.approx(4.0 + 4 * 0.31, rel=1e-9)  # the square and both faces
    faces = mesh.facets()
    assert np.linalg.norm(faces[:, 1] - faces[:, 0], axis=1).sum() == pytest.approx(0.62, rel=1e-9)


def test_a_cut_that_ends_on_the_border_is_open_there(tip_mesh):
    cut = np.array([[0.0, 0.52], [0.47, 0.61]])
    mesh = tip_mesh(*square(4), cut.tolist(), cut[1:])
    assert [(np.linalg.norm(mesh.points - end, axis=1) < 1e-9).sum() for end in cut] == [2, 1]


@pytest.mark.heavy
@pytest.mark.skipif(
    bool(state_of(foreign_solver("getfem")).missing), reason="GetFEM is not installed"
)
def test_tip_functions_have_the_orders_of_a_smooth_field():
    """Orders 2 and 1, a quarter and a fifth less on coarse meshes; without them 1 and 1/2."""
    scene, angle, centre = load_scene("statics/griffith_inside"), 37.0, np.array([0.07, -0.04])
    along = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    ends = centre + 0.9 * np.array([-along, along])
    parameters = {**scene.exact.parameters, "centre": centre.tolist(), "a": 0.9, "angle": angle}
    changed = {
        "exact": scene.exact.model_copy(update={"parameters": parameters}),
        "cuts": [scene.cuts[0].model_copy(update={"points": tuple(map(tuple, ends.tolist()))})],
    }
    scenes = [
        scene.model_copy(
            update=changed | {"mesh": scene.mesh.model_copy(update={"cells": [cells]})}
        )
        for cells in ((16, 16), (32, 32))
    ]
    variant = variant_of("getfem tip=functions")
    found = [one for scene in scenes for one in measurements(variant, scene)]
    for error, order in (("displacement_l2", 1.75), ("energy_norm", 0.8)):
        coarse, fine = (one.value for one in found if one.quantity == error)
        assert coarse / fine >= 2**order, error


@pytest.mark.heavy
@pytest.mark.skipif(
    bool(state_of(foreign_solver("getfem")).missing), reason="GetFEM is not installed"
)
def test_a_body_without_a_tip_in_it_needs_no_functions():
    checks = [
        word for name in ("uncut-2d", "closed-cut", "cut-patch") for word in ("--check", name)
    ]
    assert main(["conform", "getfem", "--set", "tip=functions", *checks]) == 0
