"""Internal force of a cut body with a ghost penalty: what moves if slivers are penalised.

The penalty is a quadratic potential of its own, the same for every component, so that it needs no
rotations: its force and stiffness join those of the material in everything that a scheme asks for.
"""

import numpy as np
from numpy.typing import NDArray

from verify.xfem.block_pattern import BlockPattern
from verify.xfem.elasticity import Material
from verify.xfem.errors import XfemError
from verify.xfem.ghost_penalty import GhostPenalty
from verify.xfem.internal_force import InternalForce, Kinematics, TangentKind
from verify.xfem.kernels import PLAIN, Kernels
from verify.xfem.phantom import PhantomMesh

__all__ = ["PenalisedForce"]

_Floats = NDArray[np.float64]


class PenalisedForce(InternalForce):
    """Internal force with a ghost penalty.

    Parameters
    ----------
    phantom, material, kinematics, kernels
        As for `InternalForce`.
    ghost : GhostPenalty
        Of the same body.

    Attributes
    ----------
    penalty_energy : float
        Share of the penalty in the energy that the last `evaluate` returned, in joules.

    Raises
    ------
    XfemError
        If the penalty belongs to another body, or as `InternalForce`.
    """

    def __init__(
        self,
        phantom: PhantomMesh,
        material: Material,
        ghost: GhostPenalty,
        kinematics: Kinematics = "corotational",
        kernels: Kernels = PLAIN,
    ) -> None:
        super().__init__(phantom, material, kinematics, kernels)
        if ghost.phantom is not phantom:
            raise XfemError("the ghost penalty belongs to another body; expected one of this one")
        self.ghost = ghost
        self.penalty_energy = 0.0

    def evaluate(self, displacement: _Floats, out: _Floats | None = None) -> tuple[_Floats, float]:
        """Return force and energy of material and penalty together; see `InternalForce`."""
        force, energy = super().evaluate(displacement, out)
        penalty, self.penalty_energy = self.ghost.force(displacement)
        force += penalty
        return force, energy + self.penalty_energy

    def add_penalty(self, vector: _Floats, scale: float, out: _Floats) -> None:
        """Add `scale` times the penalty's stiffness times a vector (N, d) to `out`."""
        out += scale * (self.ghost.matrix @ vector)

    def add_tangent_product(self, vector: _Floats, scale: float, out: _Floats) -> None:
        """Add `scale` K v (N, d) to `out`, the penalty's stiffness included."""
        super().add_tangent_product(vector, scale, out)
        self.add_penalty(vector, scale, out)

    def add_stiffness(
        self,
        pattern: BlockPattern,
        blocks: _Floats,
        scale: float = 1.0,
        kind: TangentKind = "rotation-fixed",
        displacement: _Floats | None = None,
    ) -> None:
        """Add `scale` times the stiffness of material and penalty to the nodal blocks."""
        super().add_stiffness(pattern, blocks, scale, kind, displacement)
        self.ghost.add_stiffness(pattern, blocks, scale)

    def linearise(
        self,
        pattern: BlockPattern,
        displacement: _Floats,
        velocity: _Floats,
        implicit: float,
        scale: float,
        force: _Floats,
        blocks: _Floats,
        whole: bool = True,
        rotational: float = 0.0,
    ) -> None:
        """Overwrite force and stiffness of an implicit step, the penalty's included."""
        moved = displacement, velocity, implicit
        super().linearise(pattern, *moved, scale, force, blocks, whole, rotational)
        if self.has_one_pass:  # else the material has called `evaluate` and `add_stiffness` of here
            self.add_penalty(displacement + implicit * velocity, 1.0, force)
            self.ghost.add_stiffness(pattern, blocks, scale)

    def linearise_average(
        self,
        pattern: BlockPattern,
        start: _Floats,
        end: _Floats,
        substituted: NDArray[np.bool_],
        scale: float,
        force: _Floats,
        blocks: _Floats,
        whole: bool = True,
        rotational: float = 0.0,
    ) -> None:
        """Overwrite averaged force and stiffness, the penalty's included."""
        moved = start, end, substituted
        super().linearise_average(pattern, *moved, scale, force, blocks, whole, rotational)
        self.add_penalty(0.5 * (start + end), 1.0, force)
        self.ghost.add_stiffness(pattern, blocks, scale)
