"""References that carry their own error bar: an exact solution, or conforming levels."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Protocol

import numpy as np

from verify.compare.body import Body
from verify.compare.cut_line import CutRule
from verify.compare.displacement_error import displacement_error
from verify.compare.energy_error import energy_error
from verify.compare.error_norm import ErrorNorm
from verify.compare.hooke import Hooke
from verify.compare.integration import cut_rules, rules
from verify.compare.jump_error import jump_error
from verify.compare.locate import Field
from verify.compare.opening import opening
from verify.compare.point_displacement import point_displacement
from verify.compare.slabs import Rule, area_rule, slab_angles
from verify.compare.strain_energy import field_strain_energy
from verify.errors import InputError
from verify.scene import Scene
from verify.scene.acceptance import DisplacementQuantity, OpeningQuantity, Quantity
from verify.solution import Solution
from verify.study.quantities import Measured
from verify.study.richardson import Extrapolation, extrapolate, field_uncertainty

__all__ = ["ERRORS", "Reference", "conforming_reference", "exact_reference", "size_of"]

Measure = Callable[[Field, Field, Any, Hooke], ErrorNorm]

# error metrics: how they are measured, along the cuts or over the body, and the order in
# element size that P_p can be counted on for, beyond p
ERRORS: dict[str, tuple[Measure, type, int]] = {
    "displacement_l2": (lambda f, r, rule, law: displacement_error(f, r, rule), Rule, 1),
    "energy_norm": (energy_error, Rule, 0),
    "jump_l2": (lambda f, r, rule, law: jump_error(f, r, rule), CutRule, 1),
}


class ExactField(Field, Protocol):
    """What an exact solution must offer."""

    @property
    def singular_points(self) -> Any:
        """Points (k, d) near which derivatives are unbounded."""
        ...


@dataclass
class Reference:
    """What results are compared with, and how well it is known.

    Parameters
    ----------
    field : Field
        The field.
    source : str
        What it is, in words.
    norms : dict of str to float
        Bound of the absolute norm of its error, per error metric.
    quantities : dict of str to (float, float)
        Value and half-width per quantity of interest.
    record : dict
        What the result says about it (JSON).
    """

    field: Field
    source: str
    norms: dict[str, float]
    quantities: dict[str, tuple[float, float]]
    record: dict[str, Any]


def size_of(solution: Solution) -> float:
    """Element size of a solution, m; from the mean cell volume where it says none."""
    if np.isfinite(solution.size) and solution.size > 0:
        return float(solution.size)
    spans = np.ptp(solution.points, axis=0)
    d = solution.dimension
    return float((np.prod(spans) * (2 if d == 2 else 6) / len(solution.cells)) ** (1 / d))


def exact_reference(scene: Scene, exact: ExactField, body: Body, law: Hooke) -> Reference:
    """Make the reference from an exact solution; its quantities are integrated here."""
    assert scene.exact is not None
    quantities = {q.name: _exact_quantity(q, exact, body, law) for q in scene.quantities}
    source = f"exact: {scene.exact.solution}"
    record = {
        "kind": "exact",
        "source": source,
        "levels": [],
        "metrics": {
            name: {"values": [value], "uncertainty": width, "order": None, "reason": "exact"}
            for name, (value, width) in quantities.items()
        },
    }
    return Reference(exact, source, dict.fromkeys(ERRORS, 0.0), quantities, record)


def _exact_quantity(
    asked: Quantity, exact: ExactField, body: Body, law: Hooke
) -> tuple[float, float]:
    if isinstance(asked, DisplacementQuantity):
        return point_displacement(exact, asked.point, asked.component), 0.0
    if isinstance(asked, OpeningQuantity):
        return opening(exact, body, asked.cut, asked.at, asked.component), 0.0
    # spectral away from the tips; at a tip, halving cells down to 1e-8 of the others
    fine, check = (
        field_strain_energy(exact, area_rule(body, body.size / n, angle, 7, 1e-8), law)
        for n, angle in zip((14, 10), slab_angles(body)[:2], strict=True)
    )
    return fine, abs(fine - check) + 1e-14 * abs(fine)


def conforming_reference(
    scene: Scene, levels: Mapping[int, Solution], body: Body, law: Hooke, size: float
) -> Reference:
    """Make the reference from conforming solutions of at least three levels.

    Parameters
    ----------
    scene : Scene
    levels : mapping of int to Solution
        The reference solver's solutions by level.
    body : Body
    law : Hooke
    size : float
        Element size for the quadrature of differences, m: that of the finest solution that
        will be judged.

    Raises
    ------
    InputError
        If there are fewer than three levels or their sizes do not fall.
    """
    solutions = [levels[level] for level in sorted(levels)]
    if len(solutions) < 3:
        raise InputError(
            f"the reference has {len(solutions)} solved levels; its uncertainty needs at least 3"
        )
    sizes = [size_of(solution) for solution in solutions]
    measured = [Measured(solution, body, law) for solution in solutions]
    order = solutions[-1].order
    known: dict[str, Extrapolation] = {}
    record_metrics: dict[str, Any] = {}
    for asked in scene.quantities:
        values = [one.quantity(asked) for one in measured]
        # energies converge with twice the order (Galerkin); for the others one more is sane
        best = 2 * order if asked.kind == "strain_energy" else order + 1
        known[asked.name] = extrapolate(values, sizes, order, best)
        record_metrics[asked.name] = _entry(values, known[asked.name])
    norms = {}
    families: dict[type, Any] = {Rule: rules(body, size)[0], CutRule: cut_rules(body, size)[0]}
    for name, (measure, kind, extra) in ERRORS.items():
        if kind is CutRule and not body.parts:
            continue
        steps = [
            measure(one.field, other.field, families[kind], law)
            for one, other in pairwise(measured)
        ]
        found = field_uncertainty([step.absolute for step in steps], sizes, order + extra)
        norms[name] = found.half_width
        scale = steps[-1].scale or 1.0
        record_metrics[name] = _entry([step.absolute / scale for step in steps], found, scale)
    source = f"conforming P{order}, {len(solutions)} levels, GCI"
    record = {
        "kind": "conforming",
        "source": source,
        "levels": [
            {"level": level, "size": h, "unknowns": int(levels[level].unknowns)}
            for level, h in zip(sorted(levels), sizes, strict=True)
        ],
        "metrics": record_metrics,
    }
    quantities = {q.name: (known[q.name].value, known[q.name].half_width) for q in scene.quantities}
    return Reference(measured[-1].field, source, norms, quantities, record)


def _entry(values: list[float], known: Extrapolation, scale: float = 1.0) -> dict[str, Any]:
    order = known.order if known.order is not None and np.isfinite(known.order) else None
    return {
        "values": values,
        "extrapolated": known.extrapolated / scale,
        "uncertainty": known.half_width / scale,
        "order": order,
        "reason": known.reason,
    }
