"""Equilibrium of a cut body: linear, and at finite rotation."""

from verify.xfem.statics.finite_rotation import StaticEquilibrium, static_equilibrium
from verify.xfem.statics.linear import StaticSolution, solve_static
from verify.xfem.statics.load_path import PathCheck
from verify.xfem.statics.newton import NotInEquilibriumError

__all__ = [
    "NotInEquilibriumError",
    "PathCheck",
    "StaticEquilibrium",
    "StaticSolution",
    "solve_static",
    "static_equilibrium",
]
