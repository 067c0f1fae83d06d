"""Removal: what is touched is lost, exactly; refinement makes it less."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from verify.methods import cut_by
from verify.methods.removal import bisect_cells
from verify.xfem.cuts import Plane, Polyline
from verify.xfem.mesh import box_mesh, rectangle_mesh

FEW = settings(max_examples=12, deadline=None, derandomize=True)


def crossed(mesh, plane):
    """Cells with corners strictly on both sides of a plane: what it touches, by definition."""
    values = plane.level_set(mesh.points)[mesh.cells]
    return (values.max(axis=1) > 1e-9) & (values.min(axis=1) < -1e-9)


@FEW
@given(
    dim=st.sampled_from([2, 3]),
    direction=st.tuples(*[st.floats(-1, 1)] * 3),
    offset=st.floats(-0.3, 0.3),
)
def test_removal_loses_exactly_the_volume_of_the_touched_cells_and_its_debris(
    dim, direction, offset
):
    mesh = rectangle_mesh((6, 6)) if dim == 2 else box_mesh((3, 3, 3))
    plane = Plane(np.full(dim, 0.5 + offset), np.array(direction)[:dim] + 1e-3)
    near = np.abs(plane.level_set(mesh.points))
    assume(not ((near > 1e-15) & (near < 1e-3)).any())  # grazing: what "touched" is, is a choice
    body = cut_by("removal", mesh, [plane])
    touched = crossed(mesh, plane)
    lost = {change.kind.split(",")[0]: change for change in body.changes}
    assert lost["touched cell removed"].count == touched.sum()
    gone = mesh.measures[touched].sum()
    assert lost["touched cell removed"].size == pytest.approx(gone, rel=1e-12)
    debris = lost["cell removed as debris"].size if "cell removed as debris" in lost else 0.0
    assert body.phantom.volumes.sum() == pytest.approx(1.0 - gone - debris, rel=1e-12)


def test_a_part_that_hangs_on_a_node_only_is_apart():
    # the cut removes the lower left triangle's neighbour: what remains of the corner hangs on nodes
    mesh = rectangle_mesh((2, 1))
    body = cut_by("removal", mesh, [Polyline([[0.4, -1.0], [0.45, 2.0]])])
    first = body.phantom.cells
    shared = [len(np.intersect1d(first[a], first[b])) for a in range(len(first)) for b in range(a)]
    assert 1 not in shared


def test_refinement_brings_the_lost_volume_down_by_half_per_level():
    mesh, plane = box_mesh((3, 3, 3)), Plane([0.5, 0.5, 0.47], [0.1, 0.2, 1.0])
    lost = [
        1.0 - cut_by("removal_refined", mesh, [plane], levels=k).phantom.volumes.sum()
        for k in (0, 1, 2)
    ]
    assert lost[0] == pytest.approx(1.0 - cut_by("removal", mesh, [plane]).phantom.volumes.sum())
    # a band as wide as the cells: half as wide, within the spread of the shapes of few cells
    assert np.array(lost[1:]) / lost[:-1] == pytest.approx(0.5, abs=0.12)


@FEW
@given(dim=st.sampled_from([2, 3]), seed=st.integers(0, 10_000), rounds=st.integers(1, 3))
def test_bisection_leaves_no_hanging_node_and_no_gap(dim, seed, rounds):
    rng = np.random.default_rng(seed)
    mesh = rectangle_mesh((3, 3)) if dim == 2 else box_mesh((2, 2, 2))
    origin = np.arange(len(mesh.cells))
    whole = mesh
    for _ in range(rounds):
        mesh, before = bisect_cells(mesh, rng.random(len(mesh.cells)) < 0.2)
        origin = origin[before]
    assert mesh.measures.sum() == pytest.approx(1.0, rel=1e-12)
    shares = np.bincount(origin, mesh.measures) / whole.measures
    assert shares == pytest.approx(1.0, rel=1e-12)
    # a facet with a hanging node would have no neighbour, and would lie inside the body
    facets = mesh.boundary_facets
    local = np.arange(mesh.dim + 1) != facets[:, 1:]
    corners = mesh.points[mesh.cells[facets[:, 0]][local].reshape(-1, dim)]
    on_side = [(np.abs(corners - x) < 1e-12).all(axis=1).any(axis=1) for x in (0.0, 1.0)]
    assert (on_side[0] | on_side[1]).all()
