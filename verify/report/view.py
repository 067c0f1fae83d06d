"""Window, colours and lines of a picture, the same for every renderer."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.report.bodies import Body

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
