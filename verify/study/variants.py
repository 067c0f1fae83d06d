"""Variants of a solver: its name and the parameters of its solves, as a study takes them."""

import os
import sys
from dataclasses import dataclass, field
from typing import Any

from verify.errors import InputError
from verify.solvers import Solver, check_parameters, find_solver

__all__ = ["Variant", "variant_of"]


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
    name, *words = text.split() or [""]
    parameters: dict[str, Any] = {}
    for word in words:
        key, equals, value = word.partition("=")
        if not key or not equals or not value:
            raise InputError(f"'{word}' in '{text}'; expected NAME PARAMETER=VALUE …", "--solver")
        parameters[key] = _plain(value)
    variant = Variant(" ".join([name, *words]), name, parameters)
    check_parameters(name, variant.found(), parameters)
    return variant


def _plain(value: str) -> int | float | str:
    for kind in (int, float):
        try:
            return kind(value)
        except ValueError:
            continue
    return value
