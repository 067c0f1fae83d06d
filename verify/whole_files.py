"""Files that are whole or not there: a reader, or a kill at any time, never sees half of one.

And files of others, which may be pipes, devices, or larger than memory: read within limits.
"""

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from verify.errors import InputError

DISK_FAILURES = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EIO)


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give the name of a file to write, which takes the place of `path` at the end.

    If writing fails or is interrupted, the half is removed and what was at `path` stays. A link
    is followed; a device or a pipe, which has no half, is written as it is.

    Raises
    ------
    OSError
        As writing raised it, with the name `path`: a full disk does not say where.
    """
    direct = path.exists() and not path.is_file()
    target = path if direct else Path(os.path.realpath(path))
    partial = path if direct else target.with_name(f"{target.name}.partial")
    try:
        yield partial
        if not direct:
            os.replace(partial, target)
    except BaseException as error:
        if not direct:
            with suppress(OSError):  # it was never made
                partial.unlink()
        if isinstance(error, OSError) and _is_of(error, partial):
            # a new one: the second name that replacing and copying give cannot be taken away
            raise OSError(error.errno, error.strerror, str(path)) from error
        raise


def write_whole(path: Path, content: str | bytes) -> None:
    """Write text (UTF-8) or bytes by `whole_file`."""
    with whole_file(path) as partial:
        partial.write_bytes(content.encode() if isinstance(content, str) else content)


def read_bounded(path: Path, what: str, largest: int = 2**28) -> bytes:
    """Read a file that somebody else may have made.

    Parameters
    ----------
    path : Path
    what : str
        What is expected there, for the message: "a case file".
    largest : int
        Bytes.

    Raises
    ------
    InputError
        If it is missing, no plain file (a pipe would be waited for), too large, or unreadable.
    """
    try:
        status = path.stat()
        if stat.S_ISDIR(status.st_mode):
            raise InputError(f"is a directory; expected {what}", str(path))
        if not stat.S_ISREG(status.st_mode):
            raise InputError(f"is a pipe or a device; expected {what}", str(path))
        if status.st_size > largest:
            size = f"{status.st_size / 1e6:.3g} MB"
            text = f"has {size}; expected {what}, which has {largest / 1e6:.3g} MB at most"
            raise InputError(text, str(path))
        return path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"no such file; expected {what}", str(path)) from None
    except (OSError, ValueError) as error:  # a null byte in a name is a ValueError
        if isinstance(error, InputError):
            raise
        why = getattr(error, "strerror", None) or error
        raise InputError(f"cannot be read ({why})", str(path)) from None


@contextmanager
def asked_place(path: Path) -> Iterator[None]:
    """Write inside it what the user asked to have at `path`.

    Raises
    ------
    InputError
        If it cannot be written there and can be elsewhere.
    OSError
        If the disk fails, or is full (`DISK_FAILURES` without a disk that is read-only).
    """
    try:
        yield
    except OSError as error:
        if error.errno in DISK_FAILURES and error.errno != errno.EROFS:
            raise
        raise InputError(f"cannot be written ({error.strerror})", str(path)) from None


def _is_of(error: OSError, partial: Path) -> bool:
    if error.errno is None:  # no error of the system's
        return False
    return error.filename is None or str(partial) in (str(error.filename), str(error.filename2))
