"""The result model: one record per solve, one per judged requirement. Versioned JSON.

`verify.report`, baselines and the pytest plugin read this and nothing else. A failed, refused
or timed-out solve is a record like any other, with its reason. First what solutions say too (what
a solver dropped, its cut, its reference), then results, the ranking of solvers, and the files.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from enum import StrEnum
from functools import cache
from itertools import pairwise
from math import inf, log
from pathlib import Path
from statistics import median
from typing import Any, Literal

from verify.errors import InputError
from verify.files import plain, read_json, write_plain
from verify.printable import one_line, words_of


@dataclass(frozen=True)
class Regularisation:
    """Something the solver dropped, snapped, clamped, scaled or floored.

    Parameters
    ----------
    kind : str
        What was done, e.g. ``"zero-volume piece dropped"``.
    count : int
        How often.
    size : float or None
        Its largest contribution, in the unit of `unit`; None as read from JSON, which has no word
        for numbers that are not finite.
    unit : str
        Unit of `size`, e.g. ``"volume fraction"``.
    """

    kind: str
    count: int
    size: float | None
    unit: str


@dataclass(frozen=True)
class CutRecord:
    """The realised cut of a solve beside the cut as asked.

    Parameters
    ----------
    dimension : int
        Of the cells, 2 or 3.
    asked_to_realised, realised_to_asked : float
        Largest distance of a point of one from the other, m, where the nearest point is no end.
    missing, surplus : float
        Of the cut as asked beyond the ends of the realised one, and the reverse: a length, m; of
        surfaces in space an area, m².
    swept : float
        Between the two over their common part: an area, m², in space a volume, m³.
    element : float
        Largest longest edge of the cells at the realised cut, m.
    limit : float
        Lateral deviation of a facet up to which fields are continued across it, m.
    radius : float or None
        Least radius of curvature of the cuts as asked, m; None if all are straight or plane.
    errors : dict of str to float
        Relative errors that are not judged, by metric: without any continuation if those judged
        are with it everywhere, else with it everywhere. Empty where both are the same.
    """

    dimension: int
    asked_to_realised: float
    realised_to_asked: float
    missing: float
    surplus: float
    swept: float
    element: float
    limit: float
    radius: float | None
    errors: dict[str, float] = field(default_factory=dict)

    @property
    def lateral(self) -> float:
        """Larger of both lateral deviations, m."""
        return max(self.asked_to_realised, self.realised_to_asked)

    @property
    def continued(self) -> bool:
        """Whether the judged field is continued across all of the realised cut."""
        return self.lateral <= self.limit

    @property
    def under_resolved(self) -> bool:
        """Whether an arc is of less than two elements in radius."""
        return self.radius is not None and self.radius < 2.0 * self.element


@dataclass(frozen=True)
class ReferenceRecord:
    """What a result says about its reference; None where it says nothing.

    Parameters
    ----------
    kind : {"exact", "conforming", "none"} or None
        None: the comparison failed.
    source : str
        What it is, in words.
    reason : str
        Why there is none.
    near : dict
        ``radius`` (m) within which errors are near a tip, and its ``reason``.
    levels : list of dict
        ``level``, ``size`` (m) and ``unknowns`` of each conforming level.
    time_to_accuracy : dict of str to dict
        By level: ``unknowns``, ``seconds``, and bounds of the relative errors by metric.
    metrics : dict of str to dict
        ``values`` by level, ``extrapolated``, ``uncertainty``, ``order``, ``reason``; ``second``, a
        second estimate, and its ``disagreement`` over the uncertainties.
    missing : dict of str to str
        Why it does not have a quantity of interest.
    suffices : bool
        Whether its uncertainty is at most a tenth of each error that it judges.
    suffices_reason : str
    judged_errors : dict of str to dict
        The errors that it judges, largest share of uncertainty first.
    overlap : dict
        ``depth`` (m) and ``place`` of material of an exact solution that lies in other material.
    """

    kind: str | None = None
    source: str | None = None
    reason: str | None = None
    near: dict[str, Any] | None = None
    levels: list[dict[str, Any]] | None = None
    time_to_accuracy: dict[str, dict[str, Any]] | None = None
    metrics: dict[str, dict[str, Any]] | None = None
    missing: dict[str, str] | None = None
    suffices: bool | None = None
    suffices_reason: str | None = None
    judged_errors: dict[str, dict[str, Any]] | None = None
    overlap: dict[str, Any] | None = None

    def said(self) -> dict[str, Any]:
        """Return what it says, by name."""
        entries = {one.name: getattr(self, one.name) for one in fields(self)}
        return {name: entry for name, entry in entries.items() if entry is not None}


SCHEMA_VERSION = 1
REFERENCE = "reference"  #: solver that judges the others, where no exact solution does
SUFFICIENT = 0.1  #: half-width of a reference over the error it judges, that it shall not exceed
LOG = "log"  #: of the notes of a solve without an answer: its log, in the run directory
FORECAST = "finer levels"  #: of the notes of a reference: expected time of the levels to come
WITHIN = "within"  #: of the notes of a reference: how much larger its elements are by --within
MESHING = "meshing"  #: of the phases of a solve: the first mesh that it makes
HANDED_OVER = "mesh handed over"  #: phase of who solves on a conforming mesh that others made
_CUTTING = ("cutting", "enrichment")  # phases that cut a mesh which does not know the cut
COMPILING = "compiling"  #: of the notes of a solve: seconds that numba compiled kernels for
#: of the notes of a solve in motion or of slivers: of central differences, undeformed body
CRITICAL_STEP = "critical step"
CUT = "cut"  #: of the notes of a solve: where its realised cut is not as asked
#: begins the note "comparison" of a solve that the comparison, not its solver, failed on
COMPARISON_FAILED = "comparison failed"


def _closed[Kind](kind: Kind) -> Kind:
    """Have unknown keys refused where a record is made from plain values."""
    kind.__pydantic_config__ = {"extra": "forbid"}  # type: ignore[attr-defined]
    return kind


_closed(Regularisation)
_closed(CutRecord)
_closed(ReferenceRecord)


class Status(StrEnum):
    """How a solve ended."""

    SOLVED = "solved"
    REFUSED = "refused"
    FAILED = "failed"
    TIMEOUT = "timeout"
    MEMORY = "memory"


class Verdict(StrEnum):
    """The state of a requirement."""

    PASS = "PASS"
    FAIL = "FAIL"
    UNDECIDED = "UNDECIDED"
    ERROR = "ERROR"  # could not be judged: a solve did not finish, or the comparison failed


@_closed
@dataclass(frozen=True)
class Metric:
    """A number that was measured, with its reference and half-width.

    Parameters
    ----------
    name : str
        A relative error (``displacement_l2``, ``energy_norm``, ``jump_l2`` … see
        `verify.judge.intervals.ERROR_METRICS`), ``strain_energy`` or the name of a quantity of
        interest.
    value : float
    unit : str
        ``"1"`` for relative errors.
    reference : float or None
        Reference value of a quantity; None for an error, whose reference value is 0.
    uncertainty : float
        Half-width of the interval that the reference's imperfection puts around `value` (for
        an error) or around `reference` (for a quantity), in the metric's unit. It includes
        the integration error of the comparison.
    source : str
        What the reference is, e.g. ``"exact: griffith"`` or
        ``"conforming P2, 3 levels, GCI"``.
    width_from : str
        What most of the half-width is from; empty if it is from the reference.
    """

    name: str
    value: float
    unit: str
    reference: float | None = None
    uncertainty: float = 0.0
    source: str = ""
    width_from: str = ""

    def relative_distance(self) -> tuple[float, float, float]:
        """Return |value/reference − 1| of a quantity, and its bounds for every true reference.

        The true reference lies within `uncertainty` of the stated one, and is the divisor too: a
        smaller one makes the distance larger twice. Unbounded where it may be 0.

        Raises
        ------
        ValueError
            If there is no reference, or it is 0.
        """
        if not self.reference:
            raise ValueError(f"{self.name} has no reference, or one that is 0")
        near, far = (abs(self.reference) + s * self.uncertainty for s in (-1.0, 1.0))
        value = self.value if self.reference > 0.0 else -self.value
        ends = abs(value - near) / near if near > 0.0 else inf, abs(value - far) / far
        low = 0.0 if near <= value <= far else min(ends)
        return abs(self.value - self.reference) / abs(self.reference), low, max(ends)


@_closed
@dataclass(frozen=True)
class PartRecord:
    """A separated part of a moving body: a connected piece of material of its final cut.

    Parameters
    ----------
    mass : float
        kg (plane scenes: per metre of thickness, as all that follows).
    centre : list of float
        Of mass, undeformed, m.
    inertia : list of float
        Moments about the axes z, in space x, y, z, through its own centre, undeformed, kg m².
    free_from : float or None
        From when on only gravity and uniform body forces act on it, s; None if never.
    drift : dict of str to float
        From then on, relative: ``linear_momentum`` beside the impulse of these forces, and
        ``angular_momentum`` about its own centre. Empty if it is not free or has no velocities.
    series : dict of str to list of float
        Over the output times: ``strain`` and ``kinetic`` energy (J), ``linear_momentum_x`` …
        (N s), ``angular_momentum_z`` … about its own centre (N m s).
    """

    mass: float
    centre: list[float]
    inertia: list[float]
    free_from: float | None
    drift: dict[str, float] = field(default_factory=dict)
    series: dict[str, list[float]] = field(default_factory=dict)


@_closed
@dataclass(frozen=True)
class SolveRecord:
    """One solve: one solver on one mesh level of one case.

    `timings` are wall seconds by phase: median and the list of repetitions. `unknowns`,
    `size` and the rest are as in `verify.solution.Solution`. Of `notes`, `COMPILING` says how much
    of `wall` went to compiling kernels, which is kept for later runs.
    """

    case: str
    solver: str
    level: int
    status: Status
    reason: str = ""
    parameters: dict[str, Any] = field(default_factory=dict)
    size: float | None = None
    unknowns: int | None = None
    metrics: list[Metric] = field(default_factory=list)
    timings: dict[str, list[float]] = field(default_factory=dict)
    peak_memory: float | None = None  # bytes, of the solving process
    wall: float | None = None  # seconds, of the solving process, start-up included
    iterations: dict[str, int] = field(default_factory=dict)
    regularisations: list[Regularisation] = field(default_factory=list)
    notes: dict[str, str] = field(default_factory=dict)
    solution: str | None = None  # path of the stored solution, relative to the run directory
    # relative errors over time, by metric, with "time" in s; empty for a static scene
    series: dict[str, list[float]] = field(default_factory=dict)
    # energies, momenta and asked forces over time, by name, with "time" in s; empty if static
    account: dict[str, list[float]] = field(default_factory=dict)
    # separated parts, from the top down; empty for a static scene
    parts: list[PartRecord] = field(default_factory=list)
    # where the realised cut is; None of a body without cuts, or in older results
    cut: CutRecord | None = None
    # whether its own mesh conforms to the cut, beyond faces of the background mesh; None: not known
    conforming: bool | None = None

    @property
    def paid(self) -> dict[str, list[float]]:
        """Wall seconds, by phase and repetition, of what each cut costs anew.

        A mesh that is cut afterwards, or does not conform to the cut, is made once. One that
        conforms to it is made for each cut.
        """
        once = self.conforming is False or any(name in _CUTTING for name in self.timings)
        return {k: times for k, times in self.timings.items() if not (once and k == MESHING)}

    def metric(self, name: str) -> Metric | None:
        """Return the metric called `name`, if it was measured."""
        return next((metric for metric in self.metrics if metric.name == name), None)

    @property
    def energy_taker(self) -> str | None:
        """What the scene has take energy from the body: "a blade", "damping", or nothing."""
        if self.metric("released_to_cut") is not None:
            return "a blade"
        return "damping" if any(self.account.get("damping", ())) else None

    @property
    def not_compared(self) -> str:
        """Why nothing was measured of a solve that gave an answer; empty if something was."""
        return "" if self.metrics else self.notes.get("comparison", "")


def meshes_charged(records: Sequence[SolveRecord]) -> list[SolveRecord]:
    """Charge solves on a mesh that conforms to the cut, and that they were handed, with making it.

    `conforming` on the same level says how long that takes; without it the quickest other solve
    that makes such a mesh. Without any the phase is empty, and the solve has no time.
    """
    able = [r for r in records if r.conforming and r.paid.get(MESHING)]
    able.sort(key=lambda r: (r.solver == "conforming", -median(r.timings[MESHING])))
    makers = {record.level: record for record in able}  # the last one counts
    return [
        replace(record, timings={**record.timings, HANDED_OVER: _share(record, makers)})
        if record.conforming and record.timings and not _makes_its_mesh(record)
        else record
        for record in records
    ]


def _makes_its_mesh(record: SolveRecord) -> bool:
    return MESHING in record.timings or any(name in _CUTTING for name in record.timings)


def _share(record: SolveRecord, makers: Mapping[int, SolveRecord]) -> list[float]:
    if (maker := makers.get(record.level)) is None:
        return []
    return [median(maker.timings[MESHING])]


def repeated_totals(phases: Mapping[str, Sequence[float]]) -> list[float]:
    """Wall seconds of each repetition over all phases; none where a phase has no time.

    A phase that was timed less often, as meshing is, counts by its median in each of them.
    """
    if not all(phases.values()):
        return []
    count = max(map(len, phases.values()), default=0)
    return [
        sum(times[i] if len(times) == count else median(times) for times in phases.values())
        for i in range(count)
    ]


type Times = tuple[float, float, float]  # median, least and most of repetitions, s
type TimedErrors = Sequence[tuple[float, Times]]  # of levels, coarse to fine
_REACHED = 1.0 + 1e-9  # times an error: round-off of the same one


def time_at(levels: TimedErrors, error: float) -> Times | None:
    """Return the time that an error takes, interpolated between levels, log against log.

    None if the levels do not reach it; where they all stay below it, the time of the coarsest.
    """
    if levels and levels[0][0] <= error:
        return levels[0][1]
    for (coarse, before), (fine, after) in pairwise(levels):
        if fine <= error * _REACHED:
            share = min(log(coarse / error) / log(coarse / fine), 1.0)
            one, two, three = (
                a ** (1 - share) * b**share for a, b in zip(before, after, strict=True)
            )
            return one, two, three
    return None


def times_at_equal_error(one: TimedErrors, other: TimedErrors) -> tuple[Times, Times] | None:
    """Return the times of two solvers at the smallest error that both reach.

    None where that error lies below the coarsest level of either: nobody would choose such a mesh.
    """
    if not one or not other:
        return None
    error = max(min(level[0] for level in levels) for levels in (one, other))
    if any(max(level[0] for level in levels) * _REACHED < error for levels in (one, other)):
        return None
    first, second = time_at(one, error), time_at(other, error)
    return (first, second) if first and second else None


@_closed
@dataclass(frozen=True)
class Rate:
    """Observed order of an error under refinement, or why there is none.

    Parameters
    ----------
    solver, metric : str
    order : float or None
        Slope of log(error) over log(h) between the finest levels.
    uncertainty : float
        Half-width from the spread of the levels and the reference's uncertainty.
    reason : str
        Empty if the order means something; else ``"floor"`` (errors at round-off or at the
        reference's uncertainty), ``"oscillating"``, ``"uneven"``, ``"rising"``, ``"slowing"``,
        ``"diverging"``, ``"too few levels"``, followed by the numbers that say so.
    pairwise : list of float
        Slope between each pair of successive levels.
    """

    solver: str
    metric: str
    order: float | None
    uncertainty: float
    reason: str
    pairwise: list[float] = field(default_factory=list)


@_closed
@dataclass(frozen=True)
class VerdictRecord:
    """The verdict on one acceptance check of a case, made of one solver.

    `solver` is empty if the check holds for no solver of the run. `observed` is the measured value;
    `low`/`high` is the interval of its true value, by the half-width of the reference. `limit` is
    the demand of the case (as text), `reason` one sentence. `known` is the reason that the
    case gives for a FAIL that it lists as a known finding, else empty. `reference_share` is the
    half-width of the reference over the error that is judged, on the finest level; None where no
    reference judges, or both are round-off.
    """

    check: str
    solver: str
    metric: str
    verdict: Verdict
    observed: float | None
    low: float | None
    high: float | None
    limit: str
    reason: str
    known: str = ""
    reference_share: float | None = None

    @property
    def badge(self) -> str:
        """What stands beside the verdict where the reference is not clearly better than judged."""
        share = self.reference_share
        if share == inf:
            return "reference: not known as well as the error"
        return f"reference: {share:.2g} of the error" if share and share > SUFFICIENT else ""

    @property
    def counts_as_failed(self) -> bool:
        """Whether this is a FAIL that the case does not list as a known finding."""
        return self.verdict is Verdict.FAIL and not self.known


class NoticeKind(StrEnum):
    """What a notice is about."""

    WARNING = "warning"  # an answer whose meaning is in doubt, whatever its verdict
    UNAVAILABLE = "unavailable"  # a quantity that was asked for and cannot be had
    ADEQUACY = "adequacy"  # what the model of the case costs in error, or a cheaper one would


@_closed
@dataclass(frozen=True)
class Notice:
    """A sentence that a reader of a case must not miss, beside its verdicts.

    Parameters
    ----------
    kind : NoticeKind
    about : str
        Name of the quantity, or of the cut (``"cut 0"``).
    solver : str or None
        Whose answer it is about; None if it holds for every solver.
    text : str
        One sentence, with its numbers and their place.
    """

    kind: NoticeKind
    about: str
    solver: str | None
    text: str


@_closed
@dataclass(frozen=True)
class OpeningCurve:
    """The displacement jump of one field along a line on a cut.

    `level` is None for an exact solution. `normal` and `tangential` are in m, positive where the
    cut opens; in space the tangential jump is a length. `pressure` acts between faces that touch,
    in Pa; empty without contact. The bands are half-widths of a reference; empty where nothing
    says how well the field is known.
    """

    solver: str
    level: int | None
    normal: list[float]
    tangential: list[float]
    normal_band: list[float] = field(default_factory=list)
    tangential_band: list[float] = field(default_factory=list)
    pressure: list[float] = field(default_factory=list)
    pressure_band: list[float] = field(default_factory=list)


@_closed
@dataclass(frozen=True)
class OpeningProfile:
    """Jumps and pressures along a line on a cut, of all solvers' finest levels and the reference.

    Parameters
    ----------
    cut : str
    where : str
        Which line on the cut, in words.
    time : float or None
        In s; None for a static case.
    why : str
        Why at this time.
    arc : list of float
        Arc length along the line, m.
    points : list of list of float
        Places in the material, m.
    curves : list of OpeningCurve
    """

    cut: str
    where: str
    time: float | None
    why: str
    arc: list[float]
    points: list[list[float]]
    curves: list[OpeningCurve]


@_closed
@dataclass(frozen=True)
class CaseResult:
    """All that is known about one case of a run."""

    case: str
    title: str
    requirement: str
    scene_hash: str
    scene: dict[str, Any]
    reference: ReferenceRecord
    solves: list[SolveRecord]
    rates: list[Rate]
    verdicts: list[VerdictRecord]
    pictures: dict[str, str] = field(default_factory=dict)  # name -> path in the run directory
    provenance: dict[str, Any] = field(default_factory=dict)
    notices: list[Notice] = field(default_factory=list)
    openings: list[OpeningProfile] = field(default_factory=list)
    row: dict[str, Any] | None = None  # family, parameter and value, if the case has several rows
    schema: int = SCHEMA_VERSION

    @property
    def verdict(self) -> Verdict:
        """The worst verdict of the case; UNDECIDED if some solvers alone could not be judged."""
        lost = {v.solver for v in self.verdicts if v.verdict is Verdict.ERROR}
        whole = worst(v.verdict for v in self.verdicts)
        if whole is Verdict.ERROR and lost < {v.solver for v in self.verdicts}:
            return Verdict.UNDECIDED
        return whole

    @property
    def badge(self) -> str:
        """The badge of the check whose reference is the largest share of the error judged."""
        shares = sorted(self.verdicts, key=lambda record: record.reference_share or 0.0)
        if not shares or not shares[-1].badge:
            return ""
        return f"{shares[-1].badge} ({shares[-1].metric} of {shares[-1].solver})"

    def content(self) -> dict[str, Any]:
        """Return all of it as plain values; of the reference what its record says."""
        return {**asdict(self), "reference": self.reference.said()}

    @property
    def warnings(self) -> list[Notice]:
        """The notices that put an answer in doubt."""
        return [notice for notice in self.notices if notice.kind is NoticeKind.WARNING]

    @property
    def failing(self) -> list[str]:
        """Solvers that fail a check, known findings included, in their order."""
        return list(dict.fromkeys(v.solver for v in self.verdicts if v.verdict is Verdict.FAIL))


def finest_of(solves: Iterable[SolveRecord]) -> dict[str, SolveRecord]:
    """Return the solve on the finest level by solver."""
    return {solve.solver: solve for solve in sorted(solves, key=lambda solve: solve.level)}


def worst(verdicts: Iterable[Verdict]) -> Verdict:
    """Return the worst of verdicts: FAIL, ERROR, UNDECIDED, PASS; UNDECIDED if there are none.

    A FAIL stands whatever the outcome of checks that could not be judged.
    """
    order = (Verdict.PASS, Verdict.UNDECIDED, Verdict.ERROR, Verdict.FAIL)
    return max(verdicts, key=order.index, default=Verdict.UNDECIDED)


def error_picture(solver: str) -> str:
    """Return the name under which `CaseResult.pictures` has the error field of a solver."""
    return f"error_field of {solver}"


@dataclass(frozen=True)
class LeftOut:
    """What does not count in a comparison, and why; an empty solver means all of them."""

    case: str
    solver: str
    reason: str


@dataclass(frozen=True)
class Standing:
    """A solver in a comparison.

    Parameters
    ----------
    solver : str
    rank : int or None
        One more than the number of solvers that are certainly better (their intervals lie
        wholly below). None for a solver without a number in some item: its `value` is over fewer
        items than the others' values.
    tied : bool
        Whether another has the same rank.
    value, low, high : float or None
        The number and the interval in which it lies.
    count : int
        Items that it rests on.
    where : str
        Case that decided.
    """

    solver: str
    rank: int | None
    tied: bool
    value: float | None
    low: float | None
    high: float | None
    count: int
    where: str = ""


@dataclass(frozen=True)
class Comparison:
    """All solvers in one respect, on the finest level of each; the worst case counts.

    Parameters
    ----------
    metric : str
        What was compared.
    items : int
        Cases.
    standings : list of Standing
        Best first, those without rank last.
    left_out : list of LeftOut
    """

    metric: str
    items: int
    standings: list[Standing]
    left_out: list[LeftOut]


@dataclass(frozen=True)
class StabilityStanding:
    """How the solves of one solver ended.

    Parameters
    ----------
    solver : str
    rank : int
        One more than the number of solvers with a smaller share of solves lost.
    tied : bool
    asked, solved, refused : int
        Refusals are not held against a solver: it says what it cannot do.
    failed, timeout, memory : int
    blown_up : int
        Solved, but as far off as a body that does not move, or not finite.
    inside_out : int
        Solves at finite rotation whose field turns cells inside out.
    lost : float
        Share of the solves not refused that failed, ran out of time or memory, or blew up.
    regularisations : dict of str to int
        What was dropped, snapped, clamped, scaled or floored, and how often.
    """

    solver: str
    rank: int | None
    tied: bool
    asked: int
    solved: int
    refused: int
    failed: int
    timeout: int
    memory: int
    blown_up: int
    inside_out: int
    lost: float | None
    regularisations: dict[str, int]


@dataclass(frozen=True)
class Pair:
    """A solver beside another, on the scenes that both did.

    Parameters
    ----------
    metric : str
        ``"displacement_l2"``, ``"energy_norm"``, ``"jump_l2"``, ``"quantities"`` (all of interest)
        at equal element size, or ``"time"`` at an equal error of the displacement.
    kind : str
        Of the scenes: ``"rest"`` or ``"motion"``.
    solver, rival : str
        Each pair stands in both directions.
    wins, ties, losses : int
        Scenes, of the solver; their sum is the number of scenes in common.
    ratio : float or None
        Number of the solver over its rival's, median over scenes; None if there is none.
    low, high : float or None
        Range of the ratios: 5th and 95th percentile; below ten scenes least and largest.
    count : int
        Scenes that have a ratio: neither number is round-off, and both are told from none.
    """

    metric: str
    kind: str
    solver: str
    rival: str
    wins: int
    ties: int
    losses: int
    ratio: float | None
    low: float | None
    high: float | None
    count: int


@dataclass(frozen=True, kw_only=True)
class Ranking:
    """A table per question, and what was left out.

    Parameters
    ----------
    cases, solvers : list of str
    conformance : dict of str to dict
        What ``verify conform`` found, by solver; it does not move the ranks.
    pairs : list of Pair
        Accuracy and cost.
    groups : list of list of str
        Solvers that are one discretisation, two or more.
    coverage : dict of str to dict
        By solver and kind of scene (``"rest"``, ``"motion"``): scenes answered, scenes asked.
    stability : list of StabilityStanding
    energy : list of Comparison
    left_out : list of LeftOut
        What no ranking counts.
    contended : list of str
        Why times may be off, if they may.
    """

    schema: Literal[2]
    kind: Literal["ranking"] = "ranking"
    cases: list[str]
    solvers: list[str]
    conformance: dict[str, dict[str, Any]]
    pairs: list[Pair]
    groups: list[list[str]]
    coverage: dict[str, dict[str, list[int]]]
    stability: list[StabilityStanding]
    energy: list[Comparison]
    left_out: list[LeftOut]
    contended: list[str]


def ranked_solvers(results: Sequence[CaseResult]) -> list[str]:
    """Return the solvers of a run that can be ranked: all but the reference."""
    names = dict.fromkeys(solve.solver for result in results for solve in result.solves)
    return [name for name in names if name != REFERENCE]


def folder_of_case(case: str) -> str:
    """Return the name of the folder of a case below ``cases/`` of a run."""
    name = case.replace("/", "__")
    return f"_{name}" if name.startswith(".") else name


def write_result(result: CaseResult, path: Path) -> None:
    """Write `result` as JSON, in one step (a reader never sees half a file).

    Numbers that are not finite, for which JSON has no word, are null there, and named with what
    they are under ``not_finite``; numpy's scalars are plain numbers.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    lost: dict[str, str] = {}
    content = plain(result.content(), lost)
    write_plain({**content, "not_finite": lost} if lost else content, path)


def read_result(path: Path) -> CaseResult:
    """Read what `write_result` wrote.

    Raises
    ------
    InputError
        If the file is missing, damaged, or of another schema version.
    """
    record = read_json(path, "a result")
    if record.get("schema") != SCHEMA_VERSION:
        raise InputError(f"not a result of schema version {SCHEMA_VERSION}", str(path))
    try:
        for place, number in record.pop("not_finite", {}).items():
            _put(record, place, float(number))
    except (AttributeError, LookupError, OverflowError, TypeError, ValueError) as error:
        raise InputError(f"not a readable result ({words_of(error)})", str(path)) from None
    return checked(CaseResult, record, "result", str(path))


def checked[Kind](kind: type[Kind], content: Any, what: str, where: str) -> Kind:
    """Make a record of `verify.result`, or of what holds them, from plain values.

    Parameters
    ----------
    kind : type
        A dataclass.
    content : object
    what : str
        What it is called in the message.
    where : str

    Raises
    ------
    InputError
        If a value is missing, of another type, or unknown; the first such is named.
    """
    from pydantic import ValidationError

    make: Any = kind
    try:
        made: Kind = adapter_of(make).validate_python(content)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        said = one_line(f"{place}: {first['msg']}")
        raise InputError(f"not a readable {what} ({said})", where) from None
    return made


@cache
def adapter_of(kind: Any) -> Any:
    """Make what checks records of a kind, once: that takes longer than checking many."""
    from pydantic import TypeAdapter

    return TypeAdapter(kind)


def _put(record: Any, place: str, number: float) -> None:
    """Put a number at a JSON pointer (RFC 6901), where null stands for it."""
    keys = [key.replace("~1", "/").replace("~0", "~") for key in place.split("/")[1:]]
    for key in keys[:-1]:
        record = record[int(key) if isinstance(record, list) else key]
    record[int(keys[-1]) if isinstance(record, list) else keys[-1]] = number
