"""Schemes, masses and time steps that the XFEM adapter offers, by the names of its parameters."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from verify.errors import InputError
from verify.methods.generalised_alpha import GeneralisedAlpha
from verify.methods.mass_variants import (
    eigenvalue_stabilised_mass,
    generalised_eigenvalue_stabilised_mass,
    shifted_mass,
)
from verify.xfem.body import DynamicBody, Integrator
from verify.xfem.critical_step import RESONANCE_FREE, critical_step, element_critical_steps
from verify.xfem.elasticity import Material
from verify.xfem.energy_momentum import EnergyMomentum
from verify.xfem.explicit import CentralDifferences, ForwardEuler, SymplecticEuler
from verify.xfem.implicit import ImplicitEuler, Trapezoidal
from verify.xfem.mass import Mass, consistent_mass, side_wise_mass
from verify.xfem.phantom import PhantomMesh

SCHEMES: dict[str, Callable[[DynamicBody, float], Integrator]] = {
    "newmark": Trapezoidal,
    "implicit_euler": ImplicitEuler,
    "energy_momentum": EnergyMomentum,
    "generalised_alpha": GeneralisedAlpha,
    "central_differences": CentralDifferences,
    "symplectic_euler": SymplecticEuler,
    "forward_euler": ForwardEuler,
}
MASSES: dict[str, Callable[[PhantomMesh, ArrayLike], Mass]] = {
    "sidewise": side_wise_mass,
    "consistent": consistent_mass,
    "evs": eigenvalue_stabilised_mass,
    "gevs": generalised_eigenvalue_stabilised_mass,
    "row_sum": lambda phantom, density: shifted_mass(phantom, density, "row sum"),
    "hrz": lambda phantom, density: shifted_mass(phantom, density, "weighted diagonal"),
    "thesis": lambda phantom, density: shifted_mass(phantom, density, "enrichment"),
}
_REACH = 1.0  # strain up to which the step of a turning body is a bound
EXPLICIT = ("central_differences", "symplectic_euler", "forward_euler")


def integrator_of(
    body: DynamicBody, step_size: float, scheme: str, spectral_radius: float
) -> Integrator:
    """Make the integrator of a scheme.

    Parameters
    ----------
    body : DynamicBody
    step_size : float
        In s.
    scheme : str
        One of `SCHEMES`.
    spectral_radius : float
        Of generalised-α, at infinite frequency; the others have none.
    """
    if scheme == "generalised_alpha":
        return GeneralisedAlpha(body, step_size, spectral_radius=spectral_radius)
    return SCHEMES[scheme](body, step_size)


def largest_step(
    body: DynamicBody,
    material: Material,
    density: ArrayLike,
    scheme: str,
    factor: float,
    asked: float | None,
) -> tuple[float, str]:
    """Return the largest time step, s, and where it comes from.

    An explicit scheme takes `factor` times its critical step, or the step asked for if that is
    smaller. Where pieces turn, the critical step is that of strains up to 1, and `RESONANCE_FREE`
    of it, so that the time grid makes no modes resonate (docs/theory/dynamics.md). An implicit one
    takes the step asked for, or else `factor` times the critical step of the uncut elements: what
    an explicit scheme could follow.

    Parameters
    ----------
    body : DynamicBody
    material : Material
    density : float or (m,) array_like
    scheme : str
        One of `SCHEMES`.
    factor : float
    asked : float, optional
        ``analysis.time_step`` of the scene, s.
    """
    explicit = scheme in EXPLICIT
    if not explicit and asked is not None:
        return asked, "analysis.time_step"
    critical = _critical(body, material, density, explicit)
    turning = explicit and body.force.is_corotational
    found = factor * critical * (RESONANCE_FREE if turning else 1.0)
    said = f"{factor:g} of {'√½ of ' if turning else ''}the critical step {critical:.4g} s"
    if not np.isfinite(found) or found <= 0.0:
        raise InputError(f"the critical step is {critical:g} s; give analysis.time_step")
    if asked is not None and asked < found:
        return asked, f"analysis.time_step; the critical step is {critical:.4g} s"
    return found, said


def _critical(body: DynamicBody, material: Material, density: ArrayLike, explicit: bool) -> float:
    phantom = body.force.phantom
    if not explicit or body.mass.keeps_element_steps:
        # side-wise mass: no cut makes it smaller than that of the smallest uncut element
        strain = _REACH if body.force.is_corotational else 0.0
        step = float(element_critical_steps(phantom.mesh, material, density, strain).min())
    else:
        force: Any = body.force
        blocks = force.stiffness(body.pattern, np.zeros(body.shape), "rotation-fixed")
        step = critical_step(csr_array(body.pattern.matrix(blocks)), body.mass, body.fixed)
    if not explicit:
        return step
    # damping is taken at the velocity half a step back: (1 + ξ²)^½ − ξ of the undamped step
    highest = 2.0 / step
    ratio = 0.5 * (body.damping.mass / highest + body.damping.stiffness * highest)
    return step * float(np.hypot(1.0, ratio) - ratio)
