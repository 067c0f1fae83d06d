"""Corotational elasticity of a cut body: one polar rotation per piece (2.42, 2.66-70).

The potential is W = μ‖U − I‖² + ½λ tr²(U − I) with F = R U: with polar rotations (and with no
others) the corotational force is its gradient. Pieces turn on their own, so the parts of a cut
cell need not agree on a rotation. A collapsed or inverted piece has a rotation of determinant +1;
U then has a negative eigenvalue, which is what the potential pulls back.
"""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from verify.xfem.block_pattern import BlockPattern
from verify.xfem.corotation.corotational_kernels import corotational_kernels
from verify.xfem.corotation.membrane_tension import add_tension
from verify.xfem.elasticity import Material
from verify.xfem.errors import XfemError
from verify.xfem.given_arrays import check_floats
from verify.xfem.kernels import PLAIN, Kernels, OnePass
from verify.xfem.virtual import VirtualMesh

__all__ = ["InternalForce", "Kinematics", "TangentKind"]

_Floats = NDArray[np.float64]
Kinematics = Literal["corotational", "linear"]
TangentKind = Literal["frozen", "tensioned", "exact"]


class InternalForce:
    """Internal force, strain energy and stiffness of a cut body.

    Parameters
    ----------
    virtual : VirtualMesh
        Triangles in the plane, tetrahedra, or triangles in space (membranes without bending
        stiffness; their material is in plane stress times the thickness, its unit N/m).
    material : Material
    kinematics : {"corotational", "linear"}
        Linear keeps every rotation at the identity.
    kernels : Kernels
        Those of this body, its linear solvers among them.

    Attributes
    ----------
    left_out : int
        Pieces whose rotation was not differentiable at the last exact `add_stiffness`, and
        which therefore entered with a frozen one.

    Raises
    ------
    XfemError
        If the material fits neither () nor (m,), the kinematics is unknown, or a membrane is to
        be linear (it would resist rotation across its plane).
    """

    def __init__(
        self,
        virtual: VirtualMesh,
        material: Material,
        kinematics: Kinematics = "corotational",
        kernels: Kernels = PLAIN,
    ) -> None:
        mesh = virtual.mesh
        if kinematics not in ("corotational", "linear"):
            raise XfemError(f"kinematics '{kinematics}'; expected corotational or linear")
        if mesh.dim < mesh.space and kinematics == "linear":
            raise XfemError("linear kinematics of a membrane in space; expected corotational")
        self.virtual, self.kinematics, self.kernels = virtual, kinematics, kernels
        self.lam, self.mu = material.of_cells(len(mesh.cells))
        self.left_out = 0
        pieces, space = len(virtual.cells), mesh.space
        self._rotations = np.zeros((pieces, space, space))
        self._rotations[:, range(space), range(space)] = 1.0
        self._quaternions = np.zeros((pieces, 4))
        self._quaternions[:, 0] = 1.0
        self._kernels = corotational_kernels(space)
        self._gradients = np.ascontiguousarray(mesh.gradients)
        self._normals = _unit_normals(virtual)
        self._shape = (virtual.node_count, space)
        self._sweep: OnePass | None = None
        self._swept = False  # whether the last rotations are those of the sweep

    @property
    def rotations(self) -> _Floats:
        """(p, d, d) rotation of each piece at the last evaluation."""
        if self._swept and self._sweep is not None:
            self._sweep.write_rotations(self._rotations)
            self._swept = False
        return self._rotations

    @property
    def turning(self) -> bool:
        """Whether pieces have rotations of their own."""
        return self.kinematics == "corotational"

    @property
    def is_membrane(self) -> bool:
        """Whether the body is of triangles in space."""
        return self.virtual.mesh.dim < self.virtual.mesh.space

    @property
    def geometry(self) -> tuple[_Floats, NDArray[np.int64], _Floats, _Floats, _Floats, _Floats]:
        """(gradients, parent, volumes, normals, λ, μ): what every kernel reads."""
        v = self.virtual
        return self._gradients, v.parent, v.volumes, self._normals, self.lam, self.mu

    def evaluate(
        self,
        displacement: _Floats,
        out: _Floats | None = None,
        velocity: _Floats | None = None,
        scale: float = 0.0,
    ) -> tuple[_Floats, float]:
        """Return internal force (N, d) in newtons and strain energy in joules; update rotations.

        Parameters
        ----------
        displacement : (N, d) float array
            Of the unknown nodes, in metres.
        out : (N, d) float array, optional
            Overwritten with the force.
        velocity : (N, d) float array, optional
            With a scale in seconds: `scale` K v, K with frozen rotations, is added to the force.

        Raises
        ------
        XfemError
            If an array has a wrong shape or type.
        """
        self._check("displacement", displacement)
        if out is not None:
            self._check("force", out)
        if velocity is not None:
            self._check("velocity", velocity)
        force = np.empty(self._shape) if out is None else out
        force[:] = 0.0
        v, extended, corner_force = self.virtual, self.virtual.extend(displacement), force
        if v.aggregation is not None:
            corner_force = np.zeros_like(extended)
        if self.turning:
            where = v.cells, self._gradients, v.parent, self._normals, extended
            self._kernels.turn(*where, self._quaternions, self._rotations)
            self._swept = False
        energy = self._kernels.internal_force(
            v.cells, *self.geometry, self._rotations, extended, corner_force
        )
        if velocity is not None and scale != 0.0:
            self._kernels.frozen_product(
                v.cells, *self.geometry, self._rotations, v.extend(velocity), scale, corner_force
            )
        if v.aggregation is not None:
            force += v.restrict(corner_force)
        return force, float(energy)

    def _check(self, name: str, values: _Floats) -> None:
        check_floats(name, values, self._shape)

    def _check_all(self, **arrays: _Floats) -> None:
        for name, values in arrays.items():
            self._check(name, values)

    def _check_blocks(self, pattern: BlockPattern, blocks: _Floats) -> None:
        space = self._shape[1]
        check_floats("blocks", blocks, (len(pattern.columns), space, space))
        if pattern.node_count != self._shape[0] or len(pattern.targets) < len(self.virtual.cells):
            raise XfemError(
                f"pattern of {pattern.node_count} nodes and {len(pattern.targets)} cells; expected "
                f"that of the body, {self._shape[0]} and {len(self.virtual.cells)}"
            )

    def prepare(self, pattern: BlockPattern) -> None:
        """Do what `linearise` does otherwise when it is first called with a sparsity."""
        if self.is_swept:
            self._sweep = self._sweep_over(pattern)

    @property
    def is_swept(self) -> bool:
        """Whether one pass gives force and stiffness: of tetrahedra with unknowns of their own."""
        solid = self.virtual.mesh.dim == 3 and self.virtual.aggregation is None
        return solid and self.kernels.one_pass is not None

    def _sweep_over(self, pattern: BlockPattern) -> OnePass:
        if self._sweep is not None and self._sweep.pattern is pattern:
            return self._sweep
        assert self.kernels.one_pass is not None
        return self.kernels.one_pass(self.virtual, self.lam, self.mu, pattern, self.turning)

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
        spin: float = 0.0,
    ) -> None:
        """Overwrite force and stiffness as an implicit step wants them; update rotations.

        Tetrahedra are swept once, in a fraction of the time of `evaluate` and `add_stiffness`.

        Parameters
        ----------
        pattern : BlockPattern
            Its first cells must be those of the body.
        displacement, velocity : (N, d) float array
        implicit : float
            In seconds; the force is f_int(u) + `implicit` K v, K with frozen rotations.
        scale : float
            Of the stiffness with frozen rotations in the blocks.
        force : (N, d) float array
            Overwritten.
        blocks : (B, d, d) float array
            Overwritten.
        whole : bool
            Without it what is below the diagonal may be anything.
        spin : float
            Of what the exact stiffness has beyond that with frozen rotations.

        Raises
        ------
        XfemError
            If an array is not of the body, or not of the pattern.
        """
        self._check_all(displacement=displacement, velocity=velocity, force=force)
        self._check_blocks(pattern, blocks)
        if not self.is_swept:
            self.evaluate(displacement, force, velocity, implicit)
            blocks[:] = 0.0
            self.add_stiffness(pattern, blocks, scale - spin)
            if spin != 0.0:
                self.add_stiffness(pattern, blocks, spin, "exact", displacement)
            return
        self._sweep = self._sweep_over(pattern)
        moved = displacement, velocity, implicit
        self.left_out = self._sweep(*moved, scale, force, blocks, whole, spin)
        self._swept = self.turning

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
        spin: float = 0.0,
    ) -> None:
        """Overwrite the force averaged over a step, of tetrahedra, and the stiffness at its end.

        Parameters
        ----------
        start, end : (N, 3) float array
            Displacements.
        substituted : (p,) bool array
            Pieces that have taken the substitute for the averaged stress; updated.
        pattern, scale, force, blocks, whole, spin
            As for `linearise`.

        Raises
        ------
        XfemError
            If an array is not of the body, or not of the pattern.
        """
        assert self.is_swept
        self._check_all(start=start, end=end, force=force)
        self._check_blocks(pattern, blocks)
        self._sweep = sweep = self._sweep_over(pattern)
        self.left_out = sweep.average(start, end, scale, spin, substituted, force, blocks, whole)
        self._swept = True

    def add_frozen_product(self, vector: _Floats, scale: float, out: _Floats) -> None:
        """Add `scale` K v (N, d), K with the rotations of the last `evaluate`, to `out`.

        Raises
        ------
        XfemError
            If an array has a wrong shape or type.
        """
        self._check("vector", vector)
        self._check("force", out)
        v = self.virtual
        extended = v.extend(vector)
        corner_force = out if v.aggregation is None else np.zeros_like(extended)
        self._kernels.frozen_product(
            v.cells, *self.geometry, self.rotations, extended, scale, corner_force
        )
        if v.aggregation is not None:
            out += v.restrict(corner_force)

    def add_stiffness(
        self,
        pattern: BlockPattern,
        blocks: _Floats,
        scale: float = 1.0,
        kind: TangentKind = "frozen",
        displacement: _Floats | None = None,
    ) -> None:
        """Add `scale` times the stiffness at the last `evaluate` to the nodal blocks.

        Parameters
        ----------
        pattern : BlockPattern
            Its first cells must be those of the body.
        blocks : (B, d, d) float array
        kind : {"frozen", "tensioned", "exact"}
            Rotations held; the same and what tension gives membranes across their plane, which
            has no negative mode either; or the second derivative of the potential.
        displacement : (N, d) float array, optional
            That of the last `evaluate`; needed for all but the frozen stiffness.

        Raises
        ------
        XfemError
            If the kind is unknown or needs a displacement that is not given, or an array is not of
            the body.
        """
        self._check_blocks(pattern, blocks)
        if kind not in ("frozen", "tensioned", "exact"):
            raise XfemError(f"stiffness '{kind}'; expected frozen, tensioned or exact")
        if kind != "frozen" and self.turning:
            if displacement is None:
                raise XfemError(f"{kind} stiffness without the displacement at which it is wanted")
            self._check("displacement", displacement)
        v, added = self.virtual, pattern.unfold(blocks)
        targets = pattern.targets[: len(v.cells)]
        self._kernels.add_frozen_stiffness(targets, *self.geometry, self.rotations, scale, added)
        if kind == "exact" and self.turning and displacement is not None:
            self.left_out = self._kernels.add_spin_stiffness(
                v.cells, targets, *self.geometry, self.rotations, v.extend(displacement), scale,
                added,
            )  # fmt: skip
        pattern.fold(added, blocks)
        if kind == "tensioned" and self.is_membrane and displacement is not None:
            nothing = np.zeros(self._shape)
            self.add_tension(pattern, displacement, nothing, 0.0, scale, nothing, blocks)

    def add_tension(
        self,
        pattern: BlockPattern,
        displacement: _Floats,
        vector: _Floats,
        share: float,
        scale: float,
        force: _Floats,
        blocks: _Floats,
        least: float = 0.0,
    ) -> None:
        """Add the stiffness of a membrane across its plane, at the last evaluation.

        Parameters
        ----------
        pattern : BlockPattern
        displacement : (N, 3) float array
            That of the last evaluation.
        vector : (N, 3) float array
        share : float
            Times the stiffness times the vector is added to `force` (N, 3).
        scale : float
            Times the stiffness is added to `blocks` (B, 3, 3).
        least : float
            Tension over μ that every direction is taken to have at least: without it what is slack
            has no stiffness across its plane.

        Raises
        ------
        XfemError
            If the body is no membrane, or an array not of it.
        """
        if not self.is_membrane:
            raise XfemError("stiffness from tension of a solid; expected a membrane in space")
        self._check_all(displacement=displacement, vector=vector, force=force)
        self._check_blocks(pattern, blocks)
        v, added = self.virtual, pattern.unfold(blocks)
        extended = v.extend(displacement)
        corner_force = force if v.aggregation is None else np.zeros_like(extended)
        add_tension(
            v.cells, pattern.targets[: len(v.cells)], *self.geometry, self.rotations, extended,
            v.extend(vector), share, scale, least, corner_force, added,
        )  # fmt: skip
        pattern.fold(added, blocks)
        if v.aggregation is not None:
            force += v.restrict(corner_force)

    def stiffness(
        self, pattern: BlockPattern, displacement: _Floats, kind: TangentKind = "exact"
    ) -> _Floats:
        """(B, d, d) nodal blocks of the stiffness at a displacement, in N/m."""
        self.evaluate(displacement)
        space = self._shape[1]
        blocks = np.zeros((len(pattern.columns), space, space))
        self.add_stiffness(pattern, blocks, 1.0, kind, displacement)
        return blocks


def _unit_normals(virtual: VirtualMesh) -> _Floats:
    mesh = virtual.mesh
    if mesh.dim == mesh.space:
        return np.zeros((1, 3))
    edges = mesh.edge_vectors
    normals = np.cross(edges[:, 0], edges[:, 1])
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)
