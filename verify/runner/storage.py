"""JSON files that are whole or not there."""

import json
import math
import os
from pathlib import Path
from typing import Any

from verify.errors import InputError

__all__ = ["read_json", "write_json"]


def write_json(content: Any, path: Path) -> None:
    """Write `content` in one step: a reader, or a kill at any time, never sees half a file.

    Raises
    ------
    OSError
        With the name of the file; what was there before stays.
    """
    partial = path.with_name(path.name + ".partial")
    text = json.dumps(_plain(content), indent=1, allow_nan=False)
    try:
        partial.write_text(text, encoding="utf-8")
        os.replace(partial, path)
    except OSError as error:
        error.filename = error.filename or str(path)  # a full disk does not say where
        partial.unlink(missing_ok=True)
        raise


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
        case dict():
            return {str(key): _plain(entry) for key, entry in value.items()}
        case list() | tuple():
            return [_plain(entry) for entry in value]
        case None | bool() | int() | str():
            return value
    if hasattr(value, "tolist"):  # numpy's scalars and arrays
        return _plain(value.tolist())
    return str(value)
