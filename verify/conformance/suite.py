"""The suite: every check on one solver, each with the argument for its limit."""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from verify.compare.hooke import hooke, law_of
from verify.compare.motion_account import MotionAccount, energy_scale, motion_account, total_energy
from verify.conformance import scenes
from verify.conformance.check import (
    EXACT,
    Check,
    CheckResult,
    Finding,
    Solutions,
    State,
    distance,
    evaluate,
    is_field,
    weight_imbalance,
)
from verify.conformance.meeting import (
    end_check,
    interface_check,
    parted_checks,
    pulled_halves_in_space,
)
from verify.conformance.trials import Outcome, Trial, solve_trials
from verify.errors import InputError
from verify.result import Status
from verify.scene.strict import nearest
from verify.solution import Solution
from verify.solvers.interface import parameters_in

_RIGID = 1e-6  # of the height of the fall: what 40 steps of an iterative solver may add up to


def checks(folder: Path) -> list[Check]:
    """Return all checks; mesh files are written into `folder`."""
    return [
        _uncut_linear(2),
        _uncut_linear(3),
        _rigid("translation", 2),
        _rigid("rotation", 2),
        _rigid("translation", 3),
        _rigid("rotation", 3),
        _turned(2),
        _turned(3),
        is_field(
            "parted-3d", "the halves of a cut cube part without strain",
            *scenes.parted_halves(), 0.0,
        ),
        is_field(
            "cut-patch", "each side of a cut takes its own strain (patch test on a cut)",
            *scenes.strained_sides(),
        ),
        *parted_checks(),
        end_check(),
        _energy_account(),
        _closed_cut(),
        is_field(
            "traction",
            "two halves under a traction contract each for itself, with the material's constants",
            *scenes.pulled_halves(),
        ),
        is_field(  # whoever is too stiff passes all prescribed motions
            "traction-3d", "two halves of a cube under a traction contract each for itself (3D)",
            *pulled_halves_in_space(),
        ),
        is_field(
            "two-materials", "of two materials each strains with its own constants, beside a cut",
            *scenes.two_materials(),
        ),
        interface_check(),
        _hanging_halves(),
        _freed_half(),
        energy_in_motion(),
        energy_in_motion(shaken=True),
        _mirrored_cut(),
        _renumbering(folder),
        _repeatability(),
        _free_piece(),
        _refusals(),
    ]  # fmt: skip


def _uncut_linear(dimension: int) -> Check:
    scene, field = scenes.uncut_linear(dimension)
    gradient = field(np.eye(dimension), np.eye(dimension)).T[None]
    energy = float(hooke(scene.material).energy_density(gradient)[0])
    claim = f"without a cut a linear field is reproduced ({dimension}D)"
    return is_field(f"uncut-{dimension}d", claim, scene, field, energy)


def _rigid(kind: str, dimension: int) -> Check:
    words = {"translation": "a translation", "rotation": "an infinitesimal rotation"}[kind]
    claim = f"{words} of a cut body costs no energy ({dimension}D)"
    return is_field(f"rigid-{kind}-{dimension}d", claim, *scenes.rigid(kind, dimension), 0.0)


def _turned(dimension: int) -> Check:
    """At finite rotation the engineering strain does not vanish: the field is all that is judged.

    The strain energy is the solver's own account, if it keeps one.
    """
    scene, field = scenes.turned(dimension)
    claim = f"a finite rotation of a cut body costs no energy ({dimension}D, corotational)"
    check = is_field(f"finite-rotation-{dimension}d", claim, scene, field)
    judge_field = check.judge
    assert judge_field is not None

    def judge(solutions: Solutions) -> Finding:
        found = judge_field(solutions)
        (solution,) = solutions.values()
        stated = solution.ledger.get("strain")
        if stated is None or (found.limit is not None and found.observed > found.limit):
            return found
        energy = abs(float(stated[-1]))
        allowed = 400 * EXACT**2 * scenes.YOUNG * float(np.abs(solution.displacement).max()) ** 2
        note = f"strain energy {energy:.3g} where there is none"
        return found if energy <= allowed else Finding(energy, allowed, note)

    return replace(check, judge=judge)


def _freed_half() -> Check:
    scene, gravity = scenes.freed_half()
    end, step = scene.analysis.duration, scene.analysis.time_step
    assert end is not None
    assert step is not None

    def judge(solutions: Solutions) -> Finding:
        (solution,) = solutions.values()
        wanted = np.array(scene.analysis.output_times)
        if len(solution.times) != len(wanted) or np.abs(solution.times - wanted).max() > 1e-9:
            return Finding(float("inf"), 0.0, f"output times {solution.times.tolist()}")
        corners = solution.points[solution.cells]
        middle = corners[:, :3].mean(axis=1)
        freed = middle[:, 1] < 0.47 + 0.24 * (middle[:, 0] - 0.5)
        fallen = solution.displacement[:, np.unique(solution.cells[freed])]
        scale = 0.5 * float(np.linalg.norm(gravity)) * end**2
        spread = float(np.abs(fallen - fallen.mean(axis=1, keepdims=True)).max()) / scale
        if not spread <= _RIGID:
            return Finding(spread, _RIGID, "the freed half does not stay as it is")
        parabola = 0.5 * wanted[:, None, None] ** 2 * gravity
        off = float(np.linalg.norm(fallen - parabola, axis=2).max()) / scale
        # a scheme of first order is off by g t Δt / 2
        return Finding(off, 1.001 * step / end, "" if off <= EXACT else "of first order in time")

    claim = "the freed half of a cut body falls with g, wherever the cut passes"
    return Check("free-fall", claim, [Trial(scene.name, scene)], judge)


def _energy_account() -> Check:
    scene, _, energy = scenes.strained_sides()

    def judge(solutions: Solutions) -> Finding:
        (solution,) = solutions.values()
        own = {"ledger": solution.ledger.get("strain"), "quantity": None}
        if "strain_energy" in solution.quantities:
            own["quantity"] = np.array([solution.quantities["strain_energy"]])
        given = {name: float(np.ravel(v)[-1]) for name, v in own.items() if v is not None}
        if not given:
            return Finding(0.0, None, "the solver states no strain energy")
        worst = max(abs(value - energy) for value in given.values()) / energy
        said = ", ".join(f"{name} {value:.6g}" for name, value in given.items())
        return Finding(worst, 2 * EXACT, f"{said}; the field's is {energy:.6g}")

    claim = "the strain energy that the solver states is that of its field"
    return Check("energy-account", claim, [Trial("account", scene)], judge)


def _closed_cut() -> Check:
    cut, uncut = scenes.closed_cut()

    def judge(solutions: Solutions) -> Finding:
        return Finding(distance(solutions["closed-cut"], solutions["no-cut"], cut), EXACT)

    trials = [Trial("closed-cut", cut), Trial("no-cut", uncut)]
    return Check("closed-cut", "a cut along the load changes nothing", trials, judge)


def _hanging_halves() -> Check:
    scene, weight = scenes.hanging_halves()
    law = hooke(scene.material)

    def judge(solutions: Solutions) -> Finding:
        # Galerkin: round-off. A stabilised method may put some energy elsewhere: of the order of
        # the squared error in the energy norm, below 5 % here (P1: 20 % of error at 5 × 4 cells)
        observed = weight_imbalance(solutions["hanging"], weight, law)
        return Finding(observed, 0.05, "" if observed <= EXACT else "not a Galerkin solution")

    claim = "the weight of a cut body does twice the work that is stored (Clapeyron)"
    return Check("weight", claim, [Trial("hanging", scene)], judge)


def _mirrored_cut() -> Check:
    scene, mirrored = scenes.sheared_halves(False), scenes.sheared_halves(True)

    def judge(solutions: Solutions) -> Finding:
        observed = distance(solutions["as-it-is"], solutions["mirrored"], scene, swap=True)
        # on the mesh of the scene, which is symmetric: round-off. A solver with a mesh of its own
        # errs differently on both; each error e is at most twice the change u_h − u_{h/2} that
        # the next level makes (rates ≥ 1 in L2), so that both together stay below four changes
        change = distance(solutions["as-it-is"], solutions["finer"], scene)
        note = "" if observed <= EXACT else "equal up to the discretisation only"
        return Finding(observed, max(EXACT, 4 * change), note)

    trials = [
        Trial("as-it-is", scene), Trial("mirrored", mirrored), Trial("finer", scene, 1),
    ]  # fmt: skip
    return Check("mirrored-cut", "a mirrored cut gives the mirrored answer", trials, judge)


def _renumbering(folder: Path) -> Check:
    given, shuffled = scenes.given_mesh(folder, False), scenes.given_mesh(folder, True)

    def judge(solutions: Solutions) -> Finding:
        return Finding(distance(solutions["given"], solutions["shuffled"], given), EXACT)

    trials = [Trial("given", given), Trial("shuffled", shuffled)]
    return Check("renumbering", "numbers of nodes and cells do not matter", trials, judge)


def _repeatability() -> Check:
    scene = scenes.sheared_halves(False)
    names = ("first", "again", "elsewhere")

    def judge(solutions: Solutions) -> Finding:
        first = solutions["first"].displacement
        worst = 0.0
        for name in names[1:]:
            other = solutions[name].displacement
            if other.shape != first.shape:
                return Finding(float("inf"), 1e-12, f"'{name}' has another number of nodes")
            off, largest = float(np.abs(other - first).max()), float(np.abs(first).max())
            if off > 0.0:  # a solver may move nothing at all
                worst = max(worst, off / largest if largest > 0.0 else float("inf"))
        # sums in another order (threads) may differ in the last digits
        return Finding(worst, 1e-12, "" if worst == 0.0 else "not equal bit by bit")

    claim = "the same call gives the same numbers, also after other calls and in another process"
    trials = [Trial(name, scene) for name in names]
    return Check("repeatability", claim, trials, judge, separate=("elsewhere",))


def _free_piece() -> Check:
    def judge(outcomes: Mapping[str, Outcome]) -> str:
        outcome = outcomes["free-piece"]
        if outcome.status is Status.SOLVED:
            return "answered a static scene in which nothing holds a piece"
        return f"the process died: {outcome.reason}" if outcome.crashed else ""

    claim = "a piece that nothing holds is reported, not answered"
    return Check("free-piece", claim, [Trial("free-piece", scenes.free_piece())], None, judge)


def _refusals() -> Check:
    unusual = scenes.unusual()

    def judge(outcomes: Mapping[str, Outcome]) -> str:
        fine = (Status.SOLVED, Status.REFUSED)
        return "; ".join(
            f"{name}: {outcome.reason}"
            for name, outcome in outcomes.items()
            if outcome.status not in fine
        )

    claim = "what the solver cannot do it refuses; it does not crash"
    trials = [Trial(f"unusual-{scene.name}", scene) for scene in unusual]
    return Check("refusals", claim, trials, None, judge)


# Of the energy in play. The motion is slow: an angle of 0.03 per step in its lowest mode, of which
# the square over 8 is what central differences keep to; what is a third of 0.3 % is seen.
_LOST = 1e-3
# A scheme of first order without dissipation oscillates by half that angle, 1.5 %.
_GAINED = 0.05
# Simpson's rule for the rate over two outputs is off by (0.3)⁴/180 in the lowest mode, 1e-2 in one
# of nine times its frequency; a velocity that is half a step late by 1.5 %.
_NO_RATE = 0.05
# What no field has: dissipated by the scheme, stored in a ghost penalty, gone with removed cells.
_STATED = ("algorithmic", "penalty", "removed_energy", "cut_work", "projection")


def energy_in_motion(shaken: bool = False) -> Check:
    """Make the check of a cut body that swings under its weight, `shaken` by its support or not."""
    scene = scenes.swinging(shaken)

    def judge(solutions: Mapping[str, Solution]) -> Finding:
        (solution,) = solutions.values()
        account = motion_account(scene, solution, law_of(scene))
        if account.energies.lacking:
            return Finding(0.0, None, account.energies.lacking)
        wanted = np.array(scene.analysis.output_times)
        if len(solution.times) != len(wanted) or np.abs(solution.times - wanted).max() > 1e-9:
            return Finding(float("inf"), 0.0, f"output times {solution.times.tolist()}")
        if moved := _not_at_rest(solution):
            return moved
        off, time = _rate_off(solution)
        if not off <= _NO_RATE:
            note = "its velocities are not the rates of its displacements, most at t = "
            return Finding(off, _NO_RATE, f"{note}{time:.3g} s")
        return _kept(account)

    claim = "in motion energy is kept, but for what the solver states that its method takes"
    name = "energy-in-motion"
    if shaken:
        name, claim = "work-of-supports", f"{claim}, and for the work of supports that move"
    return Check(name, claim, [Trial(scene.name, scene)], judge)


def _kept(account: MotionAccount) -> Finding:
    """Judge the sum of the measured energies and of the stated dissipation."""
    energies = account.energies
    total, scale = total_energy(energies.parts), energy_scale(energies.parts)
    if total is None or scale == 0.0:
        return Finding(float("inf"), _LOST, "nothing moves")
    stated = [row for name, row in account.stated.items() if name in _STATED]
    taken = sum((row - row[0] for row in stated), np.zeros_like(total)) / scale
    missing = np.abs((total - total[0]) / scale + taken)
    width = (energies.width + energies.width[0]) / scale
    least, most = float((missing - width).max()), float((missing + width).max())
    if taken.min() < -_GAINED:
        return Finding(float(-taken.min()), _GAINED, "its method produces energy, as it states")
    if least > _LOST:
        return Finding(float(missing.max()), _LOST, "energy changes that nothing accounts for")
    if most > _LOST:
        why = energies.sources.get("work_of_supports", energies.sources["kinetic_energy"])
        return Finding(0.0, None, f"known within {width.max():.1g} only: {why}")
    loss = float(taken.max())
    note = f"its method takes {loss:.2g} of the energy in play, as it states"
    return Finding(float(missing.max()), _LOST, note if loss > _LOST else "")


def _rate_off(solution: Solution) -> tuple[float, float]:
    """Largest difference of velocities from rates, over the largest velocity, and its time, s."""
    u, v, times = solution.displacement, solution.velocity, solution.times
    assert v is not None
    largest = float(np.linalg.norm(v, axis=(1, 2)).max())
    rate = (u[2:] - u[:-2]) / (2 * (times[1] - times[0]))  # the scene asks for equal intervals
    mean = (v[:-2] + 4 * v[1:-1] + v[2:]) / 6
    off = np.linalg.norm(rate - mean, axis=(1, 2))
    worst = int(np.argmax(off))
    return (float(off[worst]) / largest if largest > 0.0 else 0.0), float(times[worst + 1])


def _not_at_rest(solution: Solution) -> Finding | None:
    """Find what moves at the first output of a scene that begins at rest, undeformed."""
    for name, values in (
        ("displacement", solution.displacement),
        ("velocity", solution.velocity),
    ):
        assert values is not None
        sizes = np.linalg.norm(values, axis=2).max(axis=1)
        off = float(sizes[0] / sizes.max()) if sizes.any() else 0.0
        if not off <= EXACT:
            note = (
                f"at t = {solution.times[0]:g} s its {name} is {off:.2g} of the largest; expected "
                '0: the scene begins at rest, undeformed ([initial] kind = "rest")'
            )
            return Finding(off, EXACT, note)
    return None


def conform(
    solver: str,
    parameters: Mapping[str, Any] | None = None,
    timeout: float = 120.0,
    only: Sequence[str] = (),
) -> list[CheckResult]:
    """Check the solver called `solver`.

    Parameters
    ----------
    solver : str
        Name, or ``module:Class``; parameters may follow it.
    parameters : mapping, optional
        Parameters of its `solve`, under those that follow its name.
    timeout : float
        Wall seconds for each of the about 30 small solves.
    only : sequence of str
        Names of the checks wanted; default all.

    Returns
    -------
    list of CheckResult

    Raises
    ------
    InputError
        If there is no such solver or check, or the solver cannot be loaded.
    """
    given = {**(parameters or {}), **parameters_in(solver)}
    with tempfile.TemporaryDirectory(prefix="verify-") as place:
        folder = Path(place)
        every = {check.name: check for check in checks(folder)}
        for name in only:
            if name not in every:
                raise InputError(f"no check '{name}'{nearest(name, every)}")
        asked = [check for name, check in every.items() if not only or name in only]
        together: list[Trial] = []
        apart: list[Trial] = []
        for number, check in enumerate(asked):
            for trial in check.trials:
                where = apart if trial.name in check.separate else together
                where.append(replace(trial, name=f"{number}-{trial.name}"))
        outcomes: dict[str, Outcome] = {}
        for label, trials in (("together", together), ("apart", apart)):
            outcomes |= solve_trials(solver, given, trials, folder, timeout, label)
    return [
        evaluate(check, {t.name: outcomes[f"{number}-{t.name}"] for t in check.trials})
        for number, check in enumerate(asked)
    ]


def exit_code_of(results: Sequence[CheckResult]) -> int:
    """Return 1 if a check fails, else 3 for an error, 4 if nothing was done, else 0."""
    states = [result.state for result in results]
    if State.FAIL in states:
        return 1
    if State.ERROR in states:
        return 3
    # a solver that refuses everything also passes "refuses instead of crashing"
    return 0 if any(r.state is State.PASS and r.observed is not None for r in results) else 4
