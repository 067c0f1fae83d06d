"""Random cuts through a square or a cube, the XFEM mesh of each, and each part moved by itself."""

from typing import Any

import numpy as np
import scenes
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from verify.compare.body import AnyBody, body_of
from verify.geometry.simplices import frame
from verify.scene import Scene
from verify.solution import Solution
from verify.solvers.body_of_scene import cuts_of
from verify.xfem.mesh import SimplexMesh, box_mesh
from verify.xfem.phantom import PhantomMesh, cut_mesh
from verify.xfem.subdivision import subdivide

Array = NDArray[np.float64]


def random_square(n: int, random: np.random.Generator) -> SimplexMesh:
    """Unstructured triangles of the unit square, about n to a side."""
    axis = np.linspace(0.0, 1.0, n + 1)
    points = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1)
    shift = random.uniform(-0.35, 0.35, points.shape) / n
    for a in range(2):
        shift[(points[..., a] == 0.0) | (points[..., a] == 1.0), a] = 0.0
    points = (points + shift).reshape(-1, 2)
    cells = Delaunay(points).simplices.astype(np.int64)
    edges = points[cells[:, 1:]] - points[cells[:, :1]]
    return SimplexMesh(points, cells[np.abs(np.linalg.det(edges)) > 1e-9])


def random_cube(n: int, random: np.random.Generator) -> SimplexMesh:
    """Tetrahedra of the unit cube, about n to a side, whose nodes are shaken."""
    mesh = box_mesh((n, n, n))
    shift = random.uniform(-0.12, 0.12, mesh.points.shape) / n
    shift[(mesh.points == 0.0) | (mesh.points == 1.0)] = 0.0
    return SimplexMesh(mesh.points + shift, mesh.cells)


def random_curves(random: np.random.Generator) -> list[dict[str, Any]]:
    """Between one and three of: a circle, an arc through the square, an S through it."""
    return [
        {**_curve(random, random.integers(3)), "name": f"cut {k}"}
        for k in range(random.integers(1, 4))
    ]


def _curve(random: np.random.Generator, kind: int) -> dict[str, Any]:
    turn = random.uniform(0.0, 2 * np.pi)
    if kind == 0:
        return {
            "kind": "arc", "centre": random.uniform(0.35, 0.65, 2).tolist(),
            "radius": random.uniform(0.12, 0.3),
        }  # fmt: skip
    if kind == 1:  # a part of a circle that is outside of the square but there
        radius, at = random.uniform(0.9, 1.6), random.uniform(-0.2, 0.2)
        centre = 0.5 + (radius + at) * np.array([np.cos(turn), np.sin(turn)])
        start = np.rad2deg(turn) + 180.0 - 75.0
        return {
            "kind": "arc", "centre": centre.tolist(), "radius": radius, "start": start,
            "sweep": 150.0,
        }  # fmt: skip
    x = np.linspace(-1.0, 1.0, 13)
    s = np.column_stack([x, 0.2 * np.sin(random.uniform(2, 5) * x) + random.uniform(-0.2, 0.2)])
    way = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    return {"kind": "polyline", "points": (0.5 + s @ way).tolist()}


def random_surfaces(random: np.random.Generator) -> list[dict[str, Any]]:
    """Between one and two of: a cylinder, a swept S, a plane, all through the cube."""
    found = []
    for k in range(random.integers(1, 3)):
        axes = frame(np.array([0.0, 0.0, 1.0]) + random.uniform(-0.3, 0.3, 3))
        kind = random.integers(3)
        middle = random.uniform(0.4, 0.6, 3)
        if kind == 0:
            cut = {
                "kind": "cylinder", "base": (middle - 2 * axes[2]).tolist(),
                "axis": axes[2].tolist(), "radius": random.uniform(0.2, 0.4), "height": 4.0,
            }  # fmt: skip
        elif kind == 1:
            x = np.linspace(-2.0, 2.0, 9)
            s = np.column_stack([x, 0.2 * np.sin(3 * x)]) @ axes[:2]
            points = middle + s - 2 * axes[2]
            cut = {"kind": "swept", "points": points.tolist(), "along": (4 * axes[2]).tolist()}
        else:
            corners = np.array([[-2, -2], [2, -2], [2, 2], [-2, 2.0]])
            cut = {"kind": "polygon", "points": (middle + corners @ axes[1:]).tolist()}
        found.append({**cut, "name": f"cut {k}"})
    return found


def parts_of(scene: Scene, points: Array) -> NDArray[np.int64]:
    """Part (n,) of a body that is cut through, by winding: a bit for the left of each cut."""
    bits = np.zeros(len(points), dtype=np.int64)
    for k, cut in enumerate(scene.cuts):
        bits |= _on_positive_side(cut, points).astype(np.int64) << k
    return bits


def _on_positive_side(cut: Any, points: Array) -> NDArray[np.bool_]:
    if cut.kind == "arc":
        return np.linalg.norm(points - np.array(cut.centre), axis=1) < cut.radius
    if cut.kind == "polyline":
        return _winding(points, _closed_left(np.array(cut.points))) > 0.5
    if cut.kind == "cylinder":
        flat = (points - np.array(cut.base)) @ cut.axes()[:2].T
        return np.linalg.norm(flat, axis=1) < cut.radius
    path = np.array(cut.points)
    if cut.kind == "swept":
        along = np.array(cut.along) / np.linalg.norm(cut.along)
        e = (path[-1] - path[0]) - ((path[-1] - path[0]) @ along) * along
        e /= np.linalg.norm(e)
        # the positive side is that of (b − a) × along: to the right, seen against `along`
        axes = np.array([e, np.cross(e, along)])
        return _winding((points - path[0]) @ axes.T, _closed_left((path - path[0]) @ axes.T)) > 0.5
    normal = np.cross(path[1] - path[0], path[2] - path[0])
    return (points - path[0]) @ normal > 0.0


def _closed_left(path: Array) -> Array:
    """Polygon around what is left of a path that passes by: a detour of a hundred lengths."""
    way = path[-1] - path[0]
    left = np.array([-way[1], way[0]])
    beyond = [path[-1] + 9 * way, path[-1] + 9 * (way + left), path[0] + 9 * (left - way)]
    return np.vstack([path, *beyond, path[0] - 9 * way])


def _winding(points: Array, polygon: Array) -> Array:
    """How often a closed polygon goes around points (n, 2): the angles that its edges subtend."""
    to = polygon[None] - points[:, None]
    angle = np.arctan2(to[..., 1], to[..., 0])
    step = np.diff(np.concatenate([angle, angle[:, :1]], axis=1), axis=1)
    return np.round(((step + np.pi) % (2 * np.pi) - np.pi).sum(axis=1) / (2 * np.pi))


def moved_parts(scene: Scene, mesh: SimplexMesh, size: float) -> tuple[Solution, set[int]]:
    """Every body of the cut mesh moved by the number of the part that it is; the parts there are.

    Which part a body is says the largest of its pieces: it is no sliver, and lies on one side.
    """
    phantom: PhantomMesh = cut_mesh(mesh, cuts_of(scene, size))
    of_piece = phantom.bodies[phantom.cells[:, 0]]
    order = np.argsort(phantom.volumes, kind="stable")
    largest = np.zeros(of_piece.max() + 1, dtype=np.int64)
    largest[of_piece[order]] = order
    part = parts_of(scene, phantom.piece_centroids[largest])
    u = np.zeros_like(phantom.node_points)
    u[:, 0] = part[phantom.bodies]
    shown = subdivide(phantom)
    solution = Solution(
        shown.points, shown.cells, (shown.interpolation @ u)[None], cut_facets=shown.cut_facets
    )
    return solution, set(part.tolist())


def parted_square(random: np.random.Generator, n: int) -> tuple[Scene, AnyBody, Solution, set[int]]:
    """A square with random cuts, and its parts moved."""
    scene = scenes.scene(random_curves(random))
    return scene, body_of(scene), *moved_parts(scene, random_square(n, random), 1.0 / n)


def parted_cube(random: np.random.Generator, n: int) -> tuple[Scene, AnyBody, Solution, set[int]]:
    """A cube with random cuts, and its parts moved."""
    scene = scenes.scene(random_surfaces(random), 3)
    return scene, body_of(scene), *moved_parts(scene, random_cube(n, random), 1.0 / n)
