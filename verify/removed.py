"""Keys, values and commands that were removed, and what to use instead."""

from verify.errors import InputError

_INSTEAD = {
    "xfem.basis": "leave it out; all bases span the space of the side-wise unknowns",
}


def check_removed(name: str, where: str = "") -> None:
    """Refuse what was removed under `name`.

    Raises
    ------
    InputError
        With what to use instead.
    """
    if name in _INSTEAD:
        raise InputError(f"{name} was removed: {_INSTEAD[name]}", where)
