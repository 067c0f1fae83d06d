"""The error budget: a chain of answers, each of which differs from the one before in one thing.

From the user's problem to the answer of the judged solver: the cut as asked, then as realised;
finite rotations, then linear kinematics (if the answer is linear); a fine mesh, then the solver's
own element size on a conforming mesh; then the solver. What a quantity of interest changes by
along the chain adds up to its total error exactly; norms of the differences bound the norm of
the total (triangle inequality).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from verify.compare.body import AnyBody
from verify.compare.displacement_error import displacement_error
from verify.compare.energy_error import energy_error
from verify.compare.hooke import Hooke
from verify.compare.integration import rules
from verify.compare.locate import Field
from verify.compare.sampled import Sampled

__all__ = ["Answer", "Budget", "Part", "error_budget"]


@dataclass(frozen=True)
class Answer:
    """A link of the chain.

    Parameters
    ----------
    name : str
        What it is, in words.
    change : str
        What changed against the link before; empty for the first.
    field : Field
    quantities : dict of str to (float, float)
        Value and half-width per quantity of interest; those it does not have are missing.
    norms : dict of str to float
        Bound of the absolute norm of its own error, per norm; 0 for what is not a reference.
    """

    name: str
    change: str
    field: Field
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
    """

    source: str
    value: float
    uncertainty: float


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


def error_budget(
    chain: Sequence[Answer], body: AnyBody, size: float, law: Hooke, units: Mapping[str, str]
) -> list[Budget]:
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

    Returns
    -------
    list of Budget
        Displacement (L2), energy norm, then the quantities that every link has.
    """
    sampled = [Sampled(answer.field) for answer in chain]
    family = rules(body, size)

    def l2(one: Field, other: Field, rule: object) -> tuple[float, float]:
        norm = displacement_error(one, other, rule)  # type: ignore[arg-type]
        return norm.absolute, norm.scale

    def energy(one: Field, other: Field, rule: object) -> tuple[float, float]:
        norm = energy_error(one, other, rule, law)  # type: ignore[arg-type]
        return norm.absolute, norm.scale

    budgets = []
    for name, measure in (("displacement_l2", l2), ("energy_norm", energy)):
        scale = measure(sampled[-1], sampled[0], family[0])[1]
        if scale > 0.0:
            budgets.append(_of_norm(name, chain, sampled, measure, family, scale))
    for name, unit in units.items():
        if all(name in answer.quantities for answer in chain):
            budgets.append(_of_quantity(name, unit, chain))
    return budgets


def _of_norm(name, chain, sampled, measure, family, scale) -> Budget:  # type: ignore[no-untyped-def]
    def part(source: str, i: int, j: int) -> Part:
        values = [measure(sampled[j], sampled[i], rule)[0] for rule in family]
        spread = max(abs(value - values[0]) for value in values)
        known = chain[i].norms.get(name, 0.0) + chain[j].norms.get(name, 0.0)
        return Part(source, values[0] / scale, (known + spread) / scale)

    parts = [part(answer.change, i, i + 1) for i, answer in enumerate(chain[1:])]
    total = part("total", 0, len(chain) - 1)
    room = total.uncertainty + sum(p.uncertainty for p in parts)
    closes = bool(total.value <= sum(p.value for p in parts) + room)
    return Budget(name, "1", scale, parts, total, closes)


def _of_quantity(name: str, unit: str, chain: Sequence[Answer]) -> Budget:
    values = [answer.quantities[name] for answer in chain]
    scale = abs(values[0][0]) or 1.0
    parts = [
        Part(answer.change, (b[0] - a[0]) / scale, (a[1] + b[1]) / scale)
        for answer, a, b in zip(chain[1:], values[:-1], values[1:], strict=True)
    ]
    total = Part(
        "total", (values[-1][0] - values[0][0]) / scale, (values[0][1] + values[-1][1]) / scale
    )
    left = sum(p.value for p in parts) - total.value
    closes = bool(abs(left) <= 1e-12 * max(1.0, abs(total.value)))
    notes = [] if values[0][0] else ["the quantity is zero in the user's problem: absolute values"]
    return Budget(name, unit, scale, parts, total, closes, notes)
