"""A scene whose first cut grows step by step."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.scene import PolylineCut, Scene


def growing_scenes(scene: Scene, steps: int) -> list[Scene]:
    """Return `scene` with its first cut at 1/`steps`, 2/`steps`, …, all of its length.

    Parameters
    ----------
    scene : Scene
        Plane, static, judged by a conforming reference; its first cut is a polyline.
    steps : int
        At least 1.

    Returns
    -------
    list of Scene
        Named after the case with the step behind; without acceptance.

    Raises
    ------
    InputError
        If the scene has no such cut, or is judged by an exact solution (which holds for the
        whole cut only).
    """
    where = str(scene.file or scene.name)
    first = scene.cuts[0] if scene.cuts else None
    if not isinstance(first, PolylineCut):
        raise InputError("the first cut of the scene must be a polyline, which is grown", where)
    if scene.exact is not None:
        raise InputError("a scene with an exact solution has no shorter cuts", where)
    grown = []
    for step in range(1, steps + 1):
        points = _beginning(np.array(first.points, dtype=float), step / steps)
        expected = first.expected if step == steps else None
        content = scene.model_dump(mode="json", by_alias=True)
        content |= {"acceptance": [], "known_findings": [], "tags": []}
        content["cuts"][0] |= {"points": points, "expected": expected}
        one = Scene.model_validate(content)
        one._file = scene.file or Path(f"{scene.name}.toml")
        one._name = f"{scene.name}@{step}"
        grown.append(one)
    return grown


def _beginning(points: NDArray[np.float64], share: float) -> list[list[float]]:
    """Return the polyline's first part, by length."""
    if share >= 1.0:
        return [list(map(float, point)) for point in points]
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    reached = np.concatenate([[0.0], np.cumsum(lengths)])
    end = share * reached[-1]
    whole = int(np.searchsorted(reached, end, side="left"))
    part = (end - reached[whole - 1]) / lengths[whole - 1]
    tip = points[whole - 1] + part * (points[whole] - points[whole - 1])
    return [list(map(float, point)) for point in [*points[:whole], tip]]
