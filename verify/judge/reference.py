"""References that carry their own error bar: an exact solution, or conforming levels."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import factorial, inf
from typing import Any, Protocol

import numpy as np

from verify.compare.body import AnyBody, Body
from verify.compare.body_rule import Rule, area_rule, body_rule, slab_angles
from verify.compare.errors import (
    COARSER,
    ERROR_NAMES,
    ERRORS,
    NEAR,
    ErrorNorm,
    History,
    Rules,
    base_of,
    compared_times,
    error_history,
    near_radius,
)
from verify.compare.hooke import Corotated, Law, field_strain_energy
from verify.compare.locate import Field
from verify.compare.motion import ExactMotion, Motion, field_at
from verify.compare.simplices import cells_of
from verify.errors import InputError, UnsupportedSceneError
from verify.judge.contact import ContactTruth, known_contact
from verify.judge.convergence import (
    ROUND_OFF,
    Extrapolation,
    counted_order,
    cut_on_the_way,
    error_fall,
    extrapolate,
    field_uncertainty,
    observed_order,
    place_uncertainty,
)
from verify.judge.intervals import time_to_accuracy
from verify.judge.quantities import Measured, field_quantity, local_difference
from verify.judge.resultants import mean_stress, scale_of
from verify.judge.stress_intensity import exact_intensity
from verify.result import ReferenceRecord
from verify.scene import MeshFile, Scene
from verify.scene.acceptance import (
    DisplacementQuantity,
    FractureQuantity,
    MaximumDisplacementQuantity,
    OpeningQuantity,
    PartQuantity,
    Quantity,
    ReactionQuantity,
    SectionQuantity,
    StressQuantity,
)
from verify.solution import Solution

_CLOSED_FORM = 1e-11  # relative accuracy of an exact solution's own strain energy
_LEAST = 0.25  # order in the energy norm that is counted on at least
OTHER = "conforming"  # solver whose levels give a second estimate of quantities, if it was run

# of the mean and of the largest cell: so fine, so coarse a solution may state itself to be
_FINER, _COARSER = 0.25, 2.0


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
    motion : Motion
        The field, over time.
    source : str
        What it is, in words.
    norms : dict of str to float
        Bound of the absolute norm of its error, per error metric.
    quantities : dict of str to (float, float)
        Value and half-width per quantity of interest that it has.
    record : ReferenceRecord
        What the result says about it.
    contact : ContactTruth, optional
        Pressures that its levels state; an exact field has them in its stress.
    rules : Rules, optional
        At the points of which the motion was asked before, and remembers what it was.
    """

    motion: Motion
    source: str
    norms: dict[str, float]
    quantities: dict[str, tuple[float, float]]
    record: ReferenceRecord
    rules: Rules | None = None
    contact: ContactTruth | None = None


def size_of(solution: Solution) -> float:
    """Element size of a solution, m; from the mean cell volume where it says none."""
    if np.isfinite(solution.size) and solution.size > 0:
        return float(solution.size)
    return _sizes_of_cells(solution)[0]


def compared_size(solution: Solution, body: AnyBody) -> float:
    """Element size that the quadrature of a comparison goes by, m.

    A solution is not believed a size beyond that of its largest cell, or far below that of the
    mean one: all solvers of a level are compared at the same points, as many as the finest needs.
    """
    mean, largest = (min(size, body.size) for size in _sizes_of_cells(solution))
    return float(np.clip(size_of(solution), _FINER * mean, _COARSER * largest))


def _sizes_of_cells(solution: Solution) -> tuple[float, float]:
    """Sizes of the mean and of the largest cell: of the legs of a right simplex of its volume."""
    d = solution.cell_dimension
    volume = cells_of(solution).volume
    mean, largest = float(volume.sum()) / len(volume), float(volume.max())
    return (factorial(d) * mean) ** (1 / d), (factorial(d) * largest) ** (1 / d)


def exact_reference(scene: Scene, exact: ExactField, body: AnyBody, law: Law) -> Reference:
    """Make the reference from an exact solution; its quantities are integrated here."""
    assert scene.exact is not None
    motion = ExactMotion(exact, scene.analysis.duration)
    found = {q.name: _exact_quantity(scene, q, exact, body, law) for q in scene.quantities}
    quantities = {name: pair for name, pair in found.items() if pair is not None}
    source = f"exact: {scene.exact.solution}"
    record = ReferenceRecord(
        kind="exact",
        source=source,
        near=_near_text(body),
        levels=[],
        metrics={
            name: {"values": [value], "uncertainty": width, "order": None, "reason": "exact"}
            for name, (value, width) in quantities.items()
        },
    )
    return Reference(motion, source, dict.fromkeys(ERROR_NAMES, 0.0), quantities, record)


def _exact_quantity(
    scene: Scene, asked: Quantity, exact: ExactField, body: AnyBody, law: Law
) -> tuple[float, float] | None:
    end = scene.analysis.duration
    motion = ExactMotion(exact, end)
    if isinstance(asked, PartQuantity | ReactionQuantity | SectionQuantity):
        return None  # parts, and what supports hold, are known of meshes only
    if isinstance(asked, StressQuantity):
        return mean_stress(motion.at(asked.time), law, asked), 0.0
    if isinstance(asked, FractureQuantity):
        stated = exact_intensity(scene, field_at(exact, asked.time or end), asked)
        return None if stated is None else (stated, 0.0)
    if isinstance(asked, MaximumDisplacementQuantity):
        found = [
            float(
                np.linalg.norm(motion.at(asked.time).displacement(r.points, r.points), axis=1).max()
            )
            for r in _exact_rules(body)
        ]
        return max(found), 3 * abs(found[0] - found[1])  # the maximum lies between points
    if asked.kind != "strain_energy":
        return field_quantity(motion.at(asked.time), body, asked), 0.0
    return _exact_energy(scene, field_at(exact, end), body, law)


def _exact_energy(scene: Scene, exact: ExactField, body: AnyBody, law: Law) -> tuple[float, float]:
    """Strain energy, J, and how well it is known: in closed form, or integrated over the body.

    At finite rotation it is integrated: the closed forms are those of linear elasticity.
    """
    closed_form = getattr(exact, "strain_energy", None)  # a field of the user's own may have none
    if closed_form is not None and not isinstance(law, Corotated):
        try:
            energy = float(closed_form(scene))
            return energy, _CLOSED_FORM * abs(energy)
        except InputError:  # the geometry is a mesh, or a crack reaches the surface in space
            pass
    fine, check = (field_strain_energy(exact, rule, law) for rule in _exact_rules(body))
    return fine, 3 * abs(fine - check) + 1e-14 * abs(fine)


def _exact_rules(body: AnyBody) -> Sequence[Rule]:
    """Two rules for fields that are smooth away from tips and fronts, the finer first.

    Spectral away from the tips; at a tip, halving cells down to 1e-8 of the others. In space
    a front takes many more cells than a tip: down to 1/32 of the others only, good to 1e-4 of
    the energy, and of a lower order, which does not matter there. The other rule halves once less:
    what both miss at a front would not differ.
    """
    if isinstance(body, Body):
        return [
            area_rule(body, body.size / n, angle, 7, 1e-8)
            for n, angle in zip((14, 10), slab_angles(body)[:2], strict=True)
        ]
    if body.cell_dimension == 2:
        order, depth = 5, 1e-6
    else:
        order, depth = 3 if len(body.front) else 5, 1 / 32
    return [
        body_rule(body, body.size / n, seed, order, (1 + seed) * depth)
        for seed, n in enumerate((14, 10))
    ]


def conforming_reference(
    scene: Scene,
    levels: Mapping[int, Solution],
    body: AnyBody,
    law: Law,
    rules: Rules,
    others: Mapping[int, Solution] | None = None,
) -> Reference:
    """Make the reference from conforming solutions of at least three levels.

    Parameters
    ----------
    scene : Scene
    levels : mapping of int to Solution
        The reference solver's solutions by level.
    body : Body or SolidBody
    law : Law
    rules : Rules
        For the quadrature of differences, of the element size of the finest solution that will be
        judged.
    others : mapping of int to Solution, optional
        Solutions of an independent discretisation, for a second estimate of the quantities.

    Raises
    ------
    InputError
        If there are fewer than three levels or their sizes do not fall.
    """
    solutions = [levels[level] for level in sorted(levels)]
    if len(solutions) < 3:
        raise InputError(
            f"the reference has {len(solutions)} solved levels; its uncertainty needs at least 3: "
            f"{_coarser(scene, solutions)}"
        )
    sizes = [size_of(solution) for solution in solutions]
    measured = [Measured(solution, body, law, scene) for solution in solutions]
    order = counted_order(scene, solutions[-1])
    falls = error_fall(scene, solutions, sizes, body)
    times = compared_times(scene, solutions[-1])
    motions = [one.motion.afresh() for one in measured]  # the middle one is asked twice
    first = COARSER[:1]  # the rule by which solutions are measured first
    steps = [
        error_history(one, other, times, rules, law, first) for one, other in pairwise(motions)
    ]
    norms, entries = _field_norms([step.reported() for step in steps], sizes, order, falls)
    # functionals of a Galerkin solution converge with twice the order of its field
    doubled = 2 * (entries["energy_norm"]["order"] or 0.0)
    second = [Measured(s, body, law, scene) for _, s in sorted((others or {}).items())]
    found, missing = _known_quantities(scene, measured, steps, sizes, doubled, falls)
    metrics = {
        asked.name: _entry(*known) | _second_opinion(scene, asked, second, known[1])
        for asked in scene.quantities
        if (known := found.get(asked.name))
    } | entries
    quantities = {name: (known.value, known.half_width) for name, (_, known) in found.items()}
    source = f"conforming P{solutions[-1].order}, {len(solutions)} levels, GCI"
    record = ReferenceRecord(
        kind="conforming",
        source=source,
        near=_near_text(body),
        levels=[
            {"level": level, "size": h, "unknowns": int(levels[level].unknowns)}
            for level, h in zip(sorted(levels), sizes, strict=True)
        ],
        time_to_accuracy=time_to_accuracy(levels, metrics),
        metrics=metrics,
        missing=missing or None,
    )
    contact = known_contact(solutions, rules.on_cuts(), source, sizes, order, falls)
    return Reference(motions[-1], source, norms, quantities, record, rules, contact)


def _known_quantities(
    scene: Scene, measured: Sequence[Measured], steps: Sequence[History], sizes: list[float],
    doubled: float, falls: float,
) -> tuple[dict[str, tuple[list[float | None], Extrapolation]], dict[str, str]]:  # fmt: skip
    """Values by level and what they are worth, by quantity; and why others are not known."""
    found, missing = {}, {}
    for asked in scene.quantities:
        values, why = _on_finest(asked, measured)
        if len(values) < 3:
            missing[asked.name] = why
            continue
        coarse = len(measured) - len(values)  # levels that do not have it
        at_tip = _order_at_the_tip(scene, asked, steps, sizes)
        functional = doubled if at_tip is None else at_tip
        known = known_quantity(asked, measured[coarse:], values, sizes[coarse:], functional, falls)
        found[asked.name] = [*[None] * coarse, *values], known
    return found, missing


def _coarser(scene: Scene, solutions: Sequence[Solution]) -> str:
    """Say with which lines in its case a reference of too few solved levels has three."""
    if isinstance(scene.geometry, MeshFile):
        if scene.reference.degree == 2:
            return "add to the case the lines '[reference]' and 'degree = 1'"
        return "give a mesh of fewer cells, or more time (--timeout) and memory (--memory)"
    if not solutions:
        return "give [reference] of the case a larger size, or more time (--timeout)"
    size = size_of(solutions[0]) * 2 ** (3 - len(solutions))
    return f"add to the case the lines '[reference]' and 'size = {size:.3g}'"


def known_quantity(
    asked: Quantity,
    measured: Sequence[Measured],
    values: list[float],
    sizes: list[float],
    functional: float = inf,
    falls: float = inf,
) -> Extrapolation:
    """Judge a quantity from its levels; a value at a place by what lies around it.

    Parameters
    ----------
    asked : Quantity
    measured : sequence of Measured
        Levels, coarse to fine.
    values, sizes : list of float
        The quantity on each of them, and their element sizes, m.
    functional : float
        Order that the field lets a functional of it count on; 0 if it has none.
    falls : float
        See `verify.judge.convergence.extrapolate`.
    """
    order = counted_order(measured[-1].scene, measured[-1].solution)
    nothing = _round_off(asked, measured[-1])
    if max(map(abs, values)) <= nothing:
        return Extrapolation(0.0, 0.0, nothing, None, "zero but for round-off")
    if isinstance(asked, DisplacementQuantity | OpeningQuantity):
        around = [local_difference(asked, *pair) for pair in pairwise(measured)]
        return place_uncertainty(values[-1], around, sizes, order + 1, falls)
    if isinstance(asked, MaximumDisplacementQuantity):
        return extrapolate(values, sizes, order + 1, falls)
    return extrapolate(values, sizes, min(max(functional, 2 * _LEAST), 2 * order), falls)


def _order_at_the_tip(
    scene: Scene, asked: Quantity, steps: Sequence[History], sizes: Sequence[float]
) -> float | None:
    """Order of the field near tips at the time of a factor in motion; None of anything else.

    Fronts of waves elsewhere, which lower the order of the whole field to ½ or less, have nothing
    to do with a factor before they pass its tip. The difference of levels near the tip has that
    of their factors in it: its order counts once, not twice as that of a Galerkin solution.
    """
    if not isinstance(asked, FractureQuantity) or scene.analysis.kind == "static":
        return None
    if cut_on_the_way(scene) or "energy_norm_near" not in steps[-1].norms:
        return None
    times = np.array(steps[-1].times, dtype=float)
    at = int(np.abs(times - (asked.time or times[-1])).argmin())
    first, last = (step.norms["energy_norm_near"][at][0].absolute for step in steps[-2:])
    return observed_order(first, last, sizes[-3:]) or 0.0


def _round_off(asked: Quantity, measured: Measured) -> float:
    """Bound what round-off of the displacement makes of a quantity that is zero.

    Displacements are known to 1e-13 of the largest, as their differences; strains to 1e-10 of that
    over the size of the body (`verify.compare.errors`); nothing is claimed of other quantities.
    """
    u, points = measured.motion.nodal(getattr(asked, "time", None)), measured.solution.points
    moved = float(np.abs(u).max(initial=0.0))
    if isinstance(asked, DisplacementQuantity | OpeningQuantity):
        return 1e-13 * moved
    if isinstance(asked, ReactionQuantity | SectionQuantity | StressQuantity):
        return scale_of(measured.weak_form, asked)
    if asked.kind == "strain_energy":
        strain = 1e-10 * moved / float(np.ptp(points, axis=0).max())
        stiffness = np.max(measured.law.lame) + 2 * np.max(measured.law.shear)
        return float(0.5 * stiffness * strain**2 * measured.body.measure)
    return 0.0


def _on_finest(asked: Quantity, measured: Sequence[Measured]) -> tuple[list[float], str]:
    """Values on the finest levels, as far as they have one, and why the next does not."""
    values: list[float] = []
    for one in reversed(measured):
        try:
            values.insert(0, one.quantity(asked))
        except UnsupportedSceneError as problem:
            return values, str(problem)
    return values, ""


def _field_norms(
    steps: Sequence[dict[str, list[ErrorNorm]]],
    sizes: Sequence[float],
    order: float,
    falls: float,
) -> tuple[dict[str, float], dict[str, Any]]:
    """Bounds of the error norms of the finest level, and what the record says of each.

    From the differences of successive levels.
    """
    norms, entries = {}, {}
    for name in steps[-1]:
        counted = order + ERRORS[base_of(name)].beyond
        absolute = [step[name][0].absolute for step in steps]
        found = field_uncertainty(absolute, sizes, counted, falls)
        norms[name] = found.half_width
        scale = steps[-1][name][0].scale or 1.0
        entries[name] = _entry([value / scale for value in absolute], found, scale)
        # what the levels before said of the error of the last but one, against what it was
        said = absolute[-2] / (min((sizes[-3] / sizes[-2]) ** counted, falls) - 1)
        entries[name] |= {
            "second": {
                "source": "difference of the last two levels, over the estimate without the last",
                "value": absolute[-1] / scale,
                "uncertainty": said / scale,
            },
            "disagreement": absolute[-1] / said if said > ROUND_OFF * scale else None,
        }
    return norms, entries


def _second_opinion(
    scene: Scene, asked: Quantity, others: Sequence[Measured], known: Extrapolation
) -> dict[str, Any]:
    """Richardson's value from other levels, and its distance over the sum of the half-widths.

    It is shown and does not move the reference: those levels are judged by it.
    """
    if len(others) < 3:
        return {}
    try:
        values = [one.quantity(asked) for one in others]
        sizes, order = [size_of(one.solution) for one in others], others[-1].solution.order
        solutions = [one.solution for one in others]
        falls = error_fall(scene, solutions, sizes, others[0].body)
        found = known_quantity(asked, others, values, sizes, falls=falls)
    except (InputError, UnsupportedSceneError):
        return {}
    apart = abs(found.value - known.value)
    width = found.half_width + known.half_width
    source = f"{OTHER} P{order}, {len(others)} levels, GCI"
    return {
        "second": {"source": source, "value": found.value, "uncertainty": found.half_width},
        "disagreement": apart / width if width > 0.0 else None,
    }


def _near_text(body: AnyBody) -> dict[str, Any]:
    """State what near a tip means."""
    radius = near_radius(body)
    return {"radius": radius, "reason": f"{NEAR:g} of the shortest cut with a tip, in space of the "
            "root of the area of the cuts"} if radius else {}  # fmt: skip


def _entry(
    values: Sequence[float | None], known: Extrapolation, scale: float = 1.0
) -> dict[str, Any]:
    order = known.order if known.order is not None and np.isfinite(known.order) else None
    return {
        "values": values,
        "extrapolated": known.extrapolated / scale,
        "uncertainty": known.half_width / scale,
        "order": order,
        "reason": known.reason,
    }
