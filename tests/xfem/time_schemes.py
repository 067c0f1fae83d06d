"""All time integration schemes of the compact solver, for claims that hold for each."""

from verify.xfem.dynamics import (
    CentralDifferences,
    EnergyMomentum,
    ForwardEuler,
    GeneralisedAlpha,
    ImplicitEuler,
    RealTimeEuler,
    SymplecticEuler,
    Trapezoidal,
)

SCHEMES = [
    CentralDifferences,
    SymplecticEuler,
    ForwardEuler,
    RealTimeEuler,
    ImplicitEuler,
    Trapezoidal,
    EnergyMomentum,
    GeneralisedAlpha,
]
