"""Checks of a case that take more than the case file: its exact solution, mesh, solvers."""

from typing import Any

from verify.errors import InputError
from verify.runner.mesh_faults import check_overlaps
from verify.scene import MeshFile, Scene, read_mesh
from verify.scene.acceptance import FractureQuantity
from verify.scene.placement import empty_region, group_fault, part_without_mesh
from verify.scene.strict import nearest
from verify.solvers import solver_names
from verify.solvers.interface import parameters_in, solver_in

_CHECKED = 200_000  # most nodes of the coarsest mesh of a scene whose mechanics are checked: 1 s


def check_scene(scene: Scene) -> None:
    """Raise `InputError` if something that `scene` names is not there or is bad."""
    where = str(scene.file or scene.name)
    if isinstance(scene.geometry, MeshFile):
        try:
            mesh = read_mesh(scene)
            fault = group_fault(scene) or part_without_mesh(scene, *mesh)
            if fault := fault or empty_region(scene, mesh[0][mesh[1]].mean(1)):
                raise InputError(fault, where)
            check_overlaps(scene, *mesh)
        except InputError:
            raise
        except ValueError as error:
            raise InputError(str(error), where) from None
    exact = _exact_of(scene, where)
    if scene.played_only is None:
        _check_mechanics(scene, exact)
    for i, asked in enumerate(scene.quantities):
        if isinstance(asked, FractureQuantity):
            from verify.judge.stress_intensity import intensity_defect

            if reason := intensity_defect(scene, asked):
                raise InputError(f"quantities[{i}] ('{asked.name}'): {reason}", where)
    for i, check in enumerate(scene.acceptance):
        for name in (check.solver, check.compared):
            if name is not None:
                check_solver_name(name, f"{where}: acceptance[{i}]")


def _check_mechanics(scene: Scene, exact: Any) -> None:
    """Refuse what has no solution, or another one than the exact solution."""
    # they cut meshes: commands that check nothing shall not load what that takes
    from verify.runner.cost import mesh_of_level
    from verify.runner.exact_fit import check_exact_fits
    from verify.runner.mesh_checks import (
        check_cuts_can_be_meshed,
        check_formulas_are_finite,
        check_pieces_are_held,
        check_places_in_mesh,
        check_supports_do_not_jump,
    )
    from verify.solvers.body_of_scene import background_mesh

    if (mesh_of_level(scene, 0) or (0.0,))[0] > _CHECKED:
        return
    mesh = background_mesh(scene, 0)[0]
    if isinstance(scene.geometry, MeshFile):
        check_places_in_mesh(scene, mesh)
    check_cuts_can_be_meshed(scene)
    check_formulas_are_finite(scene, mesh)
    check_pieces_are_held(scene, exact)
    if exact is not None and scene.judged_by_exact:
        check_exact_fits(scene, exact, mesh)
    check_supports_do_not_jump(scene, mesh, exact)


def _exact_of(scene: Scene, where: str) -> Any:
    """Return the exact solution of a scene, or None if it names none."""
    if scene.exact is None:
        return None
    from reference.exact import exact_of

    try:
        return exact_of(scene)
    except InputError as error:
        raise InputError(f"exact: {error}", where) from None


def check_solver_name(name: str, where: str) -> None:
    """Raise `InputError` if there is no solver of that name (``module:Class`` is not looked up).

    It may be followed by parameters; only their form is checked.
    """
    known, solver = solver_names(), solver_in(name)
    if ":" not in solver and solver not in known:
        raise InputError(f"no solver '{solver}'{nearest(solver, known)}", where)
    parameters_in(name)
