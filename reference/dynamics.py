"""Linear motion of a cut body: generalised-α (Newmark), implicit Euler, an energy ledger."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference.elasticity import mass_form, stiffness_form
from reference.nodal_algebra import NodalMatrix, NodalSolver, assembled_matrix, nodal_forces
from reference.space import ConformingSpace
from verify.errors import InputError
from verify.scene import Material

__all__ = ["LinearMotion", "Moment", "Scheme", "generalised_alpha", "implicit_euler", "inherit"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Scheme:
    """Parameters of one-step schemes with one unknown acceleration a₊.

    M a_{n+1−α_m} + C v_{n+1−α_f} + K u_{n+1−α_f} = f, where n+1−α is (1−α)·new + α·old, with
    u₊ = u + Δt v + Δt² (β₀ a + β a₊) and v₊ = v + Δt (γ₀ a + γ a₊).
    """

    alpha_m: float
    alpha_f: float
    beta_old: float
    beta: float
    gamma_old: float
    gamma: float


def generalised_alpha(spectral_radius: float = 1.0) -> Scheme:
    """Make the generalised-α scheme of a spectral radius at infinite frequency.

    Of second order (Chung & Hulbert, J. Appl. Mech. 60, 1993). At 1 it is the midpoint form of
    the trapezoidal rule and dissipates nothing.
    """
    rho = spectral_radius
    if not 0.0 <= rho <= 1.0:
        raise InputError(f"spectral radius {rho}; expected 0 to 1")
    alpha_m, alpha_f = (2 * rho - 1) / (rho + 1), rho / (rho + 1)
    beta, gamma = (1 - alpha_m + alpha_f) ** 2 / 4, 0.5 - alpha_m + alpha_f
    return Scheme(alpha_m, alpha_f, 0.5 - beta, beta, 1 - gamma, gamma)


def implicit_euler() -> Scheme:
    """Make implicit Euler: u₊ = u + Δt v₊, v₊ = v + Δt a₊.

    Of first order; an amplitude is multiplied by 1/√(1+(ωΔt)²) per step.
    """
    return Scheme(0.0, 0.0, 0.0, 1.0, 0.0, 1.0)


@dataclass(frozen=True)
class Moment:
    """State and energies at one time.

    Attributes
    ----------
    time : float
        s.
    displacement, velocity : (n, d) arrays
        m, m/s.
    kinetic, strain, work : float
        J/m; `work` is what loads have done since the start.
    dissipated : float
        By damping and by the scheme since the start, J/m: what closes the balance.
    """

    time: float
    displacement: Array
    velocity: Array
    kinetic: float
    strain: float
    work: float
    dissipated: float


class LinearMotion:
    """Linear elastic motion on one mesh, from a given state; supports stay where they are.

    Parameters
    ----------
    material : Material
        With a density.
    space : ConformingSpace
    unknowns : (k,) int array
        Scalar unknowns held at their initial displacement.
    displacement, velocity : (n, d) arrays
        At the nodes of the space at `start`, m and m/s.
    load : callable, optional
        Gives the linear form of constant loads for a test function.
    damping : (float, float)
        Rayleigh: mass (1/s) and stiffness (s) factors.
    start : float
        Time, s.
    """

    def __init__(
        self,
        material: Material,
        space: ConformingSpace,
        unknowns: NDArray[np.int32],
        displacement: Array,
        velocity: Array,
        load: Any = None,
        damping: tuple[float, float] = (0.0, 0.0),
        start: float = 0.0,
    ) -> None:
        import ufl
        from dolfinx import fem

        V = space.function_space
        u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
        self._mass = NodalMatrix(assembled_matrix(mass_form(material, u, v)), space)
        self._stiffness = NodalMatrix(assembled_matrix(stiffness_form(material, u, v)), space)
        self._damping, self._held, self._time = damping, unknowns, start
        self._space = space
        self._u = np.array(displacement, dtype=float).ravel()
        self._v = np.array(velocity, dtype=float).ravel()
        self._v[unknowns] = 0.0
        zero = fem.Constant(V.mesh, np.zeros(space.dimension))
        form = ufl.inner(zero, v) * ufl.dx if load is None else load(v)
        self._force = nodal_forces(form, space)
        self._a = self._initial_acceleration()
        self._starts = True

    def run(self, scheme: Scheme, step: float, steps: int, every: int = 1) -> Iterator[Moment]:
        """March in time; give the initial state and every `every`-th of `steps` states.

        Parameters
        ----------
        scheme : Scheme
        step : float
            Δt, s.
        steps, every : int
        """
        solver = self._effective(scheme, step)
        if self._starts and self._damping[1] > 0.0 and scheme.alpha_m != scheme.alpha_f:
            # as of `Stepper.restart`: damping that is out of balance must not throw stiff modes
            left = self._remaining(self._u, self._v, 0.0 * self._a)
            self._a = (1 - scheme.alpha_m) * solver.solve(left)
        self._starts = False
        start_total = sum(self._energies())
        work = 0.0
        yield self._moment(work, start_total)
        for n in range(1, steps + 1):
            # predictors with a₊ = 0, then one solve for a₊
            before, old = self._u, scheme.alpha_f
            u = before + step * self._v + step**2 * scheme.beta_old * self._a
            v = self._v + step * scheme.gamma_old * self._a
            right = self._remaining(
                (1 - old) * u + old * before,
                (1 - old) * v + old * self._v,
                scheme.alpha_m * self._a,
            )
            self._a = solver.solve(right)
            self._u = u + step**2 * scheme.beta * self._a
            self._v = v + step * scheme.gamma * self._a
            work += float(self._force @ (self._u - before))
            self._time += step
            if n % every == 0 or n == steps:
                yield self._moment(work, start_total)
        solver.destroy()

    def _remaining(self, u: Array, v: Array, a: Array) -> Array:
        """Return the forces f − K u − C v − M a that are left, none where held."""
        mass, stiffness = self._damping
        right = self._force - self._stiffness @ (u + stiffness * v) - self._mass @ (mass * v + a)
        right[self._held] = 0.0
        return right

    def _effective(self, scheme: Scheme, step: float) -> NodalSolver:
        mass, stiffness = self._damping
        keep = 1 - scheme.alpha_f
        matrix = self._mass.petsc.copy()
        matrix.scale(1 - scheme.alpha_m + keep * scheme.gamma * step * mass)
        share = keep * (scheme.beta * step**2 + scheme.gamma * step * stiffness)
        matrix.axpy(share, self._stiffness.petsc)
        return NodalSolver(matrix, self._space, self._held)

    def _initial_acceleration(self) -> Array:
        """M a = f − C v − K u with a = 0 where held."""
        solver = NodalSolver(self._mass.petsc.copy(), self._space, self._held)
        acceleration = solver.solve(self._remaining(self._u, self._v, 0.0 * self._u))
        solver.destroy()
        return acceleration

    def _energies(self) -> tuple[float, float]:
        kinetic = 0.5 * float(self._v @ (self._mass @ self._v))
        return kinetic, 0.5 * float(self._u @ (self._stiffness @ self._u))

    def _moment(self, work: float, start_total: float) -> Moment:
        kinetic, strain = self._energies()
        d = self._space.dimension
        return Moment(
            self._time,
            self._u.reshape(-1, d).copy(),
            self._v.reshape(-1, d).copy(),
            kinetic,
            strain,
            work,
            start_total + work - kinetic - strain,
        )


def inherit(closed: ConformingSpace, opened: ConformingSpace, field: Array) -> Array:
    """Carry nodal values (n, d) over to the same mesh with more of its cuts open.

    Every copy of a node starts with the value that the node had: nothing jumps when a cut
    opens, so energy and momentum go on.

    Raises
    ------
    InputError
        If the two are not the same cells.
    """
    same = closed.cell_nodes.shape == opened.cell_nodes.shape and np.allclose(
        closed.node_points[closed.cell_nodes],
        opened.node_points[opened.cell_nodes],
        rtol=0.0,
        atol=1e-12 * float(np.ptp(closed.node_points, axis=0).max()),
    )
    if not same:
        raise InputError("the opened mesh does not have the cells of the closed one")
    values = np.empty((len(opened.node_points), field.shape[1]))
    values[opened.cell_nodes] = field[closed.cell_nodes]
    return values
