"""JSON files that are whole or not there."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from verify.errors import InputError
from verify.whole_files import write_whole

__all__ = ["read_json", "write_json"]


def write_json(content: Any, path: Path) -> None:
    """Write `content` in one step. Numbers that are not finite become null.

    Raises
    ------
    OSError
        With the name of the file; what was there before stays.
    """
    write_whole(path, json.dumps(_plain(content), indent=1, allow_nan=False) + "\n")


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


def _plain(value: Any) -> Any:
    """Replace what JSON has no word for: numbers that are not finite become null."""
    match value:
        case float():
            return float(value) if math.isfinite(value) else None
        case Mapping():
            return {str(key): _plain(entry) for key, entry in value.items()}
        case list() | tuple():
            return [_plain(entry) for entry in value]
        case None | bool() | int() | str():
            return value
    if hasattr(value, "tolist"):  # numpy's scalars and arrays
        return _plain(value.tolist())
    return str(value)
