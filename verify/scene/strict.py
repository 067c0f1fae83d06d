"""The base of all scene models, the form of a rule, and messages about a case file in one line.

Models are strict and frozen; unknown keys are errors. A rule is a row of a table: the key that it
is about, what breaks it, and the text of the message. A message names the key, the fault and the
nearest valid word there.
"""

import re
from collections.abc import Callable, Iterable
from difflib import get_close_matches
from inspect import cleandoc
from typing import Annotated, Any, ClassVar, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator

from verify.errors import instead
from verify.printable import shown

# `strict`: a number is a number; "1e4" and true are not
# and none is so large, or so small above zero, that its powers are not
_LARGEST = 1e60
_SMALLEST = 1e-60


def _not_tiny(value: float) -> float:
    if value < _SMALLEST:
        raise ValueError(f"expected a number ≥ {_SMALLEST:g}, got {value:g}")
    return value


Finite = Annotated[float, Field(strict=True, ge=-_LARGEST, le=_LARGEST, allow_inf_nan=False)]
Positive = Annotated[
    float, Field(strict=True, gt=0, le=_LARGEST, allow_inf_nan=False), AfterValidator(_not_tiny)
]
NonNegative = Annotated[float, Field(strict=True, ge=0, le=_LARGEST, allow_inf_nan=False)]
Count = Annotated[int, Field(strict=True, ge=1, le=10**9)]
# printed later: no escapes of the terminal, no marks of direction
Line = Annotated[
    str,
    Field(
        min_length=1, max_length=2000, pattern=r"^[^\x00-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069]*$"
    ),
]
Point2 = tuple[Finite, Finite]
Point3 = tuple[Finite, Finite, Finite]
Vector = Annotated[list[Finite], Field(min_length=2, max_length=3)]
# a number, or a formula in x, y, z, t that `verify.scene.regions.parse_expression` reads
Formula = Annotated[str, Field(min_length=1, max_length=1000)]
Components = Annotated[list[Finite | Formula], Field(min_length=1, max_length=3)]

_DESCRIPTION = re.compile(r"^(\w+)\n((?: {4}.*\n?)+)", re.MULTILINE)
#: key that the rule is about (empty: the part as a whole), what breaks it, and the message
Rule = tuple[str, Callable[..., Any], str]
Rules = tuple[Rule, ...]


def first_broken(rules: Rules, *parts: Any, place: str = "") -> str | None:
    """Say in one line which rule is broken first, or None if all hold.

    Parameters
    ----------
    rules : Rules
        What breaks a rule is asked of the parts. It answers with nothing (None, False) if the rule
        holds; else with what stands in the braces of the message, a tuple if that are several.
    parts
        What the rules are on.
    place : str
        Where it stands, before the key.
    """
    for key, broken, text in rules:
        if found := broken(*parts):
            said = text.format(*found) if isinstance(found, tuple) else text.format(found)
            where = ".".join(filter(None, (place, key)))
            return f"{where}: {said}" if where else said
    return None


def none_or_both(one: str, other: str) -> Callable[[Any], bool]:
    """Break a rule where neither of two keys is given, or both are."""
    return lambda part: (getattr(part, one) is None) == (getattr(part, other) is None)


def one_alone(one: str, other: str) -> Callable[[Any], bool]:
    """Break a rule where one of two keys is given without the other."""
    return lambda part: (getattr(part, one) is None) != (getattr(part, other) is None)


class Strict(BaseModel):
    """A part of a scene. Unknown keys are refused; values do not change after validation."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    rules: ClassVar[Rules] = ()

    def __init_subclass__(cls, **more: Any) -> None:
        """Take the descriptions of keys, for the schema, from the docstring of a table."""
        super().__init_subclass__(**more)
        text, _, listed = cleandoc(cls.__doc__ or "").partition("\n\nAttributes\n----------\n")
        cls.__doc__ = text or None
        for key, said in _DESCRIPTION.findall(listed):
            described = Field(description=" ".join(said.split()))
            cls.__annotations__[key] = Annotated[cls.__annotations__[key], described]

    @model_validator(mode="after")
    def _keeps_its_rules(self) -> Self:
        if fault := first_broken(self.rules, self):
            raise ValueError(fault)
        return self


# ------------------------------------------------------------------------------ messages
_FEW, _SHOWN = 30, 3
#: why there is no kind of load that acts on less than an area, in the plane than a length
NO_POINT_LOADS = (
    "; a force at a point or on an edge has an infinite energy: give the traction on the part that "
    "it acts on"
)
_HINTS = {"loads": NO_POINT_LOADS}  # by the list
# what pydantic expected, by the type of its error
_WANTED = {
    **dict.fromkeys(("float_type", "finite_number"), "a finite number"),
    **dict.fromkeys(("int_type", "int_from_float"), "a whole number"),
    "string_type": "a text in quotes",
    **dict.fromkeys(("string_too_short", "string_pattern_mismatch"), "one line of text"),
    "string_too_long": "at most {max_length} characters",
    **dict.fromkeys(("dict_type", "model_type", "model_attributes_type"), "a table of keys"),
    "too_short": "at least {min_length} entries",
    "too_long": "at most {max_length} entries",
    "greater_than": "a number > {gt:g}",
    "greater_than_equal": "a number ≥ {ge:g}",
    "less_than": "a number < {lt:g}",
    "less_than_equal": "a number ≤ {le:g}",
    "literal_error": "{expected}",
}


def nearest(word: str, words: Iterable[str]) -> str:
    """Give a phrase to put behind "no such …": the nearest of `words`, or all if they are few."""
    known = sorted(words)
    if close := get_close_matches(word, known, n=1, cutoff=0.6):
        return f"; did you mean '{close[0]}'?"
    if len(known) > _FEW:
        return f"; expected one of {len(known)}, such as {', '.join(known[:_SHOWN])}"
    return f"; expected one of {', '.join(known)}" if known else ""


def first_fault(error: ValidationError, content: dict[str, Any], schema: dict[str, Any]) -> str:
    """Say the most telling of pydantic's errors in one line.

    Parameters
    ----------
    error : ValidationError
    content : dict
        What was validated, as read from the file.
    schema : dict
        JSON Schema of it, for the valid keys.
    """
    faults = error.errors()
    # a misspelt key is usually also a missing one: the misspelling is what to mend
    found = min(faults, key=lambda fault: fault["type"] != "extra_forbidden")
    key = _key(found, content)
    same = [fault for fault in faults if _key(fault, content) == key]
    others = len({_key(fault, content) for fault in faults} - {key})
    more = f" (and {others} more)" if others else ""
    return f"{_sentence(found, same, key, schema)}{more}"


def _sentence(found: Any, same: list[Any], key: str, schema: dict[str, Any]) -> str:
    match found["type"]:
        case "extra_forbidden":
            if said := instead(key):
                return said
            valid = _valid_keys(found["loc"][:-1], schema)
            return f"{key}: unknown key{nearest(str(found['loc'][-1]), valid)}"
        case "missing":
            return f"{key}: missing"
        case "union_tag_not_found":
            tag = found["ctx"]["discriminator"].strip("'")
            return f"{key}.{tag}: missing{_tags(found, schema)}"
        case "union_tag_invalid":
            tag = found["ctx"]["discriminator"].strip("'")
            hint = _HINTS.get(key.split("[")[0], "")
            return f"{key}.{tag}: no '{found['ctx']['tag']}'{_tags(found, schema)}{hint}"
        case "value_error":
            message = found["msg"].removeprefix("Value error, ")
            return f"{key}: {message}" if key else message
    wanted = " or ".join(dict.fromkeys(_wanted(fault) for fault in same))
    return f"{key}: expected {wanted}, got {shown(found['input'])}"


def _tags(found: Any, schema: dict[str, Any]) -> str:
    """Name the valid tags of a union, or the nearest one."""
    given = str(found["ctx"].get("tag", ""))
    return nearest(given, _node(found["loc"], schema).get("discriminator", {}).get("mapping", {}))


def _wanted(fault: Any) -> str:
    """Say what pydantic expected in words of a case file (it speaks of tuples)."""
    if fault["type"] in ("list_type", "tuple_type"):
        table = isinstance(fault["input"], dict)
        return "a list of tables ([[…]], not […])" if table else "a list in brackets"
    if (text := _WANTED.get(fault["type"])) is None:
        return str(fault["msg"]).removeprefix("Input should be ")
    return text.format(**fault.get("ctx", {}))


def _key(fault: Any, content: Any) -> str:
    """``cuts[0].points`` from pydantic's location, without the tags of its unions."""
    location = fault["loc"]
    text, inner = "", content
    for part in location:
        if isinstance(part, int):
            text += f"[{part}]"
            inner = inner[part] if isinstance(inner, list) and part < len(inner) else None
        elif isinstance(inner, dict) and part in inner:
            text += f".{part}"
            inner = inner[part]
        elif part == location[-1] and fault["type"] == "missing":
            text += f".{part}"
    return text.lstrip(".")


def _valid_keys(location: Iterable[int | str], schema: dict[str, Any]) -> list[str]:
    """Keys that the schema allows at `location`."""
    return list(_node(location, schema).get("properties", {}))


def _node(location: Iterable[int | str], schema: dict[str, Any]) -> dict[str, Any]:
    """Find the part of the schema that describes `location`."""
    node = schema
    for part in location:
        node = _resolved(node, schema)
        if "discriminator" in node and part in node["discriminator"]["mapping"]:
            node = {"$ref": node["discriminator"]["mapping"][part]}
        elif isinstance(part, int):
            node = node.get("items", {})
        else:
            node = node.get("properties", {}).get(part, node)
    return _resolved(node, schema)


def _resolved(node: dict[str, Any], schema: dict[str, Any]) -> dict[str, Any]:
    if "anyOf" in node:
        node = next((n for n in node["anyOf"] if n.get("type") != "null"), node)
    if "$ref" in node:
        node = schema["$defs"][node["$ref"].rsplit("/", 1)[-1]]
    return node
