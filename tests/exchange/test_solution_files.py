"""Files of another program: what it must write is little, and what it gets wrong is named."""

import json

import meshio
import numpy as np
import pytest

from verify.errors import InputError
from verify.solution import read_solution

POINTS = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
CELLS = np.array([[0, 1, 2], [0, 2, 3]])
LEAST = {"schema": 1, "files": ["u.vtu"], "dimension": 2, "order": 1}


@pytest.fixture
def answer(tmp_path):
    """Write a JSON half and a VTU half; returns the path that `read_solution` takes."""

    def write(record, points=POINTS, cells=(("triangle", CELLS),), name="displacement", file="u"):
        values = {name: 0.1 * points} if name else {}
        meshio.Mesh(points, list(cells), values).write(tmp_path / f"{file}.vtu")
        (tmp_path / "solution.json").write_text(json.dumps(record))
        return tmp_path / "solution"

    return write


def test_four_keys_and_a_displacement_are_enough(answer):
    solution = read_solution(answer(LEAST))
    assert solution.points.shape == (4, 2)
    np.testing.assert_array_equal(solution.displacement, 0.1 * POINTS[None, :, :2])
    assert solution.times.tolist() == [0.0]
    assert solution.cut_facets.shape == (0, 2, 2)
    assert (solution.ledger, solution.timings, solution.unknowns) == ({}, {}, 0)
    assert np.isnan(solution.size)


@pytest.mark.parametrize(
    "record, said",
    [
        ({"tiems": [0.0]}, "unknown key 'tiems'; did you mean 'times'"),
        ({"schema": 2}, "schema"),
        ({"order": 3}, "dimension"),
        ({"dimension": 3}, "triangle"),
        ({"files": "u.vtu"}, "expected a list of VTU files"),
        ({"files": []}, "expected a list of VTU files"),
        ({"files": ["v.vtu"]}, "v.vtu: no such file; expected the VTU half"),
        ({"files": ["u.vtu", "u.vtu"]}, "times"),
        ({"files": ["u.vtu"], "times": [0.0, 1.0]}, "for 1 files; expected one each"),
        ({"timings": {"solve": "fast"}}, "not a readable solution"),
        ({"regularisations": [{"kind": "snapped"}]}, "not a readable solution"),
    ],
)
def test_a_fault_in_the_json_half_is_named(answer, record, said):
    with pytest.raises(InputError) as caught:
        read_solution(answer(LEAST | record))
    assert said in str(caught.value)


@pytest.mark.parametrize(
    "vtu, said",
    [
        ({"name": "U"}, "displacement"),
        ({"name": ""}, "displacement"),
        ({"cells": [("triangle", CELLS), ("quad", [[0, 1, 2, 3]])]}, "triangle"),
        ({"cells": [("triangle6", [[0, 1, 2, 3, 3, 3]])]}, "triangle"),
        ({"points": POINTS + np.inf}, "not finite"),
    ],
)
def test_a_fault_in_the_vtu_half_is_named(answer, vtu, said):
    with pytest.raises(InputError) as caught:
        read_solution(answer(LEAST, **vtu))
    assert said in str(caught.value)


def test_points_that_move_with_the_displacement_are_refused(answer):
    answer(LEAST, points=POINTS * 1.1, file="v")
    record = LEAST | {"files": ["u.vtu", "v.vtu"], "times": [0.0, 1.0]}
    with pytest.raises(InputError, match="material"):
        read_solution(answer(record))
