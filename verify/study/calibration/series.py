"""Families of series of mixed orders: three levels of a number whose limit is known."""

from dataclasses import dataclass

import numpy as np

from verify.judge.richardson import extrapolate
from verify.study.calibration.trial import Trial

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
