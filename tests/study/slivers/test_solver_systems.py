"""The systems that solvers hand over are those of the body, and independent ones agree."""

import sys
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from verify.assess.system_numbers import condition_numbers, critical_step
from verify.scene import load_scene
from verify.solvers import find_solver
from verify.study.slivers.step_by_running import step_by_running
from verify.system import checked_system

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
def test_a_system_has_the_mass_of_the_body_and_no_stiffness_against_translation(name, scene):
    system = checked_system(find_solver(name).system(scene, 0))
    shift = np.zeros(len(system.fixed))
    shift[::2] = 1.0
    assert shift @ system.mass @ shift == pytest.approx(1.0, rel=1e-12)  # ρ = 1 on a unit square
    assert np.abs(system.stiffness @ shift).max() < 1e-12 * system.stiffness.max()
    assert system.fixed.any()


@pytest.mark.parametrize("name", SOLVERS)
def test_all_solvers_have_the_same_stiffness_without_a_cut(name, scene):
    """One mesh, one element: the condition number, which no numbering changes, is that of xfem."""
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


@pytest.mark.parametrize("basis", ["shifted", "heaviside"])
def test_another_basis_is_another_condition_and_the_same_step(basis, scene):
    """ω of K x = ω² M x is that of the space, whatever spans it."""
    solver = find_solver("xfem")
    given = {"mass": "consistent", "slivers": "keep"}
    own = solver.system(scene, 0, **given)
    other = checked_system(solver.system(scene, 0, basis=basis, **given))
    assert critical_step(other) == pytest.approx(critical_step(own), rel=1e-9)
    assert condition_numbers(other)[0] != pytest.approx(condition_numbers(own)[0], rel=0.05)


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
