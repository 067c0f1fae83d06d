"""Elasticity and density of a scene's material in forms: constants, or functions by cell."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from verify.scene import Material


def lame(material: Material) -> tuple[float, float]:
    """Lamé constants (λ, μ) in Pa of one material; of a plane or thin body the reduced λ.

    That is so in plane stress and of membranes. Where materials differ by region, they are those
    outside the regions.
    """
    mu = material.young / (2 * (1 + material.poisson))
    lam = material.young * material.poisson / ((1 + material.poisson) * (1 - 2 * material.poisson))
    thin = material.plane == "stress" or material.thickness is not None
    return (2 * lam * mu / (lam + 2 * mu), mu) if thin else (lam, mu)


def lame_constants(material: Material, test: Any, factor: float = 1.0) -> tuple[Any, Any]:
    """Give λ and μ, times a factor, as UFL coefficients on the mesh of a test function.

    Constants, so that another material does not compile another form; where materials differ by
    region, functions that are constant in each cell, of the material at its centroid.

    Parameters
    ----------
    material : Material
    test : UFL expression
        Of arguments or functions of a space of DOLFINx.
    factor : float
    """
    rows = [tuple(factor * value for value in lame(one)) for one in material.each]
    return _by_cell(material, test, rows)


def density(material: Material, test: Any) -> Any:
    """Give the density in kg/m³, of a membrane in kg/m², as a UFL coefficient."""
    thickness = material.thickness or 1.0
    rows = [(thickness * float(one.density or 0.0),) for one in material.each]
    return _by_cell(material, test, rows)[0]


def wave_speed(material: Material) -> float:
    """Speed of pressure waves in the quickest of the materials, m/s."""
    speeds = []
    for one in material.each:
        assert one.density is not None  # the scene has checked it
        e, nu = one.young, one.poisson
        modulus = e * (1 - nu) / ((1 + nu) * (1 - 2 * nu))
        speeds.append(float(np.sqrt(modulus / one.density)))
    return max(speeds)


def _by_cell(material: Material, test: Any, rows: Sequence[tuple[float, ...]]) -> tuple[Any, ...]:
    """Coefficients of which each has one value per material (rows)."""
    from dolfinx import fem
    from ufl.algorithms import extract_arguments, extract_coefficients

    mesh = [*extract_arguments(test), *extract_coefficients(test)][0].ufl_function_space().mesh
    if material.is_uniform:
        return tuple(fem.Constant(mesh, np.asarray(value)) for value in rows[0])
    cellwise = fem.functionspace(mesh, ("DG", 0))
    # the one unknown of a cell lies at its centroid
    centroids = cellwise.tabulate_dof_coordinates()[:, : mesh.geometry.dim]
    number = material.number_at(centroids)
    found = []
    for values in np.array(rows, dtype=float).T:
        function = fem.Function(cellwise)
        function.x.array[:] = values[number]
        found.append(function)
    return tuple(found)
