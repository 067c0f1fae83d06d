"""Solvers of the framework: one interface, one thin adapter per solver."""

from verify.solvers.interface import Solver, find_solver, solver_names

__all__ = ["Solver", "find_solver", "solver_names"]
