"""Positions of the mesh: other meshes of the same body, for every solver; one reference for all."""

from itertools import combinations

import numpy as np
import pytest
import scenes

from verify.exchange.problem import problem_of
from verify.geometry.simplices import measures
from verify.runner.fingerprint import physics_digest, reference_digest
from verify.runner.references import current_key
from verify.scene.mesh_position import POSITIONS, mesh_position
from verify.solvers import find_solver
from verify.solvers.body_of_scene import background_mesh
from verify.solvers.conforming_meshes import _background, peer_mesh

# sides that differ, away from the origin
BODY = {2: ([-0.3, 0.2], [1.1, 1.3], [7, 5]), 3: ([-0.3, 0.2, 0.4], [1.1, 1.3, 1.2], [4, 3, 3])}
CUT = {
    2: {"kind": "polyline", "points": [[-0.9, 0.31], [1.7, 1.17]]},
    3: {"kind": "polygon", "points": [[-1, -1, 0.13], [2, -1, 0.73], [2, 2, 1.5], [-1, 2, 0.9]]},
}


def along(d):
    """Unit vector in the plane of the cut."""
    corners = np.array(CUT[d]["points"], dtype=float)
    vector = corners[1] - corners[0]
    return vector / np.linalg.norm(vector)


def stretching(d):
    """Displacement gradient of tension along the cut, whose faces are free of traction, turned."""
    t = along(d)
    across = 0.3 / 0.7 if d == 2 else 0.3  # plane strain
    strain = (1 + across) * np.outer(t, t) - across * np.eye(d)
    turn = np.zeros((d, d))
    turn[0, 1], turn[1, 0] = 0.2, -0.2
    return strain + turn


def scene(d, position, **mesh):
    lower, upper, counts = BODY[d]
    rows = [
        " + ".join(f"{a:.17g} * {x}" for a, x in zip(row, "xyz", strict=False))
        for row in stretching(d).tolist()
    ]
    cut = {**CUT[d], "points": [[float(x) for x in p] for p in CUT[d]["points"]]}
    return scenes.scene(
        [cut], d, geometry=scenes.box(upper, lower),
        mesh={"cells": [counts], "position": position} | mesh,
        supports=[{"where": "boundary", "displacement": rows}],
    )  # fmt: skip


def coordinates(points, cells):
    """Cells as sorted corners, whatever the numbers of nodes are."""
    rounded = np.round(points, 12) + 0.0
    return sorted(sorted(map(tuple, corners)) for corners in rounded[cells].tolist())


@pytest.mark.parametrize("d", [2, 3])
def test_sixteen_meshes_of_one_body(d):
    """Measure to 1e-12, cells positive, n ± 1 elements, nodes of the boundary on the grid."""
    lower, upper, counts = (np.array(one) for one in BODY[d])
    found = [background_mesh(scene(d, k), 0) for k in range(POSITIONS)]
    for (mesh, size), position in zip(found, map(mesh_position, range(POSITIONS)), strict=True):
        n = counts + position.more
        assert len(mesh.cells) == np.prod(n) * (2 if d == 2 else 6)
        assert size == pytest.approx(((upper - lower) / n).max())
        sizes = measures(mesh.points[mesh.cells])
        assert sizes.min() > 0.0
        # absolute: an element that were turned inside out would count twice
        assert sizes.sum() == pytest.approx(np.prod(upper - lower), rel=1e-12)
        # nodes on each face are as on the grid, those inside move up to a fifth and not all a bit
        off = (mesh.points - lower) / (upper - lower) * n
        off -= np.rint(off)
        on_face = ((mesh.points == lower) | (mesh.points == upper)).any(axis=1)
        assert on_face.sum() == np.prod(n + 1) - np.prod(n - 1)
        assert np.abs(off[on_face]).max() < 1e-12
        moved = np.linalg.norm(off[~on_face], axis=1)
        if position.way:
            assert 0.1 < moved.max() <= 0.2 + 1e-12
        else:
            assert moved.max() < 1e-12
    meshes = [coordinates(mesh.points, mesh.cells) for mesh, _ in found]
    assert all(a != b for a, b in combinations(meshes, 2))
    assert found[0][0].points.tobytes() == background_mesh(scene(d, 0), 0)[0].points.tobytes()


@pytest.mark.parametrize("d", [2, 3])
def test_a_mesh_made_anew_is_another_at_each_position(d):
    """Diagonals and nodes of a grid are nothing to it: eight and four positions were one mesh."""
    cells = {2: [14, 10], 3: [4, 3, 3]}[d]
    found = [peer_mesh(scene(d, k, cells=[cells]), 0, "remeshed") for k in range(POSITIONS)]
    meshes = [coordinates(mesh.points, mesh.cells) for mesh in found]
    assert all(a != b for a, b in combinations(meshes, 2))


def test_a_layer_stays_a_layer_and_its_nodes_move_along_it():
    """A slab of antiplane scenes: 16 meshes of one body, with one element across each."""
    lower, upper, _ = (np.array(one) for one in BODY[3])
    found = [background_mesh(scene(3, k, cells=[[4, 3, 1]]), 0)[0] for k in range(POSITIONS)]
    for mesh, position in zip(found, map(mesh_position, range(POSITIONS)), strict=True):
        n = np.array([4, 3, 0]) + position.more
        n[2] = 1
        assert len(mesh.cells) == 6 * np.prod(n)
        sizes = measures(mesh.points[mesh.cells])
        assert sizes.min() > 0.0
        assert sizes.sum() == pytest.approx(np.prod(upper - lower), rel=1e-12)
        off = (mesh.points - lower) / (upper - lower) * n
        off -= np.rint(off)
        around = ((mesh.points == lower) | (mesh.points == upper))[:, :2].any(axis=1)
        assert np.abs(off[:, 2]).max() < 1e-12  # both faces stay
        assert np.abs(off[around]).max() < 1e-12
        moved = np.linalg.norm(off[~around], axis=1).max()
        assert 0.05 < moved <= 0.2 + 1e-12 if position.way else moved < 1e-12
    meshes = [coordinates(mesh.points, mesh.cells) for mesh in found]
    assert all(a != b for a, b in combinations(meshes, 2))


def test_eight_have_n_elements_and_half_of_each_are_falling():
    found = [mesh_position(k) for k in range(POSITIONS)]
    assert len(set(found)) == POSITIONS
    assert [sum(p.more == m for p in found) for m in (-1, 0, 1)] == [4, 8, 4]
    for more in (-1, 0, 1):
        assert np.mean([p.falling for p in found if p.more == more]) == 0.5
    assert {p.way for p in found} == {0, 1, 2, 3}
    assert found[0] == (0, False, 0)


@pytest.mark.parametrize("d, position", [(2, 4), (2, 13), (3, 7), (3, 14)])
def test_all_get_the_same_mesh(d, position):
    """xfem and the methods, conforming, the files; remeshed its element size."""
    asked = scene(d, position)
    mesh, _ = background_mesh(asked, 0)
    own = coordinates(mesh.points, mesh.cells)
    assert own == coordinates(*_background(asked, 0))
    exported = problem_of(asked, 0)
    assert own == coordinates(exported.points, exported.cells)
    if mesh_position(position).more:
        cells = {k: len(peer_mesh(scene(d, k), 0, "remeshed").cells) for k in (0, position)}
        assert np.sign(cells[position] - cells[0]) == mesh_position(position).more


@pytest.mark.parametrize("d", [2, 3])
def test_tension_along_the_cut_is_exact_on_every_mesh(d):
    """A patch test: linear, with the faces of the inclined cut free of traction."""
    for position in range(POSITIONS):
        name = "conforming" if position == 7 else "virtual_node" if position % 5 == 2 else "xfem"
        found = find_solver(name).solve(scene(d, position), 0, 0)
        wanted = found.points @ stretching(d).T
        assert np.abs(found.displacement[-1] - wanted).max() < 1e-11, (name, position)


def test_one_reference_for_all_positions_and_solves_of_their_own():
    asked = [scene(2, k) for k in range(POSITIONS)]
    assert len({reference_digest(one) for one in asked}) == 1
    assert len({current_key(one, 1, {}) for one in asked}) == 1
    assert len({physics_digest(one) for one in asked}) == POSITIONS
    assert reference_digest(asked[0]) == physics_digest(asked[0])


def test_a_cut_that_may_be_faces_of_the_mesh_has_its_own_references():
    """On a realised cut the reference refines the mesh of which its facets are faces."""
    mesh, _ = background_mesh(scene(3, 5), 0)
    face = mesh.points[mesh.cells[40][:3]].tolist()
    cut = {"kind": "polygon", "points": face}
    content = scene(3, 5).model_dump(mode="json", by_alias=True) | {"cuts": [cut]}
    content["supports"] = [{"where": "boundary", "displacement": [0.0] * 3}]
    one = scenes.scene(**{k: content[k] for k in ("cuts", "geometry", "mesh", "supports")}, d=3)
    other = one.model_copy(update={"mesh": one.mesh.model_copy(update={"position": 0})})
    assert reference_digest(one) != reference_digest(other)
