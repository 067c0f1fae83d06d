"""Mass, inertia, momenta and energies of the part of a solution that holds a point."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from verify.compare.hooke import Law
from verify.compare.kinetic import density_of, kinetic
from verify.compare.locate import SolutionField
from verify.compare.motion import SolutionMotion
from verify.compare.motion_account import NO_VELOCITIES
from verify.compare.separated import Part, part_of, separated_parts
from verify.compare.strain_energy import cell_strain_energies
from verify.errors import UnsupportedSceneError
from verify.scene import PartQuantity, Scene
from verify.solution import Solution

_SAME_TIME = 1e-9  # of the duration
_UNITS = {
    "mass": "kg", "inertia": "kg m²", "linear_momentum": "N s", "angular_momentum": "N m s",
    "kinetic_energy": "J", "strain_energy": "J",
}  # fmt: skip


def part_quantity(
    scene: Scene, solution: Solution, motion: SolutionMotion, law: Law, asked: PartQuantity
) -> float:
    """Value of a number of a part (2D: per metre of thickness).

    Raises
    ------
    UnsupportedSceneError
        If the solution has no velocities, or not that output time.
    """
    density = density_of(scene, solution)
    part = _holding(solution, motion, density, asked)
    if asked.of == "mass":
        return part.mass
    if asked.of == "inertia":
        return float(part.inertia[_row(asked, len(part.inertia))])
    cells = part.cells
    step = -1
    if asked.time is not None:
        step = int(np.argmin(np.abs(solution.times - asked.time)))
        if abs(solution.times[step] - asked.time) > _SAME_TIME * float(np.ptp(solution.times)):
            raise UnsupportedSceneError(f"the solution has no field at {asked.time:.6g} s")
    if asked.of == "strain_energy":
        return float(cell_strain_energies(SolutionField(solution, step), law)[cells].sum())
    if solution.velocity is None:
        raise UnsupportedSceneError(NO_VELOCITIES)
    then = replace(
        solution, times=solution.times[[step]], displacement=solution.displacement[[step]],
        velocity=solution.velocity[[step]], acceleration=None, ledger={},
    )  # fmt: skip
    found = kinetic(then, density, cells)
    if asked.of == "kinetic_energy":
        return float(found.energy[0])
    row = found.linear[0] if asked.of == "linear_momentum" else found.spin[0]
    return float(row[_row(asked, len(row))])


def part_unit(asked: PartQuantity, dimension: int) -> str:
    """SI unit; plane scenes are per metre of thickness."""
    unit = _UNITS[asked.of]
    return unit if dimension == 3 else f"{unit}/m"


def _holding(
    solution: Solution,
    motion: SolutionMotion,
    density: float | NDArray[np.float64],
    asked: PartQuantity,
) -> Part:
    """Part that holds the point; without one the whole body, whatever it consists of."""
    if asked.point is None:
        return part_of(solution, density, np.arange(len(solution.cells)))
    at = np.array([asked.point], dtype=float)
    cell = int(motion.cells_at(at, at)[0])
    return next(p for p in separated_parts(solution, density) if cell in p.cells)


def _row(asked: PartQuantity, count: int) -> int:
    return "xyz".index(asked.component or "x") if count > 1 else 0
