"""Jumps and pressures along cuts: profiles with their bands, overlaps, warnings of those not meant.

A penetration counts when it is more than three times the uncertainty of the opening. Of the
reference that is the widest part of the band of its opening profile. A solver's own opening is off
by its discretisation error as well, which is measured: its largest distance from the reference's
profile. A shear crack, whose faces stay closed exactly, so does not warn of what is an error of the
solver and judged as such. That error counts up to a tenth of the largest jump only: beyond, the
solver gives another answer, not the same one less exactly.
"""

import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.compare.body import AnyBody, body_of
from verify.compare.cut_deviation import continued_where
from verify.compare.cut_profile import ProfileLine, profile_lines
from verify.compare.cut_rule import CutRule
from verify.compare.errors import displacement_jump
from verify.compare.hooke import law_of
from verify.compare.motion import ExactMotion, Motion, SolutionMotion
from verify.compare.overlap import Overlap, OverlapSearch
from verify.errors import InputError, UnsupportedSceneError
from verify.judge.contact import Pressure, exact_pressure, stated_pressure
from verify.judge.convergence import place_uncertainty
from verify.judge.reference import size_of
from verify.printable import one_line, place_text
from verify.result import (
    COMPARISON_FAILED,
    REFERENCE,
    CaseResult,
    Metric,
    Notice,
    NoticeKind,
    OpeningCurve,
    OpeningProfile,
    ReferenceRecord,
    SolveRecord,
    Status,
)
from verify.scene import Scene
from verify.scene.acceptance import OVERLAP
from verify.solution import Solution

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
    pressures : function of CutRule
        Gives the pressures of contact on these points, of the levels below it and its own.
    """

    name: str
    level: int | None
    motion: Motion
    coarser: Sequence[Motion] = ()
    sizes: Sequence[float] = ()
    order: int = 1
    pressures: Callable[[CutRule], Sequence[Pressure]] = lambda rule: ()


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
    """Take the jump of a field, and its pressure; None where it does not reach that time."""
    try:
        jumps = [_parts(body, line, m, time) for m in (*one.coarser[-2:], one.motion)]
    except InputError:
        return None
    bands = _band(one, jumps, one.order + 1)
    found = OpeningCurve(one.name, one.level, *jumps[-1].tolist(), *bands)
    stated = one.pressures(line.rule)[-3:]
    if not stated:
        return found
    pressures = [pressure(line.rule.points, time or 0.0)[None] for pressure in stated]
    (band,) = _band(one, pressures, one.order)
    return replace(found, pressure=pressures[-1][0].tolist(), pressure_band=band)


def _parts(body: AnyBody, line: ProfileLine, motion: Motion, time: float | None) -> Array:
    """Return normal and tangential jump (2, n), m; in space the second is a length."""
    jump, normals = displacement_jump(motion.at(time), line.rule), line.rule.normals
    normal = np.sum(jump * normals, axis=1)
    if body.dimension == 2:
        tangential = jump[:, 0] * normals[:, 1] - jump[:, 1] * normals[:, 0]
    else:
        tangential = np.linalg.norm(jump - normal[:, None] * normals, axis=1)
    return np.stack([normal, tangential])


def _band(one: Contestant, levels: Sequence[Array], formal: float) -> list[list[float]]:
    """Half-widths of rows (k, n) on the last levels, by how these differ around each point.

    Zero of an exact field; empty where the levels are fewer than three.
    """
    if one.level is None:
        return np.zeros_like(levels[-1]).tolist()
    if len(levels) < 3:
        return [[] for _ in levels[-1]]
    sizes = list(one.sizes[-3:])

    def width(value: float, first: float, last: float) -> float:
        return place_uncertainty(value, [first, last], sizes, formal).half_width

    differences = [_around(fine - coarse) for coarse, fine in pairwise(levels)]
    return np.vectorize(width, otypes=[float])(levels[-1], *differences).tolist()


def _around(difference: Array) -> Array:
    """Root mean square (2, n) over the points beside each."""
    n = difference.shape[1]
    rows = [slice(max(0, i - _AROUND), i + _AROUND + 1) for i in range(n)]
    return np.sqrt(np.stack([np.mean(difference[:, row] ** 2, axis=1) for row in rows], axis=1))


_TIMES = 3.0  # the uncertainty of the opening: a penetration beyond is one
_OWN = 0.1  # of the largest jump of the reference: so much may be a solver's discretisation error
# Differences of places in the deformed body: below this share of its size, round-off and what
# iterative solvers leave.
_NOTHING = 1e-8
_MOST = 10_000_000  # cells times output times that overlaps are looked for in


@dataclass(frozen=True)
class _Found:
    """The deepest overlap of a solution over its output times."""

    overlap: Overlap
    time: float | None
    looked: str  # empty, or at how many of its output times


def with_openings(
    result: CaseResult,
    scene: Scene,
    solutions: Mapping[str, Mapping[int, Solution]],
    exact: Any = None,
    announce: Callable[[SolveRecord], None] = lambda record: None,
) -> CaseResult:
    """Add overlaps, opening profiles and warnings to the result of a case.

    Parameters
    ----------
    result : CaseResult
        As `verify.judge.accuracy.assess_accuracy` makes it.
    scene : Scene
    solutions : mapping of solver to mapping of level to Solution
    exact : object with ``displacement`` and ``gradient``, optional
        The exact solution that the scene names.
    announce : callable
        Is told of each solve before its overlaps are looked for.

    Returns
    -------
    CaseResult
        With the metric ``overlap_depth`` of each solve, `openings`, and `notices` of what overlaps
        and is not meant to.
    """
    try:
        body = body_of(scene)
    except UnsupportedSceneError:  # the result says so of every comparison
        return result
    if not body.has_cuts:
        return result
    found: dict[tuple[str, int], _Found] = {}
    solves = []
    for record in result.solves:
        solution = solutions.get(record.solver, {}).get(record.level)
        if solution is None or record.status is not Status.SOLVED:
            solves.append(record)
            continue
        announce(record)
        try:
            own = found[record.solver, record.level] = _deepest(solution)
        except (InputError, UnsupportedSceneError) as problem:
            solves.append(_without(record, str(problem)))
        except Exception as problem:  # a fault of the comparison costs this solve alone
            traceback.print_exception(problem)  # for the log
            why = one_line(f"{COMPARISON_FAILED}: {type(problem).__name__}: {problem}")
            solves.append(_without(record, why))
        else:
            solves.append(_recorded(record, own, _depth_of_pressure(scene, solution, record.size)))
    result = replace(result, solves=solves)
    shown = _contestants(scene, body, result, solutions, exact)
    judge = shown[0] if shown and shown[0].name == REFERENCE else None
    finest = {one.name: found[key] for one in shown if (key := (one.name, one.level or 0)) in found}
    if judge is not None and judge.level is None and (mesh := _finest_mesh(solutions)) is not None:
        finest[REFERENCE] = _Found(OverlapSearch(_exact_on(mesh, judge.motion)).at(), None, "")
        result = replace(result, reference=_with_overlap(result.reference, finest[REFERENCE]))
    times = _times(scene, body, shown, solutions, finest)
    openings = opening_profiles(body, shown, times)
    meant = scene.contact.expected != "none"  # or judged as an error of contact
    warned = [] if meant else _warnings(scene, finest, openings)
    return replace(result, openings=openings, notices=[*result.notices, *warned])


def _deepest(solution: Solution) -> _Found:
    """Find the deepest overlap over the output times; of very many times some are left out."""
    search, times = OverlapSearch(solution), solution.times
    if len(times) == 1:
        return _Found(search.at(), None, "")
    count = int(np.clip(_MOST // max(len(solution.cells), 1), 2, len(times)))
    steps = np.unique(np.linspace(0, len(times) - 1, count).round().astype(int))
    overlaps = [search.at(int(step)) for step in steps]
    worst = int(np.argmax([overlap.depth for overlap in overlaps]))
    looked = f"at {count} of {len(times)} output times" if count < len(times) else ""
    return _Found(overlaps[worst], float(times[steps[worst]]), looked)


def _depth_of_pressure(scene: Scene, solution: Solution, size: float | None) -> float:
    """Return p h/E of the largest pressure of contact, m; zero without any."""
    if solution.contact is None or not size:
        return 0.0
    return float(solution.contact.pressure.max(initial=0.0)) * size / scene.material.young


def _recorded(record: SolveRecord, found: _Found, pressed: float) -> SolveRecord:
    """Add what was found to the record of a solve; `pressed` is p h/E, m."""
    overlap = found.overlap
    metrics = [*record.metrics, Metric(OVERLAP, overlap.depth, "m")]
    if pressed:
        metrics.append(Metric("contact_overlap", overlap.depth / pressed, "1"))
    said = [_place(found)] if overlap.depth > 0.0 else []
    said += [found.looked] if found.looked else []
    if overlap.inside_out:
        said.append(
            f"{overlap.inside_out} facets of cuts left out, whose cells are inside out in the "
            "deformed body"
        )
    notes = {**record.notes, OVERLAP: "; ".join(said)} if said else record.notes
    return replace(record, metrics=metrics, notes=notes)


def _without(record: SolveRecord, why: str) -> SolveRecord:
    return replace(record, notes={**record.notes, OVERLAP: why})


def _with_overlap(reference: ReferenceRecord, found: _Found) -> ReferenceRecord:
    """Add the overlap of an exact solution to what is recorded of it."""
    place = {"place": _place(found)} if found.overlap.depth > 0.0 else {}
    return replace(reference, overlap={"depth": found.overlap.depth, **place})


def _contestants(
    scene: Scene,
    body: AnyBody,
    result: CaseResult,
    solutions: Mapping[str, Mapping[int, Solution]],
    exact: Any,
) -> list[Contestant]:
    """List the reference first, then the finest solved level of each solver."""
    shown = []
    levels = solutions.get(REFERENCE, {})
    if scene.judged_by_exact and exact is not None:
        truth, law = Contestant(REFERENCE, None, ExactMotion(exact)), law_of(scene)
        if scene.contact.closed:
            truth = replace(truth, pressures=lambda rule: [exact_pressure(exact, law, rule)])
        shown.append(truth)
    elif levels:
        names = sorted(levels)
        motions = [SolutionMotion(levels[level], body) for level in names]
        sizes = [size_of(levels[level]) for level in names]
        order = levels[names[-1]].order
        stated = _stated([levels[level] for level in names])
        shown.append(
            Contestant(REFERENCE, names[-1], motions[-1], motions[:-1], sizes, order, stated)
        )
    good = {(s.solver, s.level): s.cut for s in result.solves if s.metrics}
    for name, own in solutions.items():
        usable = [level for level in own if (name, level) in good]
        if name != REFERENCE and usable:
            finest = max(usable)
            where = continued_where(own[finest], body, good[name, finest])
            motion = SolutionMotion(own[finest], body, continued=where)
            shown.append(Contestant(name, finest, motion, pressures=_stated([own[finest]])))
    return shown


def _stated(solutions: Sequence[Solution]) -> Callable[[CutRule], Sequence[Pressure]]:
    found = [stated_pressure(one) for one in solutions if one.contact and len(one.contact.weights)]
    return lambda rule: found


def _times(
    scene: Scene,
    body: AnyBody,
    shown: Sequence[Contestant],
    solutions: Mapping[str, Mapping[int, Solution]],
    finest: Mapping[str, _Found],
) -> dict[str, float | None]:
    """When profiles are shown, by why."""
    if scene.analysis.kind == "static" or not shown:
        return {"": None}
    leader = next((one for one in shown if one.level is not None), None)
    if leader is None or leader.level is None:
        return {"": None}
    outputs = [float(t) for t in solutions[leader.name][leader.level].times]
    times: dict[str, float | None] = {"last output time": outputs[-1]}
    if (largest := largest_opening_time(body, shown[0].motion, outputs)) not in times.values():
        times["largest opening"] = largest
    for name, found in finest.items():
        if found.overlap.depth > 0.0 and found.time not in times.values():
            times[f"deepest overlap of {name}"] = found.time
    return times


def _warnings(
    scene: Scene, finest: Mapping[str, _Found], openings: Sequence[OpeningProfile]
) -> list[Notice]:
    """Warn of every overlap beyond what is unknown of the opening."""
    warned = []
    for name, found in finest.items():
        known = uncertainty(name, found.time, openings)
        limit = _TIMES * (known or 0.0)
        overlap = found.overlap
        if overlap.depth <= max(limit, _NOTHING * _size(openings)):
            continue
        beside = (
            "how well the opening is known is not known"
            if known is None
            else f"more than three times the uncertainty of the opening, {known:.2g} m"
        )
        text = (
            f"faces overlap by up to {overlap.depth:.4g} m at {_place(found)}; {beside}. "
            "Without contact this is no answer to a cut that closes: [contact] expected = 'closed'"
        )
        warned.append(Notice(NoticeKind.WARNING, "overlap of faces", name, text))
    return warned


def uncertainty(name: str, time: float | None, openings: Sequence[OpeningProfile]) -> float | None:
    """How well the opening of a solver is known, m; None without a reference that says so."""
    widths = []
    for profile in openings:
        if profile.time != time and len({o.time for o in openings}) > 1:
            continue
        curves = {curve.solver: curve for curve in profile.curves}
        truth = curves.get(REFERENCE)
        if truth is None or len(truth.normal_band) != len(truth.normal):
            return None
        widths.append(max(truth.normal_band, default=0.0) + _own_error(curves.get(name), truth))
    return max(widths, default=None)


def _own_error(curve: OpeningCurve | None, truth: OpeningCurve) -> float:
    """Largest distance of the normal openings of a solver and the reference, m, if it is small."""
    if curve is None or curve is truth:
        return 0.0
    off = np.abs(np.subtract(curve.normal, truth.normal)).max(initial=0.0)
    jump = np.hypot(truth.normal, truth.tangential).max(initial=0.0)
    return float(min(off, _OWN * jump))


def _size(openings: Sequence[OpeningProfile]) -> float:
    """Diagonal of the box around the cuts, m."""
    places = [point for profile in openings for point in profile.points]
    return float(np.linalg.norm(np.ptp(np.array(places), axis=0))) if places else 0.0


def _place(found: _Found) -> str:
    """Say where, in the material and deformed, and when."""
    material, deformed = found.overlap.material, found.overlap.deformed
    assert material is not None
    assert deformed is not None
    when = "" if found.time is None else f", at {found.time:.4g} s"
    return f"{place_text(material)} m, deformed {place_text(deformed)} m{when}"


def _finest_mesh(solutions: Mapping[str, Mapping[int, Solution]]) -> Solution | None:
    """Take the mesh that an exact field is looked at on: the one with most cells."""
    meshes = [s for own in solutions.values() for s in own.values() if len(s.cut_facets)]
    return max(meshes, key=lambda s: len(s.cells), default=None)


def _exact_on(mesh: Solution, motion: Motion) -> Solution:
    """Take an exact field at the nodes of a solution, each on the side of its cells."""
    centres = mesh.points[mesh.cells].mean(axis=1)
    near = mesh.points.copy()
    near[mesh.cells.ravel()] = np.repeat(centres, mesh.cells.shape[1], axis=0)
    u = motion.at().displacement(mesh.points, near)
    return replace(mesh, displacement=np.asarray(u)[None], times=np.zeros(1), velocity=None,
                   acceleration=None, ledger={}, contact=None)  # fmt: skip
