"""Mesh files of others, read by meshio: whatever it meets, one error, and never for ever.

At the end of some files that are cut off (PLY, Nastran) meshio reads on for ever; on others it
prints and leaves the interpreter.
"""

import contextlib
import io
import os
import signal
import threading
import warnings
from collections.abc import Iterator
from pathlib import Path
from types import FrameType
from typing import Any

from verify.errors import InputError
from verify.printable import one_line, words_of

_SECONDS, _SECONDS_PER_MB = 5.0, 4.0  # of processor time; meshio reads a megabyte in less than one


def read_with_meshio(path: Path, file_format: str | None = None, what: str = "a mesh") -> Any:
    """Read a mesh.

    Parameters
    ----------
    path : Path
    file_format : str, optional
        As meshio calls it; default: by the ending of `path`.
    what : str
        What is expected there, for the message.

    Raises
    ------
    InputError
        If it is not there, no plain file, or meshio cannot read it.
    """
    import meshio

    if not path.is_file():
        kind = "is no plain file" if path.exists() else "no such file"
        raise InputError(f"{kind}; expected {what}", str(path))
    seconds = _SECONDS + _SECONDS_PER_MB * os.path.getsize(path) / 1e6
    printed = io.StringIO()
    try:
        with (
            contextlib.redirect_stderr(printed),
            contextlib.redirect_stdout(printed),
            warnings.catch_warnings(),
            _limited(seconds),
        ):
            warnings.simplefilter("ignore")
            return meshio.read(path, file_format=file_format)
    except (Exception, SystemExit) as error:
        reason = _reason(error, printed.getvalue())
        raise InputError(f"not {what} that meshio can read ({reason})", str(path)) from None


def _reason(error: BaseException, printed: str) -> str:
    """Say why a file is not read: what meshio prints before it leaves, or its exception."""
    if isinstance(error, SystemExit) and (said := printed.split()):
        return one_line(" ".join(said).removeprefix("Error: "))
    if isinstance(error, ModuleNotFoundError):
        return f"this format needs the package '{error.name}': pip install {error.name}"
    return words_of(error).removesuffix(": 1")


@contextlib.contextmanager
def _limited(seconds: float) -> Iterator[None]:
    """Raise TimeoutError after so much processor time; only the main thread can be stopped."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(_signal: int, _frame: FrameType | None) -> None:
        raise TimeoutError(f"not read after {seconds:.3g} s of processor time")

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
