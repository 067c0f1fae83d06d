"""The neutral solution: files are read as written, a wrong shape fails where it arises."""

import json
from dataclasses import fields, replace

import numpy as np
import pytest
from scipy.sparse import csr_array

from verify.errors import InputError
from verify.solution import (
    ContactPressure,
    Regularisation,
    Solution,
    read_solution,
    write_solution,
)

# a corner list of the unit simplex, and its mid-edge nodes in VTK's order
EDGES = {2: [(0, 1), (1, 2), (2, 0)], 3: [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]}


def simplex(dimension, order, times=1):
    corners = np.vstack([np.zeros(dimension), np.eye(dimension)]) * np.pi
    middles = [0.5 * (corners[a] + corners[b]) for a, b in EDGES[dimension]]
    points = np.vstack([corners, middles]) if order == 2 else corners
    generator = np.random.default_rng(7)
    return Solution(
        points=points,
        cells=np.arange(len(points))[None],
        displacement=generator.normal(size=(times, len(points), dimension)),
        velocity=generator.normal(size=(times, len(points), dimension)),
        acceleration=generator.normal(size=(times, len(points), dimension)),
        times=np.linspace(0.0, 1.0, times),
        order=order,
        cut_facets=generator.normal(size=(3, dimension, dimension)),
        cell_sides=np.array([2]),
        ledger={"strain": generator.normal(size=times)},
        quantities={"opening": 1 / 3},
        unknowns=7,
        size=0.1,
        timings={"solve": [0.1, 0.3]},
        iterations={"newton": 4},
        regularisations=[Regularisation("piece dropped", 2, 1e-14, "volume fraction")],
        notes={"solver": "by hand"},
    )


@pytest.mark.parametrize("dimension, order, times", [(2, 2, 3), (3, 1, 3), (3, 2, 1)])
def test_a_solution_is_read_as_it_was_written_to_the_last_bit(tmp_path, dimension, order, times):
    written = simplex(dimension, order, times)
    write_solution(written, tmp_path / "a" / "solution")
    read = read_solution(tmp_path / "a" / "solution")
    for field in fields(Solution):
        one, other = getattr(written, field.name), getattr(read, field.name)
        if isinstance(one, np.ndarray):
            np.testing.assert_array_equal(one, other)
        elif field.name == "ledger":
            np.testing.assert_array_equal(one["strain"], other["strain"])
        else:
            assert one == other


@pytest.mark.parametrize("order", [1, 2])
def test_a_membrane_is_triangles_in_space_and_read_as_such(tmp_path, order):
    flat = simplex(2, order)
    points = np.column_stack([flat.points, np.cos(flat.points[:, 0])])
    moved = np.random.default_rng(3).normal(size=(1, len(points), 3))
    edge = np.array([[[0.0, 0.0, 1.0], [1.0, 0.0, 0.5]]])
    written = Solution(points, flat.cells, moved, order=order, cut_facets=edge)
    assert (written.dimension, written.cell_dimension) == (3, 2)
    write_solution(written, tmp_path / "skin")
    read = read_solution(tmp_path / "skin")
    assert read.cell_type == flat.cell_type
    for name in ("points", "cells", "displacement", "cut_facets"):
        np.testing.assert_array_equal(getattr(read, name), getattr(written, name))


def test_a_pressure_of_contact_is_read_as_it_was_written(tmp_path):
    plain = simplex(2, 1, times=2)
    contact = ContactPressure(
        np.array([[0.1, 1 / 3], [0.2, 0.5], [0.3, 0.5]]),
        np.array([0.1, 1 / 7, 0.2]),
        np.array([[0.0, 1e5, 2.0], [1 / 3, 0.0, 0.0]]),
    )
    write_solution(replace(plain, contact=contact), tmp_path / "pressed")
    read = read_solution(tmp_path / "pressed").contact
    for name in ("points", "weights", "pressure"):
        np.testing.assert_array_equal(getattr(read, name), getattr(contact, name))
    bad = replace(contact, pressure=contact.pressure[:1])
    with pytest.raises(InputError, match=r"contact.pressure of shape \(1, 3\); expected \(2, 3\)"):
        replace(plain, contact=bad)


@pytest.mark.parametrize("kind", ["consistent", "by node", "matrix"])
def test_a_declared_mass_is_read_as_it_was_written(tmp_path, kind):
    plain = simplex(2, 1)
    coupled = np.array([[2.0, 0.1 / 3, 0.0], [0.1 / 3, 1.0, -0.2], [0.0, -0.2, 3.0]])
    masses = {"consistent": kind, "by node": np.array([1 / 3, 2.0, 0.0])}
    mass = masses.get(kind, csr_array(coupled))
    write_solution(replace(plain, mass=mass), tmp_path / "solution")
    read = read_solution(tmp_path / "solution").mass
    if kind == "matrix":
        np.testing.assert_array_equal(read.toarray(), coupled)
        content = json.loads((tmp_path / "solution.json").read_text())["mass"]
        assert all(i <= j for i, j in zip(content["rows"], content["columns"], strict=True))
    else:
        np.testing.assert_array_equal(read, mass)


@pytest.mark.parametrize("mass, said", [
    ("lumped", "mass 'lumped'; expected 'consistent', numbers or a sparse matrix"),
    (np.ones(4), "mass of shape (4,); expected (3,)"),
    (np.array([1.0, np.nan, 1.0]), "mass has values that are not finite"),
    (csr_array(np.eye(4)), "mass of shape (4, 4); expected (3, 3)"),
    (csr_array(np.triu(np.ones((3, 3)))), "not symmetric"),
])  # fmt: skip
def test_a_mass_that_is_none_is_refused(mass, said):
    with pytest.raises(InputError) as refused:
        replace(simplex(2, 1), mass=mass)
    assert said in str(refused.value)


@pytest.mark.parametrize("content, said", [
    ([1.0, 2.0], "mass of shape (2,)"),
    ({"rows": [0]}, "expected 'consistent', a list by node, or rows, columns and values"),
    ({"rows": [1], "columns": [0], "values": [1.0]}, "below its diagonal"),
    ({"rows": [0], "columns": [7], "values": [1.0]}, "not a readable solution"),
    (3.0, "mass of type 'float'"),
])  # fmt: skip
def test_a_mass_in_a_file_that_is_none_is_refused_with_the_file(tmp_path, content, said):
    write_solution(simplex(2, 1), tmp_path / "solution")
    file = tmp_path / "solution.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | {"mass": content}))
    with pytest.raises(InputError) as refused:
        read_solution(tmp_path / "solution")
    assert said in str(refused.value)
    assert "solution.json" in str(refused.value)


PLAIN = {
    "points": np.eye(3, 2),
    "cells": np.array([[0, 1, 2]]),
    "displacement": np.zeros((1, 3, 2)),
}
MASKED = np.ma.masked_array(np.zeros((1, 3, 2)), mask=True)


@pytest.mark.parametrize(
    "change, fault",
    [
        ({"points": np.full((3, 2), np.inf)}, "points"),
        ({"points": [[0, 0], [1, 0], [0, 1]]}, "points: of type 'list'; expected an array"),
        ({"cells": np.array([[0, 1, 3]])}, "outside"),
        ({"cells": np.array([[0.0, 1.0, 2.0]])}, "cells: an array of float64; expected whole"),
        ({"cells": np.zeros((1, 3), int)}, "volume"),
        ({"cells": np.zeros((0, 3), int)}, "without cells"),
        ({"order": 3}, "order 3; expected 2 or 3, and 1 or 2"),
        ({"displacement": np.zeros((3, 2))}, r"expected \(1, 3, 2\)"),
        ({"displacement": np.full((1, 3, 2), np.nan)}, "not finite"),
        ({"displacement": MASKED}, "MaskedArray"),
        ({"velocity": np.zeros((2, 3, 2))}, "velocity of shape"),
        ({"times": np.zeros(2)}, "ascending"),
        ({"times": np.zeros(0), "displacement": np.zeros((0, 3, 2))}, "expected ascending, at"),
        ({"cut_facets": np.zeros((1, 3, 2))}, "cut_facets"),
        ({"cell_sides": np.zeros(2, int)}, "cell_sides"),
        ({"ledger": {"strain": np.zeros(2)}}, "strain"),
        ({"size": -1.0}, "size"),
        ({"unknowns": -5}, "unknowns"),
        ({"timings": {"solve": [-1.0]}}, "solve"),
        ({"timings": {"a\x1b[31m": []}}, "printable"),
        ({"iterations": {"cg": -1}}, "iterations"),
        ({"quantities": {"opening": np.inf}}, "opening"),
        ({"notes": {"solver": "x" * 10**6}}, "characters"),
        ({"regularisations": ["snapped"]}, "regularisations"),
    ],
)
def test_what_is_no_solution_is_refused_where_the_solver_hands_over(change, fault):
    with pytest.raises(InputError, match=fault) as caught:
        Solution(**{**PLAIN, **change})
    assert len(str(caught.value)) < 300
    assert "\n" not in str(caught.value)
