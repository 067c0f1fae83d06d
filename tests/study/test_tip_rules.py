"""The default rule for the ends of cuts is the one that docs/theory/xfem.md chose."""

import numpy as np
import pytest
import scenes

from verify.scene import load_scene
from verify.scene.mesh_position import POSITIONS
from verify.solvers import find_solver
from verify.solvers.body_of_scene import background_mesh, cuts_of, to_cut
from verify.study.measured_scenes import measurements, variant_of
from verify.study.positions import _at
from verify.xfem.phantom import cut_mesh

DEFAULT = {2: "partial", 3: "inside"}


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


def test_nodes_at_ends_cost_a_third_less_than_whole_elements_there():
    """Root mean square over other positions of the mesh, of elements of a quarter of the crack."""

    def error(rule):
        found = []
        for position in (1, 6, 10, 15):
            variant = variant_of(f"xfem tip={rule}")
            rows = measurements(variant, _at(load_scene("benchmark/c1_slit"), 0, position))
            found += [row.value for row in rows if row.quantity == "displacement_l2"]
        assert len(found) == 4
        return np.sqrt(np.mean(np.square(found)))

    assert error("partial") < error("inside") / 1.5
