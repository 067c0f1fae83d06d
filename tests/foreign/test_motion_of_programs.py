"""Motion on the exchange of files: stages of a body that is cut, and codes that march on them."""

import sys

import numpy as np
import pytest
from scenes import undamped
from scipy.linalg import lu_factor, lu_solve

from verify.compare.hooke import law_of
from verify.compare.motion_account import motion_account
from verify.compare.part_account import account_metrics
from verify.exchange import export_case, read_answers
from verify.foreign import foreign_solver, state_of
from verify.foreign.installing import PROGRAMS
from verify.scene import load_scene
from verify.solvers import find_solver


@pytest.fixture
def modules(monkeypatch):
    """Modules of the programs, which import each other by their plain names."""
    monkeypatch.syspath_prepend(PROGRAMS)
    monkeypatch.syspath_prepend(PROGRAMS / "vbd")
    names = ("exchange_files", "motion", "example", "implicit_euler")
    yield {name: __import__(name) for name in names}
    for name in names:
        sys.modules.pop(name, None)


def newmark(example, lumped=False):
    """Dense average acceleration as an engine of `motion`, with the mass of linear simplices."""

    class Engine:
        def __init__(self, case, stage):
            self.free, self.shape = ~stage.held.ravel(), stage.points.shape
            body = type("Body", (), {"constant": case.constant, "dimension": case.dimension})()
            body.points, body.cells = stage.points, stage.cells
            self.stiffness = example.stiffness(body).toarray()
            n, k = len(stage.points), stage.cells.shape[1]
            edges = stage.points[stage.cells[:, 1:]] - stage.points[stage.cells[:, :1]]
            weight = case.constant("density") * np.abs(np.linalg.det(edges)) / {3: 2, 4: 6}[k]
            mass = np.zeros((n, n))
            for cell, share in zip(stage.cells, weight / (k * (k + 1)), strict=True):
                mass[np.ix_(cell, cell)] += share * (1.0 + np.eye(k))
            if lumped:
                mass = np.diag(mass.sum(axis=1))
            self.mass, self.factors = np.kron(mass, np.eye(self.shape[1])), {}

        def solved(self, of_mass, of_stiffness, right):
            """Solve with the sum of so many masses and stiffnesses, which is factorised once."""
            found, free, key = np.zeros(right.size), self.free, (of_mass, of_stiffness)
            if key not in self.factors:
                matrix = of_mass * self.mass + of_stiffness * self.stiffness
                self.factors[key] = lu_factor(matrix[np.ix_(free, free)])
            found[free] = lu_solve(self.factors[key], right[free])
            return found

        def equilibrium(self, values, force):
            u = values.ravel()
            u = u + self.solved(0.0, 1.0, force.ravel() - self.stiffness @ u)
            return u.reshape(self.shape)

        def begin(self, u, v, force, dt):
            self.u, self.v = u.ravel(), v.ravel()
            self.a = self.solved(1.0, 0.0, force.ravel() - self.stiffness @ self.u)

        def step(self, dt, values, force):
            guess = self.u + dt * self.v + 0.25 * dt**2 * self.a
            a = self.solved(1.0, 0.25 * dt**2, force.ravel() - self.stiffness @ guess)
            self.v = self.v + 0.5 * dt * (self.a + a)
            self.u, self.a = guess + 0.25 * dt**2 * a, a

        def state(self):
            return [field.reshape(self.shape) for field in (self.u, self.v, self.a)]

    return Engine


def same_nodes(one, other):
    """Rows of `other` that are the nodes of `one`, told apart by the middles of their cells."""

    def keys(solution):
        middle = np.zeros(solution.points.shape)
        count = np.bincount(solution.cells.ravel(), minlength=len(middle))[:, None]
        centroids = solution.points[solution.cells].mean(axis=1)
        np.add.at(middle, solution.cells, centroids[:, None])
        return np.round(np.hstack([solution.points, middle / count]), 9)

    first, second = (np.lexsort(keys(solution).T) for solution in (one, other))
    np.testing.assert_allclose(keys(one)[first], keys(other)[second], atol=1e-8)
    rows = np.empty(len(first), dtype=int)
    rows[first] = second
    return rows


def assert_same_motion(found, expected, relative):
    rows = same_nodes(found, expected)
    for name in ("displacement", "velocity"):
        field, other = getattr(found, name), getattr(expected, name)[:, rows]
        assert np.abs(field - other).max() <= relative * np.abs(other).max(), name


def test_stages_of_a_cut_body_move_as_the_conforming_solver_says(modules, tmp_path):
    scene = undamped("dynamics/prestrained_bar_solid")
    export_case(scene, tmp_path, [0], conforming=True)
    laid = modules["exchange_files"].Case(tmp_path, 0, conforming=True)
    modules["motion"].run_engine(laid, newmark(modules["example"]))
    found = read_answers(scene, tmp_path).solutions[0]
    expected = find_solver("conforming").solve(scene, 0, repetitions=1)
    assert_same_motion(found, expected, 1e-9)


@pytest.mark.parametrize("case", ["plate_bent_path", "hanging_block_quick"])
def test_facets_behind_a_blade_open_one_by_one_as_the_conforming_solver_says(
    case, modules, tmp_path
):
    scene = load_scene(f"cutting/{case}")
    times = scene.analysis.model_copy(update={"time_step": scene.analysis.output_times[-1] / 25})
    scene = scene.model_copy(update={"analysis": times})
    export_case(scene, tmp_path, [0], conforming=True)
    laid = modules["exchange_files"].Case(tmp_path, 0, conforming=True)
    modules["motion"].run_engine(laid, newmark(modules["example"]))
    found = read_answers(scene, tmp_path).solutions[0]
    assert "when the blade has passed" in found.notes["a tool path opens"]
    expected = find_solver("conforming").solve(scene, 0, repetitions=1, opening="late")
    assert_same_motion(found, expected, 1e-9)


@pytest.mark.parametrize("mass", ["consistent", "lumped"])
def test_a_program_that_says_with_which_mass_it_moves_keeps_its_energy(mass, modules, tmp_path):
    scene = undamped("dynamics/block_falls_apart")
    export_case(scene, tmp_path, [0], conforming=True)
    laid = modules["exchange_files"].Case(tmp_path, 0, conforming=True)
    engine = newmark(modules["example"], lumped=mass == "lumped")
    modules["motion"].run_engine(laid, engine, mass)
    found = read_answers(scene, tmp_path).solutions[0]
    metrics, _ = account_metrics(scene, motion_account(scene, found, law_of(scene)))
    drift = next(metric for metric in metrics if metric.name == "energy_drift")
    assert drift.value + drift.uncertainty < 1e-10
    assert "declared" in drift.source


def test_cuts_that_open_in_turn_open_one_by_one(modules, tmp_path):
    scene = load_scene("dynamics/two_cuts_in_turn")
    export_case(scene, tmp_path, [0], conforming=True)
    case = modules["exchange_files"].Case(tmp_path, 0, conforming=True)
    stages = [modules["motion"].Stage(case, instant) for instant in (0.0, 0.1, 0.2)]
    parts = [modules["exchange_files"].parts(s.cells, len(s.points)) for s in stages]
    assert [len(np.unique(part)) for part in parts] == [1, 2, 3]
    np.testing.assert_array_equal(stages[2].points[stages[2].node], case.points)
    weights = [stage.force(0.0).sum(axis=0) for stage in stages]
    np.testing.assert_allclose(weights, 3 * [[0.0, -9.8 * 1000 * 0.03]], atol=1e-9)


def cube(modules, held=False):
    """Six tetrahedra of a cube, their stable neo-Hookean body."""
    rng = np.random.default_rng(3)
    points = np.array(np.meshgrid(*3 * [[0.0, 1.0]], indexing="ij")).reshape(3, 8).T
    cells = np.array(
        [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]]
    )
    edges = points[cells[:, 1:]] - points[cells[:, :1]]
    cells[np.linalg.det(edges) < 0] = cells[np.linalg.det(edges) < 0][:, [0, 1, 3, 2]]
    marks = (points[:, 0] == 0.0) & held
    lame, shear = rng.uniform(1.0, 2.0, (2, 6))
    return modules["implicit_euler"].ImplicitEuler(points, cells, lame, shear, np.ones(8), marks)


def test_the_stable_neo_hookean_tangent_is_the_derivative_of_its_forces(modules):
    body, rng = cube(modules), np.random.default_rng(4)
    u, way = 0.1 * rng.normal(size=(2, 8, 3))
    tangent = body.forces(u, True)[1]
    ahead, behind = (body.forces(u + side * 1e-6 * way)[0] for side in (1, -1))
    expected = (ahead - behind).ravel() / 2e-6
    np.testing.assert_allclose(tangent @ way.ravel(), expected, atol=1e-8 * np.abs(expected).max())
    assert abs(tangent - tangent.T).max() < 1e-14


def test_a_turned_neo_hookean_body_has_no_forces(modules):
    body, angle = cube(modules), 2.0
    turn = np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    )
    assert np.abs(body.forces(body.points @ (turn - np.eye(3)).T)[0]).max() < 1e-14


def installed(name, *more):
    """Row of a test that needs a foreign solver."""
    missing = state_of(foreign_solver(name)).missing
    return pytest.param(name, *more, marks=pytest.mark.skipif(bool(missing), reason=missing))


@pytest.mark.heavy
@pytest.mark.parametrize("case", ["block_falls_apart", "cantilever_release", "two_rates"])
@pytest.mark.parametrize("name", [installed("kratos"), installed("akantu")])
def test_a_foreign_code_moves_as_the_conforming_solver_says(name, case):
    scene = undamped("dynamics/block_falls_apart" if case == "two_rates" else f"dynamics/{case}")
    if case == "two_rates":  # the step before the cut opens is another than that after it
        cut = scene.cuts[0].model_copy(update={"opens_at": 0.052})
        scene = scene.model_copy(update={"cuts": [cut]})
    found = find_solver(name).solve(scene, 0, repetitions=1)
    expected = find_solver("conforming").solve(scene, 0, repetitions=1)
    # its first acceleration is that of a step 1e-4 as long: off by (ω dt)²/4 where slivers ring
    assert_same_motion(found, expected, 1e-5)


PATCHES = ("statics/f1_patch", "statics/f1_3d", "material/plane_stress_patch")
TURNED = ("rotation/tissue_strip_solid", "rotation/turned_apart_solid")
NEO_HALVES = ("rotation/neo_hookean_halves", "rotation/neo_stretched_halves")


@pytest.mark.heavy
@pytest.mark.parametrize(
    ("name", "cases", "model", "rtol", "atol"),
    [
        *(installed(name, PATCHES, None, 1e-7, 1e-12) for name in ("kratos", "akantu", "sofa")),
        # corotational tetrahedra, total Lagrangian ones
        installed("sofa", TURNED, None, 0.0, 1e-8),
        installed("kratos", NEO_HALVES, "neo_hookean", 0.0, 1e-11),
    ],
)
def test_a_foreign_code_solves_as_the_conforming_solver_says(name, cases, model, rtol, atol):
    for scene in map(load_scene, cases):
        if model:
            material = scene.material.model_copy(update={"model": model})
            scene = scene.model_copy(update={"material": material})
        found = find_solver(name).solve(scene, 0, repetitions=1)
        expected = find_solver("conforming").solve(scene, 0, repetitions=1)
        wanted = expected.displacement[:, same_nodes(found, expected)]
        size = atol * np.abs(wanted).max()
        np.testing.assert_allclose(found.displacement, wanted, rtol, size, err_msg=scene.name)


@pytest.mark.heavy
@pytest.mark.parametrize("name", [installed("sofa")])
@pytest.mark.parametrize("case", ["plate_bent_path", "hanging_block_quick"])
def test_sofa_moves_behind_a_blade_by_newmarks_method(name, case, modules, tmp_path):
    scene = load_scene(f"cutting/{case}")
    found = find_solver(name).solve(scene, 0, repetitions=1, scheme="newmark")
    export_case(scene, tmp_path, [0], conforming=True)
    laid = modules["exchange_files"].Case(tmp_path, 0, conforming=True)
    modules["motion"].run_engine(laid, newmark(modules["example"], lumped=True))
    expected = read_answers(scene, tmp_path).solutions[0]
    assert_same_motion(found, expected, 1e-8)


@pytest.mark.parametrize("name", ["torn_block", "freed_half"])
def test_vertex_block_descent_takes_the_cases_of_its_own_law_alone(name):
    takes, scene = foreign_solver("vbd").takes, load_scene(f"rotation/neo_{name}")
    assert takes.refusal(scene) is None
    hooke = scene.material.model_copy(update={"model": "hooke"})
    assert "material model" in takes.refusal(scene.model_copy(update={"material": hooke}))


@pytest.mark.heavy
@pytest.mark.parametrize("name", [installed("vbd")])
def test_vertex_block_descent_comes_to_rest_where_the_exact_halves_are(name):
    scene = load_scene("rotation/neo_stretched_halves")
    found = find_solver(name).solve(scene, 0, repetitions=1)
    expected = find_solver("conforming").solve(scene, 0, repetitions=1)
    rows = same_nodes(found, expected)
    off = np.abs(found.displacement - expected.displacement[:, rows])
    assert off.max() < 1e-6  # of a body of 1 m, in single precision


@pytest.mark.heavy
@pytest.mark.parametrize("name", [installed("vbd")])
def test_vertex_block_descent_goes_towards_the_steps_that_newton_solves(name):
    scene = undamped("dynamics/block_falls_apart")
    turned = scene.analysis.model_copy(update={"kinematics": "corotational"})
    own = scene.material.model_copy(update={"model": "stable_neo_hookean"})
    scene = scene.model_copy(update={"analysis": turned, "material": own})
    code = find_solver(name)
    solved = code.solve(scene, 0, repetitions=1, step="solved").displacement
    errors = [
        np.abs(code.solve(scene, 0, repetitions=1, iterations=n).displacement - solved).max()
        for n in (4, 40, 400)
    ]
    scale = np.abs(solved).max()
    assert errors[0] > 5.0 * errors[1] > 10.0 * errors[2]
    assert errors[2] < 1e-3 * scale  # 32 bits: 1e-7 of the body, summed over the steps
