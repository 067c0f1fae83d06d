"""The error budget: a chain of answers, each of which differs from the one before in one thing.

From the user's problem to the answer of the judged solver: the cut as asked, then as realised;
finite rotations, then linear kinematics (if the answer is linear); a fine mesh, then the solver's
own element size on a conforming mesh; then the solver; in motion its mass, its time step and its
scheme. What a quantity of interest changes by along the chain adds up to its total error exactly;
norms of the differences, and their means over time, bound the norm of the total (triangle
inequality).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.compare.body import AnyBody
from verify.compare.body_rule import rules
from verify.compare.errors import ErrorNorm, displacement_error, energy_error, mean_over
from verify.compare.hooke import Hooke, Law
from verify.compare.locate import Field
from verify.compare.motion import Motion
from verify.judge.intervals import quotient_half_width

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
        """Return a norm of each pair by each rule (pairs, rules), and the first field's norm.

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


_ROUND_OFF = 1e-10  # relative: a thousand steps leave some 1e-13


@dataclass(frozen=True)
class Answer:
    """A link of the chain.

    Parameters
    ----------
    name : str
        What it is, in words.
    change : str
        What changed against the link before; empty for the first.
    motion : Motion
        Its field, over time.
    quantities : dict of str to (float, float)
        Value and half-width per quantity of interest; those it does not have are missing.
    norms : dict of str to float
        Bound of the absolute norm of its own error, per norm; 0 if it is no reference.
    """

    name: str
    change: str
    motion: Motion
    quantities: Mapping[str, tuple[float, float]]
    norms: Mapping[str, float]


@dataclass(frozen=True)
class Part:
    """The share of one source.

    Parameters
    ----------
    source : str
        What was changed.
    value : float
        Signed change of a quantity of interest, or norm of the change of the field; relative.
    uncertainty : float
        Half-width, relative, from the references on both sides and the integration.
    round_off : bool
        Whether it is certain to be no more than that.
    """

    source: str
    value: float
    uncertainty: float
    round_off: bool = False


@dataclass(frozen=True)
class Budget:
    """The budget of one metric.

    Parameters
    ----------
    metric : str
    unit : str
        ``"1"`` for norms; the relative values of a quantity refer to `scale` in this unit.
    scale : float
        What all parts are divided by: the quantity, or the norm of the field, of the first link.
    parts : list of Part
    total : Part
        Last link against the first, measured by itself.
    closes : bool
        For a quantity: the parts add up to the total, to round-off. For a norm: the total does
        not exceed the sum of the parts by more than the uncertainties.
    notes : list of str
    """

    metric: str
    unit: str
    scale: float
    parts: list[Part]
    total: Part
    closes: bool
    notes: list[str] = field(default_factory=list)

    @property
    def largest(self) -> Part:
        """The part that weighs most."""
        return max(self.parts, key=lambda part: abs(part.value))

    @property
    def is_round_off(self) -> bool:
        """Whether there is nothing to take apart."""
        return all(part.round_off for part in (*self.parts, self.total))


def error_budget(
    chain: Sequence[Answer], body: AnyBody, size: float, law: Hooke, units: Mapping[str, str],
    times: Times = (None,),
) -> list[Budget]:  # fmt: skip
    """Split the difference between the first and the last link of `chain`.

    Parameters
    ----------
    chain : sequence of Answer
        At least two.
    body : Body or SolidBody
        With the cuts as asked.
    size : float
        Element size of the last link, m, which decides the quadrature.
    law : Hooke
        Linear elasticity: the energy norm of a difference of fields.
    units : mapping of str to str
        Unit per quantity of interest that is wanted.
    times : sequence of float or None
        Output times of motions, s; [None] at rest.

    Returns
    -------
    list of Budget
        The norms of `norm_names`, then the quantities that every link has.
    """
    last = len(chain) - 1
    pairs = [*((i + 1, i) for i in range(last)), (last, 0)]
    family = rules(body, size, 3 if len(times) == 1 else 2)
    found = distances([answer.motion for answer in chain], pairs, times, family, law)
    budgets = [_of_norm(name, chain, found) for name in norm_names(times)]
    budgets = [budget for budget in budgets if budget.scale > 0.0]
    for name, unit in units.items():
        if all(name in answer.quantities for answer in chain):
            budgets.append(_of_quantity(name, unit, chain))
    return budgets


def _of_norm(name: str, chain: Sequence[Answer], found: Distances) -> Budget:
    values, scale = found.of(name)
    spread = np.abs(values - values[:, :1]).max(axis=1)
    unit = scale or 1.0

    def part(source: str, row: int, i: int, j: int) -> Part:
        known = chain[i].norms.get(name, 0.0) + chain[j].norms.get(name, 0.0)
        return _part(source, float(values[row, 0]) / unit, float(known + spread[row]) / unit)

    parts = [part(answer.change, i, i, i + 1) for i, answer in enumerate(chain[1:])]
    total = part("total", -1, 0, len(chain) - 1)
    room = total.uncertainty + sum(p.uncertainty for p in parts)
    closes = bool(total.value <= sum(p.value for p in parts) + room)
    return Budget(name, "1", scale, parts, total, closes)


def _of_quantity(name: str, unit: str, chain: Sequence[Answer]) -> Budget:
    values = [answer.quantities[name] for answer in chain]
    whole, half = values[0]
    scale = abs(whole) if abs(whole) > half else 0.0

    def part(source: str, a: tuple[float, float], b: tuple[float, float]) -> Part:
        if not scale:  # absolute values: how small they are is not known
            return Part(source, b[0] - a[0], a[1] + b[1])
        apart = b[0] - a[0]
        width = quotient_half_width(apart, a[1] + b[1], whole, half)
        return _part(source, apart / scale, width)

    parts = [
        part(answer.change, a, b)
        for answer, a, b in zip(chain[1:], values[:-1], values[1:], strict=True)
    ]
    total = part("total", values[0], values[-1])
    left = sum(p.value for p in parts) - total.value
    closes = bool(abs(left) <= 1e-12 * max(1.0, abs(total.value)))
    notes = [] if scale else ["the quantity may be zero in the user's problem: absolute values"]
    return Budget(name, unit, scale or 1.0, parts, total, closes, notes)


def _part(source: str, value: float, uncertainty: float) -> Part:
    return Part(source, value, uncertainty, abs(value) + uncertainty < _ROUND_OFF)
