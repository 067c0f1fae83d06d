"""Variants of a solver: its name and the parameters of its solves, as a study takes them."""

import os
import sys
from dataclasses import dataclass, field
from typing import Any

from verify.solvers import Solver, check_parameters, find_solver
from verify.solvers.named import one_name, parameters_in, solver_in


@dataclass(frozen=True)
class Variant:
    """A solver with parameters; `label` is how it was asked for."""

    label: str
    solver: str
    parameters: dict[str, Any] = field(default_factory=dict)

    def found(self) -> Solver:
        """Find the solver; a class of the user's own from where the study was started.

        Raises
        ------
        InputError
            If there is no such solver.
        """
        if ":" in self.solver and os.getcwd() not in sys.path:
            sys.path.append(os.getcwd())
        return find_solver(self.solver)


def variant_of(text: str) -> Variant:
    """Read ``"xfem slivers=merge mass=consistent"``.

    Raises
    ------
    InputError
        If the solver, one of its parameters or the form is unknown.
    """
    label = one_name(text)
    variant = Variant(label, solver_in(label), parameters_in(label))
    check_parameters(variant.solver, variant.found(), variant.parameters)
    return variant
