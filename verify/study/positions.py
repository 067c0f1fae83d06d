"""Ratios of errors over positions of the mesh: how much of a difference is where the cut passes.

Every scene is solved on meshes of nearly equal size (`verify.scene.mesh_position`), which the cut
passes in other places. What the middle 90 % of the ratios leave open is not claimed.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations
from typing import Any

import numpy as np
from pydantic import ValidationError

from verify.errors import InputError
from verify.judge.convergence import ROUND_OFF
from verify.judge.intervals import number_on_finest
from verify.judge.models import changed, on_one_level
from verify.report.evidence import dimension_of
from verify.report.notation import metric_title
from verify.result import CaseResult
from verify.scene import Scene, scene_content
from verify.study.study import Finding, Making, Study

# The default scenes and their levels, chosen before a number was seen. Errors depend most on ends
# of cuts inside elements, so half of the scenes have them: a crack in the plane, a branch, a front
# in space. In the others cuts go through: straight, curved in the plane, curved in space. All are
# at rest, with an exact field or a reference of seconds, and no solver is exact. Every cut is plane
# in parts: `conforming` imprints it, which is not its mesh = remeshed, and programs read it from a
# file. On these levels a solve takes about a second, and an element is a tenth to a thirtieth of
# the body.
SCENES = {
    "benchmark/c1_slit": 1,
    "meeting/branch": 1,
    "fracture/straight_front": 0,
    "statics/f3_inclined": 1,
    "curved/s_shape": 1,
    "curved/swept_s": 1,
}
METRICS = ("displacement_l2", "energy_norm")
ALL = "all"  # scenes together
_RANGE = (0.05, 0.5, 0.95)
_UNTOLD = "the reference cannot tell it from zero"


def spread_of(ratios: Sequence[float]) -> dict[str, Any]:
    """Return ``ratio``, the median, ``low`` and ``high``, percentiles 5 and 95, and ``differs``.

    Percentiles are interpolated between the ordered ratios. Solvers differ where 1 is outside.
    """
    low, middle, high = map(float, np.quantile(ratios, _RANGE))
    return {"ratio": middle, "low": low, "high": high, "differs": not low <= 1.0 <= high}


@dataclass(frozen=True, kw_only=True)
class PositionsStudy(Study):
    """What the study found.

    Attributes
    ----------
    scenes : dict of str to int
        Level of each that was solved.
    dimensions : dict of str to int
        Of the body of each.
    positions : int
    solvers : list of str
    measure : str
        The solver that all others are held against on the page.
    errors : list of dict
        ``scene``, ``position``, ``solver``, ``metric``, ``value`` and the ends of its interval.
    pairs : list of dict
        ``scene`` (or "all"), ``metric``, ``solver`` and ``rival``. The ``ratio`` is the median of
        error over error of the rival; it ``differs`` where 1 is not from ``low`` to ``high``. There
        is also the ``count`` of ratios and the number of ``scenes`` with any.
    ratios : list of dict
        To the measure: ``metric``, ``solver`` and all its ``ratios``.
    missing : list of dict
        ``scene``, ``solver``, ``positions`` without a ratio, and the reason.
    """

    scenes: dict[str, int]
    dimensions: dict[str, int]
    positions: int
    solvers: list[str]
    measure: str
    errors: list[dict[str, Any]]
    pairs: list[dict[str, Any]]
    ratios: list[dict[str, Any]]
    missing: list[dict[str, Any]]

    def rows(self) -> list[dict[str, Any]]:
        """Return the errors, a line each."""
        return self.errors

    def tables(self) -> dict[str, list[dict[str, Any]]]:
        """Return the ratios of pairs as a table of their own."""
        return {"pairs": self.pairs}


def positions_study(
    levels: Sequence[tuple[Scene, int]], solvers: Sequence[str], positions: int, making: Making
) -> PositionsStudy:
    """Solve one level of each scene on several positions of its mesh, and compare the solvers.

    Parameters
    ----------
    levels : sequence of (Scene, int)
        Scenes on structured meshes, each with the level that is solved.
    solvers : sequence of str
        Two at least, with parameters of their solves.
    positions : int
        The first of the 16.
    making : Making

    Raises
    ------
    InputError
        If fewer than two solvers are asked, or a scene has no such positions.
    """
    if len(solvers) < 2:
        raise InputError("one solver has no ratio to another; expected two at least", "--solver")
    for scene, _ in levels:
        if scene.mesh.pattern != "structured":
            said = f"'{scene.name}' has {scene.mesh.pattern} meshes"
            raise InputError(f"{said}; only structured ones have positions", "positions")
    asked = {
        (scene.name, number): _at(scene, level, number)
        for scene, level in levels
        for number in range(positions)
    }
    place = making.place_of(
        "positions", [[scene_content(one) for one in asked.values()], list(solvers)]
    )
    making.announce(f"{len(levels)} scenes on {positions} meshes each, into {place}")
    results = making.run(list(asked.values()), place, solvers)
    found = dict(zip(asked, results, strict=True))
    return summary(found, {scene.name: level for scene, level in levels}, solvers)


def _at(scene: Scene, level: int, number: int) -> Scene:
    """Return one level of a scene on a position of its mesh."""
    if not 0 <= level < scene.mesh.count:
        raise InputError(f"{level}: '{scene.name}' has 0..{scene.mesh.count - 1}", "--level")
    update: dict[str, Any] = {"mesh": {"position": number}}
    if (
        scene.judged_by_exact and scene.analysis.kind == "static"
    ):  # the others are not read, and factors along a front take longest
        update["quantities"] = [{"kind": "strain_energy"}]
    try:
        one = changed(on_one_level(scene, level), "", update)
    except ValidationError as fault:
        what = fault.errors()[0]["msg"].removeprefix("Value error, ")
        raise InputError(what, scene.name) from None
    one.came_from(scene.file, f"{scene.name}@position-{number}")
    return one


def summary(
    found: Mapping[tuple[str, int], CaseResult], levels: Mapping[str, int], solvers: Sequence[str]
) -> PositionsStudy:
    """Join the errors of a run to ratios of pairs, over all scenes and for each.

    A scene and position has no ratio where either is exact to round-off, or where the reference
    cannot tell an error from zero.

    Parameters
    ----------
    found : mapping of (str, int) to CaseResult
        By scene and position.
    levels : mapping of str to int
        By scene.
    solvers : sequence of str
    """
    errors: list[dict[str, Any]] = []
    lost: dict[tuple[str, str], dict[int, str]] = {}
    for (scene, number), result in found.items():
        for metric in METRICS:
            for solver in solvers:
                own = number_on_finest(result, metric, solver)
                if isinstance(own, str):
                    lost.setdefault((scene, solver), {}).setdefault(number, own)
                    continue
                row = {"scene": scene, "position": number, "solver": solver, "metric": metric}
                errors.append({**row, "value": own.value, "low": own.low, "high": own.high})
                if not _counts(errors[-1]):
                    why = "exact to round-off" if own.value <= ROUND_OFF else _UNTOLD
                    why = f"{metric} {own.value:.1e}: {why}"
                    lost.setdefault((scene, solver), {})[number] = why
    pairs = list(_pairs(errors, levels, solvers))
    measure = "conforming" if "conforming" in solvers else solvers[0]
    positions = len({number for _, number in found})
    return PositionsStudy(
        scenes=dict(levels), dimensions={at[0]: dimension_of(r.scene) for at, r in found.items()},
        positions=positions, solvers=list(solvers), measure=measure,
        errors=errors, pairs=pairs,
        ratios=[
            {"metric": metric, "solver": solver,
             "ratios": list(ratios_of(errors, metric, solver, measure).values())}
            for metric in METRICS for solver in solvers if solver != measure
        ],
        missing=[
            {"scene": scene, "solver": solver, "positions": len(own), "reason": own[min(own)]}
            for (scene, solver), own in lost.items()
        ],
        findings=list(_findings(pairs, measure)),
    )  # fmt: skip


def _counts(error: Mapping[str, Any]) -> bool:
    return error["value"] > ROUND_OFF and error["low"] > 0.0


def ratios_of(
    errors: Sequence[Mapping[str, Any]], metric: str, solver: str, rival: str
) -> dict[tuple[str, int], float]:
    """Return error over error of the rival by scene and position, where both count."""
    own, other = (
        {
            (row["scene"], row["position"]): row["value"]
            for row in errors
            if (row["solver"], row["metric"]) == (name, metric) and _counts(row)
        }
        for name in (solver, rival)
    )
    return {at: value / other[at] for at, value in own.items() if at in other}


def _pairs(
    errors: Sequence[Mapping[str, Any]], scenes: Iterable[str], solvers: Sequence[str]
) -> Iterator[dict[str, Any]]:
    for metric in METRICS:
        for solver, rival in permutations(solvers, 2):
            ratios = ratios_of(errors, metric, solver, rival)
            for place in (ALL, *scenes):
                own = {at: ratio for at, ratio in ratios.items() if place in (ALL, at[0])}
                if own:
                    yield {
                        "scene": place, "metric": metric, "solver": solver, "rival": rival,
                        **spread_of(list(own.values())),
                        "count": len(own), "scenes": len({scene for scene, _ in own}),
                    }  # fmt: skip


def _against(pairs: Sequence[dict[str, Any]], metric: str, measure: str) -> list[dict[str, Any]]:
    return [p for p in pairs if (p["scene"], p["metric"], p["rival"]) == (ALL, metric, measure)]


def _findings(pairs: Sequence[dict[str, Any]], measure: str) -> Iterator[Finding]:
    for metric in METRICS:
        for pair in _against(pairs, metric, measure):
            said = "they differ" if pair["differs"] else "they are not told apart"
            text = (
                f"The {metric_title(metric)} over the one of {measure} is {pair['ratio']:.3g} in "
                f"the median and {pair['low']:.3g} to {pair['high']:.3g} in 90 % of "
                f"{pair['count']} ratios, from {pair['scenes']} "
                f"scene{'s' * (pair['scenes'] != 1)}: {said}."
            )
            yield Finding(pair["solver"], text, "they differ where the range excludes 1", None)
