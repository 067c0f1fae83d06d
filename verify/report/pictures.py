"""Pictures of a run: the reference and the solvers with the cut open, and where each errs."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from verify.applied_checks import REFERENCE
from verify.errors import InputError
from verify.report.bodies import Body, deformed_body, error_body, read_stored
from verify.report.notation import ROUND_OFF, number, number_text, solver_title
from verify.report.run_directory import CaseEntry
from verify.report.turntable import packed
from verify.report.view import View, common_view
from verify.result import CaseResult, SolveRecord, Status, error_picture
from verify.solution import Solution

__all__ = ["CasePictures", "Picture", "case_pictures"]

DISPLACEMENT_COLOURS, ERROR_COLOURS = "cividis", "YlOrBr"
_MOST = 4  # bodies side by side
_STILL = 1e-200  # of the body's diagonal: displacements below are none
_WILD = 1e3  # times the smallest displacement beside it: what moves farther is not drawn
_OPENING_SHOWN = 0.15  # of the body's diagonal: what the largest displacement is scaled to


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
    """The pictures of a case and what has to be said about them.

    `deformed` share view, colours and `scale` (displacements are drawn that much enlarged).
    """

    deformed: list[Picture] = field(default_factory=list)
    error: list[Picture] = field(default_factory=list)
    scale: float = 1.0
    notes: list[str] = field(default_factory=list)

    @property
    def all(self) -> list[Picture]:
        """Every picture of the case."""
        return [*self.deformed, *self.error]


def case_pictures(root: Path, entry: CaseEntry) -> CasePictures:
    """Prepare the pictures of a case from what is stored; what is missing becomes a note."""
    pictures = CasePictures()
    if entry.result is None:
        return pictures
    shown: list[tuple[SolveRecord, Solution]] = []
    solves = _finest_solves(entry.result)
    _say_left_out(pictures, "deformed body", [solve.solver for solve in solves[_MOST:]])
    for solve in solves[:_MOST]:
        try:
            shown.append((solve, read_stored(root, solve.solution or "")))
        except InputError as error:
            where = f"{solver_title(solve.solver)}, level {solve.level}"
            pictures.notes.append(f"No picture of {where}: {error.what}.")
    shown = _without_wild(pictures, shown)
    dimensions = {solution.dimension for _, solution in shown}
    if len(dimensions) > 1:
        pictures.notes.append("No pictures side by side: the solutions differ in dimension.")
    elif shown:
        _deformed(pictures, shown)
    elif not pictures.notes:
        pictures.notes.append("No pictures: no solution is stored.")
    _errors(pictures, root, entry.result)
    return pictures


def _finest_solves(result: CaseResult) -> list[SolveRecord]:
    """Return the finest stored solve of each solver: reference, those that fail, the others."""
    finest: dict[str, SolveRecord] = {}
    for solve in sorted(result.solves, key=lambda solve: solve.level):
        if solve.status is Status.SOLVED and solve.solution:
            finest[solve.solver] = solve
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
        defect = solve.notes.get("comparison", "") if not solve.metrics else ""
        if length > _WILD * least:
            defect = f"it moves by up to {number_text(length)} m, the others by far less"
        if not defect:
            kept.append((solve, solution))
            continue
        where = f"{solver_title(solve.solver)}, level {solve.level}"
        pictures.notes.append(f"No picture of {where}: {defect}.")
    return kept


def _deformed(pictures: CasePictures, shown: list[tuple[SolveRecord, Solution]]) -> None:
    everything = np.concatenate([solution.points for _, solution in shown])
    diagonal = float(np.linalg.norm(np.ptp(everything, axis=0)))
    largest = max(float(np.abs(solution.displacement[-1]).max()) for _, solution in shown)
    moves = largest > _STILL * diagonal
    pictures.scale = _round_scale(_OPENING_SHOWN * diagonal / largest) if moves else 1.0
    bodies = [deformed_body(solution, pictures.scale) for _, solution in shown]
    view = common_view(bodies, DISPLACEMENT_COLOURS)
    for (solve, solution), body in zip(shown, bodies, strict=True):
        title = f"{solver_title(solve.solver)}, level {solve.level}"
        when = "" if len(solution.times) == 1 else f" at t = {solution.times[-1]:.4g} s"
        description = (
            f"Deformed body, {title}{when}; displacements drawn {pictures.scale:g} times, "
            f"largest displacement {number_text(float(body.values.max()))} m."
        )
        pictures.deformed.append(Picture(title + when, description, body, view))


def _round_scale(scale: float) -> float:
    """Return 1 for bodies that move visibly by themselves, else 1, 2 or 5 times a power of ten."""
    if 0.7 <= scale < 2:
        return 1.0
    power = 10.0 ** math.floor(math.log10(scale))
    return next(m * power for m in (5, 2, 1) if scale >= m * power * (1 - 1e-12))


def _errors(pictures: CasePictures, root: Path, result: CaseResult) -> None:
    """Prepare the error of each solver, the largest first, in one view and one colour scale."""
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
    if not bodies:
        pictures.notes.append("No picture of the error: no error field is stored for this case.")
        return
    largest = {solver: float(body.values.max()) for solver, body in bodies.items()}
    moved = max((float(one.body.values.max()) for one in pictures.deformed), default=0.0)
    for solver in [name for name, most in largest.items() if most <= ROUND_OFF * moved]:
        most = number(largest[solver], 2)
        said = f"Error of {solver_title(solver)}: at most {most} m, which is round-off."
        pictures.notes.append(said)
        del bodies[solver]
    if not bodies:
        return
    worst_first = sorted(bodies, key=lambda solver: -largest[solver])
    shown, rest = worst_first[:_MOST], worst_first[_MOST:]
    _say_left_out(pictures, "error", rest)
    view = common_view([bodies[solver] for solver in shown], ERROR_COLOURS)
    for solver in shown:
        most = number(largest[solver], 3)
        title = f"error of {solver_title(solver)}, at most {most} m"
        title += " (FAIL)" if solver in result.failing else ""
        description = (
            f"Error of the displacement of {solver_title(solver)} on the undeformed body; "
            f"largest {most} m."
        )
        pictures.error.append(Picture(title, description, bodies[solver], view))


def _say_left_out(pictures: CasePictures, what: str, solvers: Sequence[str]) -> None:
    if solvers:
        names = ", ".join(map(solver_title, solvers))
        pictures.notes.append(f"Without picture of the {what}, {_MOST} being shown: {names}.")
