"""Families of random scenes with an exact solution, on which the reference judges itself."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from verify.scene import Scene
from verify.study.calibration.motion_scenes import bar, sudden_crack
from verify.study.calibration.plane_scenes import (
    airy,
    arc_through,
    curved_crack,
    griffith,
    ring_and_disc,
    smooth,
    tip,
)
from verify.study.calibration.solid_scenes import ball_and_shell, solid_smooth

Content = dict[str, Any]

_SCENES, _QUICK_SCENES = 15, 2


@dataclass(frozen=True)
class Family:
    """Scenes of one kind, of which every number is drawn at random.

    Parameters
    ----------
    name : str
    make : callable
        Makes the content of a scene, without a reference, from a random generator; of a motion
        with the true ``values`` of its quantities.
    cells : (float, float)
        Elements of the coarsest level along the side of the body, least and most, by degree.
    scenes : int
    levels : int
        Every three successive levels make a reference.
    degrees : tuple of int
        Scenes take them in turn.
    """

    name: str
    make: Callable[[np.random.Generator], Content]
    cells: tuple[float, float]
    scenes: int = _SCENES
    levels: int = 3
    degrees: tuple[int, ...] = (1, 2)

    def scene(self, index: int, seed: int) -> tuple[Scene, Mapping[str, float]]:
        """Return a scene, judged by conforming levels as if there were no exact solution.

        Beside it the true values of its quantities, where it is without an exact field.
        """
        random = np.random.default_rng([seed, index, *self.name.encode()])
        content = self.make(random)
        values = content.pop("values", {})
        low, high = (np.array(content["geometry"][end]) for end in ("lower", "upper"))
        reference = {
            "kind": "conforming",
            "size": float((high - low).max() / random.uniform(*self.cells)),
            "levels": self.levels,
            "degree": self.degrees[index % len(self.degrees)],
        }
        return Scene.model_validate({**content, "reference": reference}), values


def families(quick: bool) -> list[Family]:
    """Return the families of the study; quick: two scenes each of those that are cheap."""
    n = _QUICK_SCENES if quick else _SCENES
    found = [
        Family("airy", airy, (3, 7), n),
        Family("smooth", smooth, (3, 7), n),
        Family("tip", tip, (2, 5), n),
        Family("griffith", griffith, (3, 5), n),
        Family("ring and disc", ring_and_disc, (3, 7), n),
        Family("arc through", arc_through, (3, 7), n),
        Family("arc crack", curved_crack, (3, 5), n),
        Family("bar in motion", bar, (8, 12), n, degrees=(2,)),
    ]
    if quick:
        return found
    return [
        *found,
        Family("sudden crack", sudden_crack, (4, 5), degrees=(2,)),
        # linear elements: levels of quadratic ones would take most of the study's time
        Family("solid smooth", solid_smooth, (1.5, 2.5), degrees=(1,)),
        Family("ball and shell", ball_and_shell, (1.5, 2.5), degrees=(1,)),
    ]
