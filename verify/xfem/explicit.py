"""Explicit schemes, central differences and both Euler methods, and their largest stable step.

Central differences are written in velocity form, so that displacement and velocity belong to the
same instant. All of them are free of any linear solve if the mass is diagonal. Their critical step
is 2/ω_max, exact or by a bound per element.

In nonlinear motion a step below the critical one is not enough. Central differences turn a mode by
an angle θ per step, 2 sin(θ/2) = ωh. The time grid exchanges energy between any three or four modes
whose angles sum to 2π. No three do while ω_max h < √3, no four while ω_max h < √2 (Mandziuk &
Schlick 1995; Schlick et al. 1998). The latter is the share `RESONANCE_FREE` of the critical step.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import bsr_array, csr_array, issparse, kron
from scipy.sparse.linalg import LinearOperator, eigsh

from verify.xfem.arrays import Bools, Floats, XfemError
from verify.xfem.body import (
    DynamicBody,
    MotionState,
    RayleighDamping,
    StepFailedError,
    StepForces,
    check_no_contact,
    check_state,
    check_step,
    couples_supports,
)
from verify.xfem.element import Material
from verify.xfem.internal_force import inside_out
from verify.xfem.mass import Mass, cell_densities, inverse_of_mass
from verify.xfem.mesh import SimplexMesh


class _Explicit:
    """Base of the schemes: accelerations of a body, and the end of a step."""

    def __init__(self, body: DynamicBody, step_size: float) -> None:
        # stiffness of contact over mass grows like 1/ε at a sliver of share ε: no step is stable
        check_no_contact(body, type(self).__name__)
        self.body = body
        self.step_size = check_step(step_size)
        if body.moving and couples_supports(body):
            raise XfemError(
                "explicit step with moving supports whose nodes the mass couples to free ones; "
                "use the side-wise mass, and hold slivers there on their own or keep them"
            )

    def _acceleration(
        self, displacement: Floats, velocity: Floats, time: float
    ) -> tuple[Floats, StepForces]:
        forces = self.body.balance(displacement, velocity, time)
        return self.body.free_mass.solve(forces.unbalanced), forces

    def _finish(
        self, state: MotionState, displacement: Floats, velocity: Floats, time: float
    ) -> None:
        if not (np.isfinite(displacement).all() and np.isfinite(velocity).all()):
            inverted = np.isfinite(displacement).all() and inside_out(self.body.force, displacement)
            raise StepFailedError(
                f"{type(self).__name__}: not finite at t = {time:.6g} s with a step of "
                f"{self.step_size:.6g} s; {inverted or 'beyond the critical step?'}"
            )
        fixed = self.body.fixed
        where, speed = self.body.prescribed(time)
        displacement[fixed], velocity[fixed] = where[fixed], speed[fixed]
        state.displacement[:], state.velocity[:], state.time = displacement, velocity, time


def acceleration_of(body: DynamicBody, state: MotionState) -> Floats:
    """Compute the acceleration (N, d) in m/s² that balances all forces of a state.

    Where it is held it moves with the supports: zero if they do not say their acceleration.

    Raises
    ------
    XfemError
        If the mass couples free nodes to supports that move and do not say their acceleration, or
        the state is not one of the body.
    """
    check_state(state, body.shape)
    held = body.held_acceleration(state.time)
    if body.moving and held is None and couples_supports(body):
        raise XfemError(
            "acceleration of a body whose mass couples free nodes to moving supports; expected "
            "supports that say their acceleration"
        )
    forces = body.balance(state.displacement, state.velocity, state.time)
    return body.free_mass.solve(forces.unbalanced, held)


class CentralDifferences(_Explicit):
    """Central differences (velocity Verlet), second order, symplectic.

    Parameters
    ----------
    body : DynamicBody
    step_size : float
        In seconds; stable below `verify.xfem.explicit.critical_step` if linear. Damping takes the
        velocity of the start in the first half of a step, of the middle in the second half.

    Examples
    --------
    A piece without supports falls freely:

    >>> import verify.xfem as xfem
    >>> phantom = xfem.cut_mesh(xfem.rectangle_mesh((4, 4)), [])
    >>> force = xfem.InternalForce(phantom, xfem.isotropic(1e4, 0.3, "plane strain"))
    >>> mass = xfem.side_wise_mass(phantom, 1000.0)
    >>> body = xfem.DynamicBody(force, mass, mass.weight([0.0, -10.0]))
    >>> scheme, state = xfem.CentralDifferences(body, 1e-3), body.rest()
    >>> for _ in range(100):
    ...     forces = scheme.step(state)
    >>> state.displacement[:, 1].round(9).tolist()[:2]
    [-0.05, -0.05]
    """

    def __init__(self, body: DynamicBody, step_size: float) -> None:
        super().__init__(body, step_size)
        self._end: tuple[MotionState, Floats, StepForces] | None = None

    def _start(self, state: MotionState) -> tuple[Floats, StepForces]:
        """Return the acceleration at the start, from the last step if this one continues it."""
        if self._end is not None and self.body.damping == RayleighDamping():
            end, acceleration, forces = self._end
            goes_on = end.time == state.time and np.array_equal(
                end.displacement, state.displacement
            )
            # a load or weight may have been replaced since
            if goes_on and np.array_equal(self.body.external(state.time), forces.external):
                return acceleration, forces
        return self._acceleration(state.displacement, state.velocity, state.time)

    def step(self, state: MotionState) -> StepForces:
        """Advance by one step."""
        check_state(state, self.body.shape)
        h = self.step_size
        first, before = self._start(state)
        middle = state.velocity + 0.5 * h * first
        displacement = state.displacement + h * middle
        time = state.time + h
        where, _ = self.body.prescribed(time)
        displacement[self.body.fixed] = where[self.body.fixed]
        second, after = self._acceleration(displacement, middle, time)
        self._finish(state, displacement, middle + 0.5 * h * second, time)
        kept = StepForces(after.internal, after.external.copy(), after.viscous)
        self._end = (state.copy(), second, kept)
        return StepForces(
            0.5 * (before.internal + after.internal),
            0.5 * (before.external + after.external),
            0.5 * (before.viscous + after.viscous),
        )


class SymplecticEuler(_Explicit):
    """New velocity first, then the displacement with it: stable up to the critical step.

    Parameters
    ----------
    body : DynamicBody
    step_size : float
        In seconds.
    """

    _moves_with_new_velocity = True

    def step(self, state: MotionState) -> StepForces:
        """Advance by one step."""
        check_state(state, self.body.shape)
        h = self.step_size
        acceleration, forces = self._acceleration(state.displacement, state.velocity, state.time)
        velocity = state.velocity + h * acceleration
        moving = velocity if self._moves_with_new_velocity else state.velocity
        self._finish(state, state.displacement + h * moving, velocity, state.time + h)
        return replace(forces, loaded_at=((0.0, 1.0),))


class ForwardEuler(SymplecticEuler):
    """(2.43–44) as printed: unstable at every step without damping; a negative control.

    It moves with the velocity before the step. Parameters as for `SymplecticEuler`.
    """

    _moves_with_new_velocity = False


RESONANCE_FREE = float(np.sqrt(0.5))
_DENSE = 400  # unknowns up to which all eigenvalues are cheaper than a Lanczos iteration


def critical_step(
    stiffness: bsr_array | csr_array,
    mass: Mass,
    fixed: Bools | None = None,
    tolerance: float = 1e-6,
) -> float:
    """Compute critical step of the assembled body, by a Lanczos iteration on Lᵀ K L, M⁻¹ = L Lᵀ.

    The scaling on both sides keeps the iteration accurate with slivers, whose mass and stiffness
    go to zero together.

    Parameters
    ----------
    stiffness : (N d, N d) sparse array
        At the state of interest; linear, or tangent.
    mass : Mass
    fixed : (N, d) bool array, optional
        Supported components. They may be left out: that only makes the step smaller.
    tolerance : float
        Relative, of the eigenvalue.

    Returns
    -------
    float
        In seconds; infinite if nothing resists.

    Raises
    ------
    XfemError
        If sizes do not match or everything is fixed.

    Examples
    --------
    Two masses of 0.5 kg at a spring of 1 N/m, once per component: ω² = 4.

    >>> import numpy as np
    >>> from scipy.sparse import csr_array, diags_array
    >>> import verify.xfem as xfem
    >>> from verify.xfem.mass import Mass
    >>> masses = np.array([0.5, 0.5])
    >>> mass = Mass(csr_array(diags_array(masses)), csr_array(diags_array(masses**-0.5)), masses)
    >>> round(xfem.critical_step(csr_array([[1.0, -1.0], [-1.0, 1.0]]), mass), 9)
    1.0
    """
    if not (issparse(stiffness) or isinstance(stiffness, np.ndarray)):
        raise XfemError(f"stiffness of type {type(stiffness).__name__}; expected a sparse array")
    K = csr_array(stiffness)
    if not np.isfinite(K.data).all():
        raise XfemError("stiffness with an entry that is not finite")
    nodes = mass.matrix.shape[0]
    if K.shape[0] == 0 or K.shape[0] % nodes or K.shape[0] != K.shape[1]:
        raise XfemError(f"stiffness of shape {K.shape} with a mass of {nodes} dof nodes")
    block = np.eye(K.shape[0] // nodes)
    free = np.arange(K.shape[0])
    if fixed is not None:
        held = np.asarray(fixed)
        if held.size != K.shape[0] or held.dtype != bool:
            raise XfemError(
                f"supports of shape {held.shape} and type {held.dtype}; expected one bool for each "
                f"of {K.shape[0]} components"
            )
        free = np.flatnonzero(~held.ravel())
        if len(free) == 0:
            raise XfemError("every component is fixed: no step is critical")
    M = csr_array(kron(mass.matrix, block))
    if mass.root is not None and (mass.diagonal is not None or fixed is None):
        L = csr_array(kron(mass.root, block))
        A = L.T @ K @ L
        if mass.diagonal is not None:
            A = A[free][:, free]
        return _step(_largest(A, tolerance))
    return _step(_largest_general(K[free][:, free], M[free][:, free], tolerance))


def _step(eigenvalue: float) -> float:
    return float(2.0 / np.sqrt(eigenvalue)) if eigenvalue > 0.0 else float("inf")


def _largest(A: csr_array, tolerance: float) -> float:
    if A.shape[0] <= _DENSE:
        return float(np.linalg.eigvalsh(A.toarray())[-1])
    return float(eigsh(A, k=1, which="LA", tol=tolerance, return_eigenvectors=False)[0])


def _largest_general(K: csr_array, M: csr_array, tolerance: float) -> float:
    """Compute the largest λ of K x = λ M x, M not diagonal.

    Scaled to a unit diagonal of M first: slivers make its raw condition number 1/ε.
    """
    scale = 1.0 / np.sqrt(M.diagonal())
    K = K * scale[:, None] * scale[None, :]
    M = M * scale[:, None] * scale[None, :]
    inverse = inverse_of_mass(M)
    if K.shape[0] <= _DENSE:
        factor = np.linalg.inv(np.linalg.cholesky(M.toarray()))
        return float(np.linalg.eigvalsh(factor @ K.toarray() @ factor.T)[-1])
    given = LinearOperator(K.shape, matvec=inverse)
    values = eigsh(K, k=1, M=M, Minv=given, which="LA", tol=tolerance, return_eigenvectors=False)
    return float(values[0])


def element_critical_steps(
    mesh: SimplexMesh, material: Material, density: ArrayLike, strain: float = 0.0
) -> NDArray:
    """Compute the critical step (m,) of each uncut element alone, with its mass lumped.

    The smallest bounds from below the step of any cut body with side-wise mass: a piece has
    stiffness and mass of its element, times the same factor.

    Parameters
    ----------
    mesh : SimplexMesh
    material : Material
    density : float or (m,) array_like
        In kg/m³.
    strain : float
        For corotational motion: the largest principal stretch − 1 in reach, up to 2. With polar
        rotations R the second derivative of the potential is, in the axes of the stretch,

            2μ|sym|² + λ tr² + Σ_{i<j} s_ij² [μ + (λ tr(U − I) − 2μ)/(u_i + u_j)],

        s = RᵀδF − δFᵀR: the linear stiffness, turned, and a stiffness against rotation that grows
        with the stretch. Its largest value is added here. So the bound holds for the consistent
        tangent at any rotation, as long as no stretch exceeds 1 + strain.

    Raises
    ------
    XfemError
        If the strain is outside 0…2, the range in which equal stretches have the largest factor. If
        the density is not positive and finite, or there are not as many values as cells.
    """
    if not 0.0 <= strain <= 2.0:
        raise XfemError(f"strain {strain!r} in reach; expected 0 to 2")
    b = mesh.gradients
    space = mesh.space
    count = len(mesh.cells)
    densities = cell_densities(mesh, density)
    first, second = material.of_cells(count)
    lam = first[:, None, None, None, None]
    mu = second[:, None, None, None, None]
    # unknowns scaled by a unit mass: K_ij (d + 1)/(ρ V)
    eye = np.eye(space)
    # K_ij = λ b_i b_jᵀ + μ (b_j b_iᵀ + b_i·b_j I)
    dots = np.einsum("eik,ejk->eij", b, b)
    diagonal = np.einsum("eij,kl->eikjl", dots, eye)
    turned = np.einsum("ejk,eil->eikjl", b, b)
    K = lam * np.einsum("eik,ejl->eikjl", b, b) + mu * (turned + diagonal)
    K += _against_rotation(mesh, lam, mu, strain) * 0.5 * (diagonal - turned)
    size = (mesh.dim + 1) * space
    largest = np.linalg.eigvalsh(K.reshape(count, size, size))[:, -1]
    return 2.0 / np.sqrt(largest * (mesh.dim + 1) / densities)


def _against_rotation(mesh: SimplexMesh, lam: NDArray, mu: NDArray, strain: float) -> NDArray:
    """Compute largest factor of |skew|² in the second derivative for stretches up to 1 + strain.

    All stretches are at their largest. A membrane (d = 2 in space) in tension resists rotation of
    its plane with T/u |n·δF|². The linear stiffness with its μ and twice the factor cover that.
    """
    factor: NDArray = (2.0 * mu + mesh.dim * lam) * strain / (1.0 + strain)
    return 2.0 * factor if mesh.is_membrane else factor
