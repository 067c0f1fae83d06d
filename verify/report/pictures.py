"""Pictures of a case: the reference and the solvers with the cut open, and where each errs."""

import math
from pathlib import Path

import numpy as np

from verify.applied_checks import REFERENCE
from verify.errors import InputError
from verify.report.bodies import common_view, deformed_body, read_stored
from verify.report.error_maps import add_error_maps
from verify.report.notation import number_text, solver_title
from verify.report.picture import CasePictures, Picture
from verify.report.run_directory import CaseEntry
from verify.result import CaseResult, SolveRecord, Status, finest_of
from verify.solution import Solution

__all__ = ["CasePictures", "case_pictures"]

_COLOURS = "cividis"
_MOST = 4  # bodies side by side
_FILMED = 3  # bodies whose output times are shown
_FRAMES = 6  # of a film
_FRAME_PIXELS = 110_000
_STILL = 1e-200  # of the body's diagonal: displacements below are none
_WILD = 1e3  # times the smallest displacement beside it: what moves farther is not drawn
_OPENING_SHOWN = 0.15  # of the body's diagonal: what the largest displacement is scaled to


def case_pictures(root: Path, entry: CaseEntry) -> CasePictures:
    """Prepare the pictures of a case from what is stored; what is missing becomes a note."""
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
        _film(pictures, shown)
    elif not pictures.notes:
        pictures.notes.append("No pictures: no solution is stored.")
    add_error_maps(pictures, root, entry.result)
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
    everything = np.concatenate([solution.points for _, solution in shown])
    diagonal = float(np.linalg.norm(np.ptp(everything, axis=0)))
    largest = max(float(np.abs(solution.displacement[-1]).max()) for _, solution in shown)
    moves = largest > _STILL * diagonal
    pictures.scale = _round_scale(_OPENING_SHOWN * diagonal / largest) if moves else 1.0
    bodies = [deformed_body(solution, pictures.scale) for _, solution in shown]
    view = common_view(bodies, _COLOURS)
    for (solve, solution), body in zip(shown, bodies, strict=True):
        title = _named(solve)
        when = "" if len(solution.times) == 1 else f" at t = {solution.times[-1]:.4g} s"
        description = (
            f"Deformed body, {title}{when}; displacements drawn {pictures.scale:g} times, "
            f"largest displacement {number_text(float(body.values.max()))} m."
        )
        pictures.deformed.append(Picture(title + when, description, body, view))


def _film(pictures: CasePictures, shown: list[tuple[SolveRecord, Solution]]) -> None:
    """Show some bodies at the same output times, from the first to the last."""
    times = shown[0][1].times
    shown = [one for one in shown if np.array_equal(one[1].times, times)][:_FILMED]
    if len(times) < 2:
        return
    steps = np.unique(np.linspace(0, len(times) - 1, _FRAMES).round().astype(int))
    bodies = [[deformed_body(own, pictures.scale, step) for step in steps] for _, own in shown]
    every = [body for own in bodies for body in own]
    view = common_view(every, _COLOURS, pixels=_FRAME_PIXELS)
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
