"""Internal force, energy and stiffness of a cut body, linear or corotational (2.42, 2.66-70).

Every piece, being a cell of the phantom-node mesh, has one polar rotation of its own.
`verify.xfem.element` has the equations.
"""

from typing import Literal

import numpy as np

from verify.xfem.arrays import Bools, Floats, Ints, check_choice, check_floats
from verify.xfem.block_pattern import BlockPattern
from verify.xfem.elasticity import Material
from verify.xfem.element import (
    add_force,
    add_moduli,
    add_rotation_fixed,
    consistent_moduli,
    deform,
    elements_of,
    positive_tension,
)
from verify.xfem.errors import XfemError
from verify.xfem.ghost_penalty import GhostPenalty
from verify.xfem.linear_solvers import PLAIN, Kernels, OnePass
from verify.xfem.phantom import PhantomMesh
from verify.xfem.polar import rotations_in_plane, rotations_in_space

Kinematics = Literal["corotational", "linear"]
TangentKind = Literal["rotation-fixed", "geometric", "consistent", "tension"]

_CHUNK = 512  # cells whose moduli are held at once


class InternalForce:
    """Internal force, strain energy and stiffness of a cut body.

    Parameters
    ----------
    phantom : PhantomMesh
        Triangles in the plane, tetrahedra, or triangles in space (membranes without bending
        stiffness; their material is in plane stress times the thickness, its unit N/m).
    material : Material
    kinematics : {"corotational", "linear"}
        Linear keeps every rotation at the identity. A linear membrane resists in its plane alone.
    kernels : Kernels
        Of which `one_pass` serves tetrahedra here; the rest is for what solves with this force.
    ghost : GhostPenalty, optional
        Of the same body: a potential without rotations, in energy, force and every tangent.

    Attributes
    ----------
    elements : Elements
    penalty_energy : float
        Share of the penalty in the energy that the last `evaluate` returned, in joules.
    left_out : int
        Cells whose rotation was not differentiable at the last consistent tangent, and which
        therefore entered with the rotation-fixed one.

    Raises
    ------
    XfemError
        If the material fits neither () nor (m,), the kinematics is unknown, or the penalty is of
        another body. By every method: if an array has another shape or type than the body's.
    """

    has_stress = True  # that can be averaged over a step; springs (`verify.methods`) have none

    def __init__(
        self,
        phantom: PhantomMesh,
        material: Material,
        kinematics: Kinematics = "corotational",
        kernels: Kernels = PLAIN,
        ghost: GhostPenalty | None = None,
    ) -> None:
        if ghost is not None and ghost.phantom is not phantom:
            raise XfemError("the ghost penalty belongs to another body; expected one of this one")
        check_choice(kinematics, Kinematics, "kinematics")
        self.phantom, self.kinematics, self.kernels = phantom, kinematics, kernels
        self.ghost, self.penalty_energy = ghost, 0.0
        self.elements = elements_of(phantom, material)
        self.left_out = 0
        cells, space = len(phantom.cells), phantom.mesh.space
        self._rotations = np.tile(np.eye(space), (cells, 1, 1))
        self._quaternions = np.tile([1.0, 0.0, 0.0, 0.0], (cells, 1))  # where rotations start
        self._gradient = np.empty((cells, space, space))
        self._shape = (phantom.node_count, space)
        self._pass: OnePass | None = None
        self._passed = False  # whether the last rotations are those of the pass

    @property
    def rotations(self) -> Floats:
        """(p, d, d) rotation of each cell at the last evaluation."""
        if self._passed and self._pass is not None:
            self._pass.write_rotations(self._rotations)
            self._passed = False
        return self._rotations

    @property
    def is_corotational(self) -> bool:
        """Whether cells have rotations of their own."""
        return self.kinematics == "corotational"

    @property
    def is_membrane(self) -> bool:
        """Whether the body is of triangles in space."""
        return self.elements.is_membrane

    @property
    def has_one_pass(self) -> bool:
        """Whether `linearise` takes the one pass of the kernels: tetrahedra, none aggregated."""
        solid = self.phantom.mesh.dim == 3 and self.phantom.aggregation is None
        return solid and self.kernels.one_pass is not None

    def deformation(self, displacement: Floats) -> Floats:
        """Deformation gradients (p, d, d), of membranes zero across their plane; overwritten."""
        self._check(displacement=displacement)
        deform(self.elements, self.phantom.extend(displacement), 1.0, self._gradient)
        return self._gradient

    def evaluate(self, displacement: Floats, out: Floats | None = None) -> tuple[Floats, float]:
        """Return internal force (N, d) in newtons and strain energy in joules; update rotations.

        Parameters
        ----------
        displacement : (N, d) float array
            Of the dof nodes, in metres.
        out : (N, d) float array, optional
            Overwritten with the force.
        """
        force = np.empty(self._shape) if out is None else out
        self._check(force=force)
        F = self.deformation(displacement)
        if self.is_corotational:
            if self._shape[1] == 2:
                rotations_in_plane(F, self._rotations)
            else:
                rotations_in_space(F, self._quaternions, self._rotations)
            self._passed = False
        force[:] = 0.0
        energy = self._add_force(F, 1.0, 1.0, force)
        if self.ghost is not None:
            penalty, self.penalty_energy = self.ghost.force(displacement)
            force += penalty
        return force, energy + self.penalty_energy

    def add_tangent_product(self, vector: Floats, scale: float, out: Floats) -> None:
        """Add `scale` K v (N, d), K the rotation-fixed tangent of the last evaluation, to `out`."""
        self._check(vector=vector, force=out)
        deform(self.elements, self.phantom.extend(vector), 0.0, self._gradient)
        self._add_force(self._gradient, 0.0, scale, out)
        self.add_penalty(vector, scale, out)

    def add_penalty(self, vector: Floats, scale: float, out: Floats) -> None:
        """Add `scale` times the stiffness of the penalty, if there is one, times a vector."""
        if self.ghost is not None:
            out += scale * (self.ghost.matrix @ vector)

    def _add_force(self, F: Floats, share: float, scale: float, out: Floats) -> float:
        corner_force = np.zeros_like(self.phantom.corners.node_points)
        energy = add_force(self.elements, self.rotations, F, share, scale, corner_force)
        out += self.phantom.restrict(corner_force)
        return float(energy)

    def _check(self, **arrays: Floats) -> None:
        for name, values in arrays.items():
            check_floats(name, values, self._shape)

    def _check_blocks(self, pattern: BlockPattern, blocks: Floats) -> None:
        space = self._shape[1]
        check_floats("blocks", blocks, (len(pattern.columns), space, space))
        if pattern.node_count != self._shape[0] or len(pattern.targets) < len(self.phantom.cells):
            raise XfemError(
                f"pattern of {pattern.node_count} nodes and {len(pattern.targets)} cells; expected "
                f"that of the body, {self._shape[0]} and {len(self.phantom.cells)}"
            )

    def add_stiffness(
        self,
        pattern: BlockPattern,
        blocks: Floats,
        scale: float = 1.0,
        kind: TangentKind = "rotation-fixed",
        displacement: Floats | None = None,
        least: float = 0.0,
    ) -> None:
        """Add `scale` times a tangent at the last evaluation to the nodal blocks.

        Parameters
        ----------
        pattern : BlockPattern
            Its first cells must be those of the body.
        blocks : (B, d, d) float array
        kind : {"rotation-fixed", "geometric", "consistent", "tension"}
            Rotations held; the same and the geometric stiffness of membranes, which has no
            negative mode either; the second derivative of the potential; the geometric stiffness
            of a membrane alone.
        displacement : (N, d) float array, optional
            That of the last evaluation; needed for all but the rotation-fixed tangent.
        least : float
            Tension over μ that every direction of a membrane is taken to have at least: without it
            what is slack has no stiffness across its plane.

        Raises
        ------
        XfemError
            If the kind is unknown, needs a displacement that is not given or a membrane, or an
            array is not of the body.
        """
        self._check_blocks(pattern, blocks)
        check_choice(kind, TangentKind, "stiffness")
        kind = kind if self.is_corotational or kind == "tension" else "rotation-fixed"
        if kind != "rotation-fixed" and displacement is None:
            raise XfemError(f"{kind} stiffness without the displacement at which it is wanted")
        targets, added = pattern.targets[: len(self.phantom.cells)], pattern.unfold(blocks)
        if kind in ("rotation-fixed", "geometric"):
            add_rotation_fixed(self.elements, self.rotations, scale, targets, added)
        if kind == "tension" or (kind == "geometric" and self.is_membrane):
            assert displacement is not None
            tension, n = self._tension(displacement, least)
            moduli = np.einsum("pk,pl,pnm->pknlm", n, n, tension)
            add_moduli(self.elements, moduli, scale, targets, added)
        if kind == "consistent":
            assert displacement is not None
            F, R, self.left_out = self.deformation(displacement), self.rotations, 0
            for start in range(0, len(F), _CHUNK):
                some = slice(start, start + _CHUNK)
                elements = self.elements.part(some)
                moduli, left_out = consistent_moduli(elements, R[some], F[some])
                add_moduli(elements, moduli, scale, targets[some], added)
                self.left_out += left_out
        pattern.fold(added, blocks)
        if self.ghost is not None:
            self.ghost.add_stiffness(pattern, blocks, scale)

    def add_tension_product(
        self, displacement: Floats, vector: Floats, scale: float, out: Floats
    ) -> None:
        """Add `scale` times the geometric stiffness of a membrane times a vector (N, 3) to `out`.

        Raises
        ------
        XfemError
            If the body is no membrane, or an array not of it.
        """
        self._check(vector=vector, force=out)
        tension, n = self._tension(displacement, 0.0)
        b, w = self.elements.gradients[self.elements.parent], scale * self.elements.volumes
        across = self.phantom.extend(vector)[self.phantom.cells] @ n[:, :, None]
        pull = b @ tension @ (b.transpose(0, 2, 1) @ across)
        out += self.nodal_force(w[:, None, None] * pull * n[:, None, :])

    def nodal_force(self, forces: Floats) -> Floats:
        """Sum (N, d) of forces (p, c, d) at the corners of cells."""
        v = self.phantom
        nodes, count = v.cells.ravel(), len(v.corners.node_points)
        columns = forces.reshape(-1, forces.shape[2]).T
        return v.restrict(np.stack([np.bincount(nodes, f, count) for f in columns], axis=1))

    def _tension(self, displacement: Floats, least: float) -> tuple[Floats, Floats]:
        """Positive tension (p, 3, 3) of a membrane, and its turned normals (p, 3)."""
        if not self.is_membrane:
            raise XfemError("geometric stiffness of a solid; expected a membrane in space")
        R, elements = self.rotations, self.elements
        tension = positive_tension(elements, R, self.deformation(displacement), least)
        return tension, np.einsum("pkl,pl->pk", R, elements.normals[elements.parent])

    def stiffness(
        self,
        pattern: BlockPattern,
        displacement: Floats | None = None,
        kind: TangentKind = "consistent",
    ) -> Floats:
        """(B, d, d) nodal blocks of a tangent in N/m, at a displacement or at rest."""
        at = np.zeros(self._shape) if displacement is None else displacement
        self.evaluate(at)
        blocks = np.zeros((len(pattern.columns), self._shape[1], self._shape[1]))
        self.add_stiffness(pattern, blocks, 1.0, kind, at)
        return blocks

    def prepare(self, pattern: BlockPattern) -> None:
        """Do what `linearise` does otherwise when it is first called with a sparsity."""
        if self.has_one_pass:
            self._one_pass(pattern)

    def _one_pass(self, pattern: BlockPattern) -> OnePass:
        if self._pass is None or self._pass.pattern is not pattern:
            assert self.kernels.one_pass is not None
            self._pass = self.kernels.one_pass(self.elements, pattern, self.is_corotational)
        return self._pass

    def linearise(
        self,
        pattern: BlockPattern,
        displacement: Floats,
        velocity: Floats,
        implicit: float,
        scale: float,
        force: Floats,
        blocks: Floats,
        whole: bool = True,
        rotational: float = 0.0,
    ) -> None:
        """Overwrite force and stiffness as an implicit step wants them; update rotations.

        Parameters
        ----------
        pattern : BlockPattern
            Its first cells must be those of the body.
        displacement, velocity : (N, d) float array
        implicit : float
            In seconds; the force is f_int(u) + `implicit` K v, K the rotation-fixed tangent.
        scale : float
            Of the rotation-fixed tangent in the blocks.
        force : (N, d) float array
            Overwritten.
        blocks : (B, d, d) float array
            Overwritten.
        whole : bool
            Without it what is below the diagonal may be anything.
        rotational : float
            Of what the consistent tangent has beyond the rotation-fixed one.
        """
        rotational = rotational if self.is_corotational else 0.0
        if self.has_one_pass:
            self._check(displacement=displacement, velocity=velocity, force=force)
            self._check_blocks(pattern, blocks)
            moved = displacement, velocity, implicit
            one_pass = self._one_pass(pattern)
            self.left_out = one_pass(*moved, scale, force, blocks, whole, rotational)
            self._passed = self.is_corotational
            if self.ghost is not None:
                self.add_penalty(displacement + implicit * velocity, 1.0, force)
                self.ghost.add_stiffness(pattern, blocks, scale)
            return
        self.evaluate(displacement, force)
        if implicit != 0.0:
            self.add_tangent_product(velocity, implicit, force)
        blocks[:] = 0.0
        if scale != rotational:
            self.add_stiffness(pattern, blocks, scale - rotational)
        if rotational != 0.0:
            self.add_stiffness(pattern, blocks, rotational, "consistent", displacement)

    def linearise_average(
        self,
        pattern: BlockPattern,
        start: Floats,
        end: Floats,
        substituted: Bools,
        scale: float,
        force: Floats,
        blocks: Floats,
        whole: bool = True,
        rotational: float = 0.0,
    ) -> None:
        """Overwrite the force averaged over a step, and the stiffness at its end, in one pass.

        Parameters
        ----------
        start, end : (N, 3) float array
            Displacements.
        substituted : (p,) bool array
            Cells that have taken the substitute for the averaged stress; updated.
        pattern, scale, force, blocks, whole, rotational
            As for `linearise`.
        """
        assert self.has_one_pass
        self._check(start=start, end=end, force=force)
        self._check_blocks(pattern, blocks)
        average = self._one_pass(pattern).average
        self.left_out = average(start, end, scale, rotational, substituted, force, blocks, whole)
        self._passed = True
        if self.ghost is not None:
            self.add_penalty(0.5 * (start + end), 1.0, force)
            self.ghost.add_stiffness(pattern, blocks, scale)


def inverted_cells(force: InternalForce, displacement: Floats) -> Ints:
    """Pieces (k,) whose deformation gradient has a negative determinant.

    Raises
    ------
    XfemError
        If the body is a membrane: it has no such determinant.
    """
    if force.is_membrane:
        raise XfemError("inversion of a membrane in space is not defined")
    return np.flatnonzero(np.linalg.det(force.deformation(displacement)) < 0.0)
