"""JSON files that are whole or not there; those of others are read within limits."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from verify.errors import InputError
from verify.printable import words_of
from verify.whole_files import read_bounded, write_whole

_DEEPEST = 60  # levels of nesting; none of our files has more than a dozen
_TOO_DEEP = f"not a JSON file of ours (nested too deep; expected at most {_DEEPEST} levels)"
_LONGEST = 40  # digits of a whole number


def write_json(content: Any, path: Path) -> None:
    """Write `content` in one step. Numbers that are not finite become null.

    Raises
    ------
    OSError
        With the name of the file; what was there before stays.
    """
    write_whole(path, json.dumps(plain(content), indent=1, allow_nan=False) + "\n")


def read_json(path: Path, what: str = "a JSON file") -> dict[str, Any]:
    """Read a JSON object.

    Parameters
    ----------
    path : Path
    what : str
        What is expected there, for the message.

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
        As `read_json`; `where` is said in it.
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
        Numpy's scalars and arrays become Python's; what is unknown becomes its text.
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
        case list() | tuple():
            return [inside(index, entry) for index, entry in enumerate(value)]
        case None | bool() | int() | str():
            return value
    if hasattr(value, "tolist"):  # numpy's scalars and arrays
        return plain(value.tolist(), lost, place)
    return str(value)
