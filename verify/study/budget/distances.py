"""Distances of fields, in norms over the body and over time."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.assess.error_history import mean_over
from verify.compare.displacement_error import displacement_error
from verify.compare.energy_error import energy_error
from verify.compare.error_norm import ErrorNorm
from verify.compare.hooke import Law
from verify.compare.locate import Field
from verify.compare.motion import Motion

Array = NDArray[np.float64]
Times = Sequence[float | None]

_MEASURES: dict[str, Callable[[Field, Field, Any, Law], ErrorNorm]] = {
    "displacement_l2": lambda one, other, rule, _law: displacement_error(one, other, rule),
    "energy_norm": energy_error,
}


def norm_names(times: Times) -> list[str]:
    """Norms that are split: at rest two; of motions at the end, and the means over time."""
    if len(times) == 1:
        return list(_MEASURES)
    return ["displacement_l2", *(f"{name}_mean" for name in _MEASURES)]


@dataclass(frozen=True)
class Distances:
    """Norms of differences.

    Attributes
    ----------
    times : sequence of float or None
    absolute : dict of str to (pairs, times, rules) array
    scale : dict of str to (times, rules) array
        Norms of the first field.
    """

    times: Times
    absolute: dict[str, Array]
    scale: dict[str, Array]

    def of(self, name: str) -> tuple[Array, float]:
        """Return a norm of each pair by each rule (pairs, rules), and that of the first field.

        Over time all is held against the largest norm of the first field at any time: a
        vibration passes through zero.
        """
        base = name.removesuffix("_mean")
        absolute, scale = self.absolute[base], float(self.scale[base][:, 0].max())
        if base == name:
            return absolute[:, -1], scale
        over = np.moveaxis(absolute, 1, 0)
        return mean_over([time or 0.0 for time in self.times], over), scale


def distances(
    motions: Sequence[Motion],
    pairs: Sequence[tuple[int, int]],
    times: Times,
    family: Sequence[Any],
    law: Law,
) -> Distances:
    """Measure how far the motions of some pairs are apart.

    Parameters
    ----------
    motions : sequence of Motion
    pairs : sequence of (int, int)
        Numbers of two motions, the one that is held against the other second.
    times : sequence of float or None
        [None] for fields at rest.
    family : sequence of Rule
        The finest first.
    law : Law
    """
    shape = (len(times), len(family))
    absolute = {name: np.zeros((len(pairs), *shape)) for name in _MEASURES}
    scale = {name: np.zeros(shape) for name in _MEASURES}
    for t, time in enumerate(times):
        fields = [motion.at(time) for motion in motions]  # found at the points once for all pairs
        for r, rule in enumerate(family):
            for name, measure in _MEASURES.items():
                scale[name][t, r] = measure(fields[-1], fields[0], rule, law).scale
                for p, (one, other) in enumerate(pairs):
                    found = measure(fields[one], fields[other], rule, law)
                    absolute[name][p, t, r] = found.absolute
    return Distances(times, absolute, scale)
