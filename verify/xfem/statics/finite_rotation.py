"""Static equilibrium at large rotations: load steps that follow the supports, and their check."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from verify.xfem.errors import XfemError
from verify.xfem.internal_force import InternalForce
from verify.xfem.statics.load_path import LoadPath, PathCheck
from verify.xfem.statics.newton import Descent, Newton

__all__ = ["StaticEquilibrium", "static_equilibrium"]

_Floats = NDArray[np.float64]


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
        Corrections of each load step of the path that counts.
    check : PathCheck
        What was done so that it counts.
    solvers : frozenset of {"direct", "iterative"}
        What has solved the linear systems.
    """

    displacement: _Floats
    energy: float
    reactions: _Floats
    iterations: tuple[int, ...]
    check: PathCheck
    solvers: frozenset[str]


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

    Every body follows the rigid motion of its supports; Newton's method finds the rest. Where a
    correction does not make the residual smaller, or the exact stiffness is not positive definite,
    it goes down the potential energy instead, along corrections by as much of the stiffness of
    turning as leaves it positive definite. Past a limit point (a column that buckles, an arch that
    snaps through) that ends in an equilibrium beyond.

    A load step counts if the work of its reactions and loads accounts for its energy, or if its two
    halves end at the same energy; see `LoadPath`. The last state counts if its exact stiffness is
    positive definite; an unstable one is left along its softest mode.

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
        Equal parts of the path at least; a part is halved where it does not lead on.
    tolerance : float
        Of the residual, over the largest of load, reactions and internal force.
    iterations : int
        Allowed per load step.
    start : (N, d) float array, optional
        First guess.

    Raises
    ------
    NotInEquilibriumError
        If a load step does not converge in 64 parts either, or its energy is more than the work
        done and no other path confirms it. Where pieces have collapsed on the way, it says so: the
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
    if force.is_membrane and not force.is_corotational:
        raise XfemError("linear kinematics of a membrane at finite rotation; expected corotational")
    if load_steps < 1 or iterations < 1 or not tolerance > 0.0:
        raise XfemError(
            f"{load_steps} load steps, {iterations} iterations, tolerance {tolerance:g}; expected "
            "at least one, at least one, and more than zero"
        )
    full_load = np.zeros(shape) if load is None else _checked("load", load, shape)
    displacement = np.zeros(shape) if start is None else _checked("start", start, shape).copy()

    def wanted(share: float) -> _Floats:
        values = np.zeros(shape) if prescribed is None else prescribed(share)
        if values.shape == shape:  # what is not fixed may be anything
            values = np.where(fixed, values, 0.0)
        return _checked("prescribed displacement", values, shape)

    method = Descent if force.is_membrane else Newton
    newton = method(force, fixed, tolerance, iterations)
    path = LoadPath(force, fixed, wanted, full_load, newton)
    displacement, counts = path.follow(displacement, load_steps)
    displacement = path.settle(displacement)
    internal, energy = force.evaluate(displacement)
    reactions = np.where(fixed, internal - full_load, 0.0)
    solvers = frozenset(newton.solvers)
    return StaticEquilibrium(displacement, energy, reactions, counts, path.check(), solvers)


def _checked(name: str, values: _Floats, shape: tuple[int, int]) -> _Floats:
    if values.shape != shape or not np.isfinite(values).all():
        raise XfemError(f"{name} of shape {values.shape}; expected finite {shape}")
    return values
