"""The check that an answer is a field known in closed form.

`EXACT`, 1e-7: answers that lie in the solver's space are found up to the residual at which its
linear solver stops. Direct solvers reach 1e-13 on these meshes; an iterative one that stops at a
relative residual of 1e-9 loses up to two digits to the condition number (about 1e2 for 5 × 4
cells). What is wrong in the method shows at 1e-3 and more: half an element of a wrong side, a
missing factor, a swapped sign.
"""

from collections.abc import Mapping

import numpy as np

from verify.compare.hooke import hooke
from verify.compare.realised import cut_deviation
from verify.compare.strain_energy import strain_energy
from verify.conformance.check import Check, Finding
from verify.conformance.measures import covered, nodal_deviation
from verify.conformance.scenes import YOUNG, Field
from verify.conformance.trials import Trial
from verify.scene import Scene
from verify.solution import Solution

EXACT = 1e-7
Solutions = Mapping[str, Solution]


def is_field(scene: Scene, field: Field, energy: float | None = None) -> Check:
    """Make a check that an answer is `field`; the strain energy of the answer is `energy`."""
    law = hooke(scene.material)

    def judge(solutions: Solutions) -> Finding:
        (solution,) = solutions.values()
        if (gap := covered(solution)) > EXACT:
            return Finding(gap, EXACT, "the cells do not cover the body once")
        off = nodal_deviation(solution, field)
        if not off <= EXACT:
            return Finding(off, EXACT, f"displacement off by {off:.2e}{_moved(scene, solution)}")
        found = strain_energy(solution, law)
        if energy is None:
            return Finding(off, EXACT)
        # E·(u/L)² is the energy of strains as large as the displacements; an error of EXACT in
        # the displacements is one of EXACT · u / h in the strains, and its square in the energy
        largest = float(np.abs(solution.displacement).max())
        allowed = 2 * EXACT * energy + 400 * EXACT**2 * YOUNG * largest**2
        note = f"strain energy {found:.6g}, expected {energy:.6g}"
        if not abs(found - energy) <= allowed:
            return Finding(abs(found - energy), allowed, note)
        return Finding(off, EXACT)

    return Check(scene.name, "", [Trial(scene.name, scene)], judge)


def named(check: Check, name: str, claim: str) -> Check:
    """Give a check another name, and its claim."""
    return Check(name, claim, check.trials, check.judge)


def _moved(scene: Scene, solution: Solution) -> str:
    """Say by how much the realised cut deviates from the one asked for, if it does."""
    from verify.compare.body import body_of

    if scene.dimension != 2 or not scene.cuts:
        return ""
    off = cut_deviation(solution, body_of(scene))
    return f"; its realised cut is off by {off:.2e} m" if off > EXACT else ""
