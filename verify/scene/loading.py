"""Reading case files: TOML in, `Scene` out, or one clear line about what is wrong."""

import hashlib
import json
import tomllib
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from verify.errors import InputError
from verify.scene.geometry import MeshFile
from verify.scene.nearest import nearest
from verify.scene.scene import Scene

__all__ = ["case_folder", "list_cases", "load_scene", "scene_hash", "scene_schema"]


def case_folder() -> Path:
    """The folder of the cases that come with the project (installed or in a checkout)."""
    package = Path(__file__).resolve().parent.parent
    installed = package / "_cases"
    return installed if installed.is_dir() else package.parent / "cases"


def list_cases(folder: Path | None = None) -> dict[str, Path]:
    """Case files below `folder` by name, e.g. ``{"statics/f1_patch": Path(…)}``."""
    root = folder or case_folder()
    return {
        path.relative_to(root).with_suffix("").as_posix(): path for path in sorted(root.rglob("*.toml"))
    }


def load_scene(source: str | Path) -> Scene:
    """Read a scene from a case file, or by the name of a case that comes with the project.

    Parameters
    ----------
    source : str or Path
        A path that ends in ``.toml``, or a name as `list_cases` gives it.

    Returns
    -------
    Scene

    Raises
    ------
    InputError
        With file, key and what was expected there, if anything is wrong.
    """
    text = str(source)
    path = Path(text)
    name = path.stem
    if path.suffix != ".toml":
        known = list_cases()
        if text not in known:
            raise InputError(f"no case '{text}'{nearest(text, known)}")
        name, path = text, known[text]
    elif path.resolve().is_relative_to(case_folder().resolve()):
        name = path.resolve().relative_to(case_folder().resolve()).with_suffix("").as_posix()
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError("no such file; expected a case file", str(path)) from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read ({error})", str(path)) from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"not valid TOML: {error}", str(path)) from None
    try:
        scene = Scene.model_validate(content)
    except ValidationError as error:
        raise InputError(_first_line(error, content), str(path)) from None
    scene._file, scene._name = path.resolve(), name
    if isinstance(scene.geometry, MeshFile) and not mesh_path(scene).is_file():
        raise InputError(f"geometry.file: no mesh file '{scene.geometry.file}'", str(path))
    return scene


def mesh_path(scene: Scene) -> Path:
    """Absolute path of the mesh file of a scene whose geometry is one."""
    assert isinstance(scene.geometry, MeshFile)
    folder = scene.file.parent if scene.file else Path.cwd()
    return folder / scene.geometry.file


def scene_hash(scene: Scene) -> str:
    """Content hash of a scene: the same physics gives the same hash wherever it is stored."""
    content = scene.model_dump(mode="json", by_alias=True, exclude={"title", "requirement", "tags"})
    digest = hashlib.sha256(json.dumps(content, sort_keys=True).encode())
    if isinstance(scene.geometry, MeshFile):
        digest.update(mesh_path(scene).read_bytes())
    return digest.hexdigest()[:16]


def scene_schema() -> dict[str, Any]:
    """JSON Schema of a case file, for editors."""
    return Scene.model_json_schema(by_alias=True)


def _first_line(error: ValidationError, content: dict[str, Any]) -> str:
    """The most telling of pydantic's errors as one line: key, what is wrong, what is valid."""
    found = min(error.errors(), key=lambda e: e["type"] != "extra_forbidden")
    key = _key(found["loc"], content)
    more = f" (and {error.error_count() - 1} more)" if error.error_count() > 1 else ""
    message = found["msg"].removeprefix("Value error, ")
    match found["type"]:
        case "extra_forbidden":
            valid = _valid_keys(found["loc"][:-1])
            word = str(found["loc"][-1])
            return f"{key}: unknown key{nearest(word, valid)}{more}"
        case "missing":
            return f"{key}: missing{more}"
        case "union_tag_not_found":
            return f"{key}.kind: missing; expected a kind or check{more}"
        case "union_tag_invalid":
            tags = [tag.strip(" '") for tag in found["ctx"]["expected_tags"].split(",")]
            return f"{key}: no kind '{found['ctx']['tag']}'{nearest(found['ctx']['tag'], tags)}{more}"
        case "value_error":
            return f"{key}: {message}{more}" if key else f"{message}{more}"
    return f"{key}: {message[0].lower() + message[1:]}, got {found['input']!r}{more}"


def _key(location: tuple[int | str, ...], content: Any) -> str:
    """``cuts[0].points`` from pydantic's location, without the tags of its unions."""
    text, inner = "", content
    for part in location:
        if isinstance(part, int):
            text += f"[{part}]"
            inner = inner[part] if isinstance(inner, list) and part < len(inner) else None
        elif isinstance(inner, dict) and part in inner:
            text += f".{part}"
            inner = inner[part]
        elif part == location[-1]:
            text += f".{part}"
    return text.lstrip(".")


def _valid_keys(location: tuple[int | str, ...]) -> list[str]:
    """Keys that the schema allows at `location`."""
    schema = scene_schema()
    node: Any = schema
    for part in location:
        node = _resolve(node, schema)
        if "discriminator" in node and part in node["discriminator"]["mapping"]:
            node = {"$ref": node["discriminator"]["mapping"][part]}
        elif isinstance(part, int):
            node = node.get("items", {})
        else:
            node = node.get("properties", {}).get(part, node)
    return list(_resolve(node, schema).get("properties", {}))


def _resolve(node: Any, schema: dict[str, Any]) -> Any:
    if "anyOf" in node:
        node = next((n for n in node["anyOf"] if n.get("type") != "null"), node)
    if "$ref" in node:
        node = schema["$defs"][node["$ref"].rsplit("/", 1)[-1]]
    return node
