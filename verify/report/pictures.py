"""Pictures of a case: reference and solvers with the cut open, and where each of them errs."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.geometry.planar import inside_polygon
from verify.geometry.simplices import distance_to_outline, distance_to_polyline
from verify.report.bodies import (
    Body,
    View,
    common_view,
    deformed_bodies,
    error_body,
    packed,
    zoomed,
)
from verify.report.notation import ROUND_OFF, number, number_text, solver_title
from verify.report.problem import cut_lines, plane_corners
from verify.report.run_directory import CaseEntry, read_stored
from verify.result import REFERENCE, CaseResult, SolveRecord, Status, error_picture, finest_of
from verify.solution import Solution

_OF_BODIES, _OF_ERRORS = "cividis", "YlOrBr"  # colours
_MOST = 4  # bodies side by side
_MOST_MAPS = 8  # of errors of a case
_FRAMES = 6  # of a film
_FRAME_PIXELS = 160_000
_STILL = 1e-200  # of the body's diagonal: displacements below are none
_WILD = 1e3  # times the smallest displacement beside it: what moves farther is not drawn
_OPENING_SHOWN = 0.15  # of the body's diagonal: what the largest displacement is scaled to
_PEAK = 0.995  # of the nodes: what single nodes have is no measure of a map
_CLIP = 2.0  # times the peak of the solver in the middle, where the scale ends
_TIP_SHARE = 0.15  # of the cut's length: half of the window around a tip
_TIP_CELLS = 4.0  # elements that are shown on each side of a tip at least
_TIP_SIZE = (420, 420)  # in pixels
_ON = 1e-6  # of the body's size: an end that is closer to a line ends on it

Points = NDArray[np.float64]


@dataclass
class Picture:
    """One picture: what it shows, and its image once it is drawn."""

    title: str
    description: str
    body: Body
    view: View
    image: bytes = b""  # WebP
    turnable: bool = True  # whether a body in space may be turned in the page

    @cached_property
    def solid(self) -> dict[str, str]:
        """What a view that can be turned needs; empty for plane bodies."""
        return packed(self.body, self.view)

    @property
    def turned(self) -> dict[str, str]:
        """The same if the page has room for it."""
        return self.solid if self.turnable else {}


@dataclass
class CasePictures:
    """The pictures of a case, with notes.

    `deformed` share view, colours and `scale` (displacements are drawn that much enlarged). Bodies
    that move have frames of a `film` instead, for each its output times. `tip` are the errors
    around the tip that `tip_at` names.
    """

    deformed: list[Picture] = field(default_factory=list)
    error: list[Picture] = field(default_factory=list)
    film: list[list[Picture]] = field(default_factory=list)
    tip: list[Picture] = field(default_factory=list)
    tip_at: str = ""
    scale: float = 1.0
    notes: list[str] = field(default_factory=list)

    @property
    def all(self) -> list[Picture]:
        """Every picture of the case."""
        frames = [picture for body in self.film for picture in body]
        return [*self.deformed, *self.error, *self.tip, *frames]

    def say_left_out(self, what: str, solvers: Sequence[str], shown: int) -> None:
        """Say of which solvers there is no picture, `shown` of them being shown."""
        if solvers:
            names = ", ".join(map(solver_title, solvers))
            self.notes.append(f"Without picture of the {what}, {shown} being shown: {names}.")


def case_pictures(root: Path, entry: CaseEntry) -> CasePictures:
    """Prepare the pictures of a case from stored solutions; a missing one becomes a note."""
    pictures = CasePictures()
    if entry.result is None:
        return pictures
    shown: list[tuple[SolveRecord, Solution]] = []
    solves = _finest_solves(entry.result)
    pictures.say_left_out("deformed body", [solve.solver for solve in solves[_MOST:]], _MOST)
    for solve in solves[:_MOST]:
        try:
            shown.append((solve, read_stored(root, solve.solution or "")))
        except InputError as error:
            pictures.notes.append(f"No picture of {_named(solve)}: {error.what}.")
    shown = _without_wild(pictures, shown)
    dimensions = {solution.dimension for _, solution in shown}
    if len(dimensions) > 1:
        pictures.notes.append("No pictures side by side: the solutions differ in dimension.")
    elif shown:
        _deformed(pictures, shown)
    elif not pictures.notes:
        pictures.notes.append("No pictures: no solution is stored.")
    _add_error_maps(pictures, root, entry.result)
    return pictures


def _named(solve: SolveRecord) -> str:
    return f"{solver_title(solve.solver)}, level {solve.level}"


def _finest_solves(result: CaseResult) -> list[SolveRecord]:
    """Return the finest stored solve of each solver: reference, those that fail, the others."""
    finest = finest_of(s for s in result.solves if s.status is Status.SOLVED and s.solution)
    if REFERENCE in finest and "conforming" not in result.failing:
        finest.pop("conforming", None)
    order = {REFERENCE: 0, "conforming": 2, "xfem": 3}

    def place(solve: SolveRecord) -> int:
        return 1 if solve.solver in result.failing else order.get(solve.solver, 4)

    return sorted(finest.values(), key=place)


def _without_wild(
    pictures: CasePictures, shown: list[tuple[SolveRecord, Solution]]
) -> list[tuple[SolveRecord, Solution]]:
    """Leave out, with a note, what would make the others invisible: all share view and colours."""
    moved = [float(np.abs(solution.displacement[-1]).max()) for _, solution in shown]
    least = min((length for length in moved if length > 0.0), default=0.0)
    kept = []
    for (solve, solution), length in zip(shown, moved, strict=True):
        defect = solve.not_compared
        if length > _WILD * least:
            defect = f"it moves by up to {number_text(length)} m, the others by far less"
        if not defect:
            kept.append((solve, solution))
            continue
        pictures.notes.append(f"No picture of {_named(solve)}: {defect}.")
    return kept


def _deformed(pictures: CasePictures, shown: list[tuple[SolveRecord, Solution]]) -> None:
    """Show the bodies at the end or, where they move, at the same output times."""
    everything = np.concatenate([solution.points for _, solution in shown])
    diagonal = float(np.linalg.norm(np.ptp(everything, axis=0)))
    largest = max(float(np.abs(solution.displacement[-1]).max()) for _, solution in shown)
    moves = largest > _STILL * diagonal
    pictures.scale = _round_scale(_OPENING_SHOWN * diagonal / largest) if moves else 1.0
    times = shown[0][1].times
    if len(times) > 1:
        apart = [solve for solve, own in shown if not np.array_equal(own.times, times)]
        pictures.notes += [f"Not shown in motion, at other times: {_named(s)}." for s in apart]
        _film(pictures, [one for one in shown if one[0] not in apart])
        return
    bodies = [deformed_bodies(solution, pictures.scale)[0] for _, solution in shown]
    view = common_view(bodies, _OF_BODIES)
    for (solve, _), body in zip(shown, bodies, strict=True):
        description = (
            f"Deformed body, {_named(solve)}; displacements drawn {pictures.scale:g} times, "
            f"largest displacement {number_text(float(body.values.max()))} m."
        )
        pictures.deformed.append(Picture(_named(solve), description, body, view))


def _film(pictures: CasePictures, shown: list[tuple[SolveRecord, Solution]]) -> None:
    times = shown[0][1].times
    steps = np.unique(np.linspace(0, len(times) - 1, _FRAMES).round().astype(int))
    bodies = [deformed_bodies(own, pictures.scale, steps.tolist()) for _, own in shown]
    every = [body for own in bodies for body in own]
    view = common_view(every, _OF_BODIES, pixels=_FRAME_PIXELS)
    for (solve, _), own in zip(shown, bodies, strict=True):
        name = _named(solve)
        pictures.film.append([
            Picture(f"{time:.3g} s", f"{name} at t = {time:.4g} s", body, view, turnable=False)
            for time, body in zip(times[steps], own, strict=True)
        ])  # fmt: skip


def _round_scale(scale: float) -> float:
    """Return 1 for bodies that move visibly by themselves, else 1, 2 or 5 times a power of ten."""
    if 0.7 <= scale < 2:
        return 1.0
    power = 10.0 ** math.floor(math.log10(scale))
    return next(m * power for m in (5, 2, 1) if scale >= m * power * (1 - 1e-12))


def _add_error_maps(pictures: CasePictures, root: Path, result: CaseResult) -> None:
    """Prepare the error of each solver, the largest first, in one view and one colour scale."""
    bodies = _error_bodies(pictures, root, result)
    if not bodies:
        pictures.notes.append("No picture of the error: no error field is stored for this case.")
        return
    largest = {solver: float(body.values.max()) for solver, body in bodies.items()}
    moved = max((float(one.body.values.max()) for one in pictures.all), default=0.0)
    for solver in [name for name, most in largest.items() if most <= ROUND_OFF * moved]:
        most = number(largest[solver], 2)
        said = f"Error of {solver_title(solver)}: at most {most} m, which is round-off."
        pictures.notes.append(said)
        del bodies[solver]
    if not bodies:
        return
    worst_first = sorted(bodies, key=lambda solver: -largest[solver])
    pictures.say_left_out("error", worst_first[_MOST_MAPS:], _MOST_MAPS)
    shown = {solver: bodies[solver] for solver in worst_first[:_MOST_MAPS]}
    view = common_view(list(shown.values()), _OF_ERRORS, scale_top(list(shown.values())))
    for solver, body in shown.items():
        most = number(largest[solver], 3)
        title = f"error of {solver_title(solver)}, at most {most} m"
        title += " (FAIL)" if solver in result.failing else ""
        description = (
            f"Error of the displacement of {solver_title(solver)} on the undeformed body; "
            f"largest {most} m."
        )
        pictures.error.append(Picture(title, description, body, view))
    _add_tip(pictures, result, shown)


def scale_top(bodies: Sequence[Body]) -> float:
    """Return where the scale of maps ends: no higher than their largest value.

    A solver that errs by far more than the median one would hide all others, and so would a
    single node: both are clipped.
    """
    largest = [float(body.values.max()) for body in bodies]
    peaks = [float(np.quantile(body.values, _PEAK, method="lower")) for body in bodies]
    peaks = sorted(peak or most for peak, most in zip(peaks, largest, strict=True))
    return min(max(largest), _CLIP * peaks[(len(peaks) - 1) // 2])


def _error_bodies(pictures: CasePictures, root: Path, result: CaseResult) -> dict[str, Body]:
    bodies: dict[str, Body] = {}
    for solver in dict.fromkeys(solve.solver for solve in result.solves):
        if (named := result.pictures.get(error_picture(solver))) is None:
            continue
        path = root / named
        if not path.resolve().is_relative_to(root.resolve()) or not path.is_file():
            pictures.notes.append(f"No picture of the error of {solver_title(solver)}: no file.")
            continue
        try:
            bodies[solver] = error_body(path)
        except InputError as error:
            said = f"No picture of the error of {solver_title(solver)}: {error.what}."
            pictures.notes.append(said)
    return bodies


def _add_tip(pictures: CasePictures, result: CaseResult, shown: dict[str, Body]) -> None:
    """Show the surroundings of the tip where a solver errs most, with the elements there."""
    sizes = [solve.size for solve in result.solves if solve.solver in shown and solve.size]
    worst = -1.0
    for (x, y), length in plane_tips(result.scene):
        half = max(_TIP_SHARE * length, _TIP_CELLS * min(sizes, default=0.0))
        window = (x - half, x + half, y - half, y + half)
        parts = {solver: zoomed(body, window) for solver, body in shown.items()}
        parts = {solver: part for solver, part in parts.items() if len(part.triangles)}
        if not parts:
            continue
        top = scale_top(list(parts.values()))
        most = max(float(part.values.max()) for part in parts.values())
        if most <= worst:
            continue
        worst = most
        limits = (0.0, top or 1.0)
        view = View(np.eye(3), window, _TIP_SIZE, _OF_ERRORS, limits, beyond=most > top)
        pictures.tip_at = f"({number(x, 4)}, {number(y, 4)}) m, {number(2 * half, 2)} m wide"
        pictures.tip = [
            Picture(
                f"{solver_title(solver)}, at most {number(float(part.values.max()), 3)} m",
                f"Error of {solver_title(solver)} around the tip {pictures.tip_at}.", part, view,
            )
            for solver, part in parts.items()
        ]  # fmt: skip


def plane_tips(scene: Mapping[str, Any]) -> list[tuple[Points, float]]:
    """Return the ends of cuts inside a rectangle or polygon, each with the length of its cut, m.

    An end on the boundary or on another cut is no tip.
    """
    if (corners := plane_corners(scene.get("geometry") or {})) is None:
        return []
    near = _ON * float(np.ptp(corners, axis=0).max())
    lines = [line for cut in scene.get("cuts") or [] for line in cut_lines(cut)]
    tips = []
    for line in lines:
        others = [other for other in lines if other is not line]
        length = float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
        if np.allclose(line[0], line[-1], rtol=0.0, atol=near):
            continue
        ends = line[[0, -1]]
        from_others = [distance_to_polyline(ends, other) for other in others]
        apart = np.min([distance_to_outline(ends, corners), *from_others], axis=0) > near
        tips += [(end, length) for end in ends[apart & inside_polygon(ends, corners)]]
    return tips
