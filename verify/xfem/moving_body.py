"""From a cut mesh to what moves, with one choice of what becomes of its slivers.

Three policies change the space (`verify.xfem.slivers`); the fourth leaves it as it is and penalises
jumps of the gradient beside the cut (its module `ghost_penalty`), in the stiffness and, which is
what keeps the explicit step, in the mass.
"""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from verify.xfem.elasticity import Material
from verify.xfem.errors import XfemError
from verify.xfem.ghost_penalty import DEFAULT_FACTOR, GhostPenalty
from verify.xfem.internal_force import InternalForce, Kinematics
from verify.xfem.kernels import PLAIN, Kernels
from verify.xfem.mass import Mass, side_wise_mass
from verify.xfem.penalised_force import PenalisedForce
from verify.xfem.phantom import PhantomMesh
from verify.xfem.slivers import DEFAULT_POLICY, DEFAULT_THRESHOLD, SliverReport, treat_slivers

__all__ = ["MotionPolicy", "TreatedBody", "treat_moving_body"]

MotionPolicy = Literal["keep", "drop", "merge", "penalise"]


@dataclass(frozen=True)
class TreatedBody:
    """A cut body whose slivers have been seen to: what `DynamicBody` is made of.

    Attributes
    ----------
    phantom : PhantomMesh
        The body as it is computed; supports and loads are those of this mesh.
    force : InternalForce
        With the penalty if there is one.
    mass : Mass
        Side-wise lumped; with a penalty, or where cells are aggregated, not diagonal.
    slivers : SliverReport
        What was aggregated or dropped and what was kept.
    ghost : GhostPenalty or None
        The penalty: its `factor`, and one entry of `weights` per face penalised.
    """

    phantom: PhantomMesh
    force: InternalForce
    mass: Mass
    slivers: SliverReport
    ghost: GhostPenalty | None

    @property
    def summary(self) -> str:
        """One line that says what was done."""
        report = self.slivers
        if self.ghost is not None:
            return (
                f"{len(self.ghost.weights)} faces penalised with factor {self.ghost.factor:g}; "
                f"{report.kept} slivers below {report.threshold:g} of their cell kept"
            )
        return (
            f"{report.aggregated} slivers aggregated, {report.dropped} dropped, {report.kept} kept "
            f"({report.rootless} of them without a root cell); {report.volume_share:.3g} of the "
            "volume"
        )


def treat_moving_body(
    phantom: PhantomMesh,
    material: Material,
    density: NDArray[np.float64] | float,
    policy: MotionPolicy = DEFAULT_POLICY,
    threshold: float = DEFAULT_THRESHOLD,
    factor: float = DEFAULT_FACTOR,
    kinematics: Kinematics = "corotational",
    held: NDArray[np.bool_] | None = None,
    kernels: Kernels = PLAIN,
) -> TreatedBody:
    """Apply a sliver policy and build force and mass of what moves.

    Parameters
    ----------
    phantom : PhantomMesh
    material : Material
    density : float or (m,) array
        In kg/m³.
    policy : {"keep", "drop", "merge", "penalise"}
    threshold : float
        Volume fraction below which a piece is a sliver.
    factor : float
        Of the ghost penalty; read by "penalise" alone.
    kinematics : {"corotational", "linear"}
    held : (N,) bool array, optional
        Dof nodes that a support is going to hold; see `treat_slivers`.
    kernels : Kernels

    Raises
    ------
    XfemError
        If the policy is unknown, or threshold, factor, material or density make no sense.
    """
    if policy not in get_args(MotionPolicy):
        expected = ", ".join(get_args(MotionPolicy))
        raise XfemError(f"sliver policy '{policy}'; expected one of {expected}")
    if policy != "penalise":
        treated, report = treat_slivers(phantom, policy, threshold, held)
        force = InternalForce(treated, material, kinematics, kernels)
        return TreatedBody(treated, force, side_wise_mass(treated, density), report, None)
    treated, report = treat_slivers(phantom, "keep", threshold)
    ghost = GhostPenalty(treated, material, factor)
    force = PenalisedForce(treated, material, ghost, kinematics, kernels)
    mass = ghost.mass(side_wise_mass(treated, density), density)
    return TreatedBody(treated, force, mass, report, ghost)
