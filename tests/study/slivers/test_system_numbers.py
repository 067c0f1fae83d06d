"""Condition numbers and critical steps of systems whose numbers are known in closed form."""

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.sparse import csr_array, diags_array

from verify.assess.system_numbers import condition_numbers, critical_step, lowest_frequency
from verify.errors import InputError
from verify.scene import load_scene
from verify.solvers.xfem import XfemSolver
from verify.system import System


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


def test_what_cannot_be_known_is_said():
    free = System(chain(5).stiffness, chain(5).mass, np.zeros(6, dtype=bool))
    with pytest.raises(InputError, match="round-off"):
        condition_numbers(free)
    with pytest.raises(InputError, match="no density"):
        critical_step(System(free.stiffness, None, free.fixed))
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
