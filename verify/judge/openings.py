"""Opening profiles: the jump along every cut, of the solvers and of the reference with its band."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.compare.body import AnyBody
from verify.compare.cut_profile import ProfileLine, profile_lines
from verify.compare.error_norm import displacement_jump
from verify.compare.motion import Motion
from verify.errors import InputError
from verify.judge.richardson import place_uncertainty
from verify.result import OpeningCurve, OpeningProfile

Array = NDArray[np.float64]

_AROUND = 3  # points on either side of one, over which differences of levels are averaged


@dataclass(frozen=True)
class Contestant:
    """A field in the figure.

    Parameters
    ----------
    name : str
        Of the solver, or ``"reference"``.
    level : int or None
        None for an exact solution.
    motion : Motion
    coarser : sequence of Motion
        Levels below it, coarse to fine, if it carries an uncertainty; at least two.
    sizes : sequence of float
        Element sizes of these and of its own, m.
    order : int
        Polynomial order.
    """

    name: str
    level: int | None
    motion: Motion
    coarser: Sequence[Motion] = ()
    sizes: Sequence[float] = ()
    order: int = 1


def opening_profiles(
    body: AnyBody, shown: Sequence[Contestant], times: Mapping[str, float | None]
) -> list[OpeningProfile]:
    """Measure the profiles along a line on every cut.

    Parameters
    ----------
    body : Body, SolidBody or MembraneBody
    shown : sequence of Contestant
        The reference first, if there is one.
    times : mapping of str to (float or None)
        When, s, by why that is shown; None is the only or last time.
    """
    found = []
    for why, time in times.items():
        for line in profile_lines(body):
            curves = [c for one in shown if (c := _curve(body, line, one, time)) is not None]
            found.append(
                OpeningProfile(
                    line.cut, line.where, time, why, line.arc.tolist(),
                    line.rule.points.tolist(), curves,
                )
            )  # fmt: skip
    return found


def largest_opening_time(body: AnyBody, motion: Motion, times: Sequence[float]) -> float:
    """Output time, s, at which the jump along some cut is largest; the first of equal ones."""
    lines = profile_lines(body)
    largest = [
        max(float(np.abs(_parts(body, line, motion, time)).max(initial=0.0)) for line in lines)
        for time in times
    ]
    return times[int(np.argmax(largest))]


def _curve(
    body: AnyBody, line: ProfileLine, one: Contestant, time: float | None
) -> OpeningCurve | None:
    """Take the jump of a field; None where it does not reach that time."""
    try:
        parts = _parts(body, line, one.motion, time)
        band = _band(body, line, one, time, parts)
    except InputError:
        return None
    normal, tangential = parts.tolist()
    bands = band.tolist() if band is not None else [[], []]
    return OpeningCurve(one.name, one.level, normal, tangential, *bands)


def _parts(body: AnyBody, line: ProfileLine, motion: Motion, time: float | None) -> Array:
    """Return normal and tangential jump (2, n), m; in space the second is a length."""
    jump, normals = displacement_jump(motion.at(time), line.rule), line.rule.normals
    normal = np.sum(jump * normals, axis=1)
    if body.dimension == 2:
        tangential = jump[:, 0] * normals[:, 1] - jump[:, 1] * normals[:, 0]
    else:
        tangential = np.linalg.norm(jump - normal[:, None] * normals, axis=1)
    return np.stack([normal, tangential])


def _band(
    body: AnyBody, line: ProfileLine, one: Contestant, time: float | None, parts: Array
) -> Array | None:
    """Half-widths (2, n), m, from the differences of levels around each point."""
    if one.level is None:
        return np.zeros_like(parts)
    if len(one.coarser) < 2:
        return None
    levels = [_parts(body, line, m, time) for m in one.coarser[-2:]] + [parts]
    differences = [_around(levels[1] - levels[0]), _around(levels[2] - levels[1])]
    sizes = list(one.sizes[-3:])

    def width(value: float, first: float, last: float) -> float:
        return place_uncertainty(value, [first, last], sizes, one.order + 1).half_width

    return np.asarray(np.vectorize(width, otypes=[float])(parts, *differences))


def _around(difference: Array) -> Array:
    """Root mean square (2, n) over the points beside each."""
    n = difference.shape[1]
    rows = [slice(max(0, i - _AROUND), i + _AROUND + 1) for i in range(n)]
    return np.sqrt(np.stack([np.mean(difference[:, row] ** 2, axis=1) for row in rows], axis=1))
