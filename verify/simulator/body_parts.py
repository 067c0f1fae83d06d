"""Parts of a body under the knife, as its cutter has it at a moment."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from verify.accelerated import FAST
from verify.simulator.grips import Grips
from verify.simulator.stage import Stage
from verify.xfem.arrays import Bools, Floats
from verify.xfem.body import DynamicBody
from verify.xfem.internal_force import InternalForce
from verify.xfem.mass import Mass, side_wise_mass
from verify.xfem.phantom import PhantomMesh


@dataclass(frozen=True)
class BodyParts:
    """Forces, mass, and what holds the body; the sparsity is found with `body`.

    Attributes
    ----------
    stage : Stage
    force : InternalForce
    mass : Mass
    grips : Grips
    """

    stage: Stage
    force: InternalForce
    mass: Mass
    grips: Grips

    @classmethod
    def of(
        cls,
        stage: Stage,
        phantom: PhantomMesh,
        start: dict[int, Floats],
        facets: Sequence[Bools],
    ) -> "BodyParts":
        """Make the parts of a cut body.

        Parameters
        ----------
        stage : Stage
        phantom : PhantomMesh
        start : dict
            Displacement (N, s) at which each hook (by its number) has gripped.
        facets : sequence of (m, d + 1) bool arrays
            `verify.simulator.grips.held_facets` of each hold.
        """
        mass = side_wise_mass(phantom, stage.density)
        grips = Grips(phantom, stage.holds, stage.hooks, mass.weights, start, facets)
        return cls(stage, InternalForce(phantom, stage.material, kernels=FAST), mass, grips)

    def body(self, load: Callable[[float], Floats]) -> DynamicBody:
        """Make the body and its sparsity; `load` gives nodal forces (N, s) at a time, N."""
        return DynamicBody(
            self.force,
            self.mass,
            weight=self.mass.weight(self.stage.gravity),
            load=load,
            supports=self.grips.supports,
            damping=self.stage.damping,
        )
