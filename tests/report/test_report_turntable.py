"""Claims about bodies in space that can be turned in the page."""

import base64
import json

import numpy as np
import pytest

from verify.report.bodies import deformed_body
from verify.report.turntable import packed
from verify.report.view import common_view
from verify.solution import Solution

# corners of a cube, 6 tetrahedra around its diagonal
_KUHN = [[0, 1, 3, 7], [0, 1, 5, 7], [0, 2, 3, 7], [0, 2, 6, 7], [0, 4, 5, 7], [0, 4, 6, 7]]


def cut_cube(n=4, opening=0.1):
    """Return a cube of n³ (n even) cubes, cut across in the middle and opened."""
    axis = np.arange(n + 1)
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3)
    number = {tuple(p): i for i, p in enumerate(grid)}
    corner = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    cells = np.array([
        [number[tuple(p + corner[c])] for c in tet]
        for p in grid[(grid < n).all(axis=1)] for tet in _KUHN
    ])  # fmt: skip
    points = grid / n
    below = points[cells][:, :, 2].mean(axis=1) < 0.5
    middle = np.flatnonzero(grid[:, 2] == n // 2)
    twin = np.arange(len(points))
    twin[middle] = len(points) + np.arange(len(middle))
    cells = np.where(below[:, None], cells, twin[cells])
    points = np.vstack([points, points[middle]])
    edges = points[cells][:, 1:] - points[cells][:, :1]
    cells[np.linalg.det(edges) < 0] = cells[np.linalg.det(edges) < 0][:, [0, 2, 1, 3]]
    upper = np.zeros(len(points), dtype=bool)
    upper[cells[~below]] = True
    u = np.zeros_like(points)
    u[upper, 2] = opening * (1 + points[upper, 0])
    return Solution(points=points, cells=cells, displacement=u[None])


def numbers(text, kind):
    return np.frombuffer(base64.b64decode(text), dtype=kind)


def test_the_surface_of_a_cut_cube_is_packed_whole_with_its_faces_of_the_cut_last():
    n, opening = 4, 0.1
    body = deformed_body(cut_cube(n, opening), 1.0)
    data = packed(body, common_view([body], "cividis"))
    head = json.loads(data["data-head"])
    assert head["triangles"] == 2 * n * n * (6 + 2)
    assert head["outer"] == 2 * n * n * 6
    q = numbers(data["data-vertices"], "<u2").reshape(-1, 4)
    points = np.array(head["low"]) + q[:, :3] / 65535 * np.array(head["span"])
    corners = points[numbers(data["data-triangles"], "<u4").reshape(-1, 3)]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]),
                          axis=1) / 2  # fmt: skip
    # two faces of the cut, the upper one inclined by the opening 0.1 (1 + x)
    assert area[head["outer"] :].sum() == pytest.approx(1 + np.hypot(1, opening), rel=1e-4)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    volume = np.einsum("ij,ij->", corners.mean(axis=1), normal) / 3
    assert volume == pytest.approx(1.0, rel=1e-4)  # closed, and oriented outwards
