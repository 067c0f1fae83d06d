"""Seeded strokes of the nasty kinds: on and next to vertices, edges, faces, corners, other cuts."""

import numpy as np
from numpy.typing import NDArray

from verify.xfem.arrays import XfemError
from verify.xfem.cuts import ToolPath
from verify.xfem.mesh import SimplexMesh, box_mesh, rectangle_mesh

_Floats = NDArray[np.float64]

NEARNESS = (0.0, *(10.0 ** -np.arange(1, 15)))  # how far from degenerate, in units of the body
_FAR = 3.0  # half the length of a stroke that goes through the unit body


def body(rng: np.random.Generator, dim: int) -> SimplexMesh:
    """Unit square or cube in a few elements, inner nodes moved at random every other time."""
    divisions = rng.integers(1, 5 if dim == 2 else 4, size=dim)
    if dim == 2:
        mesh = rectangle_mesh(divisions, diagonal=rng.choice(["right", "alternating", "crossed"]))
    else:
        mesh = box_mesh(divisions)
    if rng.random() < 0.5:
        return mesh
    inner = ((mesh.points > 0.0) & (mesh.points < 1.0)).all(axis=1)
    moves = rng.uniform(-0.15, 0.15, mesh.points.shape) / divisions.max()
    return SimplexMesh(mesh.points + inner[:, None] * moves, mesh.cells)


def _direction(rng: np.random.Generator, dim: int) -> _Floats:
    """Of an axis, of a diagonal, or any."""
    kind = rng.integers(3)
    if kind == 0:
        return np.eye(dim)[rng.integers(dim)]
    vector = rng.choice([-1.0, 0.0, 1.0], dim) if kind == 1 else rng.normal(size=dim)
    length = np.linalg.norm(vector)
    return vector / length if length > 0.0 else np.eye(dim)[0]


def _across(
    rng: np.random.Generator, point: _Floats, normal: _Floats, partial: bool
) -> tuple[_Floats, _Floats | None]:
    """Tips and depth of a straight stroke with that normal through a point."""
    dim = len(point)
    if dim == 2:
        along = np.array([normal[1], -normal[0]])
        depth = None
        start = point
    else:
        along = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
        along /= np.linalg.norm(along)
        deep = np.cross(normal, along)
        start = point - (rng.choice([0.0, 0.1, 0.5]) if partial else _FAR) * deep
        depth = 2.0 * _FAR * deep
    back, forth = rng.choice([0.0, 0.25, _FAR], 2) if partial else (_FAR, _FAR)
    tips = np.stack([start - back * along, start + max(forth, 0.1) * along])
    if partial and rng.random() < 0.3:  # a bend
        tips = np.concatenate([tips, tips[-1:] + 0.6 * (along + rng.uniform(-1, 1) * normal)])
    return tips, depth


def strokes(rng: np.random.Generator, mesh: SimplexMesh, count: int) -> list[ToolPath]:
    """So many strokes through or into a body, each degenerate, or nearly, in some way."""
    dim, paths = mesh.space, []
    last = (np.full(dim, 0.5), np.eye(dim)[0])
    while len(paths) < count:
        near = float(rng.choice(NEARNESS)) * rng.choice([-1.0, 1.0])
        node, normal = mesh.points[rng.integers(len(mesh.points))], _direction(rng, dim)
        kind = rng.choice(["vertex", "cell", "parallel", "corner", "again", "cross"])
        if kind == "vertex":  # through a vertex or past it; with an axis normal along edges
            point = node + near * normal
        elif kind == "cell":  # along an edge or a face of some element
            corners = mesh.points[mesh.cells[rng.integers(len(mesh.cells))]]
            edge = corners[1] - corners[0]
            if dim == 2:
                normal = np.array([edge[1], -edge[0]])
            else:
                normal = np.cross(edge, corners[2] - corners[0])
            normal = normal / np.linalg.norm(normal)
            point = corners[0] + near * normal
        elif kind == "parallel":
            normal = last[1]
            point = last[0] + near * normal
        elif kind == "corner":  # cuts a corner of the body off, or a corner of an element
            corner = rng.integers(0, 2, dim).astype(float)
            normal = (1.0 - 2.0 * corner) * rng.uniform(0.2, 1.0, dim)
            normal /= np.linalg.norm(normal)
            point = corner + abs(near) * normal
        elif kind == "again":
            point, normal = last[0], rng.choice([-1.0, 1.0]) * last[1]
        else:  # crosses the last one next to a vertex
            point = node + near * rng.normal(size=dim)
        tips, depth = _across(rng, point, normal, bool(rng.random() < 0.35))
        times = 10.0 * len(paths) + np.arange(len(tips))
        try:
            paths.append(ToolPath.of_tip(tips, times, depth))
        except XfemError:
            continue  # the bend turns back: refused, and tested elsewhere
        last = (point, normal)
    return paths
