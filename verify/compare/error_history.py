"""Errors over time, and what is reported of them."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.compare.error_norm import ErrorNorm
from verify.compare.errors import ERRORS, OVER_TIME, Rules
from verify.compare.hooke import Law
from verify.compare.motion import Motion
from verify.scene import Scene
from verify.solution import Solution

Array = NDArray[np.float64]

ERROR_NAMES = (*ERRORS, *(f"{name}_{how}" for name in OVER_TIME for how in ("max", "mean")))


def base_of(name: str) -> str:
    """Error that a name of `ERROR_NAMES` is the maximum or mean over time of, or itself."""
    return name if name in ERRORS else name.rsplit("_", 1)[0]


@dataclass(frozen=True)
class History:
    """Error norms by name, time and rule.

    Parameters
    ----------
    times : list of float or None
        Times compared at, s; [None] for a static comparison.
    norms : dict of str to list (times) of list (rules) of ErrorNorm
    """

    times: list[float | None]
    norms: dict[str, list[list[ErrorNorm]]]

    def reported(self) -> dict[str, list[ErrorNorm]]:
        """Error norms by name and rule.

        Over time every error is held against the largest norm of the reference at any time: at
        the instant at which a vibration passes through zero there is nothing to be relative to.
        """
        if len(self.times) == 1:
            return {name: rows[0] for name, rows in self.norms.items()}
        found: dict[str, list[ErrorNorm]] = {}
        for name, rows in self.norms.items():
            errors = np.array([[norm.absolute for norm in row] for row in rows])
            scales = np.array([[norm.scale for norm in row] for row in rows]).max(axis=0)
            ways = {name: errors[-1]}
            if name in OVER_TIME:
                ways[f"{name}_max"] = errors.max(axis=0)
                ways[f"{name}_mean"] = mean_over([t or 0.0 for t in self.times], errors)
            for way, values in ways.items():
                found[way] = [
                    ErrorNorm(float(e), float(s)) for e, s in zip(values, scales, strict=True)
                ]
        return found

    def series(self) -> dict[str, list[float]]:
        """Relative errors over time by the finest rule, with the times; empty if static."""
        if len(self.times) == 1:
            return {}
        rows = {"time": [float(t or 0.0) for t in self.times]}
        for name, norms in self.norms.items():
            scale = max(row[0].scale for row in norms)
            if scale > 0.0:
                rows[name] = [row[0].absolute / scale for row in norms]
        return rows


def mean_over(times: Sequence[float], values: Array) -> Array:
    """Time average of values (t, …) that are linear between the times."""
    step = np.diff(np.asarray(times))
    middle = 0.5 * (values[1:] + values[:-1])
    return np.asarray(np.tensordot(step, middle, axes=1) / step.sum())


def compared_times(scene: Scene, solution: Solution) -> list[float | None]:
    """Output times of a moving solution, which it is compared at; [None] for a static scene."""
    if scene.analysis.kind == "static" or len(solution.times) == 1:
        return [None]
    return [float(time) for time in solution.times]


def error_history(
    field: Motion, reference: Motion, times: Iterable[float | None], rules: Rules, law: Law,
    count: int | None = None,
) -> History:  # fmt: skip
    """Measure all errors of a field at all times, by all rules or the `count` finest."""
    times = list(times)
    norms: dict[str, list[list[ErrorNorm]]] = {name: [] for name in rules.measured()}
    for time in times:
        one, other = field.at(time), reference.at(time)
        for name, row in rules.norms(norms, one, other, law, count).items():
            norms[name].append(row)
    return History(times, norms)
