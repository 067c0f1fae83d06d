"""Solvers of the framework: one interface, one thin adapter per solver."""

from verify.solvers.interface import Solver, check_parameters, find_solver, solver_names
