"""The default rule for the ends of cuts is the one that docs/theory/xfem.md chose."""

import numpy as np
import pytest
import scenes

from reference.exact import exact_of
from verify.scene import load_scene
from verify.scene.mesh_position import POSITIONS
from verify.solvers import find_solver
from verify.solvers.body_of_scene import background_mesh, cuts_of, to_cut
from verify.study.positions import _at
from verify.xfem.loads_and_supports import simplex_rule
from verify.xfem.phantom import cut_mesh

DEFAULT = {2: "partial", 3: "extended"}


def short_of_the_side(d, position, before=0.3):
    """Unit square or cube whose cut ends `before` elements short of the side x = 1."""
    mesh = {"cells": [[7] * d], "position": position}
    end = 1.0 - before * background_mesh(scenes.scene(d=d, mesh=mesh), 0)[1]
    if d == 2:
        cut = {"kind": "polyline", "points": [[-1.0, 0.437], [end, 0.437]]}
    else:
        across = [[-1.0, -1.0], [end, -1.0], [end, 2.0], [-1.0, 2.0]]
        cut = {"kind": "polygon", "points": [[x, 0.437, z] for x, z in across]}
    return scenes.scene([cut], d, mesh=mesh)


def parted(rule, d):
    """Share of the positions on which the rule parts a body that the cut leaves whole."""
    found = []
    for position in range(POSITIONS):
        scene = short_of_the_side(d, position)
        mesh, size = background_mesh(scene, 0)
        asked = to_cut(mesh, cuts_of(scene, size), rule)
        phantom = cut_mesh(asked.mesh, asked.cuts, asked.rule)
        found.append(len(set(phantom.bodies.tolist())) > 1)
    return np.mean(found)


@pytest.mark.parametrize("d", [2, 3])
def test_no_default_parts_a_body_that_the_cut_leaves_whole(d):
    assert parted(DEFAULT[d], d) == 0.0
    assert parted("through", d) > 0.5  # the meshes can tell


@pytest.mark.parametrize("d", [2, 3])
def test_the_default_of_the_solver_is_the_rule_that_was_chosen(d):
    asked = short_of_the_side(d, 5)
    one, other = (
        find_solver("xfem").solve(asked, 0, 0, **given) for given in ({}, {"tip": DEFAULT[d]})
    )
    assert one.notes["tip"] == DEFAULT[d]
    assert np.array_equal(one.displacement, other.displacement)


def box_with_a_front():
    """A cube on whose outline the field of a straight front in mixed mode is imposed."""
    point, normal = np.array([0.03, -0.02, 0.04]), np.array([0.2, 0.9, -0.3])
    normal /= np.linalg.norm(normal)
    ahead = np.array([1.0, -0.2, 0.2])
    ahead -= normal * (normal @ ahead)
    ahead /= np.linalg.norm(ahead)
    along = np.cross(ahead, normal)
    ends = [(-2, 0), (2, 0), (2, -3), (-2, -3)]
    corners = [(point + a * along + b * ahead).tolist() for a, b in ends]
    parameters = {"point": point.tolist(), "normal": normal.tolist(), "axis": ahead.tolist(),
                  "intensity": [0.6, 1.0, 0.3]}  # fmt: skip
    return scenes.scene(
        [{"kind": "polygon", "points": corners}], 3, mesh={"cells": [[6] * 3]},
        geometry=scenes.box([0.5] * 3, [-0.5] * 3),
        exact={"solution": "straight_front", "parameters": parameters},
        supports=[{"where": "boundary", "displacement": "exact"}],
    )  # fmt: skip


@pytest.mark.parametrize("d", [2, 3])
def test_the_default_costs_a_third_less_than_whole_elements_at_the_ends(d):
    """Root mean square over other positions of the mesh."""
    scene = load_scene("benchmark/c1_slit") if d == 2 else box_with_a_front()

    def error(rule):
        """Of u_h in L2 over the cells of the answer, squared, without the near field's care."""
        found, exact, solver = [], exact_of(scene), find_solver("xfem")
        for position in (1, 6, 10, 15):
            answer = solver.solve(_at(scene, 0, position), 0, 1, tip=rule)
            corners, values = (x[answer.cells] for x in (answer.points, answer.displacement[-1]))
            volume = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))
            for point, weight in zip(*simplex_rule(d, 6), strict=True):
                at = np.einsum("k,ckd->cd", point, corners)
                off = np.einsum("k,ckd->cd", point, values) - exact.displacement(at, at)
                found.append(weight * volume @ (off**2).sum(axis=1))
        return np.sum(found)

    assert error(DEFAULT[d]) < error("inside") / 1.5**2
