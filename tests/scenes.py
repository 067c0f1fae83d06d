"""Scenes that tests build: each states only the keys that its claim needs."""

from functools import cache

from verify.errors import InputError
from verify.runner.checking import check_scene
from verify.scene import Scene, list_cases, load_scene, load_scenes


@cache
def catalogue():
    """Rows of every case of the project, by its name: read once in a process."""
    return {name: load_scenes(path) for name, path in list_cases().items()}


@cache
def every_row():
    """Scenes of the project by their names, of families each row."""
    return {scene.name: scene for rows in catalogue().values() for scene in rows}


@cache
def _rows_of_files():
    return {path: catalogue()[name] for name, path in list_cases().items()}


def read_once(source):
    """As `load_scenes`, but for cases of the project, which are as `catalogue` has read them."""
    return _rows_of_files().get(source) or load_scenes(source)


def box(upper, lower=None):
    """Geometry of a rectangle or box, by default from the origin."""
    kind = "rectangle" if len(upper) == 2 else "box"
    return {"kind": kind, "lower": list(lower or [0.0] * len(upper)), "upper": list(upper)}


def soft(d=2, **more):
    """E = 1, ν = 0.3; plane strain in the plane."""
    return {"young": 1.0, "poisson": 0.3, **({"plane": "strain"} if d == 2 else {}), **more}


def scene(cuts=(), d=2, **changes):
    """Unit square or cube with cuts, held all around."""
    content = {
        "title": "a test",
        "requirement": "it shall hold",
        "geometry": box([1.0] * d),
        "mesh": {"cells": [[4] * d]},
        "material": soft(d),
        "supports": [{"where": "boundary", "displacement": [0.0] * d}],
        "cuts": list(cuts),
    }
    return Scene.model_validate(content | changes)


def undamped(case):
    """Load a scene without its damping, which most programs do not offer."""
    scene = load_scene(case)
    bare = scene.analysis.model_copy(update={"damping": (0.0, 0.0)})
    return scene.model_copy(update={"analysis": bare})


def check_refusal(**content):
    """Why `verify check` refuses a scene; empty if it does not."""
    try:
        check_scene(scene(**content))
    except InputError as error:
        return str(error)
    return ""
