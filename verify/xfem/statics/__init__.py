"""Equilibrium of a cut body: linear, and at finite rotation."""

from verify.xfem.statics.finite_rotation import (
    NotInEquilibriumError,
    StaticEquilibrium,
    static_equilibrium,
)
from verify.xfem.statics.linear import StaticSolution, solve_static

__all__ = [
    "NotInEquilibriumError",
    "StaticEquilibrium",
    "StaticSolution",
    "solve_static",
    "static_equilibrium",
]
