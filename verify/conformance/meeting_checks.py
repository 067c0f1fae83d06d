"""Checks of cuts that cross, branch, end, or cross an interface, and of a force in space."""

from dataclasses import replace

import numpy as np

from verify.compare.locate import SolutionField
from verify.conformance import meeting_scenes as scenes
from verify.conformance.check import Check, Finding
from verify.conformance.excuses import parting_record, unexplained
from verify.conformance.field_check import EXACT, Solutions, is_field, named
from verify.conformance.scenes import Field
from verify.conformance.trials import Trial
from verify.scene import Scene
from verify.solution import Solution

_PARTED = {
    "two-cuts": (scenes.two_cuts, "the three parts between two cuts move without strain"),
    "crossing-cuts": (
        scenes.crossing_cuts,
        "the quarters between crossing cuts move without strain",
    ),
    "branched-cut": (scenes.branched_cut, "the parts beside a branch of a cut move without strain"),
}
# Of the opening at the mouth, a quarter of an element before the end. With linear elements it is
# a quarter of that where the cut enters the last element, 0.2 m before the end; of an infinite
# plate it is (0.2/0.6)^½ of the mouth's, so 0.14. A cut half an element short is closed there.
_OPEN = 0.02
# Of the same, a quarter of an element beyond: the places on both sides are 2e-6 m apart, over which
# strains of a few times 0.1/1 m give 1e-5.
_CLOSED = 1e-4
_AWAY, _OFF = 0.05, 1e-6  # m: a quarter of an element; from the line of the cut


def parted_checks() -> list[Check]:
    """Make the checks of bodies whose parts move, each for itself."""
    made = []
    for name, (make, claim) in _PARTED.items():
        scene, field = make()
        check = is_field(scene, field, 0.0)
        lenient = check if name == "two-cuts" else unless_stated(check, scene, field)
        made.append(named(lenient, name, claim))
    return made


def crossed_interface() -> Check:
    """Make the check of a cut that crosses an interface of materials."""
    scene, field = scenes.crossed_interface()
    check = unless_stated(is_field(scene, field), scene, field)
    return named(check, "crossed-interface", "both sides of a cut across an interface are pulled")


def pulled_in_space() -> Check:
    """Make the check of a force in space: whoever is too stiff passes all prescribed motions."""
    claim = "two halves of a cube under a traction contract each for itself (3D)"
    return named(is_field(*scenes.pulled_halves_in_space()), "traction-3d", claim)


def ending_cut() -> Check:
    """Make the check of a cut that ends where the mesh has a node."""
    scene = scenes.ending_cut()
    along = np.array([1.0, scenes.SLOPE]) / np.hypot(1.0, scenes.SLOPE)
    mouth = np.array([_OFF, scenes.END[1] - scenes.SLOPE * (scenes.END[0] - _OFF)])
    places = np.array([mouth, scenes.END - _AWAY * along, scenes.END + _AWAY * along])

    def judge(solutions: Solutions) -> Finding:
        (solution,) = solutions.values()
        opened, before, beyond = _jumps(solution, places, np.array([-along[1], along[0]]))
        if not before > _OPEN * opened:
            return Finding(1.0, _CLOSED, "it is closed a quarter of an element before its end")
        note = "it is open a quarter of an element beyond its end"
        return Finding(beyond / opened, _CLOSED, note if beyond > _CLOSED * opened else "")

    claim = "a cut that ends at a node of the mesh ends there"
    return unless_stated(Check("ending-cut", claim, [Trial(scene.name, scene)], judge), scene)


def _jumps(solution: Solution, places: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Lengths (n,) of the differences across a line at places (n, 2) on it, m."""
    field = SolutionField(solution)
    above, below = (field.displacement(places + sign * _OFF * normal) for sign in (1.0, -1.0))
    return np.asarray(np.linalg.norm(above - below, axis=1))


def unless_stated(check: Check, scene: Scene, field: Field | None = None) -> Check:
    """Hold nothing against a solver that its stated regularisation and its measured cut explain.

    `field` is the one in closed form, if there is one.
    """
    judge = check.judge
    assert judge is not None

    def lenient(solutions: Solutions) -> Finding:
        found = judge(solutions)
        (solution,) = solutions.values()
        stated = ", ".join(sorted({entry.kind for entry in solution.regularisations}))
        if found.limit is None or found.observed <= found.limit or not stated:
            return found
        cut = parting_record(scene, solution)
        lacking = unexplained(scene, solution, cut, field)
        said = f"{found.note}; it states: {stated}"
        if lacking:
            return replace(found, note=f"{said}, which does not explain it: {lacking}")
        shift = {"beside": cut.lateral, "missing": cut.missing, "more": cut.surplus}
        how = ", ".join(f"{size:.2g} m {what}" for what, size in shift.items() if size > EXACT)
        return replace(found, note=f"{said}; its cut is {how}", stated=True)

    return Check(check.name, check.claim, check.trials, lenient)
