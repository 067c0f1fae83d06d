"""Files that are whole or not there: a reader, or a kill at any time, never sees half of one.

And files of others, which may be pipes, devices, or larger than memory: read within limits. JSON
files are both.
"""

import errno
import json
import math
import os
import stat
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from verify.errors import InputError
from verify.printable import words_of

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
        Expected kind of file, for the message: "a case file".
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


_DEEPEST = 60  # levels of nesting; none of our files has more than a dozen
_TOO_DEEP = f"not a JSON file of ours (nested too deep; expected at most {_DEEPEST} levels)"
_LONGEST = 40  # digits of a whole number
_ENCODER = json.JSONEncoder(allow_nan=False)


def write_json(content: Any, path: Path) -> None:
    """Write `content` in one step. Numbers that are not finite become null.

    Raises
    ------
    OSError
        With the name of the file; what was there before stays.
    """
    write_plain(plain(content), path)


def write_plain(content: Any, path: Path) -> None:
    """Write what `plain` has made in one step: what holds no lists or mappings on one line."""
    write_whole(path, _lines(content) + "\n")


def _lines(content: Any, margin: str = "") -> str:
    """Write JSON; json's own indentation takes ten times as long."""
    entries = content.values() if isinstance(content, dict) else content
    if not isinstance(content, dict | list) or not any(isinstance(e, dict | list) for e in entries):
        return _ENCODER.encode(content)
    inner = margin + " "
    if isinstance(content, dict):
        rows = [f"{_ENCODER.encode(key)}: {_lines(entry, inner)}" for key, entry in content.items()]
    else:
        rows = [_lines(entry, inner) for entry in content]
    first, last = "{}" if isinstance(content, dict) else "[]"
    return f"{first}\n{inner}" + f",\n{inner}".join(rows) + f"\n{margin}{last}"


def read_json(path: Path, what: str = "a JSON file") -> dict[str, Any]:
    """Read a JSON object.

    Parameters
    ----------
    path : Path
    what : str
        Expected content, for the message.

    Raises
    ------
    InputError
        If the file is missing, damaged, larger or deeper than such a file is, or no object.
    """
    return parse_json(read_bounded(path, what), str(path))


def parse_json(text: str | bytes, where: str) -> dict[str, Any]:
    """Read a JSON object from text or from bytes in UTF-8.

    Raises
    ------
    InputError
        As `read_json`, with `where`.
    """
    try:
        content = json.loads(text, parse_int=_whole)
    except RecursionError:
        raise InputError(_TOO_DEEP, where) from None
    except ValueError as error:  # JSONDecodeError and UnicodeDecodeError are
        raise InputError(f"not a JSON file ({words_of(error)})", where) from None
    if not isinstance(content, dict):
        raise InputError("not a JSON object; expected one in braces", where)
    if deeper_than(content, _DEEPEST):
        raise InputError(_TOO_DEEP, where)
    return content


def deeper_than(content: Any, most: int) -> bool:
    """Whether lists and mappings are nested in each other more than `most` times."""
    level = [content]
    for _ in range(most + 1):
        level = [
            entry
            for one in level
            for entry in (one.values() if isinstance(one, dict) else one)
            if isinstance(entry, dict | list)
        ]
        if not level:
            return False
    return True


def _whole(digits: str) -> int:
    if len(digits) > _LONGEST:
        raise ValueError(f"a whole number of {len(digits)} digits; expected at most {_LONGEST}")
    return int(digits)


def plain(value: Any, lost: dict[str, str] | None = None, place: str = "") -> Any:
    """Replace what JSON has no word for: numbers that are not finite become null.

    Parameters
    ----------
    value : object
        Numpy's scalars and arrays become Python's; other objects become their text.
    lost : dict, optional
        Takes up what became null: ``"nan"``, ``"inf"`` or ``"-inf"`` by place, which is a JSON
        pointer (RFC 6901).
    place : str
        Of `value`.
    """

    def inside(key: object, entry: Any) -> Any:
        return plain(entry, lost, f"{place}/{str(key).replace('~', '~0').replace('/', '~1')}")

    match value:
        case float():
            if math.isfinite(value):
                return float(value)
            if lost is not None:
                lost[place] = str(float(value))
            return None
        case Mapping():
            return {str(key): inside(key, entry) for key, entry in value.items()}
        case list() | tuple():  # of finite floats: nearly all that there is
            return [
                entry if type(entry) is float and math.isfinite(entry) else inside(index, entry)
                for index, entry in enumerate(value)
            ]
        case None | bool() | int() | str():
            return value
    if hasattr(value, "tolist"):  # numpy's scalars and arrays
        return plain(value.tolist(), lost, place)
    return str(value)
