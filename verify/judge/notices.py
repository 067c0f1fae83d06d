"""Notices beside the verdicts: answers that mean little, and quantities that cannot be had."""

from collections.abc import Mapping, Sequence

import numpy as np

from reference.deformation import wave_speed
from verify.compare.hooke import Law, strain_energy
from verify.judge.intervals import NotMeasuredError, error_interval
from verify.result import Notice, NoticeKind, SolveRecord, Status, finest_of
from verify.scene import RatioCheck, Scene
from verify.scene.acceptance import FractureQuantity
from verify.solution import Solution

_ALL = 1.0  # relative error of a solver that answers zero
# Root mean square strain of linear kinematics that no normalised case (stress and stiffness of
# size one) comes near; a body in millimetres under its weight has a thousand times its strain.
_ABSURD = 10.0
# Of a plate with a cut (material/nearly_incompressible) linear elements store too much by a share
# that falls like h and grows like √(1 + λ/μ) = 1/√(1 − 2ν), as the bound of Babuška and Suri (SIAM
# J. Numer. Anal. 29, 1992, 1261) does: 0.65 to 0.79 of h/(L √(1 − 2ν)) at ν = 0.3, 0.45, 0.49,
# 0.499 and h = L/36, of `xfem` and of conforming elements alike. Warned of from a tenth on,
# which is what that case allows; up to ν = 0.45 a pressure does not pay.
_STIFFER, _NEARLY, _TENTH = 0.7, 0.45, 0.1
# Of h/c. Quadratic elements carry waves down to about 2h; those turn by π times this per step, and
# what turns by less than about 1 the time scheme no longer damps. They do not leave a graded mesh.
# A suddenly pressed crack, K off: 5e-4 at 0.3, 1e-3 at 0.22, 3e-2 at 0.11.
_SHORT = 0.25


def doubtful_errors(scene: Scene, records: Sequence[SolveRecord]) -> list[Notice]:
    """Warn of errors above 100 % on a finest level where a solver is judged by ratios alone.

    A ratio compares two solvers: it does not see an error that both have.
    """
    if not all(isinstance(check, RatioCheck) for check in scene.acceptance):
        return []
    found = []
    metrics = dict.fromkeys(check.metric for check in scene.acceptance)
    for record in finest_of(records).values():
        for metric in filter(None, map(record.metric, metrics)):
            try:
                error = error_interval(metric)
            except NotMeasuredError:
                continue
            if error.low > _ALL:
                text = (
                    f"an error of {100 * error.value:.3g} % on level {record.level}; the checks of "
                    "this case are ratios to another solver, which do not judge it"
                )
                found.append(Notice(NoticeKind.WARNING, metric.name, record.solver, text))
    return found


INSIDE_OUT = "cells inside out"  # a note of a solve, from its field


def inside_out_notices(records: Sequence[SolveRecord]) -> list[Notice]:
    """Warn of material that is inside out on a finest level, whatever the solver says of it."""
    return [
        Notice(
            NoticeKind.WARNING, INSIDE_OUT, record.solver,
            f"{said} on level {record.level}: det F < 0, which no body does. Laws without a "
            "barrier have such equilibria; expected smaller load steps or a finer mesh",
        )
        for record in finest_of(records).values()
        if (said := record.notes.get(INSIDE_OUT))
    ]  # fmt: skip


def absurd_strain(
    scene: Scene,
    records: Sequence[SolveRecord],
    solutions: Mapping[str, Mapping[int, Solution]],
    law: Law,
    measure: float,
) -> list[Notice]:
    """Warn of strains of linear kinematics that mean that something is not in SI units.

    Parameters
    ----------
    scene : Scene
    records : sequence of SolveRecord
        The coarsest one that was measured is looked at.
    solutions : mapping of solver to mapping of level to Solution
    law : Law
    measure : float
        Area or volume of the body.
    """
    compared = sorted((r for r in records if r.metrics), key=lambda one: one.level)
    if scene.analysis.kinematics != "linear" or not compared:
        return []
    energy = strain_energy(solutions[compared[0].solver][compared[0].level], law)
    strain = float(np.sqrt(energy / (np.max(law.shear) * measure)))
    if strain <= _ABSURD:
        return []
    text = (
        f"about {100 * strain:.2g} % in the mean, where linear kinematics holds for small strains; "
        "expected lengths in m, stresses and moduli in Pa, densities in kg/m³"
    )
    return [Notice(NoticeKind.WARNING, "strain", None, text)]


def locking_notices(scene: Scene, solutions: Mapping[str, Mapping[int, Solution]]) -> list[Notice]:
    """Warn of linear elements in nearly incompressible material, by each solver's finest answer.

    Parameters
    ----------
    scene : Scene
    solutions : mapping of solver to mapping of level to Solution
    """
    poisson = max(material.poisson for material in scene.material.each)
    # in plane stress the sheet is free to become thicker
    if poisson <= _NEARLY or scene.material.plane == "stress":
        return []
    found = []
    for name, levels in solutions.items():
        finest = levels[max(levels)]
        is_membrane = finest.cells.shape[1] == finest.points.shape[1]
        if finest.order != 1 or is_membrane:
            continue
        across = float(np.ptp(finest.points, axis=0).min()) / finest.size  # not known: nan
        share = _STIFFER / (across * (1.0 - 2.0 * poisson) ** 0.5)
        if share > _TENTH:
            text = (
                f"linear elements at Poisson's ratio {poisson:g}, {across:.3g} across the body, "
                f"may lock: a plate with a cut stores some {100 * share:.2g} % too much on such a "
                "mesh; expected a finer mesh, or a method with a pressure or an averaged dilatation"
            )
            found.append(Notice(NoticeKind.WARNING, "locking", name, text))
    return found


def ringing_factors(scene: Scene, levels: Mapping[int, Solution]) -> list[Notice]:
    """Warn of the factors of a reference whose steps are far shorter than a wave takes across h.

    Parameters
    ----------
    scene : Scene
    levels : mapping of int to Solution
        Of a conforming reference: every level halves step and elements. Empty without one.
    """
    names = [one.name for one in scene.quantities if isinstance(one, FractureQuantity)]
    duration = scene.analysis.duration
    if not names or not levels or duration is None:
        return []
    solution = levels[max(levels)]
    steps = solution.iterations.get("steps")
    if not steps:
        return []
    step, across = duration / steps, float(solution.size / wave_speed(scene.material))
    if step >= _SHORT * across:
        return []
    text = (
        f"the mean step of the reference, {step:.3g} s, is {step / across:.2g} of the time in "
        f"which a pressure wave crosses its elements, {across:.3g} s: short waves stay between "
        "elements of different sizes and ring in these factors. Fewer outputs, a longer time_step "
        "or a smaller reference.size help"
    )
    return [Notice(NoticeKind.WARNING, ", ".join(names), "reference", text)]


def unavailable_quantities(scene: Scene, records: Sequence[SolveRecord]) -> list[Notice]:
    """Make a notice of each quantity that a solver's answer, on some level, does not have.

    Parameters
    ----------
    scene : Scene
    records : sequence of SolveRecord
        Measured. What failed is said elsewhere; its quantities are not missed here.
    """
    solved = [record for record in records if record.status is Status.SOLVED]
    solvers = list(dict.fromkeys(record.solver for record in solved))
    notices = []
    for asked in scene.quantities:
        said: dict[str | None, str | None] = {
            solver: _reason([r for r in solved if r.solver == solver], asked.name)
            for solver in solvers
        }
        texts = set(said.values())
        if len(solvers) > 1 and len(texts) == 1 and None not in texts:
            said = {None: texts.pop()}
        notices += [
            Notice(NoticeKind.UNAVAILABLE, asked.name, solver, text)
            for solver, text in said.items()
            if text is not None
        ]
    return notices


def _reason(own: Sequence[SolveRecord], name: str) -> str | None:
    """Why one solver's answers lack a quantity, with the levels if it is not all of them."""
    lacking: dict[str, list[int]] = {}
    for record in own:
        if record.metric(name) is None:
            reason = record.notes.get(name, "it was not measured")
            lacking.setdefault(reason, []).append(record.level)
    if not lacking:
        return None
    if len(lacking) == 1 and len(next(iter(lacking.values()))) == len(own):
        return next(iter(lacking))
    parts = [f"on {_named_levels(levels)}: {reason}" for reason, levels in lacking.items()]
    having = [record.level for record in own if record.metric(name) is not None]
    return "; ".join(parts) + (f" ({_named_levels(having)} {_has(having)} it)" if having else "")


def _named_levels(levels: Sequence[int]) -> str:
    return f"level{'s' * (len(levels) > 1)} {', '.join(map(str, sorted(levels)))}"


def _has(levels: Sequence[int]) -> str:
    return "have" if len(levels) > 1 else "has"
