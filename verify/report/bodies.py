"""Bodies of stored fields and views of them, the same for every renderer."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.read_mesh import read_with_meshio
from verify.solution import Solution, read_solution

_FEATURE_ANGLE = 30.0  # degrees between facets beyond which a 3D edge is drawn
_SIDES = ((0, 1), (1, 2), (2, 0))  # of a triangle
_MOST_EDGES = 4000  # of elements that are drawn; more would be too dense to be seen


@dataclass(frozen=True)
class Body:
    """A surface to draw.

    Parameters
    ----------
    points : (n, 3) float array
        Where the nodes are drawn, m.
    triangles : (m, 3) int array
    edges : (e, 2) int array
        Outline; the two faces of a cut are part of it, since nodes are doubled there.
    values : (n,) or (m,) float array
        What is coloured, per node or per triangle.
    element_edges : (k, 2) int array
        Edges of the elements.
    material : (n, 3) float array
        Where the nodes are in the undeformed body, m.
    """

    points: NDArray[np.float64]
    triangles: NDArray[np.int64]
    edges: NDArray[np.int64]
    values: NDArray[np.float64]
    element_edges: NDArray[np.int64]
    material: NDArray[np.float64]

    @property
    def drawn_elements(self) -> NDArray[np.int64]:
        """Edges of the elements, none where they would be too dense to be seen."""
        return self.element_edges if len(self.element_edges) <= _MOST_EDGES else self.edges[:0]


def read_stored(root: Path, path: str) -> Solution:
    """Read the solution stored under `path` in the run directory `root`.

    Raises
    ------
    InputError
        If it is not there, not readable, or not inside the run directory.
    """
    target = (root / path).resolve()
    if not target.is_relative_to(root.resolve()):
        raise InputError("the solution lies outside the run directory", path)
    # a record may name the file, its path without ending, or its folder
    target = target / "solution" if target.is_dir() else target
    if target.suffix not in (".json", ".vtu"):
        target = target.with_name(target.name + ".json")
    try:
        return read_solution(target)
    except OSError as error:
        raise InputError(f"the solution cannot be read ({error.strerror})", path) from None


def deformed_bodies(solution: Solution, scale: float, steps: Sequence[int] = (-1,)) -> list[Body]:
    """Return the body displaced by `scale` times its displacement at times, coloured by |u|."""
    cells = _straight(solution.cells, solution.cell_type)
    still = _body(solution.points, cells, np.zeros(len(solution.points)), solution.cells)
    return [
        replace(
            still,
            points=_in_space(solution.points + scale * solution.displacement[step]),
            values=np.linalg.norm(solution.displacement[step], axis=1),
        )
        for step in steps
    ]


def error_body(path: Path) -> Body:
    """Return the undeformed body of a stored error field, coloured by the error.

    Raises
    ------
    InputError
        If the file is not a mesh of simplices with point or cell data ``error``.
    """
    mesh = read_with_meshio(path, "vtu", "an error field")
    for kind in ("tetra10", "tetra", "triangle6", "triangle"):
        if kind in mesh.cells_dict:
            break
    else:
        raise InputError("the error field has no triangles or tetrahedra", str(path))
    cells = np.asarray(mesh.cells_dict[kind], dtype=np.int64)
    points = np.asarray(mesh.points, dtype=float)
    # triangles off z = 0 are a membrane
    dimension = 3 if kind.startswith("tetra") or np.ptp(points[:, 2]) > 0.0 else 2
    points = points[:, :dimension]
    if "error" in mesh.point_data:
        values = np.asarray(mesh.point_data["error"], dtype=float)
        values = values if values.ndim == 1 else np.linalg.norm(values, axis=1)
        if len(values) != len(points) or not np.isfinite(values).all():
            raise InputError("the error field has values that are not finite", str(path))
        return _body(points, _straight(cells, kind), values, cells)
    per_cell = mesh.cell_data_dict.get("error", {}).get(kind)
    if per_cell is None or dimension == 3 or kind == "triangle6":
        raise InputError("the error field has no point data 'error'", str(path))
    return _body(points, cells, np.asarray(per_cell, dtype=float).reshape(-1), cells)


def zoomed(body: Body, window: tuple[float, float, float, float]) -> Body:
    """Return the triangles of a plane body that reach into a window (x0, x1, y0, y1)."""
    x0, x1, y0, y1 = window
    low = body.points[body.triangles].min(axis=1)
    high = body.points[body.triangles].max(axis=1)
    seen = (high[:, 0] > x0) & (low[:, 0] < x1) & (high[:, 1] > y0) & (low[:, 1] < y1)
    nodal = len(body.values) == len(body.points)
    used, index = np.unique(body.triangles[seen], return_inverse=True)
    new = np.full(len(body.points), -1)
    new[used] = np.arange(len(used))
    edges, inner = (
        kept[(kept >= 0).all(axis=1)] for kept in (new[body.edges], new[body.element_edges])
    )
    values = body.values[used] if nodal else body.values[seen]
    points, material = body.points[used], body.material[used]
    return Body(points, index.reshape(-1, 3), edges, values, inner, material)


def _straight(cells: NDArray[np.int64], kind: str) -> NDArray[np.int64]:
    """Return quadratic triangles as four straight ones, tetrahedra by their corners."""
    if kind == "triangle6":
        a, b, c, ab, bc, ca = cells.T
        return np.concatenate(
            [np.column_stack(t) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        )
    return cells[:, :4] if kind.startswith("tetra") else cells


def _body(
    points: NDArray[np.float64],
    cells: NDArray[np.int64],
    values: NDArray[np.float64],
    elements: NDArray[np.int64],
) -> Body:
    flat, drawn = points.shape[1] == 2, _in_space(points)
    if cells.shape[1] == 3:
        triangles, inner = cells, _all_edges(elements[:, :3])
        edges = _single(cells, _SIDES) if flat else _creases(drawn, triangles, oriented=False)
    else:
        triangles = _single(cells, ((1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1)))
        edges, inner = _creases(drawn, triangles), _all_edges(triangles)
    return Body(drawn, triangles, edges, values, inner, drawn)


def _in_space(points: NDArray[np.float64]) -> NDArray[np.float64]:
    flat = points.shape[1] == 2
    return np.column_stack([points, np.zeros(len(points))]) if flat else points


def _keys(found: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return one number for each row of nodes, the same for rows of the same nodes."""
    shape = (int(found.max(initial=0)) + 1,) * found.shape[1]
    return np.asarray(np.ravel_multi_index(tuple(np.sort(found, axis=1).T), shape))


def _single(cells: NDArray[np.int64], faces: tuple[tuple[int, ...], ...]) -> NDArray[np.int64]:
    """Return the faces that belong to one cell only, as the cell orients them."""
    found = np.concatenate([cells[:, list(face)] for face in faces])
    _, first, count = np.unique(_keys(found), return_index=True, return_counts=True)
    single: NDArray[np.int64] = found[np.sort(first[count == 1])]
    return single


def _all_edges(triangles: NDArray[np.int64]) -> NDArray[np.int64]:
    found = np.concatenate([triangles[:, list(side)] for side in _SIDES])
    _, first = np.unique(_keys(found), return_index=True)
    edges: NDArray[np.int64] = np.sort(found[first], axis=1)
    return edges


def _creases(
    points: NDArray[np.float64], triangles: NDArray[np.int64], oriented: bool = True
) -> NDArray[np.int64]:
    """Return the edges of a surface where it ends or bends sharply.

    Triangles that are not `oriented` alike bend by less than a right angle.
    """
    a, b, c = (points[triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    edges = np.concatenate([triangles[:, [i, j]] for i, j in _SIDES])
    owner = np.tile(np.arange(len(triangles)), 3)
    _, first, inverse, count = np.unique(
        _keys(edges), return_index=True, return_inverse=True, return_counts=True
    )
    unique, turned = np.sort(edges[first], axis=1), normals[owner]
    if not oriented:
        alike = np.einsum("ij,ij->i", turned, turned[first][inverse])
        turned = np.where(alike[:, None] < 0.0, -turned, turned)
    total = np.zeros((len(unique), 3))
    np.add.at(total, inverse, turned)
    # |n1 + n2| = 2 cos(angle/2) for the two facets of an inner edge
    sharp = np.linalg.norm(total, axis=1) < 2 * np.cos(np.deg2rad(_FEATURE_ANGLE) / 2)
    creases: NDArray[np.int64] = unique[(count != 2) | sharp]
    return creases


_PIXELS = 560_000  # of a picture: 2 × what a page shows of it, for sharp displays
_MARGIN = 0.03
# A 3D body is seen from the front, right and above (elevation 24°, azimuth −58°)
_ELEVATION, _AZIMUTH = np.deg2rad(24.0), np.deg2rad(-58.0)


@dataclass(frozen=True)
class View:
    """A parallel projection and a colour scale.

    Parameters
    ----------
    right, up, towards : (3,) tuples of float
        Axes of the picture; `towards` points at the viewer.
    window : (x0, x1, y0, y1)
        What is seen, in the picture's axes, m.
    size : (width, height)
        In pixels.
    colours : str
        Name of the matplotlib colour map.
    limits : (low, high)
        Values at its ends.
    beyond : bool
        Whether there are values above `limits`, which have the last colour.
    """

    right: tuple[float, ...]
    up: tuple[float, ...]
    towards: tuple[float, ...]
    window: tuple[float, float, float, float]
    size: tuple[int, int]
    colours: str
    limits: tuple[float, float]
    beyond: bool = False

    def projected(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (n, 3): place in the picture, and depth towards the viewer."""
        axes = np.array([self.right, self.up, self.towards])
        result: NDArray[np.float64] = points @ axes.T
        return result


def common_view(
    bodies: Sequence[Body], colours: str, top: float | None = None, pixels: int = _PIXELS
) -> View:
    """Return the one view in which all `bodies` are seen whole, with one colour scale.

    It ends at `top`, by default at the largest value.
    """
    axis = np.eye(3)
    if any(np.ptp(body.points[:, 2]) > 0 for body in bodies):
        e, a = _ELEVATION, _AZIMUTH
        towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        axis = np.array([right, np.cross(towards, right), towards])
    places = np.concatenate([body.points @ axis[:2].T for body in bodies])
    low, high = places.min(axis=0), places.max(axis=0)
    room = _MARGIN * float((high - low).max()) or 1.0
    width, height = (high - low) + 2 * room
    # a very slender body still gets a picture some tens of pixels wide
    ratio = min(max(width / height, 1 / 12), 12.0)
    size = (round((pixels * ratio) ** 0.5), round((pixels / ratio) ** 0.5))
    most = max(float(body.values.max()) for body in bodies)
    top = most if top is None else top
    centre = (low + high) / 2
    half = np.array([max(width, height * ratio), max(height, width / ratio)]) / 2
    (x0, y0), (x1, y1) = centre - half, centre + half
    return View(
        tuple(axis[0].tolist()),
        tuple(axis[1].tolist()),
        tuple(axis[2].tolist()),
        (float(x0), float(x1), float(y0), float(y1)),
        size,
        colours,
        (0.0, top if top > 0 else 1.0),
        beyond=most > top,
    )
