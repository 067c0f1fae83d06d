"""A freed half under gravity: what a wrong inertia does to its fall and to its energy.

The unit square is cut level, its upper face held. The lower half must fall with g. A lumping
that couples the halves gives it more inertia than mass; its own ledger closes all the same, because
the kinetic energy that it counts is that of the wrong mass.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.study.energy.pieces import piece_inertias
from verify.xfem.corotation import InternalForce
from verify.xfem.critical_step import critical_step
from verify.xfem.cuts import Plane
from verify.xfem.dynamics import (
    CentralDifferences,
    DynamicBody,
    EnergyMomentum,
    ImplicitEuler,
    Integrator,
    RealTimeEuler,
    SymplecticEuler,
    Trapezoidal,
)
from verify.xfem.dynamics.energy_ledger import run
from verify.xfem.elasticity import isotropic
from verify.xfem.mass import Mass, consistent_mass, side_wise_mass
from verify.xfem.mass_shifted import shifted_mass
from verify.xfem.sparsity import body_pattern
from verify.xfem.stiffness import LinearStiffness
from verify.xfem.structured_meshes import rectangle_mesh
from verify.xfem.supports import Supports
from verify.xfem.virtual import VirtualMesh, cut_mesh

__all__ = ["GRAVITY", "LUMPINGS", "SCHEMES", "Fall", "apparent_gravity", "fall"]

GRAVITY = 9.8
_DENSITY = 1000.0
_YOUNG = 1e8  # stiff: strains of g ρ L/E = 1e-4, so that the fall is nearly rigid
_DURATION = 0.1  # s
_IMPLICIT_STEPS = 20

LUMPINGS = ("side-wise", "consistent", "thesis", "row sum", "HRZ")
SCHEMES: dict[str, Callable[..., Integrator]] = {
    "central differences": CentralDifferences,
    "symplectic Euler": SymplecticEuler,
    "implicit Euler": ImplicitEuler,
    "linearised implicit Euler": RealTimeEuler,
    "trapezoidal": Trapezoidal,
    "energy–momentum": EnergyMomentum,
}
_EXPLICIT = ("central differences", "symplectic Euler")


@dataclass(frozen=True)
class Fall:
    """One fall.

    Attributes
    ----------
    lumping, scheme : str
    gravity : float
        Apparent acceleration of the freed half, in m/s²: its mean fall over that of the scheme's
        own discrete parabola, times −9.8.
    missing : float
        Energy of the freed half that is missing at the end, over the work that its weight has
        done: 1 − (true mass at the velocities found)/(work of the weight).
    own_balance : float
        What its own ledger, kept with its own mass, is off by over that work.
    """

    lumping: str
    scheme: str
    gravity: float
    missing: float
    own_balance: float


def _mass(virtual: VirtualMesh, lumping: str) -> Mass:
    if lumping == "side-wise":
        return side_wise_mass(virtual, _DENSITY)
    if lumping == "consistent":
        return consistent_mass(virtual, _DENSITY)
    names = {"thesis": "enrichment", "row sum": "row sum", "HRZ": "weighted diagonal"}
    return shifted_mass(virtual, _DENSITY, names[lumping])  # type: ignore[arg-type]


def _halves(offset: float) -> VirtualMesh:
    """Cut below the middle of the height, `offset` element sizes above a layer of nodes."""
    return cut_mesh(rectangle_mesh((8, 8)), [Plane([0.5, 0.375 + offset / 8], [0.0, 1.0])])


def apparent_gravity(lumping: str, offset: float = 0.5) -> float:
    """Acceleration of the freed half moving rigidly on its own, in m/s²: its weight over its
    inertia in the mass matrix.
    """  # noqa: D205
    virtual = _halves(offset)
    inertias = piece_inertias(virtual, _mass(virtual, lumping), _DENSITY)
    lowest = virtual.bodies[int(np.argmin(virtual.node_points[:, 1]))]
    return -GRAVITY * inertias[lowest].acceleration


def fall(lumping: str, scheme: str, offset: float = 0.5) -> Fall:
    """Let the half fall for 0.1 s."""
    virtual = _halves(offset)
    mass = _mass(virtual, lumping)
    stiff = isotropic(_YOUNG, 0.3, "plane strain")
    held = Supports.none(virtual).prescribe(virtual, virtual.mesh.points[:, 1] == 1.0)
    body = DynamicBody(
        InternalForce(virtual, stiff), mass, mass.weight([0.0, -GRAVITY]), supports=held
    )
    steps = _IMPLICIT_STEPS
    if scheme in _EXPLICIT:
        pattern = body_pattern(virtual)
        stiffness = pattern.matrix(LinearStiffness(virtual, stiff).assemble(pattern))
        steps = int(np.ceil(_DURATION / (0.5 * critical_step(stiffness, mass))))
    step = _DURATION / steps
    state = body.rest()
    account = run(SCHEMES[scheme](body, step), body, state, steps)
    lower = virtual.bodies == virtual.bodies[int(np.argmin(virtual.node_points[:, 1]))]
    share = mass.weights * lower
    mean = float(share @ state.displacement[:, 1] / share.sum())
    exact = side_wise_mass(virtual, _DENSITY)
    true = _kinetic(exact, state.velocity * lower[:, None])
    work = -GRAVITY * float(share @ state.displacement[:, 1])
    return Fall(
        lumping=lumping,
        scheme=scheme,
        gravity=-GRAVITY * mean / _parabola(scheme, step, steps),
        missing=1.0 - true / work,
        own_balance=float(np.ptp(account.balance)) / work,
    )


def _kinetic(mass: Mass, velocity: NDArray[np.float64]) -> float:
    return 0.5 * float(np.sum(velocity * mass.apply(velocity)))


def _parabola(scheme: str, step: float, steps: int) -> float:
    """Discrete free fall: n² h²/2 of centred schemes, n (n + 1) h²/2 of the Euler schemes."""
    euler = "Euler" in scheme
    return -0.5 * GRAVITY * step**2 * (steps * (steps + 1) if euler else steps**2)
