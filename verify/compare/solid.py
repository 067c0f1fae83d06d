"""Simplices in space with cuts that end somewhere, and solid bodies of them, as asked."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.compare.cell_tree import build_cell_tree
from verify.compare.locate_kernels import holding_cells
from verify.compare.sides import distance_to_segments
from verify.compare.simplices import measures, simplices
from verify.errors import UnsupportedSceneError
from verify.geometry.patches import Patch
from verify.geometry.spatial import rim_edges
from verify.scene import Scene
from verify.scene.cuts import CylinderCut, DiscCut, PolygonCut, SphereCut, SweptCut
from verify.scene.geometry import Box, MeshFile
from verify.scene.loading import read_mesh

Array = NDArray[np.float64]
Inside = Callable[[Array], NDArray[np.bool_]]


@dataclass(frozen=True, kw_only=True)
class SimplexBody:
    """Tetrahedra, or triangles in space, with cuts.

    Parameters
    ----------
    corners : (m, k + 1, 3) array
        Simplices that make up the body.
    cuts : mapping of str to sequence of Patch
        The cuts as asked, not trimmed.
    front : (f, 2, 3) array
        Where cuts end inside the body, as segments: of a membrane, tips, without length.
    box : (2, 3) array, optional
        Lower and upper corner, if it is a box.
    """

    corners: Array
    cuts: Mapping[str, Sequence[Patch]]
    front: Array
    box: Array | None = None
    dimension = 3

    @property
    def cell_dimension(self) -> int:
        """Dimension k of the simplices: 3 of a solid, 2 of a membrane."""
        return self.corners.shape[1] - 1

    @property
    def measure(self) -> float:
        """Volume, m³, or area, m²."""
        return float(measures(self.corners).sum())

    @property
    def size(self) -> float:
        """Diagonal of the bounding box, m."""
        return float(np.linalg.norm(np.ptp(self.corners.reshape(-1, 3), axis=0)))

    @property
    def patches(self) -> list[Patch]:
        """Patches of all cuts."""
        return [patch for patches in self.cuts.values() for patch in patches]

    @property
    def has_cuts(self) -> bool:
        """Whether anything is cut."""
        return bool(self.cuts)

    def tip_distance(self, points: Array) -> Array:
        """Distance (n,) of points (n, 3) to the nearest front; infinite without one."""
        return distance_to_segments(points, self.front)

    def frames_at(self, points: Array) -> Array | None:
        """Two tangents and the normal (n, 3, 3) of a surface at points (n, 3); a solid has none."""
        return None


_RIM = 64  # pieces that a rim is divided into per body's size, where it is trimmed to the body
_MARGIN = 1e-9  # of the body's size: closer to its surface is on it


@dataclass(frozen=True, kw_only=True)
class SolidBody(SimplexBody):
    """A box, or the tetrahedra of a mesh file, with cuts.

    Parameters
    ----------
    corners, cuts, front, box
        See `SimplexBody`.
    inside : callable
        Whether points (n, 3) lie inside the body or on its surface.
    """

    inside: Inside

    def nearest_on_cuts(self, points: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Nearest points (n, 3) on the cuts as asked, and whether they are ends of these (n,)."""
        found = [patch.nearest(points) for patch in self.patches]
        feet, rims = (np.array(column) for column in zip(*found, strict=True))
        nearest = np.linalg.norm(points - feet, axis=2).argmin(axis=0), np.arange(len(points))
        return feet[nearest], rims[nearest]


def solid_of(scene: Scene) -> SolidBody:
    """Take the body of a scene in space.

    Raises
    ------
    UnsupportedSceneError
        If a cut is no surface of a known kind, or the body is none.
    """
    corners, box, inside = _material(scene)
    size = float(np.linalg.norm(np.ptp(corners.reshape(-1, 3), axis=0)))
    cuts, fronts = {}, [np.zeros((0, 2, 3))]
    for cut in scene.final_cuts:
        if not isinstance(cut, PolygonCut | DiscCut | CylinderCut | SphereCut | SweptCut):
            raise UnsupportedSceneError(f"a cut of kind '{cut.kind}' cannot be compared on yet")
        cuts[cut.name] = cut.pieces()
        fronts.append(_trimmed(rim_edges(cut.facets(size / _RIM)), inside, size))
    front = np.concatenate(fronts)
    return SolidBody(corners=corners, cuts=cuts, front=front, box=box, inside=inside)


def _material(scene: Scene) -> tuple[Array, Array | None, Inside]:
    geometry = scene.geometry
    if isinstance(geometry, Box):
        box = np.array([geometry.lower, geometry.upper], dtype=float)
        margin = _MARGIN * float(np.linalg.norm(box[1] - box[0]))

        def in_box(points: Array) -> NDArray[np.bool_]:
            within = (points >= box[0] - margin) & (points <= box[1] + margin)
            return np.asarray(within.all(axis=1))

        return _box_tetrahedra(box), box, in_box
    if not isinstance(geometry, MeshFile):
        raise UnsupportedSceneError(
            f"comparison on a body of kind '{geometry.kind}' is not possible yet; boxes and mesh "
            "files of tetrahedra are"
        )
    points, cells = read_mesh(scene)
    return points[cells], None, _in_mesh(points, cells)


def _box_tetrahedra(box: Array) -> Array:
    """Six tetrahedra (6, 4, 3) around the diagonal of a box (Kuhn)."""
    unit = np.array([[i & 1, i >> 1 & 1, i >> 2 & 1] for i in range(8)], dtype=float)
    paths = [[0, *path, 7] for path in ([1, 3], [1, 5], [2, 3], [2, 6], [4, 5], [4, 6])]
    return np.asarray((box[0] + unit * (box[1] - box[0]))[np.array(paths)])


def _in_mesh(points: Array, cells: NDArray[np.int64]) -> Inside:
    shape = simplices(points, cells)
    tree = build_cell_tree(shape.corners.min(axis=1), shape.corners.max(axis=1))
    searched = tree.over(shape.corners, shape.normals)
    margin = _MARGIN * float(np.linalg.norm(np.ptp(points, axis=0)))

    def inside(x: Array) -> NDArray[np.bool_]:
        return holding_cells(x, searched, margin, nearest=False) >= 0

    return inside


def _trimmed(rim: Array, inside: Inside, size: float) -> Array:
    """Pieces (f, 2, 3) of the segments of a rim that run inside the body, not on its surface."""
    pieces = []
    for a, b in rim:
        n = max(1, int(np.ceil(_RIM * np.linalg.norm(b - a) / size)))
        stops = a + np.linspace(0.0, 1.0, n + 1)[:, None] * (b - a)
        pieces.append(np.stack([stops[:-1], stops[1:]], axis=1))
    if not pieces:
        return np.zeros((0, 2, 3))
    found = np.concatenate(pieces)
    middle = found.mean(axis=1)
    step = 1e-6 * size
    within = inside(middle)
    for way in step * np.vstack([np.eye(3), -np.eye(3)]):
        within &= inside(middle + way)
    return found[within]
