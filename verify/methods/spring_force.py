"""Mass–spring model of a cut body: springs on the edges of its cells."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from verify.methods.spring_fit import Fit, cell_edges, spring_stiffness
from verify.methods.spring_kernels import add_spring_stiffness, spring_force, spring_product
from verify.xfem.arrays import check_choice
from verify.xfem.block_pattern import BlockPattern
from verify.xfem.elasticity import Material
from verify.xfem.errors import XfemError
from verify.xfem.internal_force import InternalForce, Kinematics, TangentKind
from verify.xfem.linear_solvers import PLAIN, Kernels
from verify.xfem.phantom import PhantomMesh

_Floats = NDArray[np.float64]


class Stretched(NamedTuple):
    """Springs at a displacement.

    Attributes
    ----------
    displacement : (N, d) float array
    directions : (p, e, d) float array
    excess : (p, e) float array
        Of their length, over that length.
    force : (N, d) float array
    energy : float
    """

    displacement: _Floats
    directions: _Floats
    excess: _Floats
    force: _Floats
    energy: float


class SpringForce(InternalForce):
    """Internal force of springs, in the place of that of finite elements.

    It serves the statics at large rotations and the time integrators of `verify.xfem`, but not
    those that integrate the stress along a step (`EnergyMomentum`) or keep kernels of their own
    (`RealTimeEuler`). Masses are the side-wise lumped ones.

    Parameters
    ----------
    phantom : PhantomMesh
        Pieces of cells have springs on all edges of their cell, weaker by their share of it.
    material : Material
        Fitted by the springs as far as springs can; see `verify.methods.spring_fit`.
    kinematics : {"corotational", "linear"}
        Springs that turn (½k(l − l0)², any rotation), or that keep their directions.
    fit : {"fitted", "van_gelder"}
    kernels : Kernels
        Its linear solvers.

    Attributes
    ----------
    springs : (p, e) float array
        Stiffness of the springs of each piece, in N/m.
    clamped : int
        Springs left out because the fit would make them negative.

    Raises
    ------
    XfemError
        If the material does not fit the mesh, the mesh is a membrane, or an option is unknown.
    """

    has_stress = False

    def __init__(
        self,
        phantom: PhantomMesh,
        material: Material,
        kinematics: Kinematics = "corotational",
        fit: Fit = "fitted",
        kernels: Kernels = PLAIN,
    ) -> None:
        super().__init__(phantom, material, kinematics, kernels)
        mesh = phantom.mesh
        stiffness, clamped = spring_stiffness(mesh, material, fit)
        self.springs = stiffness[phantom.parent] * phantom.fraction[:, None]
        self.clamped = int(clamped[phantom.parent].sum())
        self._edges = cell_edges(mesh.dim)
        ends = mesh.points[mesh.cells[phantom.parent]]
        self._rest = ends[:, self._edges[:, 1]] - ends[:, self._edges[:, 0]]
        length = np.linalg.norm(self._rest, axis=2, keepdims=True)
        self._directions = self._rest / length

    @property
    def has_one_pass(self) -> bool:
        """Springs are no elements: the pass over tetrahedra is not theirs."""
        return False

    def configuration(self, displacement: _Floats) -> Any:
        """Springs at a displacement (N, d), with their force and energy."""
        if displacement.shape != self._shape:
            raise XfemError(f"displacement of shape {displacement.shape}; expected {self._shape}")
        directions, excess = self._directions.copy(), np.zeros(self.springs.shape)
        force = np.zeros(self._shape)
        energy = spring_force(
            self.phantom.cells, self._edges, self._rest, self.springs, displacement,
            self.is_corotational, directions, excess, force,
        )  # fmt: skip
        return Stretched(displacement, directions, excess, force, float(energy))

    def evaluate_at(self, at: Any, out: _Floats | None = None) -> tuple[_Floats, float]:
        """Return internal force (N, d) in newtons and energy in joules; see `InternalForce`."""
        force = np.empty(self._shape) if out is None else out
        force[:] = at.force
        return force, at.energy

    def add_tangent_product(self, at: Any, vector: _Floats, scale: float, out: _Floats) -> None:
        """Add `scale` K v (N, d), K along the springs as they are, to `out`."""
        spring_product(
            self.phantom.cells, self._edges, self.springs, at.directions, vector, scale, out
        )

    def add_stiffness(
        self,
        at: Any,
        pattern: BlockPattern,
        blocks: _Floats,
        scale: float = 1.0,
        kind: TangentKind = "rotation-fixed",
        least: float = 0.0,
    ) -> int:
        """Add `scale` times the stiffness at a configuration; see `InternalForce`.

        "rotation-fixed" and "geometric" leave out what compressed springs take away from it
        across, so that they are never indefinite.
        """
        check_choice(kind, TangentKind, "stiffness")
        targets = pattern.targets[: len(self.phantom.cells)]
        add_spring_stiffness(
            targets, self._edges, self.springs, at.directions, at.excess,
            kind == "consistent", scale, blocks,
        )  # fmt: skip
        return 0
