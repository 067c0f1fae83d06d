"""The check of the energy of a motion: what is missing must be what the solver states."""

from collections.abc import Mapping

import numpy as np

from verify.compare.hooke import law_of
from verify.compare.ledger import energy_scale, total_energy
from verify.compare.motion_account import MotionAccount, motion_account
from verify.conformance import scenes
from verify.conformance.check import Check, Finding
from verify.conformance.trials import Trial
from verify.solution import Solution

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
        if (off := _rate_off(solution)) > _NO_RATE:
            return Finding(off, _NO_RATE, "its velocities are not the rates of its displacements")
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
        why = energies.said.get("work_of_supports", energies.said["kinetic_energy"])
        return Finding(0.0, None, f"known within {width.max():.1g} only: {why}")
    loss = float(taken.max())
    note = f"its method takes {loss:.2g} of the energy in play, as it states"
    return Finding(float(missing.max()), _LOST, note if loss > _LOST else "")


def _rate_off(solution: Solution) -> float:
    """Difference of velocities from the rate of displacements, over the largest velocity."""
    u, v, times = solution.displacement, solution.velocity, solution.times
    assert v is not None
    if len(times) < 3 or np.ptp(np.diff(times)) > 1e-6 * np.ptp(times):
        return float("inf")  # the scene asks for equal intervals
    rate = (u[2:] - u[:-2]) / (2 * (times[1] - times[0]))
    mean = (v[:-2] + 4 * v[1:-1] + v[2:]) / 6
    largest = float(np.linalg.norm(v, axis=(1, 2)).max())
    off = float(np.linalg.norm(rate - mean, axis=(1, 2)).max())
    return off / largest if largest > 0.0 else 0.0
