"""Systems: growth laws, condition numbers and steps in closed form and of each solver."""

import sys
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import block_diag, eigh
from scipy.sparse import csr_array, diags_array

from verify.errors import InputError
from verify.result import Verdict
from verify.scene import load_scene
from verify.solvers import find_solver
from verify.solvers.xfem import XfemSolver
from verify.study.measured_scenes import Measurement
from verify.study.slivers import findings, growth, step_by_running
from verify.system import (
    System,
    checked_system,
    condition_numbers,
    critical_step,
    gradient_iterations,
    lowest_frequency,
)

SIZES = [0.5, 1e-1, *(10.0**-k for k in range(2, 13)), 0.0]


@pytest.mark.parametrize("exponent", [-2.0, -0.5, 0.0])
def test_an_exact_power_law_is_found_to_round_off(exponent):
    law = growth(SIZES, [7.0 * s**exponent if s else 7.0 for s in SIZES])
    assert law.exponent == pytest.approx(exponent, abs=1e-12)
    assert law.uncertainty < 1e-11
    assert law.points == 10


def test_scatter_widens_the_uncertainty_and_the_true_exponent_stays_inside():
    """A factor of up to 1.2 each way; 95 % of 200 draws, less four standard deviations of that."""
    random = np.random.default_rng(3)
    inside = 0
    for _ in range(200):
        law = growth(SIZES, [max(s, 1e-99) ** -2 * random.uniform(0.8, 1.25) for s in SIZES])
        assert law.uncertainty > 1e-3
        inside += abs(law.exponent + 2.0) <= law.uncertainty
    assert inside >= 177


def test_a_bend_is_no_power_law():
    law = growth(SIZES, [max(s, 1e-7) for s in SIZES])
    assert law.exponent is None
    assert "no single exponent" in law.reason


def test_sizes_without_a_value_are_named_and_too_few_give_no_exponent():
    values = [s**1.5 if s > 1e-9 else None for s in SIZES]
    law = growth(SIZES, values)
    assert law.exponent == pytest.approx(1.5, abs=1e-12)
    assert "1e-12" in law.reason
    law = growth([1e-3, 1e-4, 1e-5], [1.0, None, 2.0])
    assert law.exponent is None
    assert law.reason.startswith("2 positive values")


def test_a_law_ends_where_the_number_of_unknowns_changes():
    """A mesh that splits cut cells loses its step with ε until the cut moves onto nodes."""
    steps = [s if s > 1e-9 else 1.0 for s in SIZES]
    assert growth(SIZES, steps).exponent is None
    law = growth(SIZES, steps, [60.0 if s > 1e-9 else 50.0 for s in SIZES])
    assert law.exponent == pytest.approx(1.0, abs=1e-12)
    assert law.points == 6
    assert "other unknowns from ε = 1e-09 on" in law.reason


def chain(n, masses=1.0, stiffness=1.0):
    """Return n springs in a row, the first end held: ω = 2 sin((2k − 1) π / (4n + 2))."""
    main = np.full(n + 1, 2.0)
    main[[0, -1]] = 1.0
    off = -np.ones(n)
    matrix = stiffness * diags_array([off, main, off], offsets=[-1, 0, 1])
    fixed = np.zeros(n + 1, dtype=bool)
    fixed[0] = True
    return System(csr_array(matrix), csr_array(masses * diags_array([np.ones(n + 1)], offsets=[0])),
                  fixed)  # fmt: skip


@pytest.mark.parametrize("n", [3, 40])
def test_a_chain_of_springs_has_the_condition_and_step_of_the_closed_form(n):
    squares = 4.0 * np.sin((2 * np.arange(1, n + 1) - 1) * np.pi / (4 * n + 2)) ** 2
    system = chain(n, masses=3.0, stiffness=5.0)
    raw, scaled = condition_numbers(system)
    assert raw == pytest.approx(squares.max() / squares.min(), rel=1e-10)
    assert scaled < raw  # the free end has half of the diagonal
    assert critical_step(system) == pytest.approx(2.0 / np.sqrt(5.0 / 3.0 * squares.max()))
    least = np.sqrt(5.0 / 3.0 * squares.min()) / (2.0 * np.pi)
    assert lowest_frequency(system) == pytest.approx(least, rel=1e-7)


@pytest.mark.parametrize("size", [1e-4, 1e-12])
def test_a_sliver_whose_mass_and_stiffness_vanish_together_is_measured_to_round_off(size):
    """Scaled by S the raw number grows by S², and neither the scaled one nor the step changes."""
    whole = chain(20)
    scale = np.ones(21)
    scale[-1] = size
    S = csr_array(diags_array([scale], offsets=[0]))
    thin = System(S @ whole.stiffness @ S, S @ whole.mass @ S, whole.fixed)
    (raw, scaled), (_, expected) = condition_numbers(thin), condition_numbers(whole)
    assert scaled == pytest.approx(expected, rel=1e-8)
    assert 0.1 / size**2 < raw < 1e3 / size**2
    assert critical_step(thin) == pytest.approx(critical_step(whole), rel=1e-8)


@pytest.mark.parametrize("stiffnesses", [[3.0], [3.0, 700.0], [3.0, 700.0, 1e-9]])
def test_conjugate_gradients_take_an_iteration_for_each_scaled_eigenvalue(stiffnesses):
    """Pairs of unknowns on springs k, coupled by k/2: scaled 1 ± 1/3, whatever k."""
    pair = np.array([[1.5, -0.5], [-0.5, 1.5]])
    stiffness = csr_array(block_diag(*[k * pair for k in stiffnesses]))
    n = stiffness.shape[0]
    mass = csr_array(diags_array(np.arange(1.0, n + 1.0)))  # unequal: a load on both modes
    assert gradient_iterations(System(stiffness, mass, np.zeros(n, dtype=bool))) == 2


@pytest.mark.parametrize("n", [30, 200])
def test_conjugate_gradients_end_within_the_bound_of_the_condition_number(n):
    """Errors in energy fall by 2 ((√κ - 1)/(√κ + 1))^k; residuals lag by √κ at most."""
    whole = chain(n)
    root = np.sqrt(condition_numbers(whole)[1])
    assert gradient_iterations(whole) <= np.log(2.0 * root / 1e-8) / np.log((root + 1) / (root - 1))
    with pytest.raises(InputError, match="no density"):
        gradient_iterations(System(whole.stiffness, None, whole.fixed))


@pytest.mark.parametrize("family", ["plane_edges", "space_faces"])
def test_a_mesh_whose_cut_cells_are_split_takes_more_iterations_as_its_slivers_shrink(family):
    """Where cut cells stay whole it is that without slivers, less than half more."""

    def counts(name):
        scenes = [load_scene(f"slivers/{family}[epsilon={e}]") for e in ("0.1", "0.0001", "0.0")]
        return [gradient_iterations(find_solver(name).system(scene, 0)) for scene in scenes]

    far, near, none = counts("subdivision")
    assert near > 2 * far > 3 * none
    far, near, none = counts("xfem")
    assert max(far, near) <= 1.5 * none
    assert none == counts("subdivision")[2]  # one mesh, one mass


def test_what_cannot_be_known_is_said():
    free = System(chain(5).stiffness, chain(5).mass, np.zeros(6, dtype=bool))
    with pytest.raises(InputError, match="round-off"):
        condition_numbers(free)
    with pytest.raises(InputError, match="no density"):
        critical_step(System(free.stiffness, None, free.fixed))
    massless = csr_array(diags_array([1.0, 1.0, 0.0, 1.0, 1.0, 1.0]))
    with pytest.raises(InputError, match="an unknown without mass"):
        critical_step(System(free.stiffness, massless, free.fixed))
    with pytest.raises(InputError, match="held"):
        condition_numbers(System(free.stiffness, None, ~free.fixed))


@pytest.mark.parametrize("mass", ["sidewise", "consistent"])
def test_many_unknowns_have_the_step_of_all_eigenvalues(mass):
    """A general position: an inclined cut, with pieces of many sizes."""
    scene = load_scene("statics/f3_inclined").model_copy(deep=True)
    scene = scene.model_copy(
        update={"material": scene.material.model_copy(update={"density": 1e3})}
    )
    system = XfemSolver().system(scene, 2, mass=mass)
    free = ~system.fixed
    assert free.sum() > 600
    dense = [one[free][:, free].toarray() for one in (system.stiffness, system.mass)]
    scale = 1.0 / np.sqrt(np.diag(dense[1]))
    largest = eigh(*(scale[:, None] * one * scale for one in dense), eigvals_only=True)[-1]
    assert critical_step(system) == pytest.approx(2.0 / np.sqrt(largest), rel=1e-6)


EXAMPLES = Path(__file__).resolve().parents[3] / "docs" / "examples"
NEEDED = {"conforming": "dolfinx", "skfem_system:SkfemWithSystem": "skfem"}
SOLVERS = [
    pytest.param(
        name,
        marks=pytest.mark.skipif(
            name in NEEDED and find_spec(NEEDED[name]) is None, reason=f"needs {NEEDED.get(name)}"
        ),
    )
    for name in (
        "xfem", "conforming", "virtual_node", "subdivision", "snapping", "uncut",
        "skfem_system:SkfemWithSystem",
    )
]  # fmt: skip
CASE = "slivers/plane_edges[epsilon=0.5]"


@pytest.fixture(autouse=True)
def examples(monkeypatch):
    monkeypatch.setattr(sys, "path", [*sys.path, str(EXAMPLES)])


@pytest.fixture(scope="module")
def scene():
    return load_scene(CASE)


@pytest.mark.parametrize("name", SOLVERS)
def test_a_system_has_the_mass_of_the_body_and_without_a_cut_the_stiffness_of_all(name, scene):
    """One mesh, one element: the condition number, which no numbering changes, is the same."""
    system = checked_system(find_solver(name).system(scene, 0))
    shift = np.zeros(len(system.fixed))
    shift[::2] = 1.0
    assert shift @ system.mass @ shift == pytest.approx(1.0, rel=1e-12)  # ρ = 1 on a unit square
    assert np.abs(system.stiffness @ shift).max() < 1e-12 * system.stiffness.max()
    assert system.fixed.any()
    uncut = scene.model_copy(update={"cuts": []})
    found = condition_numbers(find_solver(name).system(uncut, 0))
    assert found == pytest.approx(condition_numbers(find_solver("xfem").system(uncut, 0)), rel=1e-9)


def test_consistent_masses_give_the_same_critical_step_without_a_cut(scene):
    uncut = scene.model_copy(update={"cuts": []})
    ours = critical_step(find_solver("xfem").system(uncut, 0, mass="consistent"))
    if find_spec("dolfinx"):
        assert critical_step(find_solver("conforming").system(uncut, 0)) == pytest.approx(ours)
    lumped = critical_step(find_solver("xfem").system(uncut, 0))
    assert lumped > 1.3 * ours  # lumping slows the highest mode down, in one dimension by √3


class Explicit:
    """Central differences with the scene's step, of which nothing but solutions is known."""

    name = "explicit"
    own_step = None

    def refuses(self, scene):
        return None if scene.analysis.kind == "dynamic" else "only motion"

    def levels(self, scene):
        return 1

    def solve(self, scene, level, repetitions=1):
        system = find_solver("xfem").system(scene, 0)
        free = ~system.fixed
        stiffness, mass = system.stiffness[free][:, free], system.mass.diagonal()[free]
        step = self.own_step or scene.analysis.time_step
        before = np.zeros(free.sum())
        now = step * 1e-3 * np.random.default_rng(3).normal(size=free.sum())
        for _ in range(round(scene.analysis.duration / step)):
            before, now = now, 2.0 * now - before - step**2 * (stiffness @ now) / mass
        points = np.array([[0.0, 0.0], [1.0, 1.0]])
        return SimpleNamespace(points=points, displacement=now)


def test_the_critical_step_is_found_by_running_where_there_is_no_system(scene):
    exact = critical_step(find_solver("xfem").system(scene, 0))
    low, high = step_by_running(Explicit(), scene, 0, 0.4 * exact, {})
    assert low < high < 1.02 * low
    assert low == pytest.approx(exact, rel=0.02)
    from_above = step_by_running(Explicit(), scene, 0, 7.0 * exact, {})
    assert from_above[0] == pytest.approx(exact, rel=0.02)


@pytest.mark.parametrize("fault", [MemoryError, OSError])
def test_a_fault_of_a_solver_is_no_instability(scene, fault):
    class Faulty(Explicit):
        def solve(self, scene, level, repetitions=1):
            raise fault("of its own")

    with pytest.raises(fault, match="of its own"):
        step_by_running(Faulty(), scene, 0, 0.1, {})


@pytest.mark.parametrize(
    ("near", "far", "verdicts"),
    [
        (1.04, 1.2, [Verdict.PASS, Verdict.PASS]),
        (1.06, 1.3, [Verdict.FAIL, Verdict.FAIL]),
        (0.94, 0.5, [Verdict.FAIL, Verdict.PASS]),
    ],
)
def test_errors_are_held_against_the_row_at_zero_and_the_conforming_mesh(near, far, verdicts):
    def row(solver, size, value):
        return Measurement("family", size, solver, "displacement_l2", "", value)

    measured = [row("own", 0.5, far), row("own", 1e-6, near), row("own", 0.0, 1.0)]
    measured += [row("conforming", 0.5, 1.0)]
    found = list(findings(measured, []))
    assert [f.verdict for f in found] == verdicts
    off = f"{100 * abs(near - 1.0):.2f} % {'above' if near > 1.0 else 'below'} the one at ε = 0."
    assert found[0].sentence.endswith(off)


@pytest.mark.parametrize(
    ("near", "middle", "far", "verdicts"),
    [
        (1.04, 1.5, 4.9, [Verdict.PASS, Verdict.PASS]),  # 1.25/0.9² = 1.54, 1.25/0.5² = 5
        (1.16, 1.6, 1.0, [Verdict.FAIL, Verdict.FAIL]),
        (1.04, 1.0, 5.1, [Verdict.PASS, Verdict.FAIL]),
    ],
)
def test_the_jump_is_held_against_a_mesh_whose_nodes_on_the_cut_are_closer(
    near, middle, far, verdicts
):
    def row(solver, size, value):
        return Measurement("family", size, solver, "jump_l2", "", value)

    own = {0.5: far, 0.1: middle, 1e-6: near, 0.0: 1.0}
    measured = [row("own", size, value) for size, value in own.items()]
    measured += [row("conforming", size, 1.0) for size in own]
    found = [f for f in findings(measured, []) if f.topic == "family, own"]
    assert [f.verdict for f in found] == verdicts
    assert "1.25/(1 - ε)²" in found[1].expected
