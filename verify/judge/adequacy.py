"""Cost of a scene's model in error: its reference beside that of a cheaper or richer model."""

from collections.abc import Mapping

import numpy as np

from verify.compare.body import body_of
from verify.compare.hooke import law_of
from verify.errors import InputError, UnsupportedSceneError
from verify.judge.changed_scenes import at_rest, with_kinematics
from verify.judge.intervals import quotient_half_width
from verify.judge.reference import compared_size, conforming_reference
from verify.result import CaseResult, Notice, NoticeKind
from verify.scene import Box, Polygon, Rectangle, Scene
from verify.solution import Solution

_DIVISIONS = {2: 12, 3: 4}  # of the body's extent: elements of a reference that names no size
_COARSER = {2: 3.0, 3: 1.5}
_OTHER = {"linear": "corotational", "corotational": "linear"}
_WORDS = {"linear": "linear kinematics", "corotational": "finite rotation"}


def other_scene(scene: Scene, model: str) -> Scene:
    """Return a scene with the other kinematics, or (``"motion"``) at rest under its last loads.

    Its reference is coarser.

    Raises
    ------
    UnsupportedSceneError
        If it has no such scene.
    """
    if model == "motion":
        return _coarser(at_rest(scene))
    return _coarser(with_kinematics(scene, _OTHER[scene.analysis.kinematics]))


def _coarser(scene: Scene) -> Scene:
    """Return a scene whose reference is coarser and has three levels: per cents are wanted."""
    levels: dict[str, object] = {"levels": 3, "max_levels": None}
    size = scene.reference.size
    if size is None:
        body = scene.geometry
        if isinstance(body, Rectangle | Polygon):
            x, y = body.outline().T
            area = 0.5 * abs(float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)))
            size = area**0.5 / _DIVISIONS[2]
        elif isinstance(body, Box):
            size = float(np.prod(np.subtract(body.upper, body.lower))) ** (1 / 3) / _DIVISIONS[3]
    if size is not None:
        levels["size"] = _COARSER[scene.dimension] * size
    other = scene.model_copy(update={"reference": scene.reference.model_copy(update=levels)})
    other._file, other._name = scene.file, scene.name
    return other


def adequacy_notice(
    scene: Scene, model: str, solutions: Mapping[int, Solution], result: CaseResult
) -> Notice:
    """State in one line how far the cheaper model is off in the quantities of both references.

    Parameters
    ----------
    scene : Scene
    model : str
        A name of `Adequacy.models`.
    solutions : mapping of int to Solution
        The reference's of the other model, by level.
    result : CaseResult
        Of the case: what its own reference says of the quantities.
    """
    cheap, rich, own_is_cheap = _models(scene, model)
    try:
        differences = _differences(scene, model, solutions, result, own_is_cheap)
    except (InputError, UnsupportedSceneError) as problem:
        text = f"{cheap} was not measured against {rich}: {problem}"
        return Notice(NoticeKind.ADEQUACY, model, None, text)
    said = ", ".join(_share(*pair) + f" in {name}" for name, pair in differences)
    against = f"against {rich}" if own_is_cheap else f"instead of {rich}"
    return Notice(NoticeKind.ADEQUACY, model, None, f"{cheap} {against}: {said}")


def _models(scene: Scene, model: str) -> tuple[str, str, bool]:
    """Words for the cheaper and the richer model, and whether the scene asks for the cheaper."""
    if model == "motion":
        return "the static answer", "the end of the motion", False
    return _WORDS["linear"], _WORDS["corotational"], scene.analysis.kinematics == "linear"


def _differences(
    scene: Scene,
    model: str,
    solutions: Mapping[int, Solution],
    result: CaseResult,
    own_is_cheap: bool,
) -> list[tuple[str, tuple[float, float]]]:
    """Differences and their half-widths over the richer values, by quantity, the largest first."""
    other = other_scene(scene, model)
    body = body_of(other)
    size = min((compared_size(one, body) for one in solutions.values()), default=body.size / 50)
    known = conforming_reference(other, solutions, body, law_of(other), size).quantities
    found = []
    for asked in scene.quantities:
        metric = next(
            (m for solve in result.solves if (m := solve.metric(asked.name)) and m.source), None
        )
        late = model != "motion" or getattr(asked, "time", None) is None
        if metric is None or metric.reference is None or asked.name not in known or not late:
            continue
        own = metric.reference, metric.uncertainty
        (poor, poor_width), (rich, width) = (
            (own, known[asked.name]) if own_is_cheap else (known[asked.name], own)
        )
        if rich == 0.0:
            continue
        share = quotient_half_width(poor - rich, poor_width + width, rich, width)
        found.append((asked.name, (abs(poor - rich) / abs(rich), share)))
    if not found:
        raise UnsupportedSceneError("no quantity of the case is known of both")
    return sorted(found, key=lambda row: -row[1][0])


def _share(error: float, width: float) -> str:
    """Write an error in per cent, to two digits; or that it is below what is known."""
    if not np.isfinite(error + width):
        return "an unknown difference"
    if error <= width:
        return f"no more than {100 * (error + width):.2g} %"
    digits = max(0, 1 - int(np.floor(np.log10(100 * error))))
    return f"{100 * error:.{digits}f} % (± {100 * width:.1g} %)"
