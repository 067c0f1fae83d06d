"""Locking: what an element loses as Poisson's ratio goes to 1/2, and pressures gain."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from large_bodies import lame, on_ends, solve, space_of
from reference_scenes import TENSION, energy_of, needs_fenicsx, plate, polyline, square
from solid_scenes import cube, polygon

from reference.elasticity import solve_linear
from reference.exact import exact_solution
from reference.exact.solution import hooke
from reference.fracture import stress_intensity, tips
from reference.fracture.cells import NodalPressure, cell_gradients
from reference.space import conforming_space
from verify.solvers import find_solver
from verify.solvers.conforming_meshes import peer_mesh

pytestmark = needs_fenicsx

CUT = [polyline("a", (-0.1, 0.5), (0.5, 0.5))]
CLAMPED = [{"where": "bottom", "displacement": [0, 0]}]


def plane(poisson, **changes):
    return square(
        CUT,
        material={"young": 1.0, "poisson": poisson, "density": 1.0, "plane": "strain"},
        supports=CLAMPED,
        mesh={"cells": [[12, 12]]},
        **changes,
    )


@cache
def reference(poisson, level):
    return find_solver("reference").solve(plane(poisson), level, repetitions=0)


def losses(poisson):
    """Shares of the energy that linear and quadratic elements miss: tip, clamps and locking."""
    limit = reference(poisson, 1).ledger["strain"][0]
    return [1 - energy_of(plane(poisson), "conforming", degree=p) / limit for p in (1, 2)]


def test_linear_elements_lock_and_quadratic_ones_do_not():
    stiff, soft = losses(0.49), losses(0.3)
    assert stiff[0] > 2 * soft[0] > 0  # 44 % of the energy missing, 19 % at 0.3
    assert 0 < stiff[1] < 1.5 * soft[1]  # 7.1 % and 5.3 %: tip and clamps


HALVES = polygon("a", (-1, -1, 0.5), (2, -1, 0.5), (2, 2, 0.5), (-1, 2, 0.5))
EXACT = {
    "supports": [{"where": "boundary", "displacement": "exact"}],
    "loads": [{"kind": "body_force", "force": "exact"}],
}
# waves on either side of a cut whose pressure stays bounded: nothing bends the cut
WAVES = {
    "solution": "smooth",
    "parameters": {
        "point": [0.0, 0.5],
        "slope": 0.0,
        "above": [[1.0, 3.0, 20.0], [0.0, 1.0, 0.0]],
        "below": [[0.5, 2.0, 70.0], [0.0, 1.0, 0.0]],
    },
}
SOLID_WAVES = {
    "solution": "solid_smooth",
    "parameters": {
        "point": [0.0, 0.0, 0.5],
        "normal": [0.0, 0.0, 1.0],
        "axis": [1.0, 0.0, 0.0],
        "above": [[0.1, 2.0, 1.0, 20.0], [0.1, 1.0, -2.0, 50.0], [0.0, 1.0, 1.0, 0.0]],
        "below": [[0.05, 2.0, 1.0, 70.0], [0.1, -1.0, 2.0, 10.0], [0.0, 1.0, 1.0, 0.0]],
    },
}


def waving(poisson, n, d):
    """Give sinusoids on both sides of a cut; in the plane or in space."""
    material = {"young": 1.0, "poisson": poisson, "density": 1.0}
    if d == 3:
        return cube(
            [HALVES], material=material, mesh={"cells": [[n] * 3]}, exact=SOLID_WAVES, **EXACT
        )
    through = [polyline("a", (-0.1, 0.5), (1.1, 0.5))]
    material["plane"] = "strain"
    return square(through, material=material, mesh={"cells": [[n, n]]}, exact=WAVES, **EXACT)


@cache
def errors(poisson, n, d, **parameters):
    """Largest nodal errors over the largest displacement without and with a pressure."""
    scene = waving(poisson, n, d)
    exact = exact_solution(scene.exact.solution, scene.exact.parameters, scene.material)
    space = conforming_space(peer_mesh(scene, 0, "imprinted"), 2)
    near = np.empty_like(space.node_points)
    near[space.cell_nodes] = space.centroids[:, None]
    wanted = exact.displacement(space.node_points, near)
    found = (
        solve_linear(scene, space, exact),
        solve_linear(scene, space, exact, pressure=True, **parameters),
    )
    return [np.abs(f.displacement - wanted).max() / np.abs(wanted).max() for f in found]


@pytest.mark.parametrize("d, n", [(2, 8), (3, 2)])
def test_a_pressure_keeps_the_error_that_the_element_has_at_a_third_up_to_a_half(d, n):
    pure, mixed = zip(*(errors(nu, n, d) for nu in (0.3, 0.4999)), strict=True)
    assert mixed[1] < 2 * mixed[0]
    assert pure[1] > max(1.5 * pure[0], 4 * mixed[1])


def test_the_error_with_a_pressure_falls_with_the_order_of_the_element_at_4999():
    (pure, mixed), (finer, mixed_finer) = (errors(0.4999, n, 2) for n in (8, 16))
    assert np.log2(mixed / mixed_finer) > 2.7  # 3 for quadratic elements
    assert np.log2(pure / finer) < 2.5


def test_minres_gives_the_answer_of_a_factorisation():
    direct, iterated = (errors(0.4999, 2, 3, method=m)[1] for m in ("direct", "multigrid"))
    assert iterated == pytest.approx(direct, rel=1e-6)  # residual 1e-10, errors of some 1e-3


def test_the_reference_takes_a_pressure_by_itself_and_converges_from_the_first_level():
    one, two = (reference(0.49, level) for level in (0, 1))
    assert one.notes["unknowns"] == "displacement and pressure"
    assert reference(0.3, 1).notes["unknowns"] == "displacement"
    # the potential energy is a saddle value: no bound, but close
    assert one.ledger["strain"][0] == pytest.approx(two.ledger["strain"][0], rel=5e-4)


def test_the_pressure_that_a_solution_leaves_out_is_found_again_from_its_displacement():
    """By it the solution has the energy that the solver found with its own pressure."""
    scene = plane(0.4999)
    found = find_solver("reference").solve(scene, 0, repetitions=0)
    law, cells = hooke(scene.material), np.arange(len(found.cells))
    at = cell_gradients(found, cells)
    stress = NodalPressure(found, law).stress(law, cells, at)
    pressure = 0.5 * np.trace(stress, axis1=2, axis2=3)  # 2με + pI, and div u counted in με
    strain = 0.5 * (at.gradient + at.gradient.swapaxes(2, 3))
    pressure -= law.shear * np.trace(strain, axis1=2, axis2=3)
    density = law.shear * np.sum(strain**2, axis=(2, 3)) + pressure**2 / (2 * law.lame)
    energy = np.sum(density * at.weights)
    assert energy == pytest.approx(found.ledger["strain"][0], rel=1e-9)


def test_stress_intensities_are_as_exact_at_4999_as_at_a_third():
    """Tractions alone: K is the same for every ν."""
    cut = polyline("a", (0, 1), (0.5, 1))
    scene = plate(1, 2, [cut], TENSION, poisson=0.4999)
    found = find_solver("reference").solve(scene, 1, repetitions=0)
    assert found.notes["unknowns"] == "displacement and pressure"
    (tip,) = tips(scene)
    of = [found, replace(found, notes={})]  # the second time with Hooke's stress of u alone
    one, blind = (
        stress_intensity(f, scene.material, tip.point, tip.direction, tip.radii()).mode_1
        / (2.825465 * np.sqrt(np.pi * 0.5))
        - 1
        for f in of
    )
    assert abs(one) < 2e-5  # 11e-6, and 9e-6 at 0.3
    assert abs(blind) > 20 * abs(one)


def sector(height, curvature):
    """Give the radii of incompressible neo-Hookean material bent free of traction (Rivlin)."""
    # r2² − r1² = 2 h / κ keeps the area, r1 r2 = 1 / κ² leaves both faces free
    inner = -height / curvature + np.hypot(height / curvature, 1 / curvature**2)
    return np.sqrt(inner), np.sqrt(inner + 2 * height / curvature)


def bent_energy(height, curvature, mu, lam):
    """Energy per length of the strip, with the first term in μ/λ of what little it gives."""
    inner, _ = sector(height, curvature)
    x, weights = np.polynomial.legendre.leggauss(40)
    X = 0.5 * height * (1 + x)
    square = (inner**2 + 2 * X / curvature) * curvature**2  # of the stretch around
    W = 0.5 * mu * (square + 1 / square - 2)
    start = 0.5 * mu * ((inner * curvature) ** 2 + (inner * curvature) ** -2 - 2)
    pressure = mu + (W - start) - mu / square
    return 0.5 * height * weights @ (W - pressure**2 / (2 * lam))


HEIGHT, CURVATURE = 0.4, 2.0


def test_a_thick_strip_of_neo_hookean_material_bends_to_rivlins_sector():
    """Its energy, without and with a pressure."""
    poisson, space = 0.4999, space_of(2, (3, 8), [0.0, 0.0], [HEIGHT, 1.0])
    X, Y = space.node_points.T

    def field(factor):
        if factor == 0.0:
            return np.zeros_like(space.node_points)
        k = factor * CURVATURE
        r = np.sqrt(sector(HEIGHT, k)[0] ** 2 + 2 * X / k)
        return np.column_stack([r * np.cos(k * Y), r * np.sin(k * Y)]) - space.node_points

    lam, mu = lame(poisson)
    wanted = bent_energy(HEIGHT, CURVATURE, mu, lam)
    pure, mixed = (
        solve(space, on_ends(space), field, poisson, energy="neo_hookean", pressure=pressure)
        for pressure in (False, True)
    )
    # the next term of the energy is of the order of (μ/λ)², and the mesh is coarse
    off = abs(mixed.strain_energy / wanted - 1)
    assert off < 5e-4
    assert abs(pure.strain_energy / wanted - 1) > 10 * off


def test_the_reference_takes_a_pressure_at_finite_rotation_in_the_plane():
    """Small loads: its energy is that of linear kinematics with a pressure."""

    loads = [{"kind": "traction", "where": "top", "traction": [0, 1e-5]}]
    linear, finite = (
        find_solver("reference").solve(
            plane(0.4999, loads=loads, analysis={"kinematics": kinematics}), 0, repetitions=0
        )
        for kinematics in ("linear", "corotational")
    )
    assert finite.notes["unknowns"] == "displacement and pressure"
    assert finite.ledger["strain"][0] == pytest.approx(linear.ledger["strain"][0], rel=1e-3)
