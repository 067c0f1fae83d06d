"""Maps of the error of each solver: the whole body, and the surroundings of a tip."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.path import Path as Outline
from numpy.typing import NDArray

from verify.errors import InputError
from verify.geometry.nearest import distance_to_polyline
from verify.report.bodies import Body, View, common_view, error_body, zoomed
from verify.report.figures.sketch import cut_lines
from verify.report.notation import ROUND_OFF, number, solver_title
from verify.report.picture import CasePictures, Picture
from verify.result import CaseResult, error_picture

_COLOURS = "YlOrBr"
_MOST = 8  # maps of a case
_PEAK = 0.995  # of the nodes: what single nodes have is no measure of a map
_CLIP = 2.0  # times the peak of the solver in the middle, where the scale ends
_TIP_SHARE = 0.15  # of the cut's length: half of what is shown around a tip
_TIP_CELLS = 4.0  # elements that are shown on each side of a tip at least
_TIP_SIZE = (420, 420)  # in pixels
_PLANE = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def add_error_maps(pictures: CasePictures, root: Path, result: CaseResult) -> None:
    """Prepare the error of each solver, the largest first, in one view and one colour scale."""
    bodies = _stored(pictures, root, result)
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
    pictures.say_left_out("error", worst_first[_MOST:], _MOST)
    shown = {solver: bodies[solver] for solver in worst_first[:_MOST]}
    view = common_view(list(shown.values()), _COLOURS, scale_top(list(shown.values())))
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

    A solver that errs by far more than the one in the middle would leave nothing to see of the
    others, and so would a single node: both are clipped.
    """
    largest = [float(body.values.max()) for body in bodies]
    peaks = [float(np.quantile(body.values, _PEAK, method="lower")) for body in bodies]
    peaks = sorted(peak or most for peak, most in zip(peaks, largest, strict=True))
    return min(max(largest), _CLIP * peaks[(len(peaks) - 1) // 2])


def _stored(pictures: CasePictures, root: Path, result: CaseResult) -> dict[str, Body]:
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
        view = View(*_PLANE, window, _TIP_SIZE, _COLOURS, (0.0, top or 1.0), beyond=most > top)
        pictures.tip_at = f"({number(x, 4)}, {number(y, 4)}) m, {number(2 * half, 2)} m wide"
        pictures.tip = [
            Picture(
                f"{solver_title(solver)}, at most {number(float(part.values.max()), 3)} m",
                f"Error of {solver_title(solver)} around the tip {pictures.tip_at}.", part, view,
            )
            for solver, part in parts.items()
        ]  # fmt: skip


Points = NDArray[np.float64]

_ON = 1e-6  # of the body's size: an end that is closer to a line ends on it


def plane_tips(scene: Mapping[str, Any]) -> list[tuple[Points, float]]:
    """Return the ends of cuts inside a rectangle or polygon, each with the length of its cut, m.

    An end on the boundary or on another cut is no tip.
    """
    body = scene.get("geometry") or {}
    if body.get("kind") == "rectangle":
        (x0, y0), (x1, y1) = body["lower"], body["upper"]
        corners = np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], dtype=float)
    elif body.get("kind") == "polygon":
        corners = np.asarray(body["corners"], dtype=float)
    else:
        return []
    outline = np.vstack([corners, corners[:1]])
    near = _ON * float(np.ptp(corners, axis=0).max())
    lines = [line for cut in scene.get("cuts") or [] for line in cut_lines(cut)]
    tips = []
    for line in lines:
        others = [outline, *(other for other in lines if other is not line)]
        length = float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
        for end in line[[0, -1]]:
            apart = min(_distance(end, other) for other in others) > near
            closed = np.allclose(line[0], line[-1], rtol=0.0, atol=near)
            if apart and not closed and Outline(outline).contains_point(end):
                tips.append((end, length))
    return tips


def _distance(point: Points, line: Points) -> float:
    """Return the distance of a point from a line of straight pieces."""
    return float(distance_to_polyline(point[None], line)[0])
