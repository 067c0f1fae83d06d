"""Errors of a field: in the body, near tips, far from them, on cuts, and over time.

Finite element fields have kinks along edges that the neutral quadrature does not know. Its error is
estimated by two coarser rules in other directions: it is taken to be as large as the largest
difference among them, although the finest rule is the one that counts. For pictures there is the
error of a solution at its own nodes as well.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from math import inf
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from verify.compare.body import AnyBody, Body, body_of
from verify.compare.body_rule import Rule, rule_of
from verify.compare.cut_deviation import continued_where
from verify.compare.cut_rule import CutRule, cut_rule_of, surface_rule
from verify.compare.hooke import Law
from verify.compare.locate import Field, SolutionField, value_squares
from verify.compare.motion import ExactMotion, Motion
from verify.compare.realised import cut_deviation, field_of
from verify.compare.simplex_bodies import MembraneBody
from verify.compare.simplices import cells_of
from verify.errors import InputError
from verify.files import whole_file
from verify.result import CutRecord
from verify.scene import Scene
from verify.solution import INTO_CELL, Solution

Array = NDArray[np.float64]


# Of what cancels (a gradient, a displacement over the size of the body, a displacement on both
# sides of a cut) below which a strain or a jump is none: round-off of 1e-16, times the 1e6 that a
# solve, and elements of a thousandth of the body, may amplify it by. Nothing is divided by it.
_NOTHING = 1e-10
_LOOKED_AT = 200  # points at which the displacement of a body is looked at


@dataclass(frozen=True)
class ErrorNorm:
    """An error norm, and the same norm of the reference.

    Parameters
    ----------
    absolute : float
        Norm of the difference.
    scale : float
        Norm of the reference.
    """

    absolute: float
    scale: float

    @property
    def relative(self) -> float:
        """Relative error; infinite where something differs from a reference that is zero."""
        if self.absolute == 0.0:
            return 0.0
        return self.absolute / self.scale if self.scale > 0.0 else inf


@dataclass(frozen=True)
class Squares:
    """Integrands of the squares of both norms at the points of a rule.

    Near a tip and far from it the integrands are the same, with other weights.

    Parameters
    ----------
    difference, expected : (n,) arrays
        Of the difference and of the reference.
    """

    difference: Array
    expected: Array

    def norm(self, weights: Array, whole: Array | None = None) -> ErrorNorm:
        """Integrate with the weights (n,) of the points, the scale with the weights `whole`."""
        of_scale = weights if whole is None else whole
        return ErrorNorm(
            float(np.sqrt(weights @ self.difference)), float(np.sqrt(of_scale @ self.expected))
        )

    def above(self, share: float, whole: float, weights: Array) -> "Squares":
        """Set round-off to zero: the reference, and then a difference as small.

        A norm with the weights (n,) is round-off if it is at most a share of the root of `whole`.
        """
        bound = share**2 * whole
        if weights @ self.expected > bound:
            return self
        nothing = np.zeros_like(self.expected)
        small = weights @ self.difference <= bound
        return Squares(nothing if small else self.difference, nothing)

    def largest(self) -> ErrorNorm:
        """Compute largest values at the points.

        The points lie close to everything but do not hit the maximum: the difference between
        rules, taken as the integration error, says how much that matters.
        """
        return ErrorNorm(
            *(float(s.max(initial=0.0)) ** 0.5 for s in (self.difference, self.expected))
        )


def displacement_error(field: Field, reference: Field, rule: Rule) -> ErrorNorm:
    """Compute ‖u − u_ref‖ and ‖u_ref‖ in L2 of the body; units m·m (2D), m·m^1.5 (3D)."""
    return displacement_squares(field, reference, rule).norm(rule.weights)


def energy_error(field: Field, reference: Field, rule: Rule, law: Law) -> ErrorNorm:
    """Square roots of ∫(σ−σ_ref):(ε−ε_ref) and ∫σ_ref:ε_ref over the body, in √J.

    With the corotated energy: of twice its `error_density`, and twice the reference's energy.
    A reference that moves rigidly but for round-off has the norm 0, and errors as small are none.
    """
    return energy_squares(field, reference, rule, law).norm(rule.weights)


def jump_error(field: Field, reference: Field, rule: CutRule) -> ErrorNorm:
    """Compute ‖[u] − [u_ref]‖ and ‖[u_ref]‖ in L2 of the cuts as asked."""
    return jump_squares(field, reference, rule).norm(rule.weights)


def displacement_squares(
    field: Field, reference: Field, rule: Rule, law: Law | None = None
) -> Squares:
    """Compute |u − u_ref|² and |u_ref|² at the points of a rule, m²."""
    expected = reference.displacement(rule.points, rule.points)
    return _squares(field.displacement(rule.points, rule.points), expected)


def energy_squares(field: Field, reference: Field, rule: Rule, law: Law) -> Squares:
    """Compute integrands of the squares of `energy_error` at the points of a rule, J/m^d."""
    law = law.at(rule.points)
    difference, energy, entries = law.compared(rule.gradient(field), rule.gradient(reference))
    # a solution's field has both at once, a formula was asked for these before
    some = reference.displacement(rule.points, rule.points)[:: 1 + len(rule.points) // _LOOKED_AT]
    slope = np.abs(some).max(initial=0.0) / rule.extent if len(some) else 0.0
    cancels = 2 * law.shear * (entries + slope**2)
    found = Squares(2 * difference, 2 * energy)
    return found.above(_NOTHING, float(rule.weights @ cancels), rule.weights)


def jump_squares(field: Field, reference: Field, rule: CutRule, law: Law | None = None) -> Squares:
    """Compute |[u] − [u_ref]|² and |[u_ref]|² at the points of a rule of the cuts as asked, m²."""
    found, expected = displacement_jump(field, rule), displacement_jump(reference, rule)
    return _of_jumps(found, expected, reference, rule)


def opening_squares(
    field: Field, reference: Field, rule: CutRule, law: Law | None = None
) -> Squares:
    """Compute |[u_n] − [u_ref,n]|² and |[u_ref,n]|² of jump along the normal of the cuts, m²."""
    found, expected = (
        np.einsum("ni,ni->n", displacement_jump(one, rule), rule.normals)[:, None]
        for one in (field, reference)
    )
    return _of_jumps(found, expected, reference, rule)


def displacement_jump(field: Field, rule: CutRule) -> Array:
    """Subtract the displacement of the negative side from the positive side's, (n, d), m."""
    above = field.displacement(rule.points, rule.positive)
    return above - field.displacement(rule.points, rule.negative)


def _of_jumps(found: Array, expected: Array, reference: Field, rule: CutRule) -> Squares:
    beside = reference.displacement(rule.points, rule.positive)
    cancels = rule.weights @ np.einsum("ni,ni->n", beside, beside)
    return _squares(found, expected).above(_NOTHING, cancels, rule.weights)


def _squares(found: Array, expected: Array) -> Squares:
    return Squares(*value_squares(found, expected))


# What the largest difference of two or three rules is multiplied with. In space the rules are
# coarser, and their errors have a common part, which falls at least like the spacing: of three it
# is at most 1 / (1.73 − 1) of the largest difference, of the two coarser 1.31 / (1.73 − 1.31). In
# the plane it falls at least like the square: 1.31² / (1.73² − 1.31²); the rest is random, and two
# rules are a smaller sample of it.
_SAFETY = {2: (0.0, 2.0, 1.0), 3: (0.0, 3.2, 1.5)}


@dataclass(frozen=True)
class MeasuredNorm:
    """An error norm by the finest rule, and the integration error of its relative value."""

    norm: ErrorNorm
    integration_error: float


def integrate_norm[R: (Rule, CutRule)](
    measure: Callable[[R], ErrorNorm], family: Sequence[R]
) -> MeasuredNorm:
    """Apply `measure` with each rule of a family."""
    return spread_of([measure(rule) for rule in family], family[0].points.shape[1])


def spread_of(norms: Sequence[ErrorNorm], dimension: int) -> MeasuredNorm:
    """Take the norm by the finest rule, with the largest difference of the others from it."""
    values = [norm.relative for norm in norms]
    spread = max(abs(value - values[0]) for value in values) if values[0] < float("inf") else 0.0
    return MeasuredNorm(norms[0], _SAFETY[dimension][len(norms) - 1] * spread)


# Radius called near a tip, over the length of the cuts, in space over the root of their area.
NEAR = 0.1


def near_radius(body: AnyBody) -> float:
    """Compute the distance from a tip or front that is called near, m; 0 if there is none.

    A tenth of the length of the shortest cut inside the body that has a tip; in a solid of the
    root of the area of the cuts inside the body.
    """
    if isinstance(body, Body):
        if not len(body.tips):
            return 0.0
        lengths = dict.fromkeys(body.cuts, 0.0)
        tipped = set()
        for part in body.parts:
            lengths[part.cut] += (part.end - part.start) * part.piece.length
            ends = part.piece.point(np.array([part.start, part.end]))
            if near_tip(body, ends, 1e-10 * body.size).any():
                tipped.add(part.cut)
        return NEAR * min(lengths[cut] for cut in tipped)
    if isinstance(body, MembraneBody):
        return NEAR * min(_lengths_with_tip(body), default=0.0)
    if not len(body.front):
        return 0.0
    area = float(surface_rule(body, body.size / 20, depth=1.0).weights.sum())
    return NEAR * area**0.5


def near_tip(body: AnyBody, points: NDArray[np.float64], radius: float) -> NDArray[np.bool_]:
    """Tell whether points (n, d) are nearer to a tip or front than `radius` m."""
    return np.asarray(body.tip_distance(points, radius) < radius)


def _lengths_with_tip(body: MembraneBody) -> list[float]:
    """Compute lengths of the cuts of a membrane that end inside it, m."""
    return [
        float(lines.lengths.sum())
        for lines in body.lines.values()
        if near_tip(body, lines.ends.reshape(-1, 3), 1e-9 * body.size).any()
    ]


Measure = Callable[[Field, Field, Any, Law], Squares]
Where = Literal["body", "near", "far", "cut"]


@dataclass(frozen=True)
class ErrorMetric:
    """An error metric.

    Parameters
    ----------
    measure : callable
        Squares of the difference of two fields, and of the second, at the points of a rule.
    where : {"body", "near", "far", "cut"}
        Over the body, over its points near to tips or far from them, or along the cuts.
    beyond : int
        P_p can be counted on to converge with order p + `beyond`.
    largest : bool
        Whether it is the largest at any point, not the norm in L2.
    """

    measure: Measure
    where: Where
    beyond: int
    largest: bool = False

    @property
    def place(self) -> str:
        """Whose rule it is measured by, "body" or "cut"."""
        return "cut" if self.where == "cut" else "body"


ERRORS: dict[str, ErrorMetric] = {
    "displacement_l2": ErrorMetric(displacement_squares, "body", 1),
    "energy_norm": ErrorMetric(energy_squares, "body", 0),
    "jump_l2": ErrorMetric(jump_squares, "cut", 1),
    "displacement_max": ErrorMetric(displacement_squares, "body", 1, largest=True),
    "opening_l2": ErrorMetric(opening_squares, "cut", 1),
    "opening_max": ErrorMetric(opening_squares, "cut", 1, largest=True),
    "displacement_l2_near": ErrorMetric(displacement_squares, "near", 1),
    "displacement_l2_far": ErrorMetric(displacement_squares, "far", 1),
    "energy_norm_near": ErrorMetric(energy_squares, "near", 0),
    "energy_norm_far": ErrorMetric(energy_squares, "far", 0),
}

# in dynamics these are also reported as their maximum and mean over time
OVER_TIME = ("displacement_l2", "energy_norm", "jump_l2")


# Places in the family of rules: the first measurement, and the one where that is too coarse.
COARSER, FINEST = (1, 2), (0,)


class Rules:
    """The rules of a body for one element size: families of three, the finest first.

    Each is made when it is first asked for.

    Parameters
    ----------
    body : Body or SolidBody
    size : float
        Element size, m.
    """

    def __init__(self, body: AnyBody, size: float) -> None:
        self._body, self._size, self.radius = body, size, near_radius(body)
        self._made: dict[tuple[str, int], Any] = {}
        self._has_cuts = body.has_cuts and bool(len(self.one("cut", 0).weights))

    def measured(self) -> list[str]:
        """List the names of the errors that mean something on this body."""
        there = {"body": True, "near": self.radius, "far": self.radius, "cut": self._has_cuts}
        return [name for name, metric in ERRORS.items() if there[metric.where]]

    def one(self, place: str, k: int) -> Any:
        """Make the rule of the body, or on its cuts, at a place in its family: the finest is 0."""
        if (place, k) not in self._made:
            make = cut_rule_of if place == "cut" else rule_of
            self._made[place, k] = make(self._body, self._size, k)
        return self._made[place, k]

    def on_cuts(self) -> Any:
        """Make the finest rule on the cuts; None without any."""
        return self.one("cut", 0) if self._has_cuts else None

    def _weights(self, where: Where, rule: Any) -> Array:
        """Return weights (n,) of the points of a rule, 0 outside of the region."""
        if where in ("body", "cut"):
            return np.asarray(rule.weights)
        if ("near", id(rule)) not in self._made:
            near = near_tip(self._body, rule.points, self.radius)
            self._made["near", id(rule)] = np.where(near, rule.weights, 0.0)
            self._made["far", id(rule)] = np.where(near, 0.0, rule.weights)
        return np.asarray(self._made[where, id(rule)])

    def norms(
        self, names: Iterable[str], field: Field, reference: Field, law: Law,
        which: Sequence[int] = (0, 1, 2),
    ) -> dict[str, list[ErrorNorm]]:  # fmt: skip
        """Measure error norms by name and by rule, of `which` of the family, in that order.

        Errors near a tip and far from it are relative to the norm of the reference over the whole
        body: their squares add up to the square of the whole error. All three have the same
        integrands, which are evaluated once. It goes rule by rule: an exact solution keeps what it
        found at the points that it was asked last.
        """
        found: dict[str, list[ErrorNorm]] = {name: [] for name in names}
        measures = dict.fromkeys((ERRORS[n].measure, ERRORS[n].place) for n in found)
        for k, (measure, place) in product(which, measures):
            rule = self.one(place, k)
            squares = measure(field, reference, rule, law)
            for name in found:
                if (metric := ERRORS[name]).measure is measure:
                    found[name].append(
                        squares.largest() if metric.largest
                        else squares.norm(self._weights(metric.where, rule), rule.weights)
                    )  # fmt: skip
        return found


CONTACT_ERRORS = ("contact_pressure", "contact_oscillation")  # see `verify.judge.contact`
ERROR_NAMES = (
    *ERRORS,
    *(f"{name}_{how}" for name in OVER_TIME for how in ("max", "mean")),
    *CONTACT_ERRORS,
)


def base_of(name: str) -> str:
    """Return the error behind a name of `ERROR_NAMES`: without maximum or mean over time."""
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

    def after(self, finer: "History") -> "History":
        """Return both, with the measurements by finer rules first where there are any."""
        rows = {
            name: [[*first, *row] for first, row in zip(finer.norms[name], own, strict=True)]
            if name in finer.norms
            else own
            for name, own in self.norms.items()
        }
        return History(self.times, rows)

    def reported(self) -> dict[str, list[ErrorNorm]]:
        """Collect error norms by name and rule.

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
        """Return relative errors over time by the finest rule, with the times; empty if static."""
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
    return np.asarray(np.trapezoid(values, times, axis=0) / (times[-1] - times[0]))


def compared_times(scene: Scene, solution: Solution) -> list[float | None]:
    """Return the output times to compare a moving solution at; [None] for a static scene."""
    if scene.analysis.kind == "static" or len(solution.times) == 1:
        return [None]
    return [float(time) for time in solution.times]


def error_history(
    field: Motion, reference: Motion, times: Iterable[float | None], rules: Rules, law: Law,
    which: Sequence[int] = (0, 1, 2), names: Iterable[str] | None = None,
) -> History:  # fmt: skip
    """Measure all errors of a field, or the ones of `names`, at all times, by some rules."""
    times = list(times)
    asked = rules.measured() if names is None else names
    norms: dict[str, list[list[ErrorNorm]]] = {name: [] for name in asked}
    for time in times:
        one, other = field.at(time), reference.at(time)
        for name, row in rules.norms(norms, one, other, law, which).items():
            norms[name].append(row)
    return History(times, norms)


Truth = Callable[[float], Field]  # the reference or exact field at an output time, s

_SAME_TIME = 1e-9  # of the last output time


def truth_of(
    scene: Scene, references: Mapping[int, Solution], judged: Sequence[Solution], exact: Any
) -> Truth | None:
    """Return the field that a scene is judged by, over time; None without one.

    Parameters
    ----------
    scene : Scene
    references : mapping of int to Solution
        Solutions of the reference by level; the finest counts where no exact one is asked.
    judged : sequence of Solution
        Whose cuts may deviate from the cuts as asked.
    exact : object with ``displacement`` and ``gradient``, or None
    """
    if scene.judged_by_exact:
        return ExactMotion(exact).at
    if not references:
        return None
    body, reference = body_of(scene), references[max(references)]
    deviation = max((cut_deviation(own, body) for own in judged), default=0.0)
    field = field_of(reference, body, deviation=deviation)

    def at(time: float) -> Field:
        step = int(np.argmin(np.abs(reference.times - time)))
        if abs(reference.times[step] - time) > _SAME_TIME * reference.times[-1]:
            raise InputError(f"the reference has no output at {time:.6g} s")
        return field.with_nodal(reference.displacement[step])

    return at


def nodal_differences(
    solution: Solution, truth: Truth, body: AnyBody | None = None, steps: Sequence[int] = (-1,),
    cut: CutRecord | None = None,
) -> Array:  # fmt: skip
    """Subtract the true displacement from a solution's, at its nodes, m.

    Both fields are taken a hundredth of the way from the node to the centre of its largest cell. So
    a node on the cut is compared on its own side.

    Parameters
    ----------
    solution : Solution
    truth : callable
        The reference or exact field at a time, s.
    body : Body, SolidBody or MembraneBody, optional
        Its cuts as asked: where they are not as realised, the truth is asked on the side of the
        solution's cell.
    steps : sequence of int
        Output times that are looked at; default the last.
    cut : CutRecord, optional
        Of its realised cut: beside facets beyond its limit that side is the one as realised.

    Returns
    -------
    (k, n, d) array
        0 at nodes that no cell uses.
    """
    points, cells = solution.points, solution.cells
    shape = cells_of(solution)
    owner = np.full(len(points), -1)
    order = np.argsort(shape.volume, kind="stable")  # of two assignments the last stays
    owner[cells[order].ravel()] = np.repeat(order, cells.shape[1])
    used = owner >= 0
    centre = shape.corners.mean(axis=1)[owner[used]]
    inside = points[used] + INTO_CELL * (centre - points[used])
    field = SolutionField(solution)
    if body is not None:
        field = field_of(solution, body, continued=continued_where(solution, body, cut))
    beside = field.inner_points(owner[used])
    difference = np.zeros((len(steps), *points.shape))
    for k, step in enumerate(steps):
        own, _ = field.with_nodal(solution.displacement[step]).in_cells(inside, owner[used])
        true = truth(float(solution.times[step])).displacement(inside, beside)
        difference[k, used] = own - true
    return difference


def nodal_error(
    solution: Solution, truth: Field, body: AnyBody | None = None, cut: CutRecord | None = None
) -> Array:
    """Return the magnitude (n,) of `nodal_differences` at the last output time."""
    return np.linalg.norm(nodal_differences(solution, lambda _: truth, body, cut=cut)[0], axis=1)


def write_error_field(
    solution: Solution, truth: Field, path: Path, body: AnyBody | None = None,
    cut: CutRecord | None = None,
) -> None:  # fmt: skip
    """Write the mesh of `solution` with point data ``error`` (m) and ``displacement`` (m)."""
    import meshio

    points = np.zeros((len(solution.points), 3))
    points[:, : solution.dimension] = solution.points
    displacement = np.zeros_like(points)
    displacement[:, : solution.dimension] = solution.displacement[-1]
    mesh = meshio.Mesh(
        points,
        [(solution.cell_type, solution.cells)],
        point_data={"error": nodal_error(solution, truth, body, cut), "displacement": displacement},
    )
    with whole_file(path) as partial:
        mesh.write(partial, file_format="vtu")
