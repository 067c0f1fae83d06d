"""Parameters of solvers on the command line: ``--set NAME=VALUE``."""

from collections.abc import Iterable
from typing import Any

from verify.errors import InputError
from verify.solvers.named import plain_value


def of_one_solver(given: Iterable[str]) -> dict[str, Any]:
    """Read ``tip=partial`` … as the parameters of one solver.

    Raises
    ------
    InputError
        If one is not of this form.
    """
    return dict(_split(text, text, "--set tip=partial") for text in given)


def of_solvers(given: Iterable[str]) -> dict[str, dict[str, Any]]:
    """Read ``xfem.tip=partial`` … as the parameters of several solvers.

    The solver ends at the last dot before the equals sign, so that ``module:Class`` works too.

    Raises
    ------
    InputError
        If one is not of this form.
    """
    found: dict[str, dict[str, Any]] = {}
    for text in given:
        example = "--set xfem.scheme=implicit_euler"
        key, equals, value = text.partition("=")
        solver, dot, name = key.rpartition(".")
        if not dot or not solver:
            raise InputError(f"--set {text}: expected SOLVER.NAME=VALUE, e.g. {example}")
        name, parsed = _split(f"{name}{equals}{value}", text, example)
        found.setdefault(solver, {})[name] = parsed
    return found


def _split(text: str, given: str, example: str) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    if not equals or not name.isidentifier():
        raise InputError(f"--set {given}: expected NAME=VALUE, e.g. {example}")
    return name, plain_value(value)
