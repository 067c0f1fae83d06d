"""Surfaces of a played body: that of the material itself, one to see, one to touch.

Those of a solid can be separate meshes. A plane body and a membrane are their own surface.
"""

import numpy as np

from verify.simulator.cutting.growing_body import Increment
from verify.simulator.cutting.semi_progressive import SemiProgressiveCutter
from verify.simulator.mapping.embedded_surface import EmbeddedSurface
from verify.simulator.mapping.moving_surface import BodySurface, MovingSurface
from verify.simulator.stage import Stage
from verify.xfem.arrays import Bools, Floats, Ints
from verify.xfem.phantom import PhantomMesh


class Picture:
    """Triangles to be drawn.

    Attributes
    ----------
    points, material : (q, 3) float array
        Corners as they are now, and in the uncut body, m.
    triangles : (f, 3) int array
    inner : (f,) bool array
        Whether a triangle lies on a cut.
    """

    def __init__(self, points: Floats, material: Floats, triangles: Ints, inner: Bools) -> None:
        beyond = ((0, 0), (0, 3 - points.shape[1]))
        self.points, self.material = np.pad(points, beyond), np.pad(material, beyond)
        self.triangles, self.inner = triangles, inner


class Surfaces:
    """All surfaces of a body under the knife.

    Parameters
    ----------
    stage : Stage
    cutter : SemiProgressiveCutter

    Attributes
    ----------
    material : BodySurface
        Closed around the material; of a membrane, its triangles.
    visual, collision : EmbeddedSurface or None
        Where the stage has separate ones.
    """

    def __init__(self, stage: Stage, cutter: SemiProgressiveCutter) -> None:
        self.material = BodySurface(cutter.body)
        self.visual, self.collision = (
            EmbeddedSurface(cutter, *given) if given is not None else None
            for given in (stage.visual, stage.collision)
        )
        followers = (self.material, self.visual, self.collision)
        self._followers = [surface for surface in followers if surface is not None]

    def update(self, increment: Increment) -> None:
        """Let them follow a cut."""
        for follower in self._followers:
            follower.update(increment)

    def move(self, displacement: Floats) -> None:
        """Compute the positions of all vertices for a displacement (N, s) of the unknowns."""
        self._positions = [follower.surface.positions(displacement) for follower in self._followers]

    @property
    def shown(self) -> MovingSurface:
        """The surface that is seen, the faces of cuts apart."""
        return (self.visual or self.material).surface

    @property
    def touchable(self) -> MovingSurface:
        """The surface that tools collide with."""
        return (self.collision or self.material).surface

    @property
    def touchable_positions(self) -> Floats:
        """(v, s) vertices of that surface after the last `move`, m."""
        return self._positions[-1 if self.collision else 0]

    def picture(self, phantom: PhantomMesh, displacement: Floats) -> Picture:
        """Draw the body as it is now: the visual surface with the faces of the cuts."""
        if phantom.mesh.space == 2:
            return _pieces(phantom, displacement)
        inside = self.material.surface
        parts = [(inside, inside.used)]
        if self.visual is not None:
            shown = inside.used[inside.inner.rows[inside.used]]
            parts = [(inside, shown), (self.shown, self.shown.used)]
        points, material, triangles, inner, begin = [], [], [], [], 0
        for number, (surface, used) in enumerate(parts):
            points.append(surface.positions(displacement))
            material.append(surface.material.rows)
            triangles.append(surface.facets.rows[used] + begin)
            inner.append(surface.inner.rows[used] & (number == 0))
            begin += len(points[-1])
        return Picture(*(np.concatenate(rows) for rows in (points, material, triangles, inner)))


def _pieces(phantom: PhantomMesh, displacement: Floats) -> Picture:
    """Draw a plane body: its whole triangles and the parts of the split ones."""
    piece, at, _ = phantom.solid_simplices
    corners = phantom.mesh.points[phantom.mesh.cells[phantom.parent[piece]]]
    turned = np.linalg.det(at) < 0.0  # sub-simplices come in the order of their numbers
    at = np.where(turned[:, None, None], at[:, ::-1], at)
    moved = corners + displacement[phantom.cells[piece]]
    now, before = (
        np.einsum("qki,qis->qks", at, x).reshape(-1, corners.shape[2]) for x in (moved, corners)
    )
    triangles = np.arange(len(now)).reshape(-1, 3)
    return Picture(now, before, triangles, np.zeros(len(triangles), dtype=bool))
