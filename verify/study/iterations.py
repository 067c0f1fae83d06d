"""Iterations against error: solvers of motion that stop by a count, over iterations and substeps.

Two errors are told apart. The iteration error is the distance from the same steps, solved; the
whole error is the distance from the smallest steps, solved. A solver solves them too, by default
the same one with ``step=solved``. Both answer on one mesh, and nodes are compared.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.judge.accuracy import assess_accuracy
from verify.judge.models import coarsest
from verify.result import SolveRecord, Status
from verify.scene import Scene, scene_content
from verify.solution import Solution
from verify.solvers.interface import name_with
from verify.study.measured_scenes import Variant
from verify.study.study import Finding, Making, Solved, Study

Array = NDArray[np.float64]


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
    """

    iterations: Sequence[int]
    substeps: Sequence[int]
    names: tuple[str, str] = ("iterations", "substeps")
    most: int | None = None

    def counts(self, substeps: int) -> list[int]:
        """Return the numbers of iterations of a number of substeps."""
        most = np.inf if self.most is None else self.most
        return [count for count in sorted(self.iterations) if count * substeps <= most]

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
        Of the scene.
    seconds : float or None
        As the solver measures itself, first call apart.
    reason : str
        Why there is no answer.
    """

    iterations: int | None
    substeps: int
    time_step: float | None
    iteration_error: float | None = None
    whole_error: float | None = None
    energy_drift: float | None = None
    quantities: dict[str, float] = field(default_factory=dict)
    seconds: float | None = None
    reason: str = ""


@dataclass(frozen=True, kw_only=True)
class IterationsStudy(Study):
    """What the study found."""

    case: str
    solver: str
    truth: str
    tolerance: float
    settings: list[Setting]

    def rows(self) -> list[dict[str, Any]]:
        """Return the lines of its table."""
        lines = [asdict(one) for one in self.settings]
        return [{**line.pop("quantities"), **line} for line in lines]


def iterations_study(
    scene: Scene,
    variant: Variant,
    truth: Variant,
    grid: Grid,
    tolerance: float,
    making: Making,
) -> IterationsStudy:
    """Solve the scene's coarsest level by every setting, one after the other.

    Parameters
    ----------
    scene : Scene
        Dynamic.
    variant, truth : Variant
        The solver, and who solves the same steps.
    grid : Grid
    tolerance : float
        Relative error that is good enough.
    making : Making

    Raises
    ------
    InputError
        If the scene does not move, or the truth has no answer on the nodes of the solver.
    """
    if scene.analysis.kind != "dynamic":
        raise InputError(f"{scene.name} does not move; a dynamic analysis is needed")
    truths = {count: grid.set(truth, None, count) for count in sorted(grid.substeps)}
    counted = {
        (count, iterations): grid.set(variant, iterations, count)
        for count in truths
        for iterations in grid.counts(count)
    }
    names = tuple(dict.fromkeys([*truths.values(), *counted.values()]))
    place = making.place_of("iterations", [scene_content(scene), names])
    making.announce(f"{len(names)} settings of {scene.name}, into {place}")
    (found,) = making.solved([coarsest(scene, 1)], place, names)
    solved = {count: _truth(found, name) for count, name in truths.items()}
    finest = solved[max(solved)]
    scale = max(_rms(frame) for frame in finest.displacement)
    settings = []
    for count, own in solved.items():
        step = scene.analysis.time_step
        for iterations in [*grid.counts(count), None]:
            name = truths[count] if iterations is None else counted[count, iterations]
            one = Setting(iterations, count, None if step is None else step / count)
            if answer := found.solutions.get(name, {}).get(0):
                errors = [_distance(answer, other) / scale for other in (own, finest)]
                one = replace(one, iteration_error=errors[0], whole_error=errors[1])
                one = _measured(scene, answer, one)
            else:
                one = replace(one, reason=found.reason(name))
            settings.append(one)
    return IterationsStudy(
        case=scene.name, solver=variant.label, truth=truth.label, tolerance=tolerance,
        settings=settings, findings=_findings(variant.label, settings, tolerance, grid.names),
    )  # fmt: skip


def _truth(found: Solved, name: str) -> Solution:
    if solution := found.solutions.get(name, {}).get(0):
        return solution
    raise InputError(f"'{name}' has no answer: {found.reason(name)}", "--truth")


def _rms(field: Array) -> float:
    return float(np.sqrt((field**2).sum(axis=1).mean()))


def _distance(answer: Solution, other: Solution) -> float:
    if other.displacement.shape != answer.displacement.shape:
        raise InputError(f"{len(other.points)} nodes; the solver has others", "--truth")
    return max(_rms(a - b) for a, b in zip(answer.displacement, other.displacement, strict=True))


def _measured(scene: Scene, answer: Solution, one: Setting) -> Setting:
    record = SolveRecord(scene.name, "solver", 0, Status.SOLVED, size=answer.size)
    (measured,) = assess_accuracy(scene, [record], {"solver": {0: answer}}, None).solves
    names = [asked.name for asked in scene.quantities]
    found = {name: m.value for name in names if (m := measured.metric(name)) is not None}
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
    counted = [one for one in settings if one.iterations is not None]
    found = []
    for substeps in dict.fromkeys(one.substeps for one in counted):
        own = [one for one in counted if one.substeps == substeps and not one.reason]
        if not own:
            continue
        late = [one for one in own if not _inside(one.iteration_error, tolerance)]
        rest = own[own.index(late[-1]) + 1 :] if late else own
        step = "" if own[0].time_step is None else f" of {own[0].time_step:.4g} s"
        text = f"No number of {names[0]} up to {own[-1].iterations} is"
        if rest:
            text = f"From {rest[0].iterations} {names[0]} on the answer is"
        text += f" within {tolerance:.2g} of the same steps{step}, solved"
        text += f"; {own[0].iterations} are off by {_percent(own[0].iteration_error)}"
        text += f", {own[-1].iterations} by {_percent(own[-1].iteration_error)}."
        missing = [o.iterations for o in counted if o.substeps == substeps and o.reason]
        if missing:
            text += f" Without an answer: {', '.join(map(str, missing))}."
        about = f"{label}, {names[1]} {substeps}"
        found.append(Finding(about, text, f"{tolerance:.2g}; shown, not judged", None))
    good = [one for one in counted if one.seconds and _inside(one.whole_error, tolerance)]
    text = f"No setting is within {tolerance:.2g} of the smallest steps, solved."
    if good:
        best = min(good, key=lambda one: one.seconds or 0.0)
        text = (
            f"The cheapest setting within {tolerance:.2g} of the smallest steps, solved, has "
            f"{best.iterations} {names[0]} and {names[1]} {best.substeps}: {best.seconds:.3g} s."
        )
    return [*found, Finding(f"{label}, all in all", text, "shown, not judged", None)]


def _inside(error: float | None, tolerance: float) -> bool:
    return error is not None and error <= tolerance


def _percent(error: float | None) -> str:
    return "an unknown part" if error is None else f"{100 * error:.3g} %"
