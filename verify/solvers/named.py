"""Names of solvers with parameters of their own: ``xfem tip=partial mass=consistent``.

Such a name is a solver of its own, with rows and verdicts beside those of ``xfem``.
"""

import json
from math import isfinite
from typing import Any

from verify.errors import InputError


def one_name(asked: str) -> str:
    """Return `asked` with single spaces: how records and reports name this solver."""
    return " ".join(asked.split())


def solver_in(name: str) -> str:
    """Return the solver's own name, without parameters."""
    return name.partition(" ")[0]


def parameters_in(name: str) -> dict[str, Any]:
    """Return the parameters that stand in a name.

    Raises
    ------
    InputError
        If a word of it is not ``PARAMETER=VALUE``, a parameter stands there twice, or a value is
        not finite.
    """
    parameters: dict[str, Any] = {}
    for word in name.split()[1:]:
        key, _, value = word.partition("=")
        if not key or not value or key in parameters:
            form = "NAME PARAMETER=VALUE …, each parameter once"
            raise InputError(f"'{word}' in '{name}'; expected {form}", "--solver")
        parameters[key] = plain_value(value)
    return parameters


def parameters_of(name: str, given: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Return those in a name, over what is `given` to its solver under the solver's own name."""
    return {**given.get(solver_in(name), {}), **parameters_in(name)}


def plain_value(text: str) -> Any:
    """Return what a value says: a number or another value of JSON, else the text itself.

    Raises
    ------
    InputError
        If it is no finite number: records have no word for it.
    """
    for read in (json.loads, float):
        try:
            found = read(text)
        except ValueError:
            continue
        if isinstance(found, float) and not isfinite(found):
            raise InputError(f"'{text}' as a parameter; expected a finite value")
        return found
    return text
