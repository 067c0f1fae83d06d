"""A sheet and a cube that are cut in halves: what is known of each, for tests of both."""

from dataclasses import dataclass

import numpy as np
from membrane_meshes import TILTED, Shape, flat, halved, layers, line, membrane
from solid_meshes import height, inclined, sliver_body, solid_scene, stacked

from verify.compare.body import body_of
from verify.compare.cut_rule import membrane_cut_rule, surface_rule
from verify.compare.hooke import Corotated, hooke
from verify.compare.locate import SolutionField
from verify.compare.realised import field_of
from verify.scene import Material
from verify.solution import Solution

GAUSS = [
    0.5 * (np.polynomial.legendre.leggauss(8)[0] + 1),
    0.5 * np.polynomial.legendre.leggauss(8)[1],
]


class _Halves:
    """What follows from the meshes, the same for both."""

    def halves(self, n, above, below, flip=False):
        """Linear fields (slope, shift) of the place in space, above and below the cut."""
        points, cells, layer = self.layers(n, flip=flip)
        moved = [points @ slope.T + shift for slope, shift in (below, above)]
        u = np.where(layer[:, None] > 0, moved[1], moved[0])
        return self.field(points, cells, u, self.body())


@dataclass(frozen=True)
class Sheet(_Halves):
    """A plane in space or a roof, cut along the line."""

    shape: Shape
    levels = (4, 6)
    law = Corotated(0.7, 0.4)
    round_off = 1e-15  # of the width of a sliver, a difference of numbers near .5 on a slope
    cut_rule = staticmethod(membrane_cut_rule)
    cut = "cut0"

    def body(self, gap=None):
        return halved(self.shape, gaps=[] if gap is None else [gap])

    def layers(self, n, gap=None, flip=False):
        lines = [line] if gap is None else [line, lambda x: line(x) + gap]
        return layers(self.shape, n, lines, flip)

    def field(self, points, cells, u, body):
        return field_of(membrane(points, cells, u), body)

    @property
    def _slopes(self):
        return (0.0, 0.0) if self.shape is flat else (0.8, -0.8)

    @property
    def lower_measure(self):
        return 0.5 * np.hypot(self._slopes[0], 1)  # the line is at 1/2 in the mean

    def sliver(self, gap):
        return gap * np.hypot(self._slopes[0], 1)

    def upper(self):
        """Points and weights of a Gauss rule above the cut, and the normals of the surface."""
        (x, w), rows = GAUSS, []
        for left, slope in zip((0.0, 0.5), self._slopes, strict=True):  # either side of a ridge
            s, t = np.meshgrid(left + 0.5 * x, x, indexing="ij")
            low = line(s)
            points = self.shape(s.ravel(), (low + (1 - low) * t).ravel())
            across = TILTED[2] if self.shape is flat else [-slope, 0, 1] / np.hypot(slope, 1)
            weights = (np.outer(0.5 * w, w) * (1 - low)).ravel() * np.hypot(slope, 1)
            rows.append((points, weights, np.tile(across, (64, 1))))
        return [np.concatenate(column) for column in zip(*rows, strict=True)]

    def energy(self, slope):
        """Square of the energy norm of a linear field above the cut.

        Beside a uniform stretch, which turns nothing, the symmetric tangential part counts.
        """
        _, weights, normals = self.upper()
        density = []
        for n in normals:
            within = np.eye(3) - np.outer(n, n)
            strain = within @ (slope + slope.T) @ within / 2
            square = 2 * self.law.shear * np.sum(strain**2)
            density.append(self.law.lame * np.trace(strain) ** 2 + square)
        return weights @ density

    def pieces(self):
        """Lengths and normals of the cut on either side of a ridge, square to it in the surface."""
        found = []
        for left in (0.0, 0.5):
            ends = self.shape(np.array([left, left + 0.5]), line(np.array([left, left + 0.5])))
            along = (ends[1] - ends[0]) / (length := np.linalg.norm(ends[1] - ends[0]))
            aside = self.shape(np.array([left + 0.25]), np.array([0.9]))[0] - ends[0]
            square = aside - (aside @ along) * along
            found.append((length, square / np.linalg.norm(square)))
        return found

    def place(self):
        """A point of the first piece of the cut."""
        return self.shape(np.array([0.25]), line(np.array([0.25])))[0]

    def error_density(self, corners, gradient, expected):
        """Energy density of an error at points of triangles, in frames of their own."""
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        across /= np.linalg.norm(across, axis=1)[:, None]
        along = np.cross(across, [0.0, 1, 0])
        along /= np.linalg.norm(along, axis=1)[:, None]
        frames = np.stack([along, np.cross(across, along), across], axis=1)
        own, true = (
            np.einsum("nai,nij,nbj->nab", frames, g, frames[:, :2]) for g in (gradient, expected)
        )
        return self.law.error_density(own - true, true)


class Cube(_Halves):
    """The unit cube, cut along an inclined plane."""

    levels = (3, 5)
    law = hooke(Material(young=1.0, poisson=0.3))
    round_off = 4e-16  # of the height of a sliver, a difference of numbers near .5
    lower_measure = 0.5
    cut_rule = staticmethod(surface_rule)
    cut = "cut"

    def body(self, gap=None):
        return body_of(solid_scene([inclined()])) if gap is None else sliver_body(gap)

    def layers(self, n, gap=None, flip=False):
        heights = [height] if gap is None else [height, lambda p: height(p) + gap]
        return stacked(n, heights, flip)

    def field(self, points, cells, u, body):
        own = Solution(points=points, cells=cells.astype(np.int64), displacement=u[None])
        return SolutionField(own)

    def sliver(self, gap):
        return gap

    def upper(self):
        """Points and weights of a Gauss rule above the cut."""
        x, w = GAUSS
        points = np.stack(np.meshgrid(x, x, x, indexing="ij"), axis=-1).reshape(-1, 3)
        low = height(points)
        points[:, 2] = low + (1 - low) * points[:, 2]
        return points, np.einsum("i,j,k->ijk", w, w, w).ravel() * (1 - low), None

    def energy(self, slope):
        """Square of the energy norm of a linear field above the cut."""
        strain = 0.5 * (slope + slope.T)
        square = self.law.lame * np.trace(strain) ** 2 + 2 * self.law.shear * np.sum(strain**2)
        return 0.5 * square

    def pieces(self):
        """Area and normal of the cut."""
        normal = np.array([-1 / 3, 1 / 5, 1])
        area = np.linalg.norm(normal)  # over the unit square
        return [(area, normal / area)]

    def place(self):
        """A point near the cut, of which the nearest on it is taken."""
        return [0.4, 0.6, 0.5]

    def error_density(self, corners, gradient, expected):
        """Energy density of an error at points."""
        return self.law.energy_density(gradient - expected)
