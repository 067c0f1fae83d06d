"""Exact solutions of cut bodies by name: formulas in numpy, no FEniCSx."""

from reference.exact.catalogue import exact_of, exact_solution, exact_solution_names
from reference.exact.solution import ExactSolution
