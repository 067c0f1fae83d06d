"""The sliver study: families of scenes whose cuts come ever nearer to nodes, by any solver.

Of each row errors, condition, iterations of conjugate gradients, explicit step and frequency are
measured; the step of a solver of which only solutions are known is bisected by runs. The findings
say what these do as the parameter of a family falls.
"""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.sparse import csr_array, diags_array
from scipy.stats import linregress
from scipy.stats import t as student

from verify.errors import InputError, UnsupportedSceneError
from verify.printable import one_line, words_of
from verify.report.notation import metric_title
from verify.result import Verdict
from verify.scene import Analysis, Box, Rectangle, Scene, restore_scene
from verify.solvers import Solver
from verify.solvers.interface import refusal_of
from verify.study.measured_scenes import (
    MeasuredStudy,
    Measurement,
    Variant,
    account_findings,
    measured_families,
    measurements,
    missing_solutions,
    variant_of,
)
from verify.study.study import Finding, Making, held
from verify.system import (
    CONDITION,
    FREQUENCY,
    ITERATIONS,
    SCALED,
    STEP,
    System,
    condition_numbers,
    critical_step,
    gradient_iterations,
    lowest_frequency,
    with_uncut_twin,
)

UNKNOWNS = "unknowns of the system"
Row = tuple[str, str, float | None, str]


def measured_row(variant: str, content: dict[str, Any]) -> list[Measurement]:
    """Measure a scene as `measured_scene` does, and the system of its solver."""
    return measurements(variant_of(variant), restore_scene(content), _further)


def _further(solver: Solver, variant: Variant, scene: Scene, level: int) -> Iterator[Row]:
    """Measure condition, critical step and lowest frequency, from the system or by running."""
    if scene.analysis.kinematics != "linear" or scene.analysis.kind != "static":
        return
    system: Any = getattr(solver, "system", None)
    if system is None and getattr(solver, "implicit", False):
        yield STEP, "s", None, "its time integration is implicit: no step is critical"
        return
    if system is None:
        yield _by_running(solver, variant, scene, level)
        return
    try:
        own, whole = with_uncut_twin(system, scene, level, variant.parameters)
    except Exception as problem:  # a guest may raise anything
        refused = isinstance(problem, UnsupportedSceneError | InputError)
        why = str(problem) if refused else f"{type(problem).__name__}: {problem}"
        yield STEP, "s", None, one_line(why)
        return
    # another number of unknowns is another mesh: no curve passes from one to the other
    yield UNKNOWNS, "", float(own.stiffness.shape[0]), ""
    try:
        raw, scaled = condition_numbers(own)
        yield CONDITION, "", raw, ""
        yield SCALED, "", scaled, ""
    except InputError as problem:
        yield SCALED, "", None, str(problem)
    for name, unit, measure, one in (
        (ITERATIONS, "", gradient_iterations, own),
        (STEP, "s", critical_step, own),
        (f"{STEP}, uncut", "s", critical_step, whole),
        # the same for all solvers of one mesh, whatever their masses
        (f"{STEP}, uncut and lumped", "s", critical_step, _lumped(whole)),
        (FREQUENCY, "1/s", lowest_frequency, own),
    ):
        try:
            yield name, unit, measure(one), ""
        except InputError as problem:
            yield name, unit, None, str(problem)


def _lumped(system: System) -> System:
    """Return the system with the row sums of its mass."""
    if system.mass is None:
        return system
    sums = csr_array(diags_array(system.mass.sum(axis=1)))
    return System(system.stiffness, sums, system.fixed)


def _by_running(solver: Solver, variant: Variant, scene: Scene, level: int) -> Row:
    try:
        low, high = step_by_running(solver, scene, level, _guess(scene, level), variant.parameters)
    except InputError as problem:
        return STEP, "s", None, one_line(str(problem))
    except Exception as problem:  # a guest may raise anything
        return STEP, "s", None, words_of(problem)
    return STEP, "s", float((low * high) ** 0.5), f"by running: {low:.4g} to {high:.4g} s"


def _guess(scene: Scene, level: int) -> float:
    """Time in which a pressure wave crosses about a third of an element, s."""
    cells, box = scene.mesh.cells, scene.geometry
    material = scene.material
    assert material.density is not None
    speed = (material.young / material.density) ** 0.5
    if cells is None:
        assert scene.mesh.sizes is not None
        return scene.mesh.sizes[level] / speed / 3.0
    assert isinstance(box, Rectangle | Box)
    sides = np.subtract(box.upper, box.lower) / cells[level]
    return float(sides.min() / speed / 3.0)


_STEPS = 300  # 1 % beyond the critical step a mode grows by e^(0.28 · 300)
_BLOWN_UP = 1e3  # sizes of the body that something moves
_DOUBLINGS, _BISECTIONS = 7, 7


def step_by_running(
    solver: Solver, scene: Scene, level: int, guess: float, parameters: dict[str, Any]
) -> tuple[float, float]:
    """Bracket the largest `time_step` at which a motion of `scene` does not blow up.

    The body starts at rest, and its supports and loads act at once. A run has blown up if a
    displacement is not finite or above a thousand times the body's size. An ArithmeticError,
    ValueError or RuntimeError of the solver counts as a blow-up too; other errors are raised.

    Parameters
    ----------
    guess : float
        s; a first step, from which it is doubled or halved up to 7 times.

    Returns
    -------
    stable, unstable : float
        s; about 1 % apart.

    Raises
    ------
    InputError
        If the solver refuses the motion, no step blows up (it is implicit, or chooses its own
        step), or every step does.
    """
    if scene.material.density is None:
        raise InputError("the scene states no density")
    if refusal := refusal_of(solver, _motion(scene, guess)):
        raise InputError(f"it refuses the motion: {refusal}")

    def stable(step: float) -> bool:
        return _is_stable(solver, _motion(scene, step), level, parameters)

    low = high = guess
    rising = stable(guess)
    for _ in range(_DOUBLINGS):
        low, high = (high, 2.0 * high) if rising else (0.5 * low, low)
        if stable(high if rising else low) is not rising:
            break
    else:
        if rising:
            text = (
                f"no run blows up, up to a step of {high:.2g} s: it is implicit, or takes its own"
            )
            raise InputError(text)
        raise InputError(f"every run blows up, down to a step of {low:.2g} s")
    for _ in range(_BISECTIONS):
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low, high


def _motion(scene: Scene, step: float) -> Scene:
    analysis = Analysis(kind="dynamic", duration=_STEPS * step, time_step=step, outputs=2)
    return scene.model_copy(update={"analysis": analysis, "acceptance": []})


def _is_stable(solver: Solver, scene: Scene, level: int, parameters: dict[str, Any]) -> bool:
    try:
        with np.errstate(all="ignore"):
            solution = solver.solve(scene, level, repetitions=1, **parameters)
    except UnsupportedSceneError as refusal:
        raise InputError(f"it refuses the motion: {refusal}") from None
    except InputError:
        raise
    except (ArithmeticError, ValueError, RuntimeError):  # of a solver that notices it itself
        return False
    size = float(np.ptp(np.asarray(solution.points), axis=0).max())
    largest = np.abs(np.asarray(solution.displacement)).max()
    return bool(np.isfinite(largest) and largest < _BLOWN_UP * size)


_FITTED = (CONDITION, SCALED, STEP)


@dataclass(frozen=True, kw_only=True)
class SliverStudy(MeasuredStudy):
    """What the study found.

    Attributes
    ----------
    growths : list of dict
        Exponent of each series over small ε, with its uncertainty and reason.
    """

    growths: list[dict[str, Any]]


def sliver_study(
    scenes: Sequence[Scene],
    variants: Sequence[Variant],
    making: Making,
    quick: bool = False,
) -> SliverStudy:
    """Solve every row of every family with every solver, and measure.

    Parameters
    ----------
    scenes : sequence of Scene
        Rows of families.
    variants : sequence of Variant
    making : Making
        Side by side; nothing that is measured is a time.
    quick : bool
        For the record.

    Raises
    ------
    InputError
        If no scene is a row of a family.
    """
    families: dict[str, list[Scene]] = {}
    for scene in scenes:
        if scene.row is not None:
            families.setdefault(scene.row.family, []).append(scene)
    if not families:
        raise InputError("no case with a list of values for a parameter; see `verify list`")
    every = measured_families("slivers", measured_row, families, variants, making)
    growths = _growths(every)
    found = list(findings(every, growths))
    return SliverStudy(findings=found, quick=quick, measurements=every, growths=growths)


def _growths(found: Sequence[Measurement]) -> list[dict[str, Any]]:
    series: dict[tuple[str, str, str], list[Measurement]] = {}
    unknowns = {(m.family, m.solver, m.size): m.value for m in found if m.quantity == UNKNOWNS}
    for one in found:
        if one.quantity in _FITTED and one.size is not None:
            series.setdefault((one.family, one.solver, one.quantity), []).append(one)
    return [
        {"family": family, "solver": solver, "quantity": quantity}
        | asdict(growth([m.size or 0.0 for m in own], [m.value for m in own],
                        [unknowns.get((family, solver, m.size)) for m in own]))
        for (family, solver, quantity), own in series.items()
    ]  # fmt: skip


_SMALL = 1e-3  # larger slivers are not in the asymptotic range
_CONFIDENCE = 0.95
_WANDERING = 0.25  # half the spread of local slopes above which there is no single exponent


@dataclass(frozen=True)
class Growth:
    """Exponent p of q ∝ ε^p.

    Attributes
    ----------
    exponent : float or None
        Slope of the regression of log q on log ε.
    uncertainty : float
        The larger of the regression's 95 % half-width and half the spread of the slopes between
        neighbouring points: the first knows scatter, the second knows a bend.
    points : int
        Points fitted.
    reason : str
        Why there is no exponent, or what was left out.
    """

    exponent: float | None
    uncertainty: float
    points: int
    reason: str = ""


def growth(
    sizes: Sequence[float],
    values: Sequence[float | None],
    unknowns: Sequence[float | None] = (),
) -> Growth:
    """Fit the exponent of a quantity over sliver sizes in (0, 1e-3].

    Sizes without a value are left out of the fit and named in the reason. So are those below the
    size at which the number of `unknowns` changes: the cut moves onto nodes, and the law ends.
    """
    counts = unknowns or [None] * len(sizes)
    rows = [
        row
        for row in zip(sizes, values, counts, strict=True)
        if 0.0 < row[0] <= _SMALL * (1 + 1e-9)
    ]
    first = max(rows, key=lambda row: row[0], default=(0.0, None, None))[2]
    ends = max((s for s, _, n in rows if None not in (n, first) and n != first), default=0.0)
    bad = [s for s, v, _ in rows if s > ends and (v is None or not np.isfinite(v) or v <= 0.0)]
    good = sorted((s, v) for s, v, _ in rows if s > ends and s not in bad and v is not None)
    note = f"without a value at ε = {', '.join(f'{s:g}' for s in bad)}" if bad else ""
    if ends:
        note += f"{'; ' if note else ''}other unknowns from ε = {ends:g} on"
    if len(good) < 3:
        text = f"{len(good)} positive values at ε ≤ {_SMALL:g}; a fit with its uncertainty needs 3"
        return Growth(None, 0.0, len(good), "; ".join([text, *filter(None, [note])]))
    x, y = np.log(np.array(good)).T
    line = linregress(x, y)
    width = float(student.ppf(0.5 + 0.5 * _CONFIDENCE, len(x) - 2) * line.stderr)
    local = np.diff(y) / np.diff(x)
    spread = 0.5 * float(np.ptp(local))
    if spread > _WANDERING:
        text = f"no single exponent: local slopes from {local.min():.2f} to {local.max():.2f}"
        return Growth(None, spread, len(good), text)
    return Growth(float(line.slope), max(width, spread), len(good), note)


NEAR = 1e-2  # ε up to which an error shall be that at ε = 0
_NEAR_LIMIT, _FAR_LIMIT = 0.05, 1.25
_ROUND_OFF = 1e-9
_STEP_LIMIT, _SCALED_LIMIT = 0.9, 10.0
_ERRORS = ("displacement_l2", "energy_norm", "jump_l2")
_OTHER = "conforming"
Values = dict[float, float]


def findings(
    measured: Sequence[Measurement], growths: Sequence[dict[str, Any]]
) -> Iterator[Finding]:
    """Judge every family, solver and quantity that has values.

    Parameters
    ----------
    measured : sequence of Measurement
    growths : sequence of dict
        Exponents of the condition numbers, as the study fits them.
    """
    for family in dict.fromkeys(m.family for m in measured):
        own = [m for m in measured if m.family == family and m.size is not None]
        for solver in dict.fromkeys(m.solver for m in own):
            topic = f"{family}, {solver}"
            for error in _ERRORS:
                yield from _near(topic, error, _values(own, solver, error))
                if solver != _OTHER:
                    others = _values(own, _OTHER, error)
                    yield from _far(topic, error, _values(own, solver, error), others)
            yield from _system(topic, own, solver, growths)
            if solver != _OTHER:
                yield from _frequency(topic, own, solver)
            mine = [m for m in own if m.solver == solver]
            yield from account_findings(topic, mine)
            yield from missing_solutions(topic, mine)


def _values(measured: Sequence[Measurement], solver: str, quantity: str) -> Values:
    return {
        m.size: m.value
        for m in measured
        if (m.solver, m.quantity) == (solver, quantity) and m.value is not None
        and m.size is not None
    }  # fmt: skip


def _near(topic: str, error: str, values: Values) -> Iterator[Finding]:
    base = values.get(0.0)
    small = {e: v for e, v in values.items() if 0.0 < e <= NEAR}
    if base is None or not small:
        return
    expected = f"within {_NEAR_LIMIT:.0%} of the error at ε = 0, for ε ≤ {NEAR:g}"
    if max(base, *small.values()) <= _ROUND_OFF:
        text = f"The {metric_title(error)} is round-off at every ε ≤ {NEAR:g}."
        yield Finding(topic, text, expected, Verdict.PASS)
        return
    worst = max(small, key=lambda e: abs(small[e] / base - 1.0))
    off = small[worst] / base - 1.0
    text = (
        f"The {metric_title(error)} at ε = {worst:g} is {small[worst]:.4g}; it is "
        f"{100 * abs(off):.2f} % {'above' if off > 0 else 'below'} the one at ε = 0."
    )
    yield Finding(topic, text, expected, held(abs(off) <= _NEAR_LIMIT))


def _far(topic: str, error: str, values: Values, others: Values) -> Iterator[Finding]:
    both = {e: values[e] / others[e] for e in values if e > NEAR and others.get(e, 0.0) > 0.0}
    if not both or max(values[e] for e in both) <= _ROUND_OFF:
        return
    # a conforming mesh has nodes on the cut, up to 1 - ε of an element apart, and a field that
    # is interpolated between nodes is off by the square of their distance
    closer = {e: max(e, 1.0 - e) ** 2 if error == "jump_l2" else 1.0 for e in both}
    worst = max(both, key=lambda e: both[e] * closer[e])
    limit = _FAR_LIMIT / closer[worst]
    text = f"The {metric_title(error)} at ε = {worst:g} is {both[worst]:.3f} times as large as on "
    text += "the conforming mesh."
    expected = f"at most {_FAR_LIMIT:g}, for ε > {NEAR:g}"
    if error == "jump_l2":
        expected = f"at most {_FAR_LIMIT:g}/(1 - ε)², for ε > {NEAR:g}"
    yield Finding(topic, text, expected, held(both[worst] <= limit))


def _frequency(topic: str, own: Sequence[Measurement], solver: str) -> Iterator[Finding]:
    values, others = (_values(own, name, FREQUENCY) for name in (solver, _OTHER))
    both = {e: values[e] / others[e] - 1.0 for e in values if e in others}
    if both:
        worst = max(both, key=lambda e: abs(both[e]))
        text = f"The {FREQUENCY} is {both[worst]:+.2%} off that of the conforming mesh at ε = "
        yield Finding(topic, f"{text}{worst:g}, where it is most.", "shown", None)


def _system(
    topic: str, own: Sequence[Measurement], solver: str, growths: Sequence[dict[str, Any]]
) -> Iterator[Finding]:
    steps = _values(own, solver, STEP)
    whole = next(iter(_values(own, solver, f"{STEP}, uncut").values()), None)
    if steps and whole:
        least = min(steps, key=lambda e: steps[e])
        text = f"The critical step is least at ε = {least:g}: {steps[least] / whole:.3g} of that "
        kept = held(steps[least] >= _STEP_LIMIT * whole)
        expected = f"at least {_STEP_LIMIT:g} of the uncut body's"
        yield Finding(topic, f"{text}of the uncut body.", expected, kept)
    for quantity in (CONDITION, SCALED):
        values = _values(own, solver, quantity)
        if not values:
            continue
        low, high = min(values.values()), max(values.values())
        law = next(
            (g for g in growths if (g["family"], g["solver"], g["quantity"])
             == (own[0].family, solver, quantity)), {},
        )  # fmt: skip
        grows = f", ∝ ε^{law['exponent']:.2f}" if law.get("exponent") is not None else ""
        text = f"The {quantity} is {low:.3g} to {high:.3g}{grows}."
        if quantity == CONDITION:
            yield Finding(topic, text, "shown", None)
        else:
            expected = f"bounded: at most {_SCALED_LIMIT:g} times its least"
            yield Finding(topic, text, expected, held(high / low <= _SCALED_LIMIT))
