"""Parameters of an exact solution as a case file gives them: taken by name, checked."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.scene.strict import nearest

_SHAPES = {
    (): "a number",
    (2,): "two numbers",
    (3,): "three numbers",
    (2, 2): "two rows of two numbers",
    (2, 3): "two rows of three numbers",
    (3, 3): "three rows of three numbers",
    (3, 4): "three rows of four numbers",
}


class Parameters:
    """What the case file says, until it has all been taken.

    Parameters
    ----------
    solution : str
        Name of the exact solution, for messages.
    given : mapping
        The parameters.
    """

    def __init__(self, solution: str, given: Mapping[str, Any]) -> None:
        self._solution = solution
        self._given = dict(given)
        self._known: list[str] = []
        self._missing: list[str] = []

    def has(self, name: str) -> bool:
        """Whether `name` is given."""
        self._known.append(name)
        return name in self._given

    def take(self, name: str, *shapes: tuple[int, ...], default: Any = None) -> NDArray[np.float64]:
        """Take the parameter `name`, which must have one of `shapes`.

        Raises
        ------
        InputError
            If it is not finite numbers of that shape. What is missing without a `default` is
            said by `close`.
        """
        self._known.append(name)
        if name not in self._given:
            if default is None:
                self._missing.append(f"parameters.{name} is missing; expected {_words(shapes)}")
                return np.full(shapes[0], 1.0)  # `close` refuses it
            return np.asarray(default, dtype=float)
        try:
            value = np.asarray(self._given[name], dtype=float)
        except (TypeError, ValueError):
            value = np.array([np.nan] * 99)
        if value.shape not in shapes or not np.isfinite(value).all():
            raise InputError(
                f"parameters.{name} = {self._given[name]}; '{self._solution}' expects "
                f"{_words(shapes)}"
            )
        return value

    def positive(self, name: str) -> float:
        """Take the positive number `name`."""
        value = float(self.take(name, ()))
        if value <= 0.0:
            raise InputError(f"parameters.{name} = {value:g}; expected a positive number")
        return value

    def close(self) -> None:
        """Say that all has been taken.

        Raises
        ------
        InputError
            If something is left that the solution does not know, or something was missing.
        """
        # first what is left: a misspelt name explains the one that is missing
        for name in self._given:
            if name not in self._known:
                hint = nearest(name, self._known)
                raise InputError(f"'{self._solution}' has no parameter '{name}'{hint}")
        if self._missing:
            raise InputError(self._missing[0])


def _words(shapes: tuple[tuple[int, ...], ...]) -> str:
    return " or ".join(_SHAPES[shape] for shape in shapes)
