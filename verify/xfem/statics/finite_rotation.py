"""Static equilibrium at large rotations: Newton's method with load steps."""

from collections.abc import Callable
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from verify.xfem.assembly_kernels import constrain
from verify.xfem.corotation.internal_force import InternalForce
from verify.xfem.errors import XfemError
from verify.xfem.sparse.block_pattern import block_pattern
from verify.xfem.sparse.cholesky import Cholesky, SingularStiffnessError
from verify.xfem.sparse.conjugate_gradients import ConjugateGradients, NotConvergedError
from verify.xfem.statics.linear import ITERATE_FROM

__all__ = ["NotInEquilibriumError", "StaticEquilibrium", "static_equilibrium"]

_Floats = NDArray[np.float64]

_HALVINGS = 12
_ROUND_OFF = 256.0 * np.finfo(float).eps
# of membranes, tensions over μ: at first, below which the exact stiffness is tried, and the least
_TAUT, _SLACK, _LEAST, _FALL = 1.0, 1e-3, 1e-6, 0.1
_ENOUGH = 1e-4  # of the fall of the energy that its slope promises
# of what turning adds to the stiffness, the shares that are tried until it is positive definite
_TURNS = (1.0, 0.5, 0.25, 0.125, 0.0)
_COLLAPSED = 1e-3  # of the largest stretch
_UNSEEN = 1e-12  # of the energy
_INEXACT = 1e-6  # residual that conjugate gradients leave of a correction: Newton's method goes on


class NotInEquilibriumError(RuntimeError):
    """Newton's method has not found the equilibrium of a load step."""


class StaticEquilibrium(NamedTuple):
    """A converged state.

    Attributes
    ----------
    displacement : (N, d) float array
        In metres.
    energy : float
        Strain energy in joules.
    reactions : (N, d) float array
        Forces of the supports in newtons; zero at free components.
    iterations : tuple of int
        Corrections of each load step.
    """

    displacement: _Floats
    energy: float
    reactions: _Floats
    iterations: tuple[int, ...]


def static_equilibrium(
    force: InternalForce,
    fixed: NDArray[np.bool_],
    prescribed: Callable[[float], _Floats] | None = None,
    load: _Floats | None = None,
    load_steps: int = 1,
    tolerance: float = 1e-10,
    iterations: int = 60,
    start: _Floats | None = None,
) -> StaticEquilibrium:
    """Displacement with f_int(u) = load, u given on the fixed components.

    Newton's method; where a correction does not make the residual smaller, or the exact stiffness
    is not positive definite, it goes down the potential energy instead, along corrections by as
    much of the stiffness of turning as leaves it positive definite. Past a limit point (a column
    that buckles, an arch that snaps through) that ends in an equilibrium beyond.

    Parameters
    ----------
    force : InternalForce
    fixed : (N, d) bool array
        Every piece must be held.
    prescribed : callable, optional
        Displacement (N, d) at a fraction s in (0, 1] of the path, read where fixed; zero without.
    load : (N, d) float array, optional
        Dead nodal forces at the end of the path; they grow in proportion to s.
    load_steps : int
        Equal parts of the path.
    tolerance : float
        Of the residual, over the largest of load, reactions and internal force.
    iterations : int
        Allowed per load step.
    start : (N, d) float array, optional
        First guess.

    Raises
    ------
    NotInEquilibriumError
        If a load step does not converge. Where pieces have collapsed on the way, it says so: the
        force is not continuous there, and there may be none that balances the load.
    SingularStiffnessError
        If something is not held.
    XfemError
        If a shape is wrong, a number not finite, or tolerance, load steps or iterations are not
        positive.
    """
    virtual = force.virtual
    shape = (virtual.node_count, virtual.mesh.space)
    if fixed.shape != shape or fixed.dtype != bool:
        raise XfemError(f"supports of shape {fixed.shape}, {fixed.dtype}; expected {shape}, bool")
    if load_steps < 1 or iterations < 1 or not tolerance > 0.0:
        raise XfemError(
            f"{load_steps} load steps, {iterations} iterations, tolerance {tolerance:g}; expected "
            "at least one, at least one, and more than zero"
        )
    full_load = np.zeros(shape) if load is None else _checked("load", load, shape)
    method = _Descent if force.is_membrane else _Newton
    newton = method(force, fixed, tolerance, iterations)
    displacement = np.zeros(shape) if start is None else _checked("start", start, shape).copy()
    counts = []
    for k in range(1, load_steps + 1):
        share = k / load_steps
        wanted = np.zeros(shape) if prescribed is None else prescribed(share)
        if wanted.shape == shape:  # what is not fixed may be anything
            wanted = np.where(fixed, wanted, displacement)
        change = _checked("prescribed displacement", wanted, shape) - displacement
        displacement, count = newton.solve(displacement, change, share * full_load)
        counts.append(count)
    internal, energy = force.evaluate(displacement)
    reactions = np.where(fixed, internal - full_load, 0.0)
    return StaticEquilibrium(displacement, energy, reactions, tuple(counts))


def _checked(name: str, values: _Floats, shape: tuple[int, int]) -> _Floats:
    if values.shape != shape or not np.isfinite(values).all():
        raise XfemError(f"{name} of shape {values.shape}; expected finite {shape}")
    return values


class _Place(NamedTuple):
    """Displacement (N, d), its residual (N, d) and what both are judged by."""

    displacement: _Floats
    residual: _Floats
    norm: float
    scale: float  # to which the norm compares, N
    energy: float  # potential, J


class _Newton:
    def __init__(
        self, force: InternalForce, fixed: NDArray[np.bool_], tolerance: float, iterations: int
    ) -> None:
        self._force, self._fixed = force, fixed
        self._tolerance, self._iterations = tolerance, iterations
        virtual = force.virtual
        space = virtual.mesh.space
        self._pattern = block_pattern(virtual.cells, virtual.node_count)
        self._blocks = np.zeros((len(self._pattern.columns), space, space))
        large = virtual.cells.shape[1] == 4 and virtual.node_count >= ITERATE_FROM
        self._iterative = ConjugateGradients(self._pattern, space, _INEXACT) if large else None

    @cached_property
    def _direct(self) -> Cholesky:
        return Cholesky(self._pattern, self._blocks.shape[1], self._fixed.all(axis=1))

    def solve(self, displacement: _Floats, change: _Floats, load: _Floats) -> tuple[_Floats, int]:
        """Equilibrium after a change of the fixed components, and the solves that it took."""
        start = self._place(displacement, load)
        place = self._place(displacement + self._spread(start, change), load)
        count = 1
        while not self._is_small(place):
            if count == self._iterations or not np.isfinite(place.norm):
                raise NotInEquilibriumError(
                    f"residual {place.norm:.3g} N against forces of {place.scale:.3g} N after "
                    f"{count} iterations; expected {self._tolerance:g} of them. "
                    f"{self._why(place)}"
                )
            place = self._next(place, load)
            count += 1
        return place.displacement, count

    def _why(self, place: _Place) -> str:
        """Say what stood in the way, as far as it can be seen."""
        collapsed = self._force.collapsed(place.displacement, _COLLAPSED)
        if len(collapsed) == 0:
            return "More load steps may help"
        return (
            f"{len(collapsed)} of {len(self._force.virtual.cells)} pieces have collapsed, the "
            f"first number {collapsed[0]}: the force is not continuous there (a strip is so thin "
            "at a stretch of 1 + 1/ν), so that there may be no equilibrium"
        )

    def _spread(self, start: _Place, change: _Floats) -> _Floats:
        """Spread the prescribed change with the stiffness before it."""
        return self._correct(start.displacement, start.residual, change)

    def _next(self, place: _Place, load: _Floats) -> _Place:
        """Place with a smaller residual; if that is not a correction away, one further down."""
        leap = place
        for turning in _TURNS:
            try:
                correction = self._solve(place.displacement, place.residual, None, turning)
            except SingularStiffnessError:
                if turning == 0.0:
                    raise
                continue
            if turning == 1.0:
                trial = self._place(place.displacement + correction, load)
                if trial.norm < place.norm:
                    return trial
                leap = trial
            share = self._share_downhill(place, correction, load)
            if share > 0.0:
                return self._place(place.displacement + share * correction, load)
        return leap  # beside a piece whose force jumps, or in round-off

    def _share_downhill(self, place: _Place, correction: _Floats, load: _Floats) -> float:
        """Share of a correction that lowers the potential energy as its slope says; 0 if none."""
        fall = float(np.vdot(place.residual, correction))
        for halving in range(_HALVINGS):
            share = 0.5**halving
            trial = self._place(place.displacement + share * correction, load)
            # below the round-off of the energy
            unseen = share * fall < _UNSEEN * abs(place.energy)
            falls = trial.energy <= place.energy - _ENOUGH * share * fall
            if falls or (unseen and trial.norm < place.norm):
                return share
        return 0.0

    def _is_small(self, place: _Place) -> bool:
        """Whether a residual is within the tolerance, or what round-off of positions leaves."""
        reach = np.abs(self._force.virtual.node_points + place.displacement).max()
        round_off = _ROUND_OFF * float(np.abs(self._blocks).max()) * reach
        return place.norm <= max(self._tolerance * place.scale, round_off)

    def _place(self, displacement: _Floats, load: _Floats) -> _Place:
        internal, energy = self._force.evaluate(displacement)
        scale = max(float(np.linalg.norm(internal)), float(np.linalg.norm(load)))
        potential = energy - float(np.vdot(load, displacement))
        residual = np.where(self._fixed, 0.0, load - internal)
        return _Place(displacement, residual, float(np.linalg.norm(residual)), scale, potential)

    def _correct(self, displacement: _Floats, residual: _Floats, change: _Floats | None) -> _Floats:
        try:
            return self._solve(displacement, residual, change, 1.0)
        except SingularStiffnessError:
            return self._solve(displacement, residual, change, 0.0)

    def _solve(
        self,
        displacement: _Floats,
        residual: _Floats,
        change: _Floats | None,
        turning: float,
        least: float = 0.0,
    ) -> _Floats:
        """Solve for a change of the fixed components, or for the residual.

        `turning` is the share of what turning pieces add to the stiffness. Without it membranes
        have the stiffness of their tension, taken to be `least` at least.
        """
        pattern, blocks = self._pattern, self._blocks
        blocks[:] = 0.0
        self._force.evaluate(displacement)
        if turning > 0.0:
            self._force.add_stiffness(pattern, blocks, turning, "exact", displacement)
        if turning < 1.0:
            self._force.add_stiffness(pattern, blocks, 1.0 - turning)
        if turning == 0.0 and self._force.is_membrane:
            nothing = np.zeros_like(displacement)
            self._force.add_tension(
                pattern, displacement, nothing, 0.0, 1.0, nothing, blocks, least
            )
        load = residual.copy()
        if change is not None:
            load -= (pattern.matrix(blocks) @ change.ravel()).reshape(change.shape)
            load[self._fixed] = 0.0
        constrain(pattern.starts, pattern.columns, self._fixed, blocks)
        correction = self._solved(load)
        return correction if change is None else correction + change

    def _solved(self, load: _Floats) -> _Floats:
        """Solve with the blocks; iterate if the body is large, factorise if that fails.

        Raises
        ------
        SingularStiffnessError
            If the stiffness is found not to be positive definite, by either.
        """
        if self._iterative is not None:
            self._iterative.factorize(self._blocks)
            try:
                return self._iterative.solve(load)
            except NotConvergedError:
                pass
        self._direct.factorize(self._blocks)
        return self._direct.solve(load)


class _Descent(_Newton):
    """Down the potential energy of a membrane, which has next to no stiffness where it is slack.

    Tangents, not forces, are those of a tension that is at least so much; it falls as long as full
    steps lower the energy. The exact stiffness follows where it is positive definite.
    """

    _least = _TAUT

    def _spread(self, start: _Place, change: _Floats) -> _Floats:
        """Let what is prescribed happen; how far the rest goes with it, the energy says later."""
        self._least = _TAUT
        return self._solve(start.displacement, start.residual, change, 0.0, least=self._least)

    def _next(self, place: _Place, load: _Floats) -> _Place:
        """Place further down; the same one with more tension if no way leads there."""
        correction = self._downhill(place.displacement, place.residual, self._least)
        share = self._share_downhill(place, correction, load)
        if share == 0.0:
            self._least = max(self._least, _SLACK) / _FALL
            return place
        self._least *= _FALL if share == 1.0 else 1.0
        return self._place(place.displacement + share * correction, load)

    def _downhill(self, displacement: _Floats, residual: _Floats, least: float) -> _Floats:
        """Correction along which the energy falls."""
        if least < _SLACK:
            try:
                return self._solve(displacement, residual, None, 1.0)
            except SingularStiffnessError:
                pass
        return self._solve(displacement, residual, None, 0.0, least=max(least, _LEAST))
