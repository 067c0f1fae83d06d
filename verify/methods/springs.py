"""Mass–spring model of a cut body: springs on the edges of its cells, and their stiffness.

The stiffness comes from Young's modulus and Poisson's ratio:

"fitted"
    The linear stiffness of the springs of each cell is nearest to the finite element's in the
    Frobenius norm. Source: Lloyd, Székely & Harders, *Identification of spring parameters for
    deformable object simulation*, IEEE TVCG 13 (2007). For equilateral triangles it gives their
    E√3/4 (plane stress, ν = 1/3), for regular tetrahedra their 2√2/25·E l (ν = 1/4).
"van_gelder"
    k = Σ over cells of E V / l² (Van Gelder, *Approximate simulation of elastic membranes by
    triangulated spring meshes*, J. Graphics Tools 3 (1998)), V the area or volume of the cell.

Springs along edges obey Cauchy's relations, so that isotropy needs λ = μ: ν = 1/4 in space and in
plane strain, 1/3 in plane stress. Whatever the fit, no other ratio can be had, and even these only
where the edges are arranged as in equilateral triangles.
"""

from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from verify.compiled import njit
from verify.xfem.arrays import Floats, XfemError, check_choice
from verify.xfem.block_pattern import BlockPattern
from verify.xfem.element import Material
from verify.xfem.internal_force import InternalForce, Kinematics, TangentKind
from verify.xfem.linear_solvers import PLAIN, Kernels
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import PhantomMesh

Fit = Literal["fitted", "van_gelder"]


def cell_edges(dim: int) -> NDArray[np.int64]:
    """Return the (e, 2) local nodes of the edges of a simplex."""
    return np.stack(np.triu_indices(dim + 1, 1), axis=1)


def spring_stiffness(
    mesh: SimplexMesh, material: Material, fit: Fit = "fitted"
) -> tuple[Floats, NDArray[np.bool_]]:
    """Make the stiffness of the springs of each cell alone, in N/m (per metre of thickness in 2D).

    Parameters
    ----------
    mesh : SimplexMesh
        A solid.
    material : Material
    fit : {"fitted", "van_gelder"}

    Returns
    -------
    stiffness : (m, e) float array
        Not negative.
    clamped : (m, e) bool array
        Springs that the fit would make negative, and that are left out.

    Raises
    ------
    XfemError
        If the fit is unknown or the mesh a membrane.
    """
    if mesh.is_membrane:
        raise XfemError("springs of a membrane in space; expected triangles in the plane or tets")
    count = len(mesh.cells)
    lam, mu = (np.broadcast_to(x, count).astype(float) for x in (material.lam, material.mu))
    edges = cell_edges(mesh.dim)
    along = mesh.points[mesh.cells[:, edges[:, 1]]] - mesh.points[mesh.cells[:, edges[:, 0]]]
    squared = (along**2).sum(axis=2)
    if fit == "van_gelder":
        # E of the material from λ and μ of the problem at hand: stress over strain, sides free
        young = mu * (2.0 * mu + mesh.dim * lam) / (mu + 0.5 * (mesh.dim - 1) * lam)
        return (young * mesh.measures)[:, None] / squared, np.zeros(squared.shape, dtype=bool)
    if fit != "fitted":
        raise XfemError(f"spring fit '{fit}'; expected fitted or van_gelder")
    # spring e: the matrix v vᵀ, v = −t at its first node and t at its second, so that the products
    # of two of them, and of one with K, are small sums over common nodes
    t = along / np.sqrt(squared)[:, :, None]
    incidence = np.zeros((len(edges), mesh.dim + 1))
    incidence[np.arange(len(edges)), edges[:, 0]] = -1.0
    incidence[np.arange(len(edges)), edges[:, 1]] = 1.0
    cosine = np.einsum("mei,mfi->mef", t, t) * (incidence @ incidence.T)
    stretch = np.einsum("en,mni,mei->me", incidence, mesh.gradients, t)  # t·grad u·t of v itself
    slope = np.einsum("en,mni->mei", incidence, mesh.gradients)
    # vᵀK v = V (λ tr² ε + 2μ ε:ε), ε the symmetric part of t ⊗ slope
    shear = 0.5 * ((slope**2).sum(axis=2) + stretch**2)
    target = mesh.measures[:, None] * (lam[:, None] * stretch**2 + 2.0 * mu[:, None] * shear)
    return _non_negative(cosine**2, target)


def _non_negative(gram: Floats, target: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Compute least squares with the worst negative unknown left out, until none is negative."""
    count, size = target.shape
    clamped = np.zeros((count, size), dtype=bool)
    eye = np.eye(size, dtype=bool)
    while True:
        held = clamped[:, :, None] | clamped[:, None, :]
        system = np.where(held, eye, gram)
        solution = np.linalg.solve(system, np.where(clamped, 0.0, target)[:, :, None])[:, :, 0]
        negative = solution < -1e-12 * np.abs(solution).max(axis=1, keepdims=True)
        bad = np.flatnonzero(negative.any(axis=1))
        if len(bad) == 0:
            return np.maximum(solution, 0.0), clamped
        clamped[bad, solution[bad].argmin(axis=1)] = True


@njit(cache=True)
def spring_force(cells, edges, rest, stiffness, displacement, turning, directions, excess, force):
    """Add the force of all springs to `force` (N, d); return their energy.

    `rest` (p, e, d) are edge vectors of the undeformed cells. `directions` (p, e, d) and `excess`
    (p, e), 1 − rest length / length, are written if the springs turn.
    """
    energy = 0.0
    space = displacement.shape[1]
    change = np.empty(space)
    for p in range(len(cells)):
        for e in range(len(edges)):
            a, b = cells[p, edges[e, 0]], cells[p, edges[e, 1]]
            squared, short = 0.0, 0.0
            for k in range(space):
                change[k] = displacement[b, k] - displacement[a, k]
                squared += (rest[p, e, k] + change[k]) ** 2
                short += rest[p, e, k] ** 2
            length, short = np.sqrt(squared), np.sqrt(short)
            stretch = 0.0
            if turning:
                # l − l0 without cancellation: (l² − l0²)/(l + l0)
                for k in range(space):
                    stretch += change[k] * (2.0 * rest[p, e, k] + change[k])
                    if length > 0.0:
                        directions[p, e, k] = (rest[p, e, k] + change[k]) / length
                stretch /= length + short
                excess[p, e] = stretch / length if length > 0.0 else 0.0
            else:
                for k in range(space):
                    stretch += change[k] * directions[p, e, k]
            pull = stiffness[p, e] * stretch
            energy += 0.5 * pull * stretch
            for k in range(space):
                force[a, k] -= pull * directions[p, e, k]
                force[b, k] += pull * directions[p, e, k]
    return energy


@njit(cache=True)
def add_spring_stiffness(targets, edges, stiffness, directions, excess, exact, scale, blocks):
    """Add `scale` times the stiffness to nodal blocks (B, d, d).

    Exact: k (t tᵀ + (1 − l0/l)(I − t tᵀ)); else without what a compressed spring takes away.
    """
    space = blocks.shape[1]
    for p in range(len(targets)):
        for e in range(len(edges)):
            i, j = edges[e, 0], edges[e, 1]
            across = excess[p, e]
            if not exact and across < 0.0:
                across = 0.0
            for k in range(space):
                for l in range(space):
                    value = (1.0 - across) * directions[p, e, k] * directions[p, e, l]
                    if k == l:
                        value += across
                    value *= scale * stiffness[p, e]
                    blocks[targets[p, i, i], k, l] += value
                    blocks[targets[p, j, j], k, l] += value
                    blocks[targets[p, i, j], k, l] -= value
                    blocks[targets[p, j, i], k, l] -= value


@njit(cache=True)
def spring_product(cells, edges, stiffness, directions, vector, scale, out):
    """Add `scale` k t tᵀ v of all springs to `out` (N, d)."""
    space = vector.shape[1]
    for p in range(len(cells)):
        for e in range(len(edges)):
            a, b = cells[p, edges[e, 0]], cells[p, edges[e, 1]]
            along = 0.0
            for k in range(space):
                along += directions[p, e, k] * (vector[b, k] - vector[a, k])
            along *= scale * stiffness[p, e]
            for k in range(space):
                out[a, k] -= along * directions[p, e, k]
                out[b, k] += along * directions[p, e, k]


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

    displacement: Floats
    directions: Floats
    excess: Floats
    force: Floats
    energy: float


class SpringForce(InternalForce):
    """Internal force of springs, in the place of finite elements.

    It serves the statics at large rotations and the time integrators of `verify.xfem`. Exceptions
    are integrators of the stress along a step (`EnergyMomentum`) or with kernels of their own
    (`RealTimeEuler`). Masses are lumped side-wise.

    Parameters
    ----------
    phantom : PhantomMesh
        Pieces of cells have springs on all edges of their cell, weaker by their share of it.
    material : Material
        Approximated by the springs; see `verify.methods.springs`.
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

    def configuration(self, displacement: Floats) -> Any:
        """Return springs at a displacement (N, d), with their force and energy."""
        if displacement.shape != self._shape:
            raise XfemError(f"displacement of shape {displacement.shape}; expected {self._shape}")
        directions, excess = self._directions.copy(), np.zeros(self.springs.shape)
        force = np.zeros(self._shape)
        energy = spring_force(
            self.phantom.cells, self._edges, self._rest, self.springs, displacement,
            self.is_corotational, directions, excess, force,
        )  # fmt: skip
        return Stretched(displacement, directions, excess, force, float(energy))

    def evaluate_at(self, at: Any, out: Floats | None = None) -> tuple[Floats, float]:
        """Return internal force (N, d) in newtons and energy in joules; see `InternalForce`."""
        force = np.empty(self._shape) if out is None else out
        force[:] = at.force
        return force, at.energy

    def add_tangent_product(self, at: Any, vector: Floats, scale: float, out: Floats) -> None:
        """Add `scale` K v (N, d), K along the springs as they are, to `out`."""
        spring_product(
            self.phantom.cells, self._edges, self.springs, at.directions, vector, scale, out
        )

    def add_stiffness(
        self,
        at: Any,
        pattern: BlockPattern,
        blocks: Floats,
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
