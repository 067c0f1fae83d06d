"""The errors that users see as one line and exit code 2."""


class InputError(ValueError):
    """Bad input (case file, mesh, result directory, command line).

    Parameters
    ----------
    what : str
        What is wrong and what was expected, in one sentence.
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
