"""A run as files for ParaView, read back with VTK: times, fields, tensors with known values."""

from dataclasses import asdict

import numpy as np
import pytest
import pyvista

from reference.exact import exact_solution
from verify.compare.hooke import law_of, strain_and_stress, strain_energy
from verify.compare.locate import SolutionField
from verify.exchange import export_fields, problem_of
from verify.files import write_json
from verify.result import SolveRecord, Status
from verify.scene import load_scene, scene_content
from verify.solution import Solution, write_solution

pytestmark = pytest.mark.graphics

# a displacement gradient without symmetry, XX YY ZZ XY YZ XZ of its strain are all different
GRADIENT = 1e-3 * np.array([[1.0, 0.4, -0.6], [0.2, -2.0, 0.5], [0.8, -0.1, 3.0]])


def run_of(root, scene, **solutions):
    """Return a run directory in which these solvers have solved level 0 of `scene`."""
    folder = root / "cases" / scene.name.replace("/", "__")
    for solver, solution in solutions.items():
        place = folder / f"{solver}-0"
        write_solution(solution, place / "solution")
        path = str((place / "solution").relative_to(root))
        record = SolveRecord(scene.name, solver, 0, Status.SOLVED, solution=path)
        write_json({"record": asdict(record)}, place / "record.json")
    write_json(scene_content(scene), folder / "scene.json")
    write_json({"schema": 1, "cases": [scene.name]}, root / "run.json")
    return root


def moved(case, displacement, times=(0.0,)):
    """Return the scene and a solution on its first mesh, cut and opened, displaced as given."""
    scene = load_scene(case)
    problem = problem_of(scene, 0, conforming=scene.cell_dimension == scene.dimension == 2)
    u = np.array([displacement(problem.points, time) for time in times])
    sides = np.arange(len(problem.cells)) % 3
    return scene, Solution(problem.points, problem.cells, u, np.array(times), cell_sides=sides)


def opened(file):
    """Read a .pvd at all its times."""
    reader = pyvista.PVDReader(str(file))
    meshes = []
    for time in reader.time_values:
        reader.set_active_time_value(time)
        meshes.append(reader.read()[0])
    return reader.time_values, meshes


def six(tensor):
    return tensor[[0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]]


@pytest.mark.parametrize("case", ["statics/f1_3d", "material/plane_stress_patch"])
def test_a_linear_motion_has_its_times_and_one_strain_and_stress_at_each(tmp_path, case):
    d = load_scene(case).dimension
    times = (0.0, 0.025, 0.1)
    H = GRADIENT[:d, :d]
    scene, solution = moved(case, lambda points, time: 10 * time * points @ H.T, times)
    files = export_fields(run_of(tmp_path / "run", scene, xfem=solution), tmp_path / "out")
    found, meshes = opened(files[0])
    assert found == list(times)
    E, nu = scene.material.young, scene.material.poisson
    for time, mesh in zip(times, meshes, strict=True):
        strain = np.zeros((3, 3))
        strain[:d, :d] = 10 * time * (H + H.T) / 2
        if scene.material.plane == "stress":
            strain[2, 2] = -nu / (1 - nu) * (strain[0, 0] + strain[1, 1])
        # Hooke's law as it stands in every book
        stress = E / (1 + nu) * (strain + nu / (1 - 2 * nu) * np.trace(strain) * np.eye(3))
        s = np.linalg.eigvalsh(stress)
        mises = np.sqrt(((s - np.roll(s, 1)) ** 2).sum() / 2)
        np.testing.assert_allclose(
            mesh.cell_data["strain"], np.tile(six(strain), (mesh.n_cells, 1)), atol=1e-14
        )
        np.testing.assert_allclose(
            mesh.cell_data["stress"], np.tile(six(stress), (mesh.n_cells, 1)), atol=1e-13 * E
        )
        np.testing.assert_allclose(mesh.cell_data["von_mises"], mises, atol=1e-13 * E)
        np.testing.assert_array_equal(mesh.points[:, :d], solution.points)
        u = np.pad(10 * time * solution.points @ H.T, ((0, 0), (0, 3 - d)))
        np.testing.assert_allclose(mesh.point_data["displacement"], u, atol=1e-17)
        np.testing.assert_array_equal(mesh.cell_data["side"], solution.cell_sides)


@pytest.mark.parametrize(
    "case",
    ["material/plane_stress_patch", "rotation/turned_apart_solid", "statics/membrane_halves"],
)
def test_half_of_stress_times_strain_is_the_energy_that_the_comparison_measures(case):
    random = np.random.default_rng(7)
    scene, solution = moved(case, lambda points, _: 0.02 * random.standard_normal(points.shape))
    field = SolutionField(solution)
    strain, stress = strain_and_stress(field, scene)
    density = 0.5 * np.einsum("nij,nij->n", strain, stress)
    energy = (scene.material.thickness or 1.0) * density @ field.shape.volume
    assert energy == pytest.approx(strain_energy(solution, law_of(scene)), rel=1e-12)


def test_a_turned_body_has_the_strain_of_the_body_at_rest_where_kinematics_are_corotational():
    turn = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]
    turn *= np.linalg.det(turn)
    F = np.eye(3) + 50 * (GRADIENT + GRADIENT.T)
    for rotation in (np.eye(3), turn):
        H = rotation @ F - np.eye(3)
        scene, solution = moved("rotation/turned_apart_solid", lambda x, _, H=H: x @ H.T)
        strain, _ = strain_and_stress(SolutionField(solution), scene)
        np.testing.assert_allclose(strain, np.tile(F - np.eye(3), (len(strain), 1, 1)), atol=1e-13)


def test_stress_is_that_of_the_material_of_the_cell():
    scene, solution = moved("material/layers_patch", lambda x, _: x @ GRADIENT[:2, :2].T)
    field = SolutionField(solution)
    _, stress = strain_and_stress(field, scene)
    centres = field.shape.corners.mean(axis=1)
    shear = stress[:, 0, 1] / (GRADIENT[0, 1] + GRADIENT[1, 0])
    moduli = scene.material.at(centres)
    assert len(np.unique(moduli.young)) == 2
    np.testing.assert_allclose(shear, moduli.young / 2 / (1 + moduli.poisson), rtol=1e-12)


def test_error_and_reference_are_those_of_the_side_of_the_cut_on_which_a_node_lies(tmp_path):
    scene = load_scene("statics/f1_patch")
    exact = exact_solution(scene.exact.solution, scene.exact.parameters, scene.material)
    scene, solution = moved("statics/f1_patch", lambda x, _: np.zeros_like(x))
    near = np.zeros_like(solution.points)
    near[solution.cells] = solution.points[solution.cells].mean(axis=1)[:, None]
    true = exact.displacement(solution.points, near)
    off = 1e-3 * solution.points[:, ::-1]
    wrong = Solution(solution.points, solution.cells, (true + off)[None])
    run = run_of(tmp_path / "run", scene, guest=wrong)
    files = export_fields(run, tmp_path / "out", with_reference=True)
    mesh = opened(files[0])[1][0]
    # off the node by a hundredth of the way to the centre of a cell, at most 1/8 away
    np.testing.assert_allclose(mesh.point_data["error"][:, :2], off, atol=1e-3 * 0.01 / 8)
    np.testing.assert_allclose(mesh.point_data["reference"][:, :2], true, atol=1e-3 * 0.01 / 8)


def test_the_error_of_a_motion_is_against_the_reference_at_the_same_time(tmp_path):
    times = (0.0, 0.05, 0.1)
    make = "dynamics/freed_half"
    scene, reference = moved(make, lambda x, t: t * x @ GRADIENT[:2, :2].T, times)
    _, own = moved(make, lambda x, t: t * (x @ GRADIENT[:2, :2].T + [0.0, -1e-3]), times)
    run = run_of(tmp_path / "run", scene, xfem=own, reference=reference)
    files = export_fields(run, tmp_path / "out", ["xfem"], with_reference=True)
    for time, mesh in zip(*opened(files[0]), strict=True):
        expected = np.tile([0.0, -1e-3 * time, 0.0], (mesh.n_points, 1))
        np.testing.assert_allclose(mesh.point_data["error"], expected, atol=1e-15)
