"""Reading case files: TOML in, `Scene` out, or one clear line about the fault.

A case whose numbers depend on a parameter is a family with one row per value: ``[parameters]``
names the parameter and lists its values. Wherever a text of the case uses the name, the value
stands there in each row. A text that is left without coordinates is then a number. Nothing is ever
evaluated as Python; see `verify.scene.regions`.
"""

import hashlib
import json
import re
import tomllib
import warnings
from collections.abc import Callable, Sequence
from dataclasses import asdict
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from verify.errors import InputError
from verify.files import deeper_than, read_bounded
from verify.geometry.simplices import refine_uniformly
from verify.printable import one_line, shown, words_of
from verify.scene.acceptance import RatioCheck
from verify.scene.geometry import MeshFile
from verify.scene.regions import RESERVED_NAMES, parse_expression, parse_region
from verify.scene.scene import Scene
from verify.scene.strict import first_fault, nearest
from verify.scene.tables import Row

VALUES = "values.toml"  # beside the cases of the benchmark, and none of them
_LARGEST = 2**23  # bytes; the longest case that comes with the project has 6 kB
_DEEPEST, _PARTS = 20, 20
# a dotted key takes tomllib the square of the number of its parts
_PART = r"""(?:[A-Za-z0-9_-]++|"[^"\n]*+"|'[^'\n]*+')"""
_LONG_KEY = re.compile(rf"""(?<![\w."'-])(?:{_PART}[ \t]*+\.[ \t]*+){{{_PARTS}}}""")

_MOST = 64  # values of a parameter
_KEY, _WHEN = "parameters", "when"
_PROSE = {"title", "requirement", "tags", "name", "reason", "source"}
_ROW = re.compile(r"^(?P<case>.+)\[(?P<parameter>[A-Za-z_]\w*)=(?P<value>[^\[\]=]+)\]$")
_ORIGIN = np.zeros((1, 3))


def case_folder() -> Path:
    """Return the folder of the cases that come with the project (installed or in a checkout)."""
    package = Path(__file__).resolve().parent.parent
    installed = package / "_cases"
    return installed if installed.is_dir() else package.parent / "cases"


def list_cases(folder: Path | None = None) -> dict[str, Path]:
    """Case files below `folder` by name, e.g. ``{"statics/f1_patch": Path(…)}``."""
    root = folder or case_folder()
    return {
        path.relative_to(root).with_suffix("").as_posix(): path
        for path in sorted(root.rglob("*.toml"))
        if path.name != VALUES
    }


def load_scene(source: str | Path) -> Scene:
    """Read one scene from a case file, or by the name of a case that comes with the project.

    Parameters
    ----------
    source : str or Path
        A path that ends in ``.toml``, or a name as `list_cases` gives it; of a case with
        parameters with the value of the row that is meant: ``slivers/plane[epsilon=0.01]``.

    Returns
    -------
    Scene

    Raises
    ------
    InputError
        With file, key and what was expected there, if anything is wrong; or if the case has
        several rows and none is named.
    """
    scenes = load_scenes(source)
    if len(scenes) > 1 and scenes[0].row is not None:
        rows = f"it has {len(scenes)} rows; name one, e.g. '{source}{scenes[0].row.label}'"
        raise InputError(rows, str(source))
    return scenes[0]


def load_scenes(source: str | Path) -> list[Scene]:
    """Read a case: one scene, or one for each value of its parameter.

    Parameters
    ----------
    source : str or Path
        As of `load_scene`.

    Raises
    ------
    InputError
        With file, key and what was expected there, if anything is wrong.
    """
    text = str(source)
    if (asked := row_asked(text)) is not None:
        text = asked[0]
    path = Path(text)
    name = path.stem
    if path.suffix != ".toml":
        known = list_cases()
        if text not in known:
            raise InputError(f"no case '{text}'{nearest(text, known)} (`verify list` shows all)")
        name, path = text, known[text]
    content = _content(path)
    file, cases = path.resolve(), case_folder().resolve()
    if file.is_relative_to(cases):
        name = file.relative_to(cases).with_suffix("").as_posix()
    try:
        rows = expand_rows(content, name)
    except InputError as error:
        raise InputError(str(error), str(path)) from None
    listed = [row for row, _ in rows]
    if asked is not None:
        rows = [_the_row(rows, asked, str(path))]
    scenes = [_scene(row, one, file, name, path) for row, one in rows]
    for scene in scenes:
        _check_row(scene, listed, f"{path}{scene.row.label if scene.row else ''}")
    return scenes


def _check_row(scene: Scene, known: Sequence[Row | None], where: str) -> None:
    """Raise InputError if a check compares with a row that there is not, or with itself."""
    values = [row.value for row in known if row is not None]
    own = None if scene.row is None else scene.row.value
    for i, check in enumerate(scene.acceptance):
        if (row := check.row if isinstance(check, RatioCheck) else None) is None:
            continue
        if row not in values:
            listed = ", ".join(f"{value:g}" for value in values) or "no rows: no [parameters]"
            raise InputError(f"acceptance[{i}].row: no row {row:g}; the case has {listed}", where)
        if row == own:
            text = f"the row {row:g} is compared with itself; a `when` leaves it out"
            raise InputError(f"acceptance[{i}].row: {text}", where)


def _scene(row: Row | None, content: dict[str, Any], file: Path, name: str, path: Path) -> Scene:
    """Validate one row of a case."""
    where = f"{path}{row.label if row else ''}"
    try:
        with warnings.catch_warnings():  # of numpy, about numbers that the error is about
            warnings.simplefilter("ignore")
            scene = Scene.model_validate(content)
    except ValidationError as error:
        raise InputError(first_fault(error, content, scene_schema()), where) from None
    except (ArithmeticError, MemoryError, RecursionError, np.linalg.LinAlgError) as error:
        text = f"its numbers cannot be computed with ({words_of(error)})"
        raise InputError(text, where) from None
    scene.came_from(file, f"{name}{row.label if row else ''}", row)
    if isinstance(scene.geometry, MeshFile) and not scene.geometry.path.is_file():
        raise InputError(f"geometry.file: no mesh file '{scene.geometry.file}'", where)
    return scene


def _the_row(
    rows: list[tuple[Row | None, dict[str, Any]]], asked: tuple[str, str, str], where: str
) -> tuple[Row | None, dict[str, Any]]:
    """Find the row that is named, by the number that its value is."""
    _, parameter, text = asked
    if not (known := [row.label for row, _ in rows if row is not None]):
        raise InputError(f"has no parameters, and so no row '[{parameter}={text}]'", where)
    try:
        wanted = f"[{parameter}={float(text):.12g}]"
    except ValueError:
        wanted = f"[{parameter}={text}]"
    for row, content in rows:
        if row is not None and row.label == wanted:
            return row, content
    raise InputError(f"no row '{wanted}'; it has {', '.join(known)}", where)


def _content(path: Path) -> dict[str, Any]:
    """Read TOML within limits."""
    data = read_bounded(path, "a case file", _LARGEST)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"cannot be read ({error})", str(path)) from None
    if _LONG_KEY.search(text):
        raise InputError(f"not a case: a key of more than {_PARTS} parts", str(path))
    too_deep = f"nested too deep; expected at most {_DEEPEST} levels"
    try:
        content = tomllib.loads(text)
    except RecursionError:
        raise InputError(f"not valid TOML: {too_deep}", str(path)) from None
    except ValueError as error:  # TOMLDecodeError is one; too many digits raise another
        raise InputError(f"not valid TOML: {one_line(error)}", str(path)) from None
    if deeper_than(content, _DEEPEST):
        raise InputError(f"not a case: {too_deep}", str(path))
    return content


def scene_content(scene: Scene) -> dict[str, Any]:
    """Write the scene, its name and its file as plain values, for another process."""
    return {
        "name": scene.name,
        "file": str(scene.file) if scene.file else None,
        "row": asdict(scene.row) if scene.row else None,
        "scene": scene.model_dump(mode="json", by_alias=True),
    }


def restore_scene(content: dict[str, Any]) -> Scene:
    """Read the scene that `scene_content` wrote down, by an older version too."""
    written = content["scene"]
    analysis = written.get("analysis", {})
    if analysis.get("kind", "static") == "static":  # written with defaults: they were others
        analysis = {key: value for key, value in analysis.items() if key != "opening"}
        written = {**written, "analysis": analysis}
    scene = Scene.model_validate(written)
    file = Path(content["file"]) if content["file"] else None
    row = Row(**content["row"]) if content.get("row") else None
    scene.came_from(file, content["name"], row)
    return scene


def read_mesh(scene: Scene, level: int = 0) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Read nodes (n, d), m, and cells (m, k) of a scene whose geometry is a mesh file.

    Parameters
    ----------
    scene : Scene
    level : int
        How often the mesh of the file is refined uniformly.

    Raises
    ------
    InputError
        As of `verify.scene.mesh_file.read_body`.
    """
    assert isinstance(scene.geometry, MeshFile)
    body = scene.geometry.body()
    none = np.zeros((0, body.cells.shape[1] - 1), dtype=np.int64)
    return refine_uniformly(body.points.copy(), body.cells.copy(), none, level)[:2]


def scene_hash(scene: Scene) -> str:
    """Content hash of a scene: the same physics gives the same hash wherever it is stored.

    Defaults are left out, so that a key that a later version adds does not change it.
    """
    content = scene.model_dump(
        mode="json", by_alias=True, exclude=scene.words, exclude_defaults=True
    )
    digest = hashlib.sha256(json.dumps(content, sort_keys=True).encode())
    if isinstance(scene.geometry, MeshFile):
        digest.update(scene.geometry.path.read_bytes())
    return digest.hexdigest()[:16]


def scene_schema() -> dict[str, Any]:
    """JSON Schema of a case file, for editors."""
    schema = Scene.model_json_schema(by_alias=True)
    schema["properties"]["parameters"] = rows_schema()
    return schema


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
