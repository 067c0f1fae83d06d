"""Results as JSON files, and records of plain values."""

from functools import cache
from pathlib import Path
from typing import Any

from verify.errors import InputError
from verify.json_files import plain, read_json, write_json
from verify.printable import one_line, words_of
from verify.result import SCHEMA_VERSION, CaseResult


def folder_of_case(case: str) -> str:
    """Return the name of the folder of a case below ``cases/`` of a run."""
    name = case.replace("/", "__")
    return f"_{name}" if name.startswith(".") else name


def write_result(result: CaseResult, path: Path) -> None:
    """Write `result` as JSON, in one step (a reader never sees half a file).

    Numbers that are not finite, for which JSON has no word, are null there, and named with what
    they are under ``not_finite``; numpy's scalars are plain numbers.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    lost: dict[str, str] = {}
    content = plain(result.content(), lost)
    write_json({**content, "not_finite": lost} if lost else content, path)


def read_result(path: Path) -> CaseResult:
    """Read what `write_result` wrote.

    Raises
    ------
    InputError
        If the file is missing, damaged, or of another schema version.
    """
    record = read_json(path, "a result")
    if record.get("schema") != SCHEMA_VERSION:
        raise InputError(f"not a result of schema version {SCHEMA_VERSION}", str(path))
    try:
        for place, number in record.pop("not_finite", {}).items():
            _put(record, place, float(number))
    except (AttributeError, LookupError, OverflowError, TypeError, ValueError) as error:
        raise InputError(f"not a readable result ({words_of(error)})", str(path)) from None
    return checked(CaseResult, record, "result", str(path))


def checked[Kind](kind: type[Kind], content: Any, what: str, where: str) -> Kind:
    """Make a record of `verify.result`, or of what holds them, from plain values.

    Parameters
    ----------
    kind : type
        A dataclass.
    content : object
    what : str
        What it is called in the message.
    where : str

    Raises
    ------
    InputError
        If a value is missing, of another type, or unknown; the first such is named.
    """
    from pydantic import ValidationError

    make: Any = kind
    try:
        made: Kind = _adapter(make).validate_python(content)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        said = one_line(f"{place}: {first['msg']}")
        raise InputError(f"not a readable {what} ({said})", where) from None
    return made


@cache
def _adapter(kind: Any) -> Any:
    from pydantic import TypeAdapter

    return TypeAdapter(kind)


def _put(record: Any, place: str, number: float) -> None:
    """Put a number at a JSON pointer (RFC 6901), where null stands for it."""
    keys = [key.replace("~1", "/").replace("~0", "~") for key in place.split("/")[1:]]
    for key in keys[:-1]:
        record = record[int(key) if isinstance(record, list) else key]
    record[int(keys[-1]) if isinstance(record, list) else keys[-1]] = number
