"""Energy-momentum scheme: the stress is averaged over the step, `averaged_stress`."""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from verify.xfem.averaged_stress import StepEnds, averaged_moduli, averaged_stress
from verify.xfem.body import DynamicBody, StepForces
from verify.xfem.element import add_moduli
from verify.xfem.errors import XfemError
from verify.xfem.implicit import NewtonIntegrator
from verify.xfem.internal_force import TangentKind
from verify.xfem.linear_solvers import LinearSolver

__all__ = ["EnergyMomentum"]

_Floats = NDArray[np.float64]

# after so many evaluations in a step, cells that have taken the substitute keep it
_FREE_EVALUATIONS = 8


class EnergyMomentum(NewtonIntegrator):
    """Conserves energy, linear and angular momentum of a free body at any amplitude and step.

    The internal force is a discrete gradient of the potential; see
    `verify.xfem.averaged_stress`. Its stiffness is not symmetric, and differs
    from half of that at the end by the square of the turn in a step. Corrections take the latter,
    which is found in a tenth of the time, as long as each takes half of the residual off.

    Parameters are those of `NewtonIntegrator`; with a `solver` all corrections take the former.

    Attributes
    ----------
    substituted : (p,) bool array
        Pieces that, in the last step, were too inverted for the stress in its plain form.
    """

    rate = 2.0
    share = 0.5

    def __init__(
        self,
        body: DynamicBody,
        step_size: float,
        tolerance: float = 1e-12,
        iterations: int = 80,
        solver: LinearSolver | None = None,
    ) -> None:
        if not body.force.has_stress:
            raise XfemError("springs have no stress field; expected an integrator that needs none")
        super().__init__(body, step_size, tolerance, iterations, solver)
        self._first = body.force.rotations.copy()
        self._evaluations = 0
        self._asks_for_all = solver is not None and body.force.is_corotational
        self._takes_all = False  # of the derivative of the force
        self.substituted = np.zeros(len(self._first), dtype=bool)

    @cached_property
    def _general(self) -> LinearSolver:
        if self._asks_for_all:
            return self._solver
        return self.body.force.kernels.general(self.body.pattern, self.body.shape[1])

    def _prepare(self) -> None:
        force = self.body.force
        if not force.has_one_pass:
            force.evaluate(self._start.displacement)
            self._first[:] = force.rotations
        self._evaluations = 0
        self._takes_all = self._asks_for_all

    def _forces(self, displacement: _Floats, velocity: _Floats, time: float) -> StepForces:
        body, start = self.body, self._start
        internal = np.zeros(body.shape)
        if body.force.is_corotational:
            self._evaluations += 1
            if self._evaluations <= _FREE_EVALUATIONS:
                self.substituted[:] = False
            self._average(displacement, internal)
        else:
            mean = 0.5 * (start.displacement + displacement)
            body.force.add_tangent_product(mean, 1.0, internal)
        middle = start.time + 0.5 * self.step_size
        viscous = body.viscous(0.5 * (start.velocity + velocity))
        return StepForces(internal, body.external(middle), viscous)

    def _ends(self, displacement: _Floats) -> StepEnds:
        """Both ends of the step, with the rotations of the last evaluation."""
        force = self.body.force
        F0 = force.deformation(self._start.displacement).copy()
        return StepEnds(F0, force.deformation(displacement), self._first, force.rotations)

    def _average(self, displacement: _Floats, internal: _Floats) -> None:
        """Write the force of a step that ends like this; substituted cells are updated."""
        force, before = self.body.force, self._start.displacement
        if force.has_one_pass:
            force.linearise_average(
                self.body.pattern, before, displacement, self.substituted, self._stiffness_share,
                internal, self._blocks, not self._solver.reads_half, self.share,
            )  # fmt: skip
            self._is_linearised = True
            return
        force.evaluate(displacement)
        P = averaged_stress(force.elements, self._ends(displacement), self.substituted)
        P *= force.elements.volumes[:, None, None]
        gradients = force.elements.gradients[force.elements.parent]
        internal[:] = force.nodal_force(gradients @ P.transpose(0, 2, 1))
        force.add_penalty(0.5 * (before + displacement), 1.0, internal)

    def _solved(self, displacement: _Floats, residual: _Floats, kind: TangentKind) -> _Floats:
        self._takes_all |= self._is_slow and self.body.force.is_corotational
        if not self._takes_all:
            return super()._solved(displacement, residual, kind)
        self._is_linearised = False
        self._assemble(displacement, kind)
        self._general.factorize(self._blocks)
        return self._general.solve(residual)

    def _add_stiffness(self, displacement: _Floats, kind: TangentKind) -> None:
        force = self.body.force
        if not self._takes_all:
            super()._add_stiffness(displacement, kind)
            return
        v, pattern = force.phantom, self.body.pattern
        if force.has_one_pass:
            force.evaluate(self._start.displacement)
            self._first[:] = force.rotations
            force.evaluate(displacement)
        added, elements = pattern.unfold(self._blocks), force.elements
        moduli = averaged_moduli(elements, self._ends(displacement), self.substituted)
        add_moduli(elements, moduli, 1.0, pattern.targets[: len(v.cells)], added)
        pattern.fold(added, self._blocks)
        if force.ghost is not None:
            force.ghost.add_stiffness(self.body.pattern, self._blocks, self.share)
