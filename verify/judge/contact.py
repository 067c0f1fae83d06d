"""Contact of the faces of cuts: errors of the pressure, its extent, its force, and the slip.

A solver states its pressure at points of its realised cut, with the length or area of each. It is
compared there with p = −n·σn of the exact field, or with the pressure of the reference. Errors are
in L2 over the cut, and over the output times of a motion. The oscillation is the error less its
mean over two elements to all sides. How well the reference is known follows from its levels, as of
all other numbers (`verify.judge.convergence`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from verify.compare.cut_rule import CutRule
from verify.compare.errors import CONTACT_ERRORS, displacement_jump
from verify.compare.hooke import Law
from verify.compare.motion import Motion, field_at
from verify.judge.convergence import extrapolate, field_uncertainty
from verify.result import Metric
from verify.solution import ContactPressure, Solution

Array = NDArray[np.float64]
Pressure = Callable[[Array, float], Array]  # at points (n, d) and a time, Pa
_PRESSED = 1e-3  # of the mean pressure (the largest may be at a tip): where more, faces touch
_AROUND = 2.0  # elements over which the oscillation is told from the error
_ORDER_OF_EXTENT = 1.0  # faces touch or not: the end of a zone is known to a facet
_ENDS = 2.0  # elements: so much longer or shorter, or so far off, may a realised cut be
_MOST_SLIP = 0.5  # of an element: a face meets the face that it was cut from


@dataclass(frozen=True)
class ContactTruth:
    """Pressures that are known.

    Parameters
    ----------
    pressures : sequence of Pressure
        Of the levels of a reference, coarse to fine, at least three; or an exact one, alone.
    resultants : sequence of (float, float)
        Of each of them, extent (m, in space m²) and force (N/m, N) at the last output time.
    source : str
        What they are.
    sizes : sequence of float
        Element sizes of the levels, m; none of an exact one.
    order : float
        Of the stress of a level, that can be counted on.
    falls : float
        See `verify.judge.convergence.extrapolate`.
    """

    pressures: Sequence[Pressure]
    resultants: Sequence[tuple[float, float]]
    source: str
    sizes: Sequence[float] = ()
    order: float = 1.0
    falls: float = inf

    def width_of_norm(self, differences: Sequence[float]) -> float:
        """Half-width of the norm of an error, from norms of the differences of levels."""
        if not self.sizes:
            return 0.0
        return field_uncertainty(differences, self.sizes, self.order, self.falls).half_width

    def width_of_value(self, values: Sequence[float], order: float) -> float:
        """Half-width of a number, from its values on the levels."""
        return extrapolate(values, self.sizes, order, self.falls).half_width if self.sizes else 0.0


def exact_contact(exact: Any, law: Law, rule: CutRule, time: float, source: str) -> ContactTruth:
    """Take the contact of an exact field from its stress; its resultants at a time, by a rule."""
    pressure = exact_pressure(exact, law, rule)
    return ContactTruth(
        [pressure], [_resultants(pressure(rule.points, time), rule.weights)], source
    )


def known_contact(
    levels: Sequence[Solution], rule: CutRule | None, source: str, sizes: Sequence[float],
    order: float, falls: float,
) -> ContactTruth | None:  # fmt: skip
    """Take the contact that levels of a reference state, coarse to fine; None without any.

    Their resultants at the last output time are by one rule, for all solvers.
    """
    if rule is None or any(one.contact is None for one in levels):
        return None
    pressures, last = [stated_pressure(one) for one in levels], float(levels[-1].times[-1])
    resultants = [_resultants(one(rule.points, last), rule.weights) for one in pressures]
    return ContactTruth(pressures, resultants, source, sizes, order, falls)


def exact_pressure(exact: Any, law: Law, rule: CutRule) -> Pressure:
    """Return the pressure of an exact field on the faces of cuts, zero in tension."""
    tree = cKDTree(rule.points)

    def at(points: Array, time: float) -> Array:
        nearest = tree.query(points)[1]
        normals = rule.normals[nearest]
        beside = points + rule.positive[nearest] - rule.points[nearest]
        gradient = field_at(exact, time).gradient(points, beside)
        stress = law.at(points).piola(gradient)
        drawn = np.einsum("ni,nij,nj->n", normals, stress, normals)
        return np.maximum(-np.nan_to_num(drawn), 0.0)

    return at


def stated_pressure(solution: Solution) -> Pressure:
    """Interpolate the pressure that a solution states, by inverse distances."""
    contact = solution.contact
    assert contact is not None
    count = min(solution.dimension, len(contact.points))
    tree = cKDTree(contact.points)

    def at(points: Array, time: float) -> Array:
        step = int(np.argmin(np.abs(solution.times - time)))
        away, which = tree.query(points, k=list(range(1, count + 1)))
        shares = 1.0 / np.maximum(away, 1e-12 * max(float(away.max(initial=0.0)), 1e-300))
        found = (shares * contact.pressure[step][which]).sum(axis=1) / shares.sum(axis=1)
        return np.asarray(found)

    return at


def contact_metrics(
    solution: Solution, motion: Motion, rule: CutRule, truth: ContactTruth | None, size: float,
    turns: bool = False,
) -> tuple[list[Metric], dict[str, str]]:  # fmt: skip
    """Measure the contact of faces that a solution states.

    Parameters
    ----------
    solution : Solution
    motion : Motion
        Its field over time.
    rule : CutRule
        On the cuts.
    truth : ContactTruth or None
    size : float
        Of its elements, m.
    turns : bool
        Whether normals turn with the faces.

    Returns
    -------
    metrics : list of Metric
        Relative errors ``contact_pressure`` and ``contact_oscillation``; at the last output time
        ``contact_extent`` (m, in space m²) and ``contact_force`` (N); ``contact_slip`` of faces
        that are together, the largest at any output time, in elements.
    notes : dict of str to str
        Reasons, by the name of each metric that could not be measured.
    """
    contact = solution.contact
    if contact is None or not len(contact.weights):
        return [], {CONTACT_ERRORS[0]: "the solver states no pressure of contact"}
    names = ("contact_extent", "contact_force")
    if defect := _elsewhere(contact, rule, size):
        return [], dict.fromkeys((*CONTACT_ERRORS, *names), defect)
    slip = _slip(solution, motion, rule, turns) / size
    metrics = [Metric("contact_slip", slip, "1")]
    if slip >= _MOST_SLIP:
        why = f"faces slide by {slip:.2g} elements; contact is of less than {_MOST_SLIP:g}"
        return metrics, dict.fromkeys((*CONTACT_ERRORS, *names), why)
    own = _resultants(contact.pressure[-1], contact.weights)
    units = ("m", "N/m") if solution.dimension == 2 else ("m²", "N")
    if truth is None:
        return [*metrics, *map(Metric, names, own, units)], {}
    orders = (min(_ORDER_OF_EXTENT, truth.order), truth.order)
    for name, value, unit, *values, order in zip(
        names, own, units, *truth.resultants, orders, strict=True
    ):
        width = truth.width_of_value(values, order)
        metrics.append(Metric(name, value, unit, values[-1], width, truth.source))
    errors, notes = _errors(solution, contact, truth, size)
    return metrics + errors, notes


def _elsewhere(contact: ContactPressure, rule: CutRule, size: float) -> str:
    """Say if a solver states its pressure not on the cuts, or not on all of them; else nothing.

    An end may be an element off. What is left out would have no error.
    """
    stated, asked = float(contact.weights.sum()), float(rule.weights.sum())
    space = rule.points.shape[1] == 3
    if abs(stated - asked) > _ENDS * size * (asked**0.5 if space else 1.0):
        unit = "m²" if space else "m"
        return f"pressures are stated of {stated:.4g} {unit} of cuts; expected {asked:.4g}"
    away = float(cKDTree(rule.points).query(contact.points)[0].max())
    return f"pressures are stated up to {away:.4g} m off the cuts" if away > _ENDS * size else ""


def _errors(
    solution: Solution, contact: ContactPressure, truth: ContactTruth, size: float
) -> tuple[list[Metric], dict[str, str]]:
    times, weights = solution.times, contact.weights
    spans = np.gradient(times) if len(times) > 1 else np.ones(1)
    known = [np.array([one(contact.points, t) for t in times]) for one in truth.pressures]

    def norm(values: Array) -> float:
        return float(np.sqrt(spans @ (values**2 @ weights)))

    scale, error = norm(known[-1]), contact.pressure - known[-1]
    if scale == 0.0:
        return [], dict.fromkeys(CONTACT_ERRORS, "no face is pressed in the reference")
    width = truth.width_of_norm([norm(fine - coarse) for coarse, fine in pairwise(known)]) / scale
    tree = cKDTree(contact.points)
    around = tree.sparse_distance_matrix(tree, _AROUND * size, output_type="coo_matrix").tocsr()
    around.data[:] = 1.0
    mean = around.dot((weights * error).T).T / around.dot(weights)
    shares = (norm(error), norm(error - mean))
    rows = zip(CONTACT_ERRORS, shares, strict=True)
    return [Metric(n, v / scale, "1", None, width, truth.source) for n, v in rows], {}


def _resultants(pressure: Array, weights: Array) -> tuple[float, float]:
    """Compute the length or area of the faces that are together, and the force between them."""
    return float(weights[_pressed(pressure, weights)].sum()), float(weights @ pressure)


def _pressed(pressure: Array, weights: Array) -> NDArray[np.bool_]:
    return np.asarray(pressure > _PRESSED * (weights @ pressure) / weights.sum())


def _slip(solution: Solution, motion: Motion, rule: CutRule, turns: bool) -> float:
    """Compute the largest displacement along each other of faces while they are together, m."""
    contact, largest = solution.contact, 0.0
    assert contact is not None
    # points of the cut as asked: facets of a curved one lie on one side of it, where no field jumps
    nearest = cKDTree(rule.points).query(contact.points)[1]
    for time, pressure in zip(solution.times, contact.pressure, strict=True):
        if not (pressed := _pressed(pressure, contact.weights)).any():
            continue
        beside = rule.reordered(np.unique(nearest[pressed]))
        jump = displacement_jump(motion.at(float(time)), beside)
        if not turns:  # else all of it: faces that are together have next to no gap
            jump -= np.sum(jump * beside.normals, axis=1)[:, None] * beside.normals
        largest = max(largest, float(np.linalg.norm(jump, axis=1).max()))
    return largest
