"""A membrane and its cuts as asked, as the comparison sees them: triangles in space, and lines."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.compare.facet_kernels import nearest_segments
from verify.compare.locate import nearest_of_triangles
from verify.compare.membrane_cuts import SHORT, SurfaceLines, surface_lines
from verify.compare.simplex_body import SimplexBody
from verify.compare.simplices import triangle_frames
from verify.errors import UnsupportedSceneError
from verify.geometry.nearest import feet
from verify.geometry.patches import PlanePatch
from verify.geometry.spatial import rim_edges
from verify.scene import Scene
from verify.scene.mesh_file import read_mesh
from verify.scene.tool_path import Cut

Array = NDArray[np.float64]

_SAME = 2 * SHORT  # of the body's size: ends of lines that are closer are one point


@dataclass(frozen=True, kw_only=True)
class MembraneBody(SimplexBody):
    """The triangles of a mesh file, with cuts.

    Parameters
    ----------
    corners, cuts, front
        See `SimplexBody`.
    lines : dict of str to SurfaceLines
        The lines along which the cuts cross the surface.
    """

    lines: dict[str, SurfaceLines]

    @property
    def tips(self) -> Array:
        """Ends (t, 3) of the lines inside the surface."""
        return np.asarray(self.front[:, 0])

    def frames_at(self, points: Array) -> Array:
        """Two tangents and the normal (n, 3, 3) of the triangles that points (n, 3) lie in."""
        found, _ = nearest_of_triangles(points, self.corners, 1e-10 * self.size)
        return triangle_frames(self.corners[found])

    def nearest_on_cuts(self, points: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Nearest points (n, 3) on the lines of the cuts, and whether they are tips (n,)."""
        ends = np.concatenate([lines.ends for lines in self.lines.values()])
        _, foot, _ = nearest_segments(points, ends)
        return foot, self.tip_distance(foot) <= _SAME * self.size


def membrane_of(scene: Scene) -> MembraneBody:
    """Take the body of a scene whose geometry is a surface; see `cut_membrane`."""
    return cut_membrane(*read_mesh(scene), scene.final_cuts)


def cut_membrane(points: Array, cells: NDArray[np.int64], asked: Sequence[Cut]) -> MembraneBody:
    """Make the body of triangles (m, 3) in space and cuts.

    Raises
    ------
    UnsupportedSceneError
        If a cut is not plane in parts, crosses no triangle, or runs along a fold.
    """
    cuts, lines = {}, {}
    for cut in asked:
        if not cut.faceted:
            raise UnsupportedSceneError(
                f"a cut of kind '{cut.kind}' through a membrane cannot be compared on yet; "
                "polygons and swept polylines can"
            )
        patches = [patch for patch in cut.pieces() if isinstance(patch, PlanePatch)]
        found = surface_lines(points, cells, patches, cut.name)
        if not len(found.ends):
            raise UnsupportedSceneError(f"cut '{cut.name}' does not cross the membrane")
        cuts[cut.name], lines[cut.name] = patches, found
    tips = _tips([line.ends for line in lines.values()], rim_edges((points, cells)))
    front = np.stack([tips, tips], axis=1)
    return MembraneBody(corners=points[cells], cuts=cuts, front=front, lines=lines)


def _tips(lines: Sequence[Array], rim: Array) -> Array:
    """Find the ends (t, 3) of lines (s, 2, 3) that are neither on the rim nor met by another."""
    everything = np.concatenate([rim, *lines])
    size = float(np.linalg.norm(np.ptp(everything.reshape(-1, 3), axis=0)))
    tips = []
    for end in everything[len(rim) :].reshape(-1, 3):
        away = np.linalg.norm(feet(end, everything[:, 0], everything[:, 1]) - end, axis=1)
        if np.sum(away <= _SAME * size) == 1:  # its own piece, and no other
            tips.append(end)
    return np.array(tips).reshape(-1, 3)
