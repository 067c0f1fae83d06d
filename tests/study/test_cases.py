import numpy as np
import pytest

from reference.exact import exact_solution
from verify.compare.body import body_of
from verify.compare.hooke import hooke
from verify.scene import list_cases, load_scene
from verify.study.reference import exact_reference

CASES = [name for name in list_cases() if name.startswith("statics/")]
EXACT = [name for name in CASES if load_scene(name).exact is not None]


@pytest.mark.parametrize("name", CASES)
def test_a_case_states_a_requirement_and_how_it_is_judged(name):
    case = load_scene(name)
    assert " shall " in case.requirement
    assert case.acceptance


@pytest.mark.parametrize("name", EXACT)
def test_the_exact_energy_integrated_over_the_body_is_the_work_on_its_boundary(name):
    """Two ways that share nothing but the field: quadrature by slabs, and ½∮t·u."""
    case = load_scene(name)
    exact = exact_solution(case.exact.solution, case.exact.parameters, case.material)
    body = body_of(case, exact.singular_points)
    value, width = exact_reference(case, exact, body, hooke(case.material)).quantities[
        "strain_energy"
    ]
    work = exact.strain_energy(case)
    assert abs(value - work) <= width + 1e-12 * work
    assert width < 1e-8 * work


@pytest.mark.parametrize("name", EXACT)
def test_the_tips_of_the_cut_are_the_singular_points_of_the_exact_field(name):
    case = load_scene(name)
    exact = exact_solution(case.exact.solution, case.exact.parameters, case.material)
    if case.dimension == 3:
        assert not len(body_of(case).front)
        assert not len(exact.singular_points)
        return
    tips, points = body_of(case).tips, np.asarray(exact.singular_points).reshape(-1, 2)
    assert len(tips) == len(points)
    for tip in tips:
        assert np.linalg.norm(points - tip, axis=1).min() < 1e-14


def places(name):
    """Position of the tips inside their square of the background mesh, per level."""
    case = load_scene(name)
    lower, upper = (np.array(corner) for corner in (case.geometry.lower, case.geometry.upper))
    for cells in case.mesh.cells:
        where = (body_of(case).tips - lower) / (upper - lower) * cells
        yield where - np.floor(where)


@pytest.mark.parametrize("name", ["statics/griffith_edges", "statics/tissue_strip"])
def test_tips_lie_in_the_middle_of_a_vertical_edge(name):
    for place in places(name):
        assert np.allclose(place, [0.0, 0.5], atol=1e-12)


def test_tips_lie_inside_elements():
    for place in places("statics/griffith_inside"):
        x, y = place.T
        # off the sides of the square, and off its rising diagonal
        assert (np.minimum.reduce([x, 1 - x, y, 1 - y, np.abs(x - y)]) > 0.02).all()
