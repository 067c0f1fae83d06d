"""What runs and studies have left for the sentences of the front page, and ratios taken from it."""

import csv
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from verify.files import read_json
from verify.report.notation import ROUND_OFF, number
from verify.report.run_directory import load_run
from verify.result import CaseResult, Pair, ranked_solvers
from verify.scene import list_cases, load_scenes

MEASURE = "conforming"  # what all solvers are held against
LONG_RUN = "benchmark/c7_spinning"
# runs: all scenes, those that a later commit added, and the long one, which is timed once
JUDGED = ("arena", "late", "long")

_SCENE = re.compile(r"benchmark/c(\d)_")
Row = dict[str, str]


@dataclass(frozen=True)
class Evidence:
    """What runs and studies have left.

    Parameters
    ----------
    results : list of CaseResult
        Of all runs.
    pairs : dict of str to list of Pair
        By the names of `subsets`.
    groups : list of list of str
        Programs that are one discretisation.
    coverage : dict of str to dict
        As in `verify.result.Ranking`.
    positions, benchmark_positions, slivers, claims, speed : list of dict
        Rows of their tables; empty if there are none.
    frames : list of CaseResult
        Cut solids in motion by the step of the real-time engine.
    hand : dict
        Steps of the real-time engine in the thesis study; empty if there are none.
    commands : dict of str to str
        By run or study; a missing entry has none.
    tips : frozenset of str
        Scenes of both studies of positions in which a cut ends inside the body.
    """

    results: list[CaseResult]
    pairs: Mapping[str, Sequence[Pair]] = field(default_factory=dict)
    groups: Sequence[Sequence[str]] = ()
    coverage: Mapping[str, Mapping[str, Sequence[int]]] = field(default_factory=dict)
    positions: list[Row] = field(default_factory=list)
    benchmark_positions: list[Row] = field(default_factory=list)
    slivers: list[Row] = field(default_factory=list)
    claims: list[Row] = field(default_factory=list)
    speed: list[Row] = field(default_factory=list)
    frames: Sequence[CaseResult] = ()
    hand: dict[str, Any] = field(default_factory=dict)
    commands: dict[str, str] = field(default_factory=dict)
    tips: frozenset[str] = frozenset()

    @cached_property
    def solvers(self) -> list[str]:
        """Solvers of the runs."""
        return ranked_solvers(self.results)

    @property
    def long_run(self) -> CaseResult | None:
        """The result of `LONG_RUN`, if there is one."""
        return next((r for r in self.results if r.case == LONG_RUN), None)


def load_evidence(runs: Path, published: Path) -> Evidence:
    """Read what `runs` holds; studies that are not there, from their tables below `published`.

    Nothing is compared: pairs, groups and coverage are left to who judges. The runs ``late`` and
    ``long`` add the scenes that ``arena`` is without.

    Raises
    ------
    InputError
        If there is no run in ``arena``.
    """
    results: dict[str, CaseResult] = {}
    commands, thesis = {"speed": "make bench"}, dict[str, Any]()
    for name in JUDGED:
        if name == "arena" or (runs / name).is_dir():
            run = load_run(runs / name)
            new = [r for r in run.results if r.case not in results]
            results |= {result.case: result for result in new}
            if new:
                commands[name] = str(run.record.get("command") or "unknown")
    frames: list[CaseResult] = []
    if (runs / "frames").is_dir():
        run = load_run(runs / "frames")
        frames, commands["frames"] = run.results, str(run.record.get("command") or "unknown")
    for name in ("positions", "benchmark_positions", "slivers", "thesis"):
        if (record := runs / name / f"{name}.json").is_file():
            found = read_json(record)
            commands[name] = str(found.get("command") or "unknown")
            thesis = found if name == "thesis" else thesis

    def table(name: str, file: str) -> list[Row]:
        for folder in (runs / name, published / name):
            if (folder / file).is_file():
                commands.setdefault(name, f"see {name}/index.md")
                return _rows(folder / file)
        return []

    positions = table("positions", "positions.csv")
    benchmark = table("benchmark_positions", "positions.csv")
    return Evidence(
        results=list(results.values()), positions=positions,
        benchmark_positions=benchmark,
        slivers=table("slivers", "slivers.csv"), claims=table("claims", "claims.csv"),
        speed=_rows(published / "speed.csv"), frames=frames,
        hand={**(thesis.get("hand") or {}), "contended": thesis.get("contended")}
        if thesis.get("hand") else {},
        commands=commands,
        tips=_with_tips({row["scene"] for row in (*positions, *benchmark)}),
    )  # fmt: skip


def _rows(path: Path) -> list[Row]:
    if not path.is_file():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def ends_inside(scene: dict[str, Any]) -> bool:
    """Whether a cut of a scene ends inside the body."""
    return any(cut.get("expected") in ("edge", "inner") for cut in scene.get("cuts") or [])


def moves(result: CaseResult) -> bool:
    """Whether the scene of a result is in motion."""
    return (result.scene.get("analysis") or {}).get("kind") == "dynamic"


def dimension_of(scene: Mapping[str, Any]) -> int:
    """Return the dimension of the body of a scene."""
    geometry = scene.get("geometry") or {}
    if geometry.get("kind") == "file":
        return int(geometry.get("dimension") or 2)
    return 3 if geometry.get("kind") in ("box", "skin") else 2


def is_solid(scene: Mapping[str, Any]) -> bool:
    """Whether the body of a scene is in space, and no slab of a single layer of elements."""
    levels = (scene.get("mesh") or {}).get("cells") or [[2]]
    return dimension_of(scene) == 3 and min(levels[-1]) > 1


def subsets(results: Sequence[CaseResult]) -> dict[str, list[CaseResult]]:
    """Return the results that are compared together: by kind of scene, and the benchmark's scenes.

    The kinds are ``"rest"`` and ``"motion"``, and at rest ``"through"`` and ``"tip"``, by where
    cuts end. The scenes are ``"C1"`` to ``"C8"``, those in motion and in space apart.
    """
    kinds = {
        kind: [r for r in results if _is(kind, moves(r), ends_inside(r.scene))]
        for kind in ("through", "tip", "rest", "motion")
    }
    return kinds | benchmark_scenes(results)


def benchmark_scenes(results: Sequence[CaseResult]) -> dict[str, list[CaseResult]]:
    """Return the members of C1 to C8 by label.

    A scene in the plane and in space, at rest and in motion, counts as two.
    """
    scenes: dict[tuple[str, bool, int], list[CaseResult]] = {}
    for result in results:
        if found := _SCENE.match(result.case):
            key = f"C{found[1]}", moves(result), dimension_of(result.scene)
            scenes.setdefault(key, []).append(result)
    return {
        label + " space" * (d == 3 and (label, moving, 2) in scenes)
        + " motion" * (moving and any((label, False, other) in scenes for other in (2, 3))): own
        for (label, moving, d), own in sorted(scenes.items())
    }  # fmt: skip


def _with_tips(names: set[str]) -> frozenset[str]:
    cases, found = list_cases(), set()
    for name in names:
        path = cases.get(name.partition("[")[0])
        if path and ends_inside(load_scenes(path)[0].model_dump(mode="json", by_alias=True)):
            found.add(name)
    return frozenset(found)


MISSING = "†"  # beside a name or number: of another body


def misses_material(results: Sequence[CaseResult], solver: str) -> bool:
    """Whether an answer of a solver that was compared does not cover the body."""
    own = (s for r in results for s in r.solves if s.solver == solver)
    return any(s.metrics and "coverage" in s.notes for s in own)


@dataclass(frozen=True)
class Beside:
    """One discretisation beside another.

    Parameters
    ----------
    ratio, low, high : float
        Median over the common scenes of the run, and the range over them.
    count : int
        Scenes.
    scatter : tuple of float or None
        Median and 90 % range over positions of the mesh; None where they were not studied.
    meshes : int
        Ratios behind it.
    by_scene : mapping of str to tuple of float
        The same of each scene whose positions were studied.
    outcomes : tuple of int
        Scenes won, tied and lost.
    """

    ratio: float
    low: float
    high: float
    count: int
    scatter: tuple[float, float, float] | None = None
    meshes: int = 0
    by_scene: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    outcomes: tuple[int, int, int] = (0, 0, 0)

    def within(self, least: float, most: float) -> bool:
        """Whether the medians over scenes and over mesh positions lie between two numbers."""
        return all(least <= middle <= most for middle in (self.ratio, *(self.scatter or ())[:1]))

    @property
    def over_scenes(self) -> str:
        """The ratio with its range over scenes."""
        return f"{number(self.ratio, 2)} ({number(self.low, 2)} to {number(self.high, 2)})"

    @property
    def shown(self) -> int:
        """Whether positions of the mesh show more (1) or less (−1) than the rival's, or neither."""
        return 0 if self.scatter is None else _side(self.scatter)

    @property
    def over_positions(self) -> str:
        """The ratio over positions of the mesh, as words; none where they were not studied.

        Two scenes are told one by one: their common range belongs to neither. Of more, those are
        counted whose own range excludes 1.
        """
        if self.scatter is None:
            return ""
        told = {name_of(n): own for n, own in self.by_scene.items()}
        if len(told) == 2 and any(map(_side, told.values())):
            tells = {-1: "below 1", 0: "not told apart", 1: "above 1"}
            words = (f"{n} {_over(o)}, {tells[_side(o)]}" for n, o in told.items())
            return f" Over positions: {'; '.join(words)}"
        if len(told) == 2:
            both = ", ".join(f"{n} {_over(o)}" for n, o in told.items())
            return f" Over positions: {both}, neither told apart"
        said = f" Over positions: {_over(self.scatter)}"
        if len(told) < 2:
            return said
        sides = (({n: o for n, o in told.items() if _side(o) == side}, word)
                 for side, word in ((-1, "below"), (1, "above")))  # fmt: skip
        parts = [f"{word} 1 in {len(own)} of {len(told)} scenes{_named(own)}"
                 for own, word in sides if own]  # fmt: skip
        return f"{said}, {' and '.join(parts) or f'not told apart in {len(told)} scenes'}"

    @property
    def contradicted(self) -> bool:
        """Whether positions of one scene show the opposite of what another shows."""
        return {-1, 1} <= {_side(own) for own in self.by_scene.values()}

    @property
    def written(self) -> str:
        """Numbers with their ranges."""
        text = (
            f"{number(self.ratio, 3)} [{number(self.low, 3)}, {number(self.high, 3)}] over "
            f"{self.count} scene{'s' if self.count != 1 else ''}"
        )
        if any(self.outcomes):
            won, tied, lost = self.outcomes
            text += f" (with exact ones: {won} won, {tied} tied, {lost} lost)"
        if self.scatter is None:
            return f"{text}; mesh scatter not studied"
        middle, low, high = (number(v, 3) for v in self.scatter)
        return f"{text}; {middle} [{low}, {high}] over {self.meshes} positions of meshes"


def _side(scatter: tuple[float, float, float]) -> int:
    return (scatter[1] > 1.0) - (scatter[2] < 1.0)


def _named(scenes: Mapping[str, tuple[float, float, float]]) -> str:
    """Name few scenes with their medians, which a range over all scenes hides."""
    told = [f"{name} {number(own[0], 2)}" for name, own in scenes.items()]
    return f" ({', '.join(told)})" if len(told) < 3 else ""


def _over(scatter: tuple[float, float, float]) -> str:
    middle, low, high = (number(value, 2) for value in scatter)
    return f"{middle} ({low} to {high})"


def name_of(case: str) -> str:
    """Return the label of a scene of the benchmark, the name of another case."""
    found = _SCENE.match(case)
    return f"C{found[1]}" if found else case


def beside(
    evidence: Evidence, kind: str, metric: str, solver: str, rival: str = MEASURE
) -> Beside | None:
    """Hold a solver against another; None where they have no scene in common.

    Parameters
    ----------
    evidence : Evidence
    kind : {"through", "tip", "rest", "motion"}
        Of the scenes: at rest by where their cuts end, all at rest, in motion.
    metric : str
        As in `verify.judge.pairs`.
    solver, rival : str
    """
    pair = pair_in(evidence.pairs.get(kind, ()), metric, solver, rival)
    if pair is None or pair.ratio is None or pair.low is None or pair.high is None:
        return None
    moving = {result.case for result in evidence.results if moves(result)}
    by_scene: dict[str, list[float]] = {}
    for rows in (
        evidence.benchmark_positions,
        evidence.positions,
    ):  # these first, of a scene of both
        by_scene |= mesh_ratios(rows, metric, solver, rival, lambda scene: _is(
            kind, scene in moving, scene in evidence.tips))  # fmt: skip
    ratios = [ratio for own in by_scene.values() for ratio in own]
    scatter = _quantiles(ratios) if ratios else None
    each = {scene: _quantiles(own) for scene, own in by_scene.items()}
    outcomes = pair.wins, pair.ties, pair.losses
    own = pair.ratio, pair.low, pair.high, pair.count
    return Beside(*own, scatter, len(ratios), each, outcomes)


def _quantiles(ratios: Sequence[float]) -> tuple[float, float, float]:
    """Return the median of ratios and the range that holds 90 % of them."""
    middle, low, high = (float(v) for v in np.quantile(ratios, [0.5, 0.05, 0.95]))
    return middle, low, high


def _is(kind: str, moving: bool, tip: bool) -> bool:
    return {"motion": moving, "rest": not moving, "tip": not moving and tip,
            "through": not moving and not tip}[kind]  # fmt: skip


def pair_in(pairs: Sequence[Pair], metric: str, solver: str, rival: str) -> Pair | None:
    """Return a pair of solvers out of many, if it is there."""
    asked = metric, solver, rival
    return next((p for p in pairs if (p.metric, p.solver, p.rival) == asked), None)


def mesh_ratios(
    rows: Sequence[Row], metric: str, solver: str, rival: str, counts: Callable[[str], bool]
) -> dict[str, list[float]]:
    """Return ratios of two solvers by scene that counts, one for each position of the mesh."""
    values: dict[tuple[str, str], dict[str, float]] = {}
    for row in rows:
        if row["metric"] == metric and counts(row["scene"]) and _is_told(row):
            place = values.setdefault((row["scene"], row["position"]), {})
            place[row["solver"]] = float(row["value"])
    ratios: dict[str, list[float]] = {}
    for (scene, _), both in sorted(values.items()):
        if {solver, rival} <= both.keys():
            ratios.setdefault(scene, []).append(both[solver] / both[rival])
    return ratios


def _is_told(row: Row) -> bool:
    """Whether an error is above round-off and the reference tells it from none."""
    return bool(row["value"]) and float(row["value"]) > ROUND_OFF and float(row["low"]) > 0.0
