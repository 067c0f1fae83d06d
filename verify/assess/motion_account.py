"""The account of a motion: energies, momenta and separated parts over the output times.

Energies are those of the solution's own ledger if it has all that the scene moves energy by; of a
solution without one they are integrated from its displacements and velocities here.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.compare.hooke import Law
from verify.compare.kinetic import Kinetic, density_of, kinetic
from verify.compare.locate import SolutionField
from verify.compare.separated import Part, separated_parts
from verify.compare.strain_energy import cell_strain_energies
from verify.scene import BodyForce, Gravity, Scene, Traction, is_uniform
from verify.solution import Solution

Array = NDArray[np.float64]

OWN = "ledger of the solution"
NO_VELOCITIES = "the solution has no velocities"
_MOST = 24  # parts
_WORK = ("gravity", "work_of_loads")


@dataclass(frozen=True)
class MotionAccount:
    """What is kept, or not, over the output times of a solution (2D: per metre of thickness).

    Parameters
    ----------
    times : (t,) array
        s.
    ledger : mapping of str to (t,) array
        Energies by name, J; empty if there are none.
    source : str
        Where the energies are from.
    lacking : str
        Why there are no energies; empty if there are.
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
    ledger: Mapping[str, Array]
    source: str
    lacking: str
    strain: Array
    strain_of_all: Array
    whole: Kinetic | None
    parts: list[Part]
    motions: list[Kinetic]
    lighter: int = 0

    @property
    def is_own_ledger(self) -> bool:
        """Whether the energies are those of the solution's own ledger."""
        return self.source == OWN


def motion_account(scene: Scene, solution: Solution, law: Law) -> MotionAccount:
    """Integrate energies and momenta of a solution and of its parts, exactly for its fields."""
    density = density_of(scene, solution)
    every = separated_parts(solution, density)
    heaviest = sorted(part.mass for part in every)[-_MOST:]
    parts = [part for part in every if part.mass >= heaviest[0]][:_MOST]
    field = SolutionField(solution)
    energies = (
        cell_strain_energies(field.with_nodal(u), law) for u in solution.displacement
    )  # one output time after the other: all at once are too many numbers
    sums = [(one.sum(), [one[part.cells].sum() for part in parts]) for one in energies]
    total, strain = (np.array(column) for column in zip(*sums, strict=True))
    whole, motions = None, []
    if solution.velocity is not None and scene.material.density is not None:
        whole = kinetic(solution, density)
        motions = [whole] if len(parts) == 1 else [
            kinetic(solution, density, part.cells) for part in parts
        ]  # fmt: skip
    ledger, source, lacking = _energies(scene, solution, total, whole)
    return MotionAccount(
        solution.times, ledger, source, lacking, strain, total, whole, parts, motions,
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


def _energies(
    scene: Scene, solution: Solution, strain: Array, whole: Kinetic | None
) -> tuple[Mapping[str, Array], str, str]:
    """Ledger, its source, and else why there is none."""
    own = {name: np.asarray(part) for name, part in solution.ledger.items() if name != "total"}
    stored = {"kinetic", "strain"} <= own.keys()
    if stored and (not scene.loads or any(name in own for name in _WORK)):
        return own, OWN, ""
    if whole is None:
        return {}, "", f"{NO_VELOCITIES}, and no ledger of energies over time"
    if reason := _unaccountable(scene):
        return {}, "", f"the solution has no ledger of energies over time, and {reason}"
    force = uniform_force(scene)
    assert force is not None
    found = {"kinetic": whole.energy, "strain": strain}
    if force.any():
        found["gravity"] = -whole.mass * whole.centre @ force
    return found, "displacements and velocities of the solution", ""


def _unaccountable(scene: Scene) -> str:
    """Why energy that enters or leaves the body cannot be had from output times alone."""
    if any(scene.analysis.damping):
        return "what the damping takes is not known between output times"
    loads = [load for load in scene.loads if not (isinstance(load, Traction) and _is_let_go(load))]
    if any(isinstance(load, Traction) for load in loads):
        return "the work of tractions is not known between output times"
    if any(not isinstance(load, Gravity | BodyForce) for load in loads):
        return "the work of loads on the faces of cuts is not known between output times"
    if uniform_force(scene) is None:
        return "the work of body forces that are not uniform is not known between output times"
    moved = [s for s in scene.supports if s.history or s.timed or s.displacement == "exact"]
    if scene.initial.kind != "equilibrium":
        moved += [s for s in scene.supports if _moves(s.displacement) or s.rotation is not None]
    return "the work of supports that move is not known between output times" if moved else ""


def _is_let_go(load: Traction) -> bool:
    """Whether a traction ends at t = 0, so that it does no work in the motion."""
    table = load.history or []
    before = [factor for time, factor in table if time <= 0.0]
    return bool(before) and not any([before[-1], *(f for time, f in table if time > 0.0)])


def _moves(displacement: object) -> bool:
    return isinstance(displacement, list) and any(value != 0.0 for value in displacement)
