"""The account of a motion: energies, momenta and separated parts over the output times.

Energies are measured on what the solver hands over (`verify.compare.measured_energies`); its own
ledger is kept beside them, to be compared.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.compare.hooke import Law
from verify.compare.kinetic import Kinetic, density_of, kinetic
from verify.compare.locate import SolutionField
from verify.compare.measured_energies import Energies, measured_energies
from verify.compare.separated import Part, separated_parts
from verify.compare.strain_energy import cell_strain_energies
from verify.scene import BodyForce, Gravity, Scene, is_uniform
from verify.solution import Solution

Array = NDArray[np.float64]

NO_VELOCITIES = "the solution has no velocities"
_MOST = 24  # parts


@dataclass(frozen=True)
class MotionAccount:
    """What is kept, or not, over the output times of a solution (2D: per metre of thickness).

    Parameters
    ----------
    times : (t,) array
        s.
    energies : Energies
        As measured.
    stated : mapping of str to (t,) array
        The solver's own ledger, J; empty if it has none.
    strain : (t, parts) array
        Strain energies of the parts, integrated from the displacements, J.
    strain_of_all : (t,) array
        That of the whole body, J.
    whole : Kinetic or None
        Of the whole body; None without velocities.
    parts : list of Part
        At most 24, the heaviest.
    motions : list of Kinetic
        Of each part; empty without velocities.
    lighter : int
        Parts that are not among them.
    """

    times: Array
    energies: Energies
    stated: Mapping[str, Array]
    strain: Array
    strain_of_all: Array
    whole: Kinetic | None
    parts: list[Part]
    motions: list[Kinetic]
    lighter: int = 0


def motion_account(scene: Scene, solution: Solution, law: Law) -> MotionAccount:
    """Integrate energies and momenta of a solution and of its parts, exactly for its fields."""
    density = density_of(scene, solution)
    every = separated_parts(solution, density)
    heaviest = sorted(part.mass for part in every)[-_MOST:]
    parts = [part for part in every if part.mass >= heaviest[0]][:_MOST]
    field = SolutionField(solution)
    of_cells = (
        cell_strain_energies(field.with_nodal(u), law) for u in solution.displacement
    )  # one output time after the other: all at once are too many numbers
    sums = [(one.sum(), [one[part.cells].sum() for part in parts]) for one in of_cells]
    total, strain = (np.array(column) for column in zip(*sums, strict=True))
    whole, motions = None, []
    if solution.velocity is not None and scene.material.density is not None:
        whole = kinetic(solution, density)
        motions = [whole] if len(parts) == 1 else [
            kinetic(solution, density, part.cells) for part in parts
        ]  # fmt: skip
    energies = Energies(lacking=NO_VELOCITIES)
    if whole is not None:
        energies = measured_energies(scene, solution, law, total, whole, density, every)
    stated = {name: np.asarray(part, dtype=float) for name, part in solution.ledger.items()}
    return MotionAccount(
        solution.times, energies, stated, strain, total, whole, parts, motions,
        len(every) - len(parts),
    )  # fmt: skip


def uniform_force(scene: Scene) -> Array | None:
    """Force per mass (d,), m/s², of gravity and uniform body forces; None if it changes."""
    found = np.zeros(scene.dimension)
    for load in scene.loads:
        if isinstance(load, Gravity):
            found += load.acceleration
        elif isinstance(load, BodyForce):
            if load.force == "exact" or not is_uniform(load.force) or load.history is not None:
                return None
            if not scene.material.is_uniform:
                return None
            assert scene.material.density is not None
            found += np.asarray(load.force, dtype=float) / scene.material.density
    return found
