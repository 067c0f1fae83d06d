"""Cuts and places are held against bodies from mesh files as against those that a case describes.

Random cuts of a rectangle and a box, once described and once from a file with the same mesh: the
closed form of `verify.scene.placement` says what the check of the mesh must say.
"""

import re

import meshio
import numpy as np
import pytest
from scenes import scene, soft

from verify.errors import InputError
from verify.runner.checking import check_scene
from verify.runner.mesh_checks import check_places_in_mesh
from verify.solvers.body_of_scene import background_mesh
from verify.xfem.mesh import box_mesh, rectangle_mesh


@pytest.fixture
def written(tmp_path):
    """Unit square and cube as mesh files."""
    for d, mesh in ((2, rectangle_mesh((4, 5))), (3, box_mesh((3, 2, 3)))):
        kind = "triangle" if d == 2 else "tetra"
        points = np.column_stack([mesh.points, np.zeros((len(mesh.points), 3 - d))])
        meshio.Mesh(points, [(kind, mesh.cells)]).write(tmp_path / f"{d}.vtu")
    return {
        d: {
            "geometry": {"kind": "file", "file": str(tmp_path / f"{d}.vtu"), "dimension": d},
            "mesh": {"pattern": "given"},
        }
        for d in (2, 3)
    }


def _random_cut(rng, d):
    expected = ["through", "edge", "inner"][rng.integers(3)]
    if d == 2:
        points = rng.uniform(-0.6, 1.6, (2, 2)).tolist()
        return {"kind": "polyline", "points": points, "expected": expected}
    centre, size = rng.uniform(-0.3, 1.3, 3), rng.choice([0.2, 0.8, 3.0])
    if rng.random() < 0.3:
        disc = {"normal": rng.normal(size=3).tolist(), "radius": 0.5 * size}
        return {"kind": "disc", "centre": centre.tolist(), **disc, "expected": expected}
    along, across = np.linalg.qr(rng.normal(size=(3, 2)))[0].T * size
    corners = [centre - along - across, centre + along - across, centre + along + across]
    points = [p.tolist() for p in (*corners, centre - along + across)]
    return {"kind": "polygon", "points": points, "expected": expected}


def _said(d, **content):
    try:
        made = scene(d=d, material=soft(d), **content)
        if content["mesh"].get("pattern") == "given":
            check_places_in_mesh(made, background_mesh(made, 0)[0])
    except (ValueError, InputError) as error:
        found = re.search(r"cuts nothing|outside|expected '\w+' but it is '\w+'|not in", str(error))
        return "outside" if found[0] == "cuts nothing" else found[0]
    return "ok"


@pytest.mark.parametrize("d", [2, 3])
def test_random_cuts_of_a_body_from_a_file_are_what_they_are_of_the_same_body_described(d, written):
    rng = np.random.default_rng(12)
    described = {"mesh": {"cells": [[2] * d]}}
    seen = set()
    for _ in range(40):
        cut = _random_cut(rng, d)
        point = rng.uniform(-0.3, 1.3, d).tolist()
        place = {"kind": "displacement", "name": "u", "point": point, "component": "x"}
        content = {"cuts": [cut], "quantities": [place]}
        there, here = _said(d, **content, **described), _said(d, **content, **written[d])
        assert here == there, content
        seen.add(there.partition(" but")[0])
    assert len(seen) > 3


def test_cuts_in_millimetres_are_told_so(written):
    far = {"kind": "polyline", "points": [[300.0, 400.0], [500.0, 700.0]]}
    with pytest.raises(InputError, match="reach 700, the body 1 m: expected both in metres"):
        check_scene(scene(cuts=[far], **written[2]))


def test_cuts_that_no_mesh_follows_are_refused():
    rng = np.random.default_rng(13)
    for _ in range(10):
        a, b, turn = rng.uniform(0.2, 0.8, 2), 10 ** rng.uniform(-11, -4.5), rng.uniform(0, 6.3)
        short = [a.tolist(), (a + b * np.array([np.cos(turn), np.sin(turn)])).tolist()]
        with pytest.raises(InputError, match=r"expected at least 0\.0001 m"):
            check_scene(scene([{"kind": "polyline", "points": short}]))
        start, end = np.sort(rng.uniform(0.1, 0.9, 2)).tolist()
        along = [[start, 1.0], [end, 1.0], rng.uniform(0.2, 0.7, 2).tolist()]
        with pytest.raises(InputError, match=r"runs along the boundary over"):
            check_scene(scene([{"kind": "polyline", "points": along}]))
        meets = [[start, 1.2], [end, 0.7], along[2]]  # crosses the boundary, and goes in
        check_scene(scene([{"kind": "polyline", "points": meets}]))
    dot = {"kind": "disc", "centre": [0.4, 0.5, 0.6], "normal": [1.0, 2.0, 3.0], "radius": 1e-6}
    with pytest.raises(InputError, match=r"expected at least 0\.0001 m"):
        check_scene(scene([dot], d=3))


def test_a_factor_at_a_tip_on_an_interface_is_refused():
    rng = np.random.default_rng(14)
    for _ in range(5):
        (x, y), slope = rng.uniform(0.3, 0.7, 2).tolist(), float(rng.uniform(-0.5, 0.5))
        region = {"where": f"y - {y!r} > {slope!r} * (x - {x!r})", "young": 5.0}
        two = soft(regions=[region])
        cut = {"kind": "polyline", "points": [[-0.1, y + rng.uniform(-0.1, 0.1)], [x, y]]}
        asked = [{"kind": "stress_intensity", "name": "K", "mode": "I", "end": "end"}]
        with pytest.raises(InputError, match="it is on an interface between materials"):
            check_scene(scene([cut], material=two, quantities=asked))
        cut["points"][1] = [x - 0.05, y + 0.1]
        check_scene(scene([cut], material=two, quantities=asked))


def test_a_factor_where_none_is_measured_is_refused(written):
    cut = {"kind": "polyline", "points": [[-0.1, 0.43], [0.55, 0.52]]}
    asked = [{"kind": "stress_intensity", "name": "K", "mode": "I", "end": "end"}]
    with pytest.raises(InputError, match="measured in rectangles and polygons"):
        check_scene(scene([cut], quantities=asked, **written[2]))
    disc = {"kind": "disc", "centre": [0.5, 0.5, 0.45], "normal": [0.0, 0.0, 1.0], "radius": 0.25}
    asked = [{"kind": "stress_intensity", "name": "K", "mode": "I", "point": [0.75, 0.5, 0.45]}]
    two = soft(3, regions=[{"where": "x > 0.9", "young": 5.0}])
    with pytest.raises(InputError, match="measured in one material"):
        check_scene(scene([disc], d=3, quantities=asked, material=two))
    check_scene(scene([disc], d=3, quantities=asked, material=soft(3)))
