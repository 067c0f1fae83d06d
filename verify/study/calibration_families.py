"""Families of the calibration study: random scenes with a known answer, and series with a limit.

The reference judges itself on the scenes. A series is three levels of a number whose orders are
mixed, and whose limit is known.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from verify.judge.convergence import extrapolate
from verify.scene import Scene
from verify.study import calibration_scenes as scenes

Content = dict[str, Any]

_SCENES, _QUICK_SCENES = 15, 2


@dataclass(frozen=True)
class Trial:
    """What a reference states of one number, and how far off it is; relative.

    Parameters
    ----------
    family : str
    scene, degree, level : int
        Which scene of the family, degree of the elements, and the finest of the three levels.
    quantity : str
        An error norm of the finest level, or a quantity of interest.
    stated, true : float
        Half-width that the reference states, and its true error.
    known : float
        How well the true error is known.
    left_out : str
        Why it does not count; empty if it does.
    """

    family: str
    degree: int
    level: int
    quantity: str
    stated: float
    true: float
    known: float
    left_out: str = ""
    scene: int = 0

    @property
    def covered(self) -> bool:
        """Whether the stated half-width covers the true error."""
        return bool(self.true <= self.stated + self.known)

    @property
    def ratio(self) -> float:
        """Stated over true."""
        return self.stated / self.true if self.true > 0.0 else float("inf")


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
        demand = "The stated uncertainty of the reference shall cover its true error."
        scene = {**content, "requirement": demand, "reference": reference}
        return Scene.model_validate(scene), values


def families(quick: bool) -> list[Family]:
    """Return the families of the study; quick: two scenes each of those that are cheap."""
    n = _QUICK_SCENES if quick else _SCENES
    found = [
        Family("airy", scenes.airy, (3, 7), n),
        Family("smooth", scenes.smooth, (3, 7), n),
        Family("tip", scenes.tip, (2, 5), n),
        Family("griffith", scenes.griffith, (3, 5), n),
        Family("ring and disc", scenes.ring_and_disc, (3, 7), n),
        Family("arc through", scenes.arc_through, (3, 7), n),
        Family("arc crack", scenes.curved_crack, (3, 5), n),
        Family("bar in motion", scenes.bar, (8, 12), n, degrees=(2,)),
    ]
    if quick:
        return found
    return [
        *found,
        Family("sudden crack", scenes.sudden_crack, (4, 5), degrees=(2,)),
        Family("blade strip", scenes.blade_strip, (6, 8), degrees=(1,)),
        # linear elements: levels of quadratic ones would take most of the study's time
        Family("solid smooth", scenes.solid_smooth, (1.5, 2.5), degrees=(1,)),
        Family("ball and shell", scenes.ball_and_shell, (1.5, 2.5), degrees=(1,)),
    ]


_LIMIT = 1.0
_SIZES = (0.2, 0.1, 0.05)  # the finest is by no means asymptotic
_DECADES = 1.0  # sizes of coefficients: 10 to the power of −1 … 1, of either sign


@dataclass(frozen=True)
class Series:
    """Values 1 + c₁ hᵃ + c₂ hᵇ + c₃ hᶜ, of which every coefficient is drawn at random.

    Parameters
    ----------
    name : str
    exponents : (float, float, float)
    formal : float
        Order that is counted on, right or wrong.
    count : int
        Series, each a triple of levels of its own.
    """

    name: str
    exponents: tuple[float, float, float]
    formal: float
    count: int

    def values(self, seed: int) -> np.ndarray:
        """Return the values (count, 3), coarse to fine."""
        random = np.random.default_rng([seed, *self.name.encode()])
        shape = (self.count, 3)
        sizes = 10.0 ** random.uniform(-_DECADES, _DECADES, shape)
        coefficients = random.choice([-1.0, 1.0], shape) * sizes
        return _LIMIT + coefficients @ np.power.outer(_SIZES, self.exponents).T

    def trials(self, seed: int) -> list[Trial]:
        """Have the estimator of quantities state its half-width of every series."""
        found = []
        for index, values in enumerate(self.values(seed)):
            stated = extrapolate(values.tolist(), _SIZES, self.formal).half_width
            true = abs(float(values[-1]) - _LIMIT)
            found.append(Trial(self.name, 0, 2, "value", stated, true, 0.0, scene=index))
        return found


def series_families(quick: bool) -> list[Series]:
    """Return the families of the study; quick: a tenth of the triples."""
    return [
        Series(f"{name}, formal order {formal}", exponents, formal, 40 if quick else 400)
        for name, exponents in (("h^½ + h + h²", (0.5, 1.0, 2.0)), ("h + h² + h³", (1.0, 2.0, 3.0)))
        for formal in (1, 2)
    ]
