"""Errors that users see, and what to use instead of what was removed."""

import signal


class InputError(ValueError):
    """Bad input (case file, mesh, result directory, command line).

    Parameters
    ----------
    what : str
        The fault and the expected value, in one sentence.
    where : str, optional
        The file, and the key in it, where it was found.
    """

    def __init__(self, what: str, where: str = "") -> None:
        self.what = what
        self.where = where
        super().__init__(f"{where}: {what}" if where else what)


class UnsupportedSceneError(Exception):
    """A solver's refusal: the scene is valid, but this solver cannot do it.

    It becomes a row of the result with its reason; it is not a crash.
    """


class RunStoppedError(Exception):
    """A run was asked to stop by a signal; finished solves stay."""

    def __init__(self, signum: int) -> None:
        self.signum = signum
        super().__init__(f"interrupted by {signal.Signals(signum).name}")


_INSTEAD = {
    "geometry.source": (
        "shapes are made by formulas; for real anatomy give its surface as 'file' "
        "(docs/guide/simulator.md)"
    ),
    "verify data": (
        "for real anatomy give its surface as 'file' of [geometry] (docs/guide/simulator.md)"
    ),
    "xfem.basis": "leave it out; all bases span the space of the side-wise unknowns",
}


def instead(name: str) -> str:
    """Say what to use instead of what was removed under `name`, or ""."""
    return f"'{name}' was removed: {_INSTEAD[name]}" if name in _INSTEAD else ""
