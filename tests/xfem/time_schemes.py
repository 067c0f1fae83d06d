"""All time integration schemes of the compact solver, for claims that hold for each."""

from verify.methods.generalised_alpha import GeneralisedAlpha
from verify.xfem.energy_momentum import EnergyMomentum
from verify.xfem.explicit import CentralDifferences, ForwardEuler, SymplecticEuler
from verify.xfem.implicit import ImplicitEuler, Trapezoidal
from verify.xfem.real_time import RealTimeEuler

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
