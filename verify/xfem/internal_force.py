"""Internal force, energy and stiffness of a cut body, linear or corotational (2.42, 2.66-70).

Every piece, being a cell of the phantom-node mesh, has one polar rotation of its own.
`verify.xfem.element` has the equations. Elements give force f and stiffness K at the corners of the
pieces. Where corners follow others, u = C û, the dof nodes have f̂ = Cᵀf and K̂ = CᵀKC. `extend`,
`restrict` and `fold` are these products; without aggregation C is the identity. Branches on
`has_one_pass` run with accelerated kernels only: never with `PLAIN`.
"""

from collections.abc import Callable
from copy import copy
from typing import Literal, NamedTuple, Protocol

import numpy as np
from scipy.sparse import csr_array

from verify.xfem.arrays import Floats, Ints, XfemError, check_choice, check_floats
from verify.xfem.block_pattern import BlockPattern
from verify.xfem.element import (
    Law,
    Material,
    add_force,
    add_moduli,
    add_rotation_fixed,
    consistent_moduli,
    deform,
    elements_of,
    tension_forces,
    tension_moduli,
)
from verify.xfem.hyperelastic import Law as Moduli
from verify.xfem.hyperelastic import add_hyperelastic_force, averages, hyperelastic_moduli
from verify.xfem.linear_solvers import PLAIN, Kernels, OnePass
from verify.xfem.mesh import cells_at
from verify.xfem.phantom import PhantomMesh
from verify.xfem.polar import rotations_in_plane, rotations_in_space

Kinematics = Literal["corotational", "linear"]
TangentKind = Literal["rotation-fixed", "geometric", "consistent", "tension"]

_HELD = 512 * 3**4  # moduli at once


class Configuration(NamedTuple):
    """Deformation of the cells of a body at a displacement.

    Attributes
    ----------
    displacement : (N, d) float array
        Of the dof nodes, in metres.
    F : (p, d, d) float array
        Deformation gradients, of membranes zero across their plane.
    R : (p, d, d) float array
        Rotations nearest to them; of linear kinematics the identity.
    """

    displacement: Floats
    F: Floats
    R: Floats


class Penalty(Protocol):
    """A potential ½ u·Ku beside the elasticity, K without rotations and alike in each component.

    Attributes
    ----------
    phantom : PhantomMesh
    matrix : (N, N) csr_array
        K, in N/m.
    couplings : (k, 2) int array
        Dof nodes that no cell couples.
    """

    phantom: PhantomMesh
    couplings: Ints

    @property
    def matrix(self) -> csr_array: ...  # noqa: D102

    def add_stiffness(self, pattern: BlockPattern, blocks: Floats, scale: float = 1.0) -> None:
        """Add `scale` K to nodal blocks (B, d, d)."""
        ...


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
    ghost : Penalty, optional
        Of the same body, as `verify.xfem.ghost_penalty`: in energy, force and every tangent.

    Attributes
    ----------
    elements : Elements

    Raises
    ------
    XfemError
        If the material fits neither () nor (m,), the kinematics is unknown, or the penalty is of
        another body. By every method: if an array has another shape or type than the body's.

    Notes
    -----
    What a method returns depends on its arguments alone. Rotations in space start from those found
    last, which makes them quicker to find, and differ by round-off.

    Examples
    --------
    >>> import numpy as np
    >>> import verify.xfem as xfem
    >>> phantom = xfem.cut_mesh(xfem.rectangle_mesh((4, 4)), [])
    >>> force = xfem.InternalForce(phantom, xfem.isotropic(1e4, 0.3, "plane strain"))
    >>> quarter_turn = phantom.node_points @ [[0.0, 1.0], [-1.0, 0.0]] - phantom.node_points
    >>> nodal, energy = force.evaluate(quarter_turn)
    >>> bool(np.abs(nodal).max() < 1e-10), bool(energy < 1e-20)
    (True, True)
    """

    has_stress = True  # that can be averaged over a step; springs (`verify.methods`) have none

    def __init__(
        self,
        phantom: PhantomMesh,
        material: Material,
        kinematics: Kinematics = "corotational",
        kernels: Kernels = PLAIN,
        ghost: Penalty | None = None,
    ) -> None:
        if ghost is not None and ghost.phantom is not phantom:
            raise XfemError("the ghost penalty belongs to another body; expected one of this one")
        check_choice(kinematics, Kinematics, "kinematics")
        self.phantom, self.kinematics = phantom, kinematics
        self.kernels, self.ghost = kernels, ghost
        self.elements, self.law = elements_of(phantom, material), material.law
        check_choice(self.law, Law, "law")
        if self.law != "hooke" and (not self.is_corotational or self.is_membrane):
            raise XfemError(f"law '{self.law}' of solids at finite rotation; this body is another")
        cells, space = len(phantom.cells), phantom.mesh.space
        self._unturned = np.tile(np.eye(space), (cells, 1, 1))
        self._quaternions = np.tile([1.0, 0.0, 0.0, 0.0], (cells, 1))
        self._shape = (phantom.node_count, space)
        self._pass: OnePass | None = None  # of the sparsity that was asked for last

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
        """Whether force and stiffness are found in one pass of the kernels: Hooke's tetrahedra."""
        accelerated = self.kernels.one_pass is not None
        return self.law == "hooke" and self.phantom.mesh.dim == 3 and accelerated

    @property
    def couplings(self) -> Ints | None:
        """(k, 2) dof nodes that the penalty alone couples; None without a penalty."""
        return None if self.ghost is None else self.ghost.couplings

    def near(self, nodes: Ints) -> "InternalForce":
        """Return the force of the cells at some dof nodes (k,): right there, and nowhere else.

        Where cells are aggregated or faces penalised, forces come from farther off: it is all, as
        it is of springs.
        """
        if self.phantom.aggregation is not None or self.ghost is not None or not self.has_stress:
            return self
        wanted = np.zeros(self._shape[0], dtype=bool)
        wanted[nodes] = True
        some = cells_at(self.phantom.cells, wanted)
        part = copy(self)
        part.elements = self.elements.part(some)
        part._unturned, part._quaternions = self._unturned[some], self._quaternions[some]
        return part

    def configuration(self, displacement: Floats) -> Configuration:
        """Find deformation gradients and rotations at a displacement (N, d)."""
        F = self.deformation(displacement)
        if not self.is_corotational:
            return Configuration(displacement, F, self._unturned)
        R = np.empty_like(F)
        if self._shape[1] == 2:
            rotations_in_plane(F, R)
        else:
            rotations_in_space(F, self._quaternions, R)
        return Configuration(displacement, F, R)

    def deformation(self, displacement: Floats) -> Floats:
        """Compute the deformation gradients (p, d, d) of a `Configuration` alone."""
        return self._gradient(displacement, 1.0)

    def _gradient(self, displacement: Floats, unit: float) -> Floats:
        self._check(displacement=displacement)
        found = np.empty_like(self._unturned)
        deform(self.elements, self.phantom.extend(displacement), unit, found)
        return found

    def evaluate(self, displacement: Floats, out: Floats | None = None) -> tuple[Floats, float]:
        """Return internal force (N, d) in newtons and energy in joules, a penalty included.

        Parameters
        ----------
        displacement : (N, d) float array
            Of the dof nodes, in metres.
        out : (N, d) float array, optional
            Overwritten with the force.
        """
        return self.evaluate_at(self.configuration(displacement), out)

    def evaluate_at(self, at: Configuration, out: Floats | None = None) -> tuple[Floats, float]:
        """Evaluate force and energy as `evaluate`, for a configuration."""
        force = np.empty(self._shape) if out is None else out
        self._check(force=force)
        if self.law == "hooke":
            force[:] = 0.0
            energy = self._add_force(at.R, at.F, 1.0, 1.0, force)
        else:
            corner_force = np.zeros_like(self.phantom.corners.node_points)
            stable = self.law == "stable_neo_hookean"
            energy = float(add_hyperelastic_force(self.elements, stable, at.F, corner_force))
            force[:] = self.phantom.restrict(corner_force)
        self.add_penalty(at.displacement, 1.0, force)
        return force, energy + self.penalty_energy(at.displacement)

    def stress(self, at: Configuration) -> Floats:
        """Compute the first Piola–Kirchhoff stress (p, d, d) of cells, in pascal."""
        lam, mu = (x[self.elements.parent] for x in (self.elements.lam, self.elements.mu))
        if self.law != "hooke":
            return averages(Moduli(lam, mu, self.law == "stable_neo_hookean"), at.F, at.F).stress
        strain = at.R.swapaxes(1, 2) @ at.F - np.eye(self._shape[1])
        volume = lam * np.trace(strain, axis1=1, axis2=2)
        sides: Floats = mu[:, None, None] * (strain + strain.swapaxes(1, 2))
        return at.R @ (sides + volume[:, None, None] * np.eye(self._shape[1]))

    def penalty_energy(self, displacement: Floats) -> float:
        """Compute energy of the penalty in joules, which `evaluate` includes; zero without one."""
        if self.ghost is None:
            return 0.0
        return 0.5 * float(np.vdot(displacement, self.ghost.matrix @ displacement))

    def add_tangent_product(
        self, at: Configuration, vector: Floats, scale: float, out: Floats
    ) -> None:
        """Add `scale` K v (N, d), K the rotation-fixed tangent of a configuration, to `out`."""
        self._check(vector=vector, force=out)
        self._add_force(at.R, self._gradient(vector, 0.0), 0.0, scale, out)
        self.add_penalty(vector, scale, out)

    def add_penalty(self, vector: Floats, scale: float, out: Floats) -> None:
        """Add `scale` times the stiffness of the penalty, if there is one, times a vector."""
        if self.ghost is not None:
            out += scale * (self.ghost.matrix @ vector)

    def _add_force(self, R: Floats, F: Floats, unit: float, scale: float, out: Floats) -> float:
        corner_force = np.zeros_like(self.phantom.corners.node_points)
        energy = add_force(self.elements, R, F, unit, scale, corner_force)
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
        at: Configuration,
        pattern: BlockPattern,
        blocks: Floats,
        scale: float = 1.0,
        kind: TangentKind = "rotation-fixed",
        least: float = 0.0,
    ) -> int:
        """Add `scale` times a tangent to the nodal blocks.

        Parameters
        ----------
        at : Configuration
        pattern : BlockPattern
            Its first cells must be the cells of the body.
        blocks : (B, d, d) float array
        kind : {"rotation-fixed", "geometric", "consistent", "tension"}
            K_R, with rotations held: no negative mode; K_R, of membranes with K_T, their geometric
            stiffness, which has none either; K_C, the second derivative of the potential; K_T. In
            linear kinematics all of them are K_R, but for the last.
        least : float
            Least tension over μ in every direction of a membrane. Without it slack cells have no
            stiffness across their plane.

        Returns
        -------
        int
            Cells without a differentiable rotation, which entered the consistent tangent with the
            rotation-fixed one.

        Raises
        ------
        XfemError
            If the kind is unknown or needs a membrane, or an array is not of the body.
        """
        self._check_blocks(pattern, blocks)
        check_choice(kind, TangentKind, "stiffness")
        kind = kind if self.is_corotational or kind == "tension" else "rotation-fixed"
        targets, added = pattern.targets[: len(self.phantom.cells)], pattern.unfold(blocks)
        left_out = 0
        if kind in ("rotation-fixed", "geometric"):
            add_rotation_fixed(self.elements, at.R, scale, targets, added)
        if kind == "tension" or (kind == "geometric" and self.is_membrane):
            self._check_membrane()
            add_moduli(
                self.elements,
                tension_moduli(self.elements, at.R, at.F, least),
                scale,
                targets,
                added,
            )
        if kind == "consistent":
            count = _HELD // self._shape[1] ** 4
            for start in range(0, len(at.F), count):
                some = slice(start, start + count)
                elements = self.elements.part(some)
                if self.law == "hooke":
                    moduli, singular = consistent_moduli(elements, at.R[some], at.F[some])
                else:
                    stable = self.law == "stable_neo_hookean"
                    moduli, singular = hyperelastic_moduli(elements, stable, at.F[some]), 0
                add_moduli(elements, moduli, scale, targets[some], added)
                left_out += singular
        pattern.fold(added, blocks)
        if self.ghost is not None:
            self.ghost.add_stiffness(pattern, blocks, scale)
        return left_out

    def add_tension_product(
        self, at: Configuration, vector: Floats, scale: float, out: Floats
    ) -> None:
        """Add `scale` times the geometric stiffness of a membrane times a vector (N, 3) to `out`.

        Raises
        ------
        XfemError
            If the body is no membrane, or an array not of it.
        """
        self._check(vector=vector, force=out)
        self._check_membrane()
        vectors = self.phantom.extend(vector)[self.phantom.cells]
        out += scale * self.nodal_force(tension_forces(self.elements, at.R, at.F, vectors))

    def nodal_force(self, forces: Floats) -> Floats:
        """Sum (N, d) of forces (p, c, d) at the corners of cells."""
        v = self.phantom
        nodes, count = v.cells.ravel(), len(v.corners.node_points)
        columns = forces.reshape(-1, forces.shape[2]).T
        return v.restrict(np.stack([np.bincount(nodes, f, count) for f in columns], axis=1))

    def _check_membrane(self) -> None:
        if not self.is_membrane:
            raise XfemError("geometric stiffness of a solid; expected a membrane in space")

    def stiffness(
        self,
        pattern: BlockPattern,
        displacement: Floats | None = None,
        kind: TangentKind = "consistent",
    ) -> Floats:
        """Assemble a tangent in nodal blocks (B, d, d), N/m, at a displacement or at rest."""
        at = self.configuration(np.zeros(self._shape) if displacement is None else displacement)
        blocks = np.zeros((len(pattern.columns), self._shape[1], self._shape[1]))
        self.add_stiffness(at, pattern, blocks, 1.0, kind)
        return blocks

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
    ) -> Configuration | None:
        """Overwrite force and stiffness of an implicit step.

        With the rotation-fixed tangent K_R and the consistent one K_C, both at u,

            force = f_int(u) + implicit K_R v,
            blocks = scale K_R + rotational (K_C − K_R).

        Parameters
        ----------
        pattern : BlockPattern
            Its first cells must be the cells of the body.
        displacement, velocity : (N, d) float array
        implicit : float
            In seconds; with zero the velocity is not read.
        scale : float
        force : (N, d) float array
            Overwritten.
        blocks : (B, d, d) float array
            Overwritten.
        whole : bool
            Without it blocks below the diagonal may be anything.
        rotational : float
            Without a meaning in linear kinematics, where K_C is K_R.

        Returns
        -------
        Configuration or None
            What was found on the way; nothing by the one pass of the kernels.
        """
        rotational = rotational if self.is_corotational else 0.0
        if self.has_one_pass:
            self._check(displacement=displacement, velocity=velocity)
            u, v = self.phantom.extend(displacement), self.phantom.extend(velocity)

            def run(one: OnePass, f: Floats, K: Floats, all_blocks: bool) -> None:
                one(u, v, implicit, scale, f, K, all_blocks, rotational)

            self.in_one_pass(pattern, run, force, blocks, whole)
            if self.ghost is not None:
                self.add_penalty(displacement + implicit * velocity, 1.0, force)
                self.ghost.add_stiffness(pattern, blocks, scale)
            return None
        at = self.configuration(displacement)
        self.evaluate_at(at, force)
        if implicit != 0.0:
            self.add_tangent_product(at, velocity, implicit, force)
        blocks[:] = 0.0
        if scale != rotational:
            self.add_stiffness(at, pattern, blocks, scale - rotational)
        if rotational != 0.0:
            self.add_stiffness(at, pattern, blocks, rotational, "consistent")
        return at

    def in_one_pass(
        self,
        pattern: BlockPattern,
        run: Callable[[OnePass, Floats, Floats, bool], None],
        force: Floats,
        blocks: Floats,
        whole: bool = True,
    ) -> None:
        """Overwrite force and stiffness of the dof nodes by a pass over the corners.

        Parameters
        ----------
        pattern : BlockPattern
        run : callable
            Overwrites force and blocks of the corners by the pass that it is given.
        force, blocks, whole
            As for `linearise`.
        """
        self._check(force=force)
        self._check_blocks(pattern, blocks)
        one, corners = self.prepare(pattern), pattern.corners
        if corners is pattern:
            run(one, force, blocks, whole)
            return
        corner_force = np.empty_like(self.phantom.corners.node_points)
        added = pattern.unfold(blocks)
        run(one, corner_force, added, True)
        force[:] = self.phantom.restrict(corner_force)
        blocks[:] = 0.0
        pattern.fold(added, blocks)

    def prepare(self, pattern: BlockPattern) -> OnePass:
        """Make the pass for a sparsity, which `linearise` does otherwise when first called."""
        assert self.kernels.one_pass is not None
        if self._pass is None or self._pass.pattern is not pattern.corners:
            self._pass = self.kernels.one_pass(self.elements, pattern.corners, self.is_corotational)
        return self._pass


def inverted_cells(force: InternalForce, displacement: Floats) -> Ints:
    """Find pieces (k,) whose deformation gradient has a negative determinant.

    Raises
    ------
    XfemError
        If the body is a membrane: it has no such determinant.
    """
    if force.is_membrane:
        raise XfemError("inversion of a membrane in space is not defined")
    return np.flatnonzero(np.linalg.det(force.deformation(displacement)) < 0.0)


def inside_out(force: InternalForce, displacement: Floats) -> str:
    """Say how many pieces are inside out and where the first is, undeformed; or nothing."""
    if force.is_membrane or not len(inverted := inverted_cells(force, displacement)):
        return ""
    mesh, first = force.phantom.mesh, force.elements.parent[inverted[0]]
    place = ", ".join(f"{x:.4g}" for x in mesh.points[mesh.cells[first]].mean(axis=0))
    effect = "the energy with ln J is infinite"
    if force.law != "neo_hookean":
        effect = "the force has no continuous stiffness"
    return (
        f"{len(inverted)} of {len(force.phantom.cells)} pieces are inside out, the first around "
        f"({place}), where {effect}"
    )
