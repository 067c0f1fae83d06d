"""Case files as files: hashes, schema, mesh files, and the way to another process."""

import json

import meshio
import numpy as np
import pytest
from scenes import catalogue
from test_case_file_faults import WHOLE, load

from verify.errors import InputError
from verify.scene import (
    Scene,
    parse_region,
    read_mesh,
    restore_scene,
    scene_content,
    scene_schema,
)

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
TRIANGLES = [[0, 1, 2], [0, 3, 2]]  # the second is turned the wrong way


def test_every_case_of_the_project_is_valid():
    assert catalogue()
    for name, rows in catalogue().items():
        for scene in rows:
            assert scene.name == name + (scene.row.label if scene.row else "")


def test_a_scene_survives_the_way_to_another_process(tmp_path):
    scene = load(tmp_path, WHOLE)
    content = json.loads(json.dumps(scene_content(scene)))
    restored = restore_scene(content)
    assert restored == scene
    assert (restored.name, restored.file) == (scene.name, scene.file)
    # of the time when cuts opened late by default
    content["scene"]["analysis"]["opening"] = "late"
    assert restore_scene(content) == scene


def test_the_schema_knows_every_key_and_forbids_others():
    schema = scene_schema()
    assert set(schema["properties"]) == {
        "parameters",  # of the case file: a scene is one row
        *(field.alias or name for name, field in Scene.model_fields.items()),
    }
    assert schema["additionalProperties"] is False
    assert all(part.get("additionalProperties") is False for part in schema["$defs"].values())


def test_a_region_is_an_inequality_and_nothing_else():
    points = np.array([[0.2, 0.0], [0.6, 0.3], [0.9, 0.9]])
    region = parse_region("0.1 < x <= 0.6 and not hypot(x, y) < 0.3 or y > 2*pi/8", 2)
    assert region(points).tolist() == [False, True, True]
    for text in ("x", "x == 1", "x.real > 0", "x < 1 if y else 2", "x < 1e999", "open('f') < x",
                 "x < " + "9" * 500, "(" * 500 + "x<1" + ")" * 500, "not " * 3000 + "x<1",
                 "x<1\0"):  # fmt: skip
        with pytest.raises(InputError):
            parse_region(text, 2)


def given_mesh(folder, points=SQUARE, cells=(("triangle", TRIANGLES),), name="body.vtk"):
    meshio.Mesh(points, [(kind, np.array(c)) for kind, c in cells]).write(folder / name)
    text = WHOLE.replace(
        'kind = "rectangle"\nlower = [0.0, 0.0]\nupper = [1.0, 2.0]',
        f'kind = "file"\nfile = "{name}"',
    ).replace("cells = [[4, 8], [8, 16]]", 'pattern = "given"')
    return load(folder, text.replace('"top"', '"y > 0.9"'))


def test_a_mesh_file_gives_simplices_of_positive_orientation(tmp_path):
    lonely = np.column_stack([np.vstack([SQUARE, [[5.0, 5.0]]]), [0, 1e-17, 0, -1e-16, 0]])
    points, cells = read_mesh(given_mesh(tmp_path, lonely))
    assert points.shape == (4, 2)  # the node that no cell uses is gone
    edges = points[cells[:, 1:]] - points[cells[:, :1]]
    np.testing.assert_allclose(np.linalg.det(edges), [1.0, 1.0], rtol=1e-15)


@pytest.mark.parametrize(
    "options, expected",
    [
        ({"cells": (("tetra", [[0, 1, 2, 3]]),)}, "has tetra; expected triangles"),
        ({"cells": (("line", [[0, 1]]),)}, "has line; expected triangles"),
        ({"cells": (("triangle", TRIANGLES), ("tetra", [[0, 1, 2, 3]]))}, "has tetra; expected"),
        ({"points": np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0.1], [0, 1, 0]])}, "not plane"),
        ({"points": SQUARE * [[1.0, 0.0]]}, "2 cells without volume"),
        ({"cells": (("triangle", [*TRIANGLES, TRIANGLES[0]]),)}, "cells 0 and 2 overlap"),
        ({"cells": (("triangle", [*TRIANGLES, [0, 1, 3]]),)}, "cells 0 and 2 overlap"),
        ({"points": np.array([[0.0, 0], [1, 0], [1, np.nan], [0, 1]])}, "not finite"),
    ],
    ids=["tetrahedra", "only lines", "mixed", "not plane", "flat", "twice", "overlapping", "nan"],
)  # fmt: skip
def test_a_bad_mesh_file_is_said_in_one_line(tmp_path, options, expected):
    with pytest.raises(InputError, match=expected) as caught:
        read_mesh(given_mesh(tmp_path, **options))
    assert "\n" not in str(caught.value)
