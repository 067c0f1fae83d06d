"""Iterations against error: solvers in steps that stop by a count, over iterations and substeps.

Two errors are told apart. The iteration error is the distance from the same steps, solved; the
whole error is the distance from the smallest steps, solved. The smallest are a quarter of any
setting's, which else would have no error of its steps. A solver solves them too, by default the
same one with ``step=solved``. Both answer on one mesh, and nodes are compared. The work of a
setting is the number of iterations in a step of the case: it does not depend on the machine.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.judge.models import coarsest
from verify.scene import Scene, scene_content
from verify.solution import Solution
from verify.solvers.interface import name_with
from verify.study.measured_scenes import Variant, measured_solve
from verify.study.study import Finding, Making, Solved, Study

Array = NDArray[np.float64]
_FINER = 4  # a rule of first order then has a quarter of the error that it judges


@dataclass(frozen=True)
class Grid:
    """The settings that are varied.

    Attributes
    ----------
    iterations, substeps : sequence of int
    names : (str, str)
        Parameters of the solver that they are.
    most : int, optional
        Iterations in a step of the case beyond which a setting is left out.
    works : sequence of int
        Iterations in a step of the case that are shared out over each number of substeps which
        divides them, beside `iterations`.
    """

    iterations: Sequence[int]
    substeps: Sequence[int]
    names: tuple[str, str] = ("iterations", "substeps")
    most: int | None = None
    works: Sequence[int] = ()

    def counts(self, substeps: int) -> list[int]:
        """Return the numbers of iterations of a number of substeps."""
        most = np.inf if self.most is None else self.most
        shared = {work // substeps for work in self.works if work % substeps == 0}
        return [count for count in sorted({*self.iterations} | shared) if count * substeps <= most]

    def set(self, variant: Variant, iterations: int | None, substeps: int) -> str:
        """Return the name of the variant with a setting; without iterations those that it has."""
        given = {**variant.parameters, self.names[1]: substeps}
        if iterations is not None:
            given[self.names[0]] = iterations
        return name_with(variant.solver, given)


@dataclass(frozen=True)
class Setting:
    """One setting and what came out.

    Attributes
    ----------
    case : str
    iterations : int or None
        None of the steps that are solved.
    substeps : int
    time_step : float or None
        s, if the case states one.
    iteration_error, whole_error : float or None
        Largest distance (RMS over nodes) at an output, over the largest displacement (RMS) of the
        solved steps: of the same, and of the smallest size. None if there is no answer.
    energy_drift : float or None
        Of the energy in play, by the energies of the scene's law.
    quantities : dict of str to float
        Of the scene, with their units.
    seconds : float or None
        As the solver measures itself, first call apart.
    reason : str
        Why there is no answer.
    """

    case: str
    iterations: int | None
    substeps: int
    time_step: float | None
    iteration_error: float | None = None
    whole_error: float | None = None
    energy_drift: float | None = None
    quantities: dict[str, float] = field(default_factory=dict)
    seconds: float | None = None
    reason: str = ""

    @property
    def work(self) -> int:
        """Iterations in a step of the case; none where steps are solved."""
        return (self.iterations or 0) * self.substeps


@dataclass(frozen=True, kw_only=True)
class IterationsStudy(Study):
    """What the study found; `left_out` says of the other cases why they are not compared."""

    solver: str
    truth: str
    tolerance: float
    settings: list[Setting]
    left_out: dict[str, str]

    def rows(self) -> list[dict[str, Any]]:
        """Return the lines of its table."""
        names = dict.fromkeys(name for one in self.settings for name in one.quantities)
        lines = [asdict(one) for one in self.settings]
        return [{**names, **line.pop("quantities"), **line} for line in lines]


def iterations_study(
    scenes: Sequence[Scene], variant: Variant, truth: Variant, grid: Grid, tolerance: float,
    making: Making,
) -> IterationsStudy:  # fmt: skip
    """Solve the coarsest level of each scene by every setting, one after the other.

    Parameters
    ----------
    scenes : sequence of Scene
        In motion, or at rest where the solver comes to rest by steps.
    variant, truth : Variant
        The solver, and who solves the same steps.
    grid : Grid
    tolerance : float
        Relative error that is good enough.
    making : Making

    Raises
    ------
    InputError
        If the truth has no answer on the nodes of the solver in any scene.
    """
    asked = sorted(grid.substeps)
    truths = {count: grid.set(truth, None, count) for count in (*asked, _FINER * asked[-1])}
    counted = {
        (count, iterations): grid.set(variant, iterations, count)
        for count in asked
        for iterations in grid.counts(count)
    }
    names = tuple(dict.fromkeys([*truths.values(), *counted.values()]))
    place = making.place_of("iterations", [[scene_content(scene) for scene in scenes], names])
    making.announce(f"{len(names)} settings of {len(scenes)} cases, into {place}")
    settings: list[Setting] = []
    without: dict[str, InputError] = {}
    for found in making.solved([coarsest(scene, 1) for scene in scenes], place, names):
        try:
            settings += _settings(found, truths, counted)
        except InputError as problem:  # of this scene alone
            without[found.scene.name] = problem
    if not settings:
        raise next(iter(without.values()))
    left_out = [
        Finding(f"{case}, {variant.label}", f"Not compared: {problem.what}.", "", None)
        for case, problem in without.items()
    ]
    return IterationsStudy(
        solver=variant.label, truth=truth.label, tolerance=tolerance, settings=settings,
        left_out={case: problem.what for case, problem in without.items()},
        findings=[*_findings(variant.label, settings, tolerance, grid.names), *left_out],
    )  # fmt: skip


def _settings(
    found: Solved, truths: Mapping[int, str], counted: Mapping[tuple[int, int], str]
) -> Iterator[Setting]:
    """Measure every setting of one scene; last of each number of substeps, the steps solved."""
    solved = {count: _truth(found, name) for count, name in truths.items()}
    finest, step = solved[max(solved)], found.scene.analysis.time_step
    scale = max(_rms(frame) for frame in finest.displacement)
    for count, own in solved.items():
        named = {made: name for (parts, made), name in counted.items() if parts == count}
        for iterations, name in [*named.items(), (None, truths[count])]:
            one = Setting(found.scene.name, iterations, count, step and step / count)
            if answer := found.solutions.get(name, {}).get(0):
                errors = [_distance(answer, other) / scale for other in (own, finest)]
                one = replace(one, iteration_error=errors[0], whole_error=errors[1])
                yield _measured(found.scene, answer, one)
            else:
                yield replace(one, reason=found.reason(name))


def _truth(found: Solved, name: str) -> Solution:
    if solution := found.solutions.get(name, {}).get(0):
        return solution
    raise InputError(f"'{name}' has no answer: {found.reason(name)}", "--truth")


def _rms(field: Array) -> float:
    return float(np.sqrt((field**2).sum(axis=1).mean()))


_SAME = 1e-9  # of the body: nodes as near are one


def _distance(answer: Solution, other: Solution) -> float:
    same = other.displacement.shape == answer.displacement.shape
    if same:  # in one order too, which cells tell of the nodes that are double on cuts
        off = np.abs(other.points - answer.points).max()
        same = off <= _SAME * np.ptp(answer.points, axis=0).max() and np.array_equal(
            np.sort(other.cells, axis=1), np.sort(answer.cells, axis=1)
        )
    if not same:
        raise InputError(f"{len(other.points)} nodes; the solver has others", "--truth")
    return max(_rms(a - b) for a, b in zip(answer.displacement, other.displacement, strict=True))


def _measured(scene: Scene, answer: Solution, one: Setting) -> Setting:
    measured = measured_solve(scene, "solver", 0, answer)
    asked = [measured.metric(quantity.name) for quantity in scene.quantities]
    found = {
        m.name if m.unit == "1" else f"{m.name}, {m.unit}": m.value for m in asked if m is not None
    }
    drift = measured.metric("energy_drift")
    return replace(
        one,
        energy_drift=None if drift is None else drift.value,
        quantities=found,
        seconds=sum(min(phase) for phase in answer.timings.values() if phase),
    )


def _findings(
    label: str, settings: Sequence[Setting], tolerance: float, names: tuple[str, str]
) -> list[Finding]:
    counted, found = [one for one in settings if one.iterations is not None], []
    limit = f"{tolerance:.2g} of the largest displacement; shown, not judged"
    for case in dict.fromkeys(one.case for one in counted):
        mine = [one for one in counted if one.case == case]
        for substeps in dict.fromkeys(one.substeps for one in mine):
            series = [one for one in mine if one.substeps == substeps]
            if text := _said(series, tolerance, names[0]):
                found.append(Finding(f"{case}, {label}, {names[1]} {substeps}", text, limit, None))
        for kind, text in _over_substeps(mine, names):
            found.append(Finding(f"{case}, {label}, {kind}", text, limit, None))
        good = [one for one in mine if _inside(one.whole_error, tolerance)]
        text = f"No setting is within {tolerance:.2g} of the smallest steps, solved."
        if good:
            best = min(good, key=lambda one: one.work)
            text = (
                f"The least work within {tolerance:.2g} of the smallest steps, solved, is "
                f"{best.work} iterations in a step of the case: {best.iterations} in each of "
                f"{best.substeps}."
            )
        found.append(Finding(f"{case}, {label}, all in all", text, limit, None))
    return found


def _said(series: Sequence[Setting], tolerance: float, name: str) -> str:
    """Say from which number of iterations on the same steps are met; empty without an answer."""
    own = [one for one in series if not one.reason]
    if not own:
        return ""
    late = [one for one in own if not _inside(one.iteration_error, tolerance)]
    rest = own[own.index(late[-1]) + 1 :] if late else own
    step = "" if own[0].time_step is None else f" of {own[0].time_step:.4g} s"
    text = f"No number of {name} up to {own[-1].iterations} is"
    if rest:
        text = f"From {rest[0].iterations} {name} on the answer is"
    text += f" within {tolerance:.2g} of the same steps{step}, solved"
    text += f"; {own[0].iterations} are off by {_share(own[0].iteration_error)}"
    if len(own) > 1:
        text += f", {own[-1].iterations} by {_share(own[-1].iteration_error)}"
    text += "."
    missing = [str(one.iterations) for one in series if one.reason]
    return text + (f" Without an answer: {', '.join(missing)}." if missing else "")


def _over_substeps(
    settings: Sequence[Setting], names: tuple[str, str]
) -> Iterator[tuple[str, str]]:
    """Tell the whole error over substeps: by the same work, and by as many iterations in each."""
    found: dict[tuple[str, int], list[tuple[int, float]]] = {}
    for one in settings:
        if one.iterations is not None and one.whole_error is not None:
            for key in (("a step of the case", one.work), ("each", one.iterations)):
                found.setdefault(key, []).append((one.substeps, one.whole_error))
    for (where, count), series in found.items():
        if len(series) > 1:
            shares = ", ".join(f"{_share(error)} with {parts}" for parts, error in series)
            best = min(series, key=lambda place: place[1])[0]
            text = f"Over {names[1]} the whole error is {shares}: least with {best}."
            yield f"{count} {names[0]} in {where}", text


def _inside(error: float | None, tolerance: float) -> bool:
    return error is not None and error <= tolerance


def _share(error: float | None) -> str:
    if error is None:
        return "an unknown part"
    return f"{100 * error:.3g} %" if error < 1.0 else f"{error:.3g} times the largest displacement"
