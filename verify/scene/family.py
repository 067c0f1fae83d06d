"""Families of scenes: a case whose numbers depend on a parameter, one row per value.

``[parameters]`` names the parameter and lists its values. Wherever a text of the case uses the
name, the value stands there in each row. A text that is left without coordinates is then a number.
Nothing is ever evaluated as Python; see `verify.scene.regions`.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np

from verify.errors import InputError
from verify.printable import shown
from verify.scene.regions import RESERVED_NAMES, parse_expression, parse_region

_MOST = 64  # values of a parameter
_KEY, _WHEN = "parameters", "when"
_PROSE = {"title", "requirement", "tags", "name", "reason", "source"}
_ROW = re.compile(r"^(?P<case>.+)\[(?P<parameter>[A-Za-z_]\w*)=(?P<value>[^\[\]=]+)\]$")
_ORIGIN = np.zeros((1, 3))


@dataclass(frozen=True)
class Row:
    """One scene of a family: the case, the name of its parameter, and the value of it here."""

    family: str
    parameter: str
    value: float

    @property
    def label(self) -> str:
        """The row as it stands behind the name of the case."""
        return f"[{self.parameter}={self.value:.12g}]"


def row_asked(source: str) -> tuple[str, str, str] | None:
    """Split ``case[epsilon=0.01]`` into the case, the parameter and the text of its value."""
    found = _ROW.match(source)
    return None if found is None else (found["case"], found["parameter"], found["value"].strip())


def expand_rows(content: dict[str, Any], family: str) -> list[tuple[Row | None, dict[str, Any]]]:
    """Write out the rows of a case; a case without parameters is its only row.

    Parameters
    ----------
    content : dict
        What the case file holds.
    family : str
        Name of the case.

    Raises
    ------
    InputError
        If the parameter, its values or a text that uses it are bad, or nothing uses it.
    """
    if _KEY not in content:
        return [(None, content)]
    name, values = _parameter(content[_KEY])
    whole = all(isinstance(value, int) for value in values)
    rest = {key: part for key, part in content.items() if key != _KEY}
    rows: list[tuple[Row | None, dict[str, Any]]] = []
    for value in values:
        row = Row(family, name, float(value))
        used: list[str] = []

        def put(text: str, row: Row = row, used: list[str] = used) -> str:
            put_in, count = re.subn(rf"(?<![\w.]){name}\b", f"({row.value!r})", text)
            used.extend([text] * count)
            return put_in

        one = _written(rest, "", put, whole)
        if not used:
            raise InputError(f"{_KEY}: no text of the case uses '{name}'")
        if isinstance(one.get("title"), str):
            one["title"] += f", {name} = {row.value:.12g}"
        rows.append((row, one))
    return rows


def rows_schema() -> dict[str, Any]:
    """JSON Schema of the table ``[parameters]``, for editors."""
    values = {"type": "array", "items": {"type": "number"}, "minItems": 1, "maxItems": _MOST}
    return {
        "type": "object",
        "description": "one parameter and the list of its values: the case has one row for each",
        "minProperties": 1,
        "maxProperties": 1,
        "additionalProperties": values,
    }


def _parameter(table: Any) -> tuple[str, list[float]]:
    wanted = "one parameter with the list of its values, such as epsilon = [0.5, 0.1, 0.0]"
    if not isinstance(table, dict) or len(table) != 1:
        raise InputError(f"{_KEY}: expected {wanted}, got {shown(table)}")
    ((name, values),) = table.items()
    if not name.isidentifier() or not name.isascii() or name in RESERVED_NAMES:
        text = "expected a word that has no other meaning in a formula"
        raise InputError(f"{_KEY}: '{name}' cannot name a parameter; {text}")
    if not isinstance(values, list) or not 1 <= len(values) <= _MOST:
        raise InputError(f"{_KEY}.{name}: expected 1 to {_MOST} numbers in brackets")
    for i, value in enumerate(values):
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not number or not isfinite(value) or abs(value) > 1e60:
            raise InputError(f"{_KEY}.{name}[{i}]: expected a finite number, got {shown(value)}")
    labels = [Row("", name, float(value)).label for value in values]
    if twins := {label for label in labels if labels.count(label) > 1}:
        raise InputError(f"{_KEY}.{name}: {min(twins)} is listed twice")
    return name, values


def _written(part: Any, where: str, put: Callable[[str], str], whole: bool) -> Any:
    """Write a part of a case with the value in place of the name."""
    if isinstance(part, dict):
        return {
            key: inner
            if key in _PROSE
            else _written(inner, f"{where}.{key}".lstrip("."), put, whole)
            for key, inner in part.items()
        }
    if isinstance(part, list):
        conditions = [_condition(one, f"{where}[{i}]", put) for i, one in enumerate(part)]
        return [
            _written(one, f"{where}[{i}]", put, whole)
            for i, (holds, one) in enumerate(conditions)
            if holds
        ]
    if isinstance(part, str) and (text := put(part)) != part:
        return _number_or_text(text, where, whole)
    return part


def _condition(part: Any, where: str, put: Callable[[str], str]) -> tuple[bool, Any]:
    """Whether the condition ``when`` of a table holds in this row, and the table without it."""
    if not isinstance(part, dict) or not isinstance(part.get(_WHEN), str):
        return True, part
    text = part[_WHEN]
    if (written := put(text)) == text:
        raise InputError(f"{where}.{_WHEN}: '{text}' does not use the parameter of the case")
    try:
        holds = bool(parse_region(written, 0)(_ORIGIN)[0])
    except InputError as error:
        raise InputError(f"{where}.{_WHEN}: {error}") from None
    return holds, {key: inner for key, inner in part.items() if key != _WHEN}


def _number_or_text(text: str, where: str, whole: bool) -> float | int | str:
    """Return the number that a text without coordinates is, else the text itself."""
    if re.search(r"[<>]", text) or re.search(r"\b[xyzt]\b", text):
        return text  # a region or a field, which the scene reads
    try:
        value = float(parse_expression(text, 0)(_ORIGIN)[0])
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    return int(value) if whole and value.is_integer() else value
