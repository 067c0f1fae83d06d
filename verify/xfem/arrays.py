"""Types of arrays, checks of arguments, and exceptions.

`what` and `name` say in the message which argument is wrong.
"""

from typing import Any, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Sides = NDArray[np.int8]  # of cuts: +1 or −1, in labels also 0 where a cut does not divide


class XfemError(ValueError):
    """Bad input to the compact solver: what it was, where, and what was expected."""


class SingularStiffnessError(XfemError):
    """The matrix is not positive definite: something moves freely, or a sign is wrong.

    Attributes
    ----------
    node : int or None
        Node at which the factorisation stopped, where it is known.
    """

    def __init__(self, node: int | None) -> None:
        self.node = node
        where = "" if node is None else f" (at dof node {node})"
        super().__init__(
            f"the stiffness is not positive definite{where}: a free piece without support, "
            "or a wrong sign"
        )


class NotConvergedError(XfemError):
    """The iterations ran out before the residual was small enough."""


def check_choice(given: str, choices: Any, what: str) -> None:
    """Check that a word is one of those that a Literal type lists.

    Raises
    ------
    XfemError
        If it is another.
    """
    if given not in get_args(choices):
        raise XfemError(f"{what} '{given}'; expected one of {', '.join(get_args(choices))}")


def real_array(given: ArrayLike, what: str) -> Floats:
    """Copy real numbers of any shape: the caller may change the array afterwards.

    Raises
    ------
    XfemError
        If there is text, None or a complex number among them, or rows differ in length.
    """
    try:
        raw = np.asarray(given)
        if not np.iscomplexobj(raw):
            return np.array(raw, dtype=np.float64, order="C")
    except (TypeError, ValueError):
        pass
    raise XfemError(f"{what} {_shown(given)}; expected real numbers, in rows of one length")


def finite_array(given: ArrayLike, what: str, *shapes: tuple[int | None, ...]) -> Floats:
    """Copy finite real numbers in one of some shapes; None stands for any length.

    Raises
    ------
    XfemError
        If they are no real numbers, one is not finite, or the shape is another.
    """
    found = real_array(given, what)
    fits = (
        len(shape) == found.ndim
        and all(n in (None, m) for n, m in zip(shape, found.shape, strict=True))
        for shape in shapes
    )
    if not any(fits):
        expected = " or ".join(str(shape).replace("None", "n") for shape in shapes)
        raise XfemError(f"{what} of shape {found.shape}; expected {expected}")
    if not np.isfinite(found).all():
        first = np.argwhere(~np.isfinite(found))[0].tolist()
        raise XfemError(f"{what}: number {first} is not finite")
    return found


def index_array(given: ArrayLike, what: str) -> Ints:
    """Copy integers of any shape; an empty list may be of any type.

    Raises
    ------
    XfemError
        If they are not of an integer type: 0.7 is not taken as 0.
    """
    try:
        raw = np.asarray(given)
    except ValueError:
        raw = np.array(None)
    if raw.size and not np.issubdtype(raw.dtype, np.integer):
        raise XfemError(f"{what} {_shown(given)}; expected integers, in rows of one length")
    return np.array(raw, dtype=np.int64, order="C")


def check_floats(name: str, values: Floats, shape: tuple[int, ...]) -> None:
    """Check an array that a compiled loop reads or writes as it is: loops check no bounds.

    Raises
    ------
    XfemError
        If it has another shape, or is not of 64-bit floats.
    """
    kind = getattr(values, "dtype", type(values).__name__)
    if kind != np.float64 or values.shape != shape:
        raise XfemError(f"{name} of shape {np.shape(values)}, {kind}; expected {shape}, float64")


def _shown(given: ArrayLike) -> str:
    text = " ".join(repr(given).split())
    return text if len(text) <= 60 else f"{text[:57]}..."
