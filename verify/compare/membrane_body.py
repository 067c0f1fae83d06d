"""A membrane and its cuts as asked, as the comparison sees them: triangles in space, and lines."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.compare.facet_kernels import distance_to_segments
from verify.compare.membrane_cuts import SHORT, SurfaceLines, nearest_on_lines, surface_lines
from verify.compare.patches import PlanePatch, patches_of
from verify.compare.splitting import measures
from verify.errors import UnsupportedSceneError
from verify.scene import Scene
from verify.scene.cuts import Cut
from verify.scene.mesh_file import read_mesh
from verify.scene.spatial import rim_edges
from verify.scene.spatial_cuts import PolygonCut, SweptCut

__all__ = ["MembraneBody", "cut_membrane", "membrane_of"]

Array = NDArray[np.float64]

_SAME = 2 * SHORT  # of the body's size: ends of lines that are closer are one point


@dataclass(frozen=True)
class MembraneBody:
    """The triangles of a mesh file, with cuts.

    Parameters
    ----------
    corners : (m, 3, 3) array
        Triangles that make up the body.
    patches : list of PlanePatch
        The cuts as asked.
    cuts : dict of str to SurfaceLines
        The lines along which these cross the surface.
    tips : (t, 3) array
        Ends of the lines inside the surface.
    """

    corners: Array
    patches: list[PlanePatch]
    cuts: dict[str, SurfaceLines]
    tips: Array
    dimension = 3
    box = None

    @property
    def measure(self) -> float:
        """Area, m²."""
        return float(measures(self.corners).sum())

    @property
    def size(self) -> float:
        """Diagonal of the bounding box, m."""
        return float(np.linalg.norm(np.ptp(self.corners.reshape(-1, 3), axis=0)))

    @property
    def has_cuts(self) -> bool:
        """Whether anything is cut."""
        return any(len(lines.ends) for lines in self.cuts.values())

    @property
    def front(self) -> Array:
        """Tips as segments (t, 2, 3) without length: what quadratures are graded to."""
        return np.stack([self.tips, self.tips], axis=1)

    def tip_distance(self, points: Array) -> Array:
        """Distance (n,) of points (n, 3) to the nearest tip; infinite without one."""
        points = np.ascontiguousarray(points)
        return np.asarray(distance_to_segments(points, self.tips, self.tips))

    def nearest_on_cuts(self, points: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Nearest points (n, 3) on the lines of the cuts, and whether they are tips (n,)."""
        ends = np.concatenate([lines.ends for lines in self.cuts.values()])
        foot, _ = nearest_on_lines(points, ends)
        return foot, self.tip_distance(foot) <= _SAME * self.size


def membrane_of(scene: Scene) -> MembraneBody:
    """Take the body of a scene whose geometry is a surface; see `cut_membrane`."""
    return cut_membrane(*read_mesh(scene), scene.cuts)


def cut_membrane(points: Array, cells: NDArray[np.int64], asked: Sequence[Cut]) -> MembraneBody:
    """Make the body of triangles (m, 3) in space and cuts.

    Raises
    ------
    UnsupportedSceneError
        If a cut is not plane in parts, crosses no triangle, or runs along a fold.
    """
    patches: list[PlanePatch] = []
    cuts = {}
    for cut in asked:
        if not isinstance(cut, PolygonCut | SweptCut):
            raise UnsupportedSceneError(
                f"a cut of kind '{cut.kind}' through a membrane cannot be compared on yet; "
                "polygons and swept polylines can"
            )
        mine = [patch for patch in patches_of(cut) if isinstance(patch, PlanePatch)]
        cuts[cut.name] = surface_lines(points, cells, mine, cut.name)
        if not len(cuts[cut.name].ends):
            raise UnsupportedSceneError(f"cut '{cut.name}' does not cross the membrane")
        patches += mine
    return MembraneBody(points[cells], patches, cuts, _tips(cuts, rim_edges((points, cells))))


def _tips(cuts: dict[str, SurfaceLines], rim: Array) -> Array:
    """Find the ends (t, 3) of lines that are neither on the rim nor met by another line."""
    everything = np.concatenate([rim, *(lines.ends for lines in cuts.values())])
    size = float(np.linalg.norm(np.ptp(everything.reshape(-1, 3), axis=0)))
    start, along = everything[:, 0], everything[:, 1] - everything[:, 0]
    tips = []
    for end in (end for lines in cuts.values() for end in lines.ends.reshape(-1, 3)):
        share = np.clip(np.sum((end - start) * along, 1) / np.sum(along**2, 1), 0.0, 1.0)
        away = np.linalg.norm(start + share[:, None] * along - end, axis=1)
        if np.sum(away <= _SAME * size) == 1:  # its own piece, and no other
            tips.append(end)
    return np.array(tips).reshape(-1, 3)
