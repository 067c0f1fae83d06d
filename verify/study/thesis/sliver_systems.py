"""Slivers: the explicit step and the condition of bodies whose cut comes ever nearer to nodes."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from verify.errors import UnsupportedSceneError
from verify.judge.system_numbers import condition_numbers, critical_step, with_uncut_twin
from verify.scene import Scene
from verify.study.measured_scenes import variant_of

_METHODS = (
    "xfem", "xfem mass=consistent", "virtual_node", "subdivision", "snapping_subdivision",
    "snapping",
)  # fmt: skip


@dataclass(frozen=True)
class SliverSystem:
    """One method with slivers of one size.

    Attributes
    ----------
    dimension : int
    method : str
        As a study of slivers takes it.
    size : float
        Distance of the cut from a layer of nodes, in element sizes.
    ratio : float
        Critical explicit step over that of the uncut body.
    condition, scaled : float
        Condition number of the stiffness, and of the stiffness scaled by its diagonal.
    """

    dimension: int
    method: str
    size: float
    ratio: float
    condition: float
    scaled: float


def sliver_systems(
    scenes: Sequence[Scene], methods: Sequence[str] = _METHODS
) -> list[SliverSystem]:
    """Measure the systems of rows of families of slivers, those of ε = 0 left out."""
    found = []
    for method in _METHODS:
        variant = variant_of(method)
        system: Any = getattr(variant.found(), "system", None)
        for scene in scenes:
            if scene.row is None or not 0.0 < scene.row.value < 0.5:
                continue
            try:
                own, whole = with_uncut_twin(system, scene, 0, variant.parameters)
            except UnsupportedSceneError:
                continue
            ratio = critical_step(own) / critical_step(whole)
            raw, scaled = condition_numbers(own)
            found.append(SliverSystem(scene.dimension, method, scene.row.value, ratio, raw, scaled))
    return found


def exponent(steps: Sequence[SliverSystem]) -> float:
    """Slope of log(critical step) over log(size) between the two smallest sizes."""
    two = sorted(steps, key=lambda step: step.size)[:2]
    return float(np.log(two[1].ratio / two[0].ratio) / np.log(two[1].size / two[0].size))
