"""Versions of DOLFINx are told by their number; what is too old is refused."""

import sys
from types import ModuleType

import numpy as np
import pytest
from reference_scenes import needs_fenicsx

from reference.dolfinx_versions import create_simplex_mesh, import_dolfinx, take_whole_steps
from verify.errors import InputError


@pytest.fixture
def dolfinx_of(monkeypatch):
    """Put a DOLFINx of some version, with nothing in it, in place of the installed one."""

    def put(version):
        module = ModuleType("dolfinx")
        module.__version__ = version
        monkeypatch.setitem(sys.modules, "dolfinx_solver", ModuleType("dolfinx_solver"))
        monkeypatch.setitem(sys.modules, "dolfinx", module)
        return module

    return put


@pytest.mark.parametrize("version", ["0.5.2", "0.8.0.post1"])
def test_a_dolfinx_that_is_too_old_is_refused_with_its_number(dolfinx_of, version):
    dolfinx_of(version)
    with pytest.raises(InputError, match=f"DOLFINx {version} is too old.* 0.9 or newer"):
        import_dolfinx()


@pytest.mark.parametrize("version", ["0.9.0", "0.10.0.post5", "0.11.0.post0", "0.12.0.dev0", "1.0"])
def test_versions_are_compared_as_numbers(dolfinx_of, version):
    module = dolfinx_of(version)
    assert import_dolfinx() is module


@needs_fenicsx[0]
@needs_fenicsx[1]
@pytest.mark.parametrize("version, points_at", [("0.9.0", 2), ("0.10.0.post5", 3), ("0.11.0", 3)])
def test_points_of_a_mesh_stand_where_the_version_wants_them(monkeypatch, version, points_at):
    dolfinx = import_dolfinx()
    from dolfinx import mesh

    taken = []
    monkeypatch.setattr(dolfinx, "__version__", version)
    monkeypatch.setattr(mesh, "create_mesh", lambda *arguments: taken.extend(arguments))
    points = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    create_simplex_mesh(points, np.array([[0, 1, 2]]))
    assert taken[points_at] is points


@needs_fenicsx[0]
@needs_fenicsx[1]
def test_without_a_line_search_newton_takes_whole_steps_and_no_other_solver_does():
    import_dolfinx()
    from petsc4py import PETSc

    def first_step_of(whole):
        """Solve atan x = 0 from 2, where Newton's whole step leads further away: to −3.54."""
        matrix = PETSc.Mat().createDense(1, comm=PETSc.COMM_SELF)
        matrix.setUp()
        solver = PETSc.SNES().create(PETSc.COMM_SELF)
        solver.setType("newtonls")
        if whole:
            take_whole_steps(solver)

        def residual(_, x, out):
            out.setValue(0, np.arctan(x.getValue(0)))
            out.assemble()

        def tangent(_, x, out, __):
            out.setValue(0, 0, 1 / (1 + x.getValue(0) ** 2))
            out.assemble()

        x = matrix.createVecRight()
        x.set(2.0)
        solver.setFunction(residual, x.duplicate())
        solver.setJacobian(tangent, matrix)
        solver.setTolerances(max_it=1)
        solver.solve(None, x)
        return x.getValue(0)

    assert first_step_of(whole=True) == pytest.approx(2 - 5 * np.arctan(2))
    assert abs(first_step_of(whole=False)) < 2
