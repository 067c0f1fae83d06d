"""Meshes of files that are another body than meant are found, in any position; sound ones pass."""

import itertools

import meshio
import numpy as np
import pytest

from verify.cli import main
from verify.errors import InputError
from verify.result import NoticeKind
from verify.runner.mesh_faults import check_overlaps, mesh_notices, mesh_warning
from verify.scene import read_mesh
from verify.scene.loading import load_scene

KINDS = ["plane", "space", "membrane"]
CASE = """
title = "A body from a file"
requirement = "It shall hang."

[geometry]
kind = "file"
file = "body.vtk"
{body}

[mesh]
pattern = "given"

[material]
young = 1e4
poisson = 0.3
density = 1000.0
{material}

[analysis]
kinematics = "corotational"

[[supports]]
where = "boundary"
displacement = {zero}

[[cuts]]
{cut}

[[loads]]
kind = "gravity"
acceleration = {zero}

[[quantities]]
kind = "strain_energy"
"""
CUTS = {
    2: 'kind = "polyline"\npoints = [[-9.0, 0.4], [9.0, 0.5]]',
    3: 'kind = "polygon"\n'
    "points = [[-9.0, -9.0, 0.4], [9.0, -9.0, 0.5], [9.0, 9.0, 0.6], [-9.0, 9.0, 0.5]]",
}


def grid(counts, lower, upper):
    """Simplices of a square or a box."""
    d = len(counts)
    axes = [np.linspace(a, b, n + 1) for n, a, b in zip(counts, lower, upper, strict=True)]
    points = np.array(list(itertools.product(*axes)))
    step = np.array([np.prod(np.array(counts[a + 1 :]) + 1) for a in range(d)], dtype=int)
    cells = []
    for corner in itertools.product(*map(range, counts)):
        for order in itertools.permutations(range(d)):
            at = [np.array(corner)]
            for axis in order:
                at.append(at[-1] + np.eye(d, dtype=int)[axis])
            cells.append([int(place @ step) for place in at])
    return points, np.array(cells)


def body(kind, counts=3, lower=0.0, upper=1.0, seed=None):
    """A square, a cube or a curved sheet; with `seed`, its inner nodes at random."""
    d = 3 if kind == "space" else 2
    points, cells = grid([counts] * d, [lower, *[0.0] * (d - 1)], [upper, *[1.0] * (d - 1)])
    if seed is not None:
        inner = ((points > lower + 1e-9) & (points < upper - 1e-9)).all(axis=1)
        moved = np.random.default_rng(seed).uniform(-0.2, 0.2, points.shape) / counts
        points[inner] += moved[inner]
    if kind == "membrane":
        points = np.column_stack([points, 0.1 * points[:, 0] ** 2 + 0.2 * np.sin(points[:, 1])])
    return points, cells


def joined(one, other, shift=0.0, merged=True):
    """Two meshes as one, the second shifted; nodes at one place merged if asked for."""
    points = np.concatenate([one[0], other[0] + shift])
    cells = np.concatenate([one[1], other[1] + len(one[0])])
    if not merged:
        return points, cells
    _, first, number = np.unique(
        np.round(points, 9), axis=0, return_index=True, return_inverse=True
    )
    return points[first], number.ravel()[cells]


def turned(kind, mesh, seed):
    """A mesh turned at random, and of a size of millimetres or of metres."""
    points, cells = mesh
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.standard_normal([points.shape[1]] * 2))[0]
    return 10.0 ** rng.integers(-3, 2) * points @ turn, cells


def scene_of(folder, kind, mesh):
    points, cells = mesh
    name = "tetra" if kind == "space" else "triangle"
    flat = np.column_stack([points, np.zeros(len(points))]) if kind == "plane" else points
    meshio.Mesh(flat, [(name, cells)]).write(folder / "body.vtk")
    membrane = kind == "membrane"
    d = points.shape[1]
    text = CASE.format(
        body=f"dimension = {d}" + ('\ncells = "surface"' if membrane else ""),
        material="thickness = 0.001" if membrane else 'plane = "strain"' if d == 2 else "",
        zero=[0.0] * d,
        cut=CUTS[d],
    )
    (folder / "case.toml").write_text(text)
    return load_scene(folder / "case.toml")


def found(folder, kind, mesh):
    """What a mesh is refused or warned of for, or an empty text."""
    scene = scene_of(folder, kind, mesh)
    try:
        check_overlaps(scene, *read_mesh(scene))
    except InputError as error:
        return str(error)
    return mesh_warning(scene)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("kind", KINDS)
def test_a_sound_mesh_passes(tmp_path, kind, seed):
    assert found(tmp_path, kind, turned(kind, body(kind, 4, seed=seed), seed)) == ""


@pytest.mark.parametrize("thickness", [1e-5, 1e-3])
@pytest.mark.parametrize("kind", ["plane", "space"])
def test_a_thin_body_and_a_wide_gap_pass(tmp_path, kind, thickness):
    points, cells = body(kind)
    thin = points * np.array([1.0] * (points.shape[1] - 1) + [thickness])
    assert found(tmp_path, kind, turned(kind, (thin, cells), 1)) == ""
    apart = joined((points, cells), (points, cells), np.eye(points.shape[1])[0] * 1.01, False)
    assert found(tmp_path, kind, turned(kind, apart, 2)) == ""


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("kind", KINDS)
def test_a_shifted_second_copy_is_refused(tmp_path, kind, seed):
    rng = np.random.default_rng(seed)
    mesh = body(kind, seed=seed)
    if kind == "membrane":  # along the sheet, where it is flat; else they only come near
        mesh[0][:, 2] = 0.3 * mesh[0][:, 0]
        along = rng.uniform(0.01, 0.4, 2)
        shift = np.array([*along, 0.3 * along[0]])
    else:
        shift = rng.uniform(0.01, 0.4, mesh[0].shape[1])
    both = turned(kind, joined(mesh, mesh, shift, False), seed)
    text = found(tmp_path, kind, both)
    assert "cells overlap in" in text
    # the place is one of the common part
    place = np.fromstring(text.split("one at (")[1].split(")")[0], sep=",")
    away = np.linalg.norm(both[0] - place, axis=1).min()
    assert away < np.ptp(both[0], axis=0).max()


def test_sheets_that_cross_are_refused(tmp_path):
    one = body("membrane")
    points = one[0][:, [0, 2, 1]] + [0.05, 0.4, -0.5]
    text = found(tmp_path, "membrane", turned("membrane", joined(one, (points, one[1])), 6))
    assert "cells overlap in" in text


@pytest.mark.parametrize("kind, count", [("plane", 2), ("space", 16), ("membrane", 2)])
def test_hanging_nodes_are_counted(tmp_path, kind, count):
    """Of 3 and 5 nodes along an edge (9 and 25 on a face) the nodes of the finer side hang."""
    coarse, fine = body(kind, 2, -1.0, 0.0), body(kind, 4)
    for points, _ in (coarse, fine):
        if kind == "membrane":
            points[:, 2] = 0.2 * points[:, 1]
    text = found(tmp_path, kind, turned(kind, joined(coarse, fine), 7))
    assert f"is not joined where {count} nodes hang on facets" in text
    # it stands beside the verdicts too
    # beside it the record says which cells were turned
    notice, *beside = mesh_notices(load_scene(tmp_path / "case.toml"))
    assert all("are turned" in one.text for one in beside)
    assert (notice.kind, notice.text) == (NoticeKind.WARNING, text)


@pytest.mark.parametrize("kind, count", [("plane", 10), ("space", 50), ("membrane", 10)])
@pytest.mark.parametrize("gap", [1e-5, 5e-4])
def test_a_gap_is_found_with_the_nodes_on_both_sides(tmp_path, kind, count, gap):
    halves = body(kind, 4, -1.0, 0.0), body(kind, 4, 0.0, 1.0)
    for points, _ in halves:
        if kind == "membrane":
            points[:, 2] = 0.3 * points[:, 0]
    shift = gap * np.array([1.0, 0.0, 0.3 if kind == "membrane" else 0.0])[: points.shape[1]]
    text = found(tmp_path, kind, turned(kind, joined(*halves, shift), 8))
    assert f"is not joined where {count} nodes lie before facets" in text


@pytest.mark.parametrize("kind, count", [("plane", 5), ("space", 25), ("membrane", 5)])
def test_doubled_nodes_are_counted(tmp_path, kind, count):
    halves = body(kind, 4, -1.0, 0.0), body(kind, 4, 0.0, 1.0)
    text = found(tmp_path, kind, turned(kind, joined(*halves, merged=False), 9))
    assert f"{count} pairs of nodes coincide" in text


def test_the_command_refuses_and_warns_in_one_line(tmp_path, capsys):
    mesh = body("space")
    scene_of(tmp_path, "space", joined(mesh, mesh, [0.3, 0.02, 0.01], merged=False))
    assert main(["check", str(tmp_path / "case.toml")]) == 2
    said = capsys.readouterr()
    assert "cells overlap in" in said.out + said.err
    scene_of(tmp_path, "space", joined(body("space", 2, -1.0, 0.0), body("space", 4)))
    assert main(["check", str(tmp_path / "case.toml")]) == 0
    assert "16 nodes hang on facets" in capsys.readouterr().err
