"""The adapter puts a scene before the compact solver as it was meant, and says what it changed."""

import meshio
import numpy as np
import pytest
from case_texts import body_text, cut_text, support_text, weight_text

from verify.errors import UnsupportedSceneError
from verify.scene import load_scene
from verify.solvers.xfem import XfemSolver
from verify.xfem.structured_meshes import rectangle_mesh

STRIP = (
    body_text(
        "A hanging strip, cut halfway",
        "It shall hang.",
        [0.02, 0.1],
        [[4, 21], [8, 41]],
        young="1e4",
        density="1000.0",
    )
    + support_text("top", [0, 0])
    + weight_text()
    + cut_text([0.0, 0.05], [0.01, 0.05])
)


def scene(folder, *changes, base=STRIP):
    text = base
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "strip.toml").write_text(text)
    return load_scene(folder / "strip.toml")


def strain_energy(solution, young=1e4, poisson=0.3):
    """Strain energy of a P1 field, from its cells alone."""
    corners = solution.points[solution.cells]
    moved = solution.displacement[-1][solution.cells]
    edges, area = corners[:, 1:] - corners[:, :1], None
    area = np.linalg.det(edges) / 2
    gradient = (np.linalg.inv(edges) @ (moved[:, 1:] - moved[:, :1])).transpose(0, 2, 1)
    strain = 0.5 * (gradient + gradient.transpose(0, 2, 1))
    lam = young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    mu = young / (2 * (1 + poisson))
    trace = np.trace(strain, axis1=1, axis2=2)
    return float(area @ (0.5 * lam * trace**2 + mu * (strain**2).sum(axis=(1, 2))))


def test_the_three_bases_give_the_same_displacements(tmp_path):
    strip = scene(tmp_path)
    solutions = [
        XfemSolver().solve(strip, 1, basis=b) for b in ("sidewise", "shifted", "heaviside")
    ]
    scale = np.abs(solutions[0].displacement).max()
    for other in solutions[1:]:
        # round-off times the condition number of a mesh of 41 elements in length, about 1e5
        np.testing.assert_allclose(
            other.displacement, solutions[0].displacement, rtol=0, atol=1e-9 * scale
        )
        assert other.unknowns == solutions[0].unknowns


def test_the_patch_has_its_exact_energy_on_every_level():
    patch = load_scene("statics/f1_patch")
    for level in range(XfemSolver().levels(patch)):
        solution = XfemSolver().solve(patch, level)
        assert strain_energy(solution, young=1.0) == pytest.approx(3.434065934e-3, rel=1e-9)


def test_the_work_of_gravity_is_twice_the_strain_energy(tmp_path):
    """Clapeyron; the work is integrated on the stored field, the energy too."""
    solution = XfemSolver().solve(scene(tmp_path), 1)
    corners = solution.points[solution.cells]
    area = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 2
    fall = solution.displacement[-1][solution.cells][:, :, 1].mean(axis=1)
    work = -9.8 * 1000.0 * float(area @ fall)
    assert work == pytest.approx(2 * strain_energy(solution), rel=1e-10)


def test_an_end_inside_an_element_is_reported_with_how_far_it_moved(tmp_path):
    on_edge = XfemSolver().solve(scene(tmp_path), 0)
    assert not [r for r in on_edge.regularisations if "end of a cut" in r.kind]
    # 2 mm past an edge, in elements 5 mm wide, along the middle of a row of elements
    inside = XfemSolver().solve(scene(tmp_path, ("[0.01, 0.05]", "[0.012, 0.05]")), 0)
    (moved,) = [r for r in inside.regularisations if "end of a cut" in r.kind]
    assert (moved.count, moved.unit) == (1, "m")
    ends = inside.cut_facets.reshape(-1, 2)[:, 0].max()
    assert moved.size == pytest.approx(0.012 - ends, abs=1e-12)


def test_a_given_mesh_gives_the_same_as_the_structured_one(tmp_path):
    mesh = rectangle_mesh([8, 41], (0.0, 0.0), (0.02, 0.1))
    shuffled = np.random.default_rng(3).permutation(len(mesh.points))
    place = np.argsort(shuffled)
    points = np.column_stack([mesh.points[shuffled], np.zeros(len(shuffled))])
    meshio.Mesh(points, [("triangle", place[mesh.cells])]).write(tmp_path / "body.vtu")
    rectangle = 'kind = "rectangle"\nlower = [0.0, 0.0]\nupper = [0.02, 0.1]'
    given = scene(
        tmp_path,
        (rectangle, 'kind = "file"\nfile = "body.vtu"'),
        ("cells = [[4, 21], [8, 41]]", 'pattern = "given"'),
        ('"top"', '"y > 0.0999999"'),
    )
    one = XfemSolver().solve(given, 0)
    other = XfemSolver().solve(scene(tmp_path), 1)
    assert strain_energy(one) == pytest.approx(strain_energy(other), rel=1e-10)


def test_timings_have_one_entry_per_repetition_and_the_first_call_is_not_among_them(tmp_path):
    solution = XfemSolver().solve(scene(tmp_path), 0, repetitions=4)
    phases = {"enrichment", "loading", "analysis", "assembly", "factorisation", "solve"}
    assert set(solution.timings) == phases | {"meshing"}
    assert {len(solution.timings[phase]) for phase in phases} == {4}


def test_a_ghost_penalty_is_reported_with_its_share_of_the_energy(tmp_path):
    """It stiffens: the strain energy under dead loads is less, by about its share."""
    plain = XfemSolver().solve(scene(tmp_path), 1, 0)
    found = XfemSolver().solve(scene(tmp_path), 1, 0, slivers="penalise")
    (entry,) = [r for r in found.regularisations if "ghost penalty" in r.kind]
    assert entry.unit == "of the strain energy"
    assert entry.count > 0
    assert 0.0 < entry.size < 0.2
    assert 0.8 < found.ledger["strain"][0] / plain.ledger["strain"][0] < 1.0


def test_a_part_may_end_at_a_cut_inside_an_element(tmp_path):
    """Below the cut the left side is held, above it the right one: each half hangs by its own."""
    parts = '"y < 0.0512 and x < 1e-9"\ndisplacement = [0.0, 0.0]\n[[supports]]\nwhere = '
    parts += '"y > 0.0512 and x > 0.01999"\ndisplacement = [1e-4, 0.0]'
    weightless = ("acceleration = [0.0, -9.8]", "acceleration = [0.0, 0.0]")
    through = ("[[0.0, 0.05], [0.01, 0.05]]", "[[-0.1, 0.0512], [0.1, 0.0512]]")
    strip = scene(tmp_path, ('"top"\ndisplacement = [0.0, 0.0]', parts), weightless, through)
    found = XfemSolver().solve(strip, 0, 0)
    above = found.points[found.cells].mean(axis=1)[:, 1] > 0.0512
    moved = found.displacement[0][found.cells]
    wanted = np.where(above[:, None, None], [1e-4, 0.0], [0.0, 0.0])
    np.testing.assert_allclose(moved, np.broadcast_to(wanted, moved.shape), atol=1e-15)
    # of the two unknowns of a node one side is held alone: which the shifted ones cannot say
    with pytest.raises(UnsupportedSceneError, match="element"):
        XfemSolver().solve(strip, 0, 0, basis="heaviside")
