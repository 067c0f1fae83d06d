"""JSON files that are whole or not there."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from verify.errors import InputError
from verify.whole_files import write_whole

__all__ = ["plain", "read_json", "write_json"]


def write_json(content: Any, path: Path) -> None:
    """Write `content` in one step. Numbers that are not finite become null.

    Raises
    ------
    OSError
        With the name of the file; what was there before stays.
    """
    write_whole(path, json.dumps(plain(content), indent=1, allow_nan=False) + "\n")


def read_json(path: Path) -> dict[str, Any]:
    """Read a JSON object.

    Raises
    ------
    InputError
        If the file is missing, damaged, or not an object.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError("no such file", str(path)) from None
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"not a JSON file ({error})", str(path)) from None
    if not isinstance(content, dict):
        raise InputError("not a JSON object", str(path))
    return content


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
