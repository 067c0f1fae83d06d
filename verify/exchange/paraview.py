"""The solutions of a run as files for ParaView.

::

    DIR/<case>/<solver>-<level>.pvd          the output times, to be opened
    DIR/<case>/<solver>-<level>/00000.vtu    mesh and fields at each of them

Points are material, with the nodes doubled on the cut: the filter Warp By Vector moves them by
``displacement``. Symmetric tensors have six components in VTK's order: XX, YY, ZZ, XY, YZ, XZ.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from verify.compare.body import body_of
from verify.compare.errors import Truth, nodal_differences, truth_of
from verify.compare.hooke import strain_and_stress
from verify.compare.locate import SolutionField
from verify.errors import InputError
from verify.files import asked_place, read_json, whole_file, write_whole
from verify.report.run_directory import CaseEntry, load_run, read_stored
from verify.result import CutRecord, SolveRecord, Status
from verify.runner.directory import folder_name
from verify.scene import Scene, restore_scene
from verify.solution import Solution

Array = NDArray[np.float64]

REFERENCE = "reference"
_VOIGT = ((0, 1, 2, 0, 1, 0), (0, 1, 2, 1, 2, 2))  # rows and columns of VTK's six components


def export_fields(
    run: Path,
    out: Path,
    solvers: Sequence[str] = (),
    level: int | None = None,
    with_reference: bool = False,
) -> list[Path]:
    """Write the stored solutions of a run for ParaView.

    Point data are ``displacement`` (m) and, where a solution has it, ``velocity`` (m/s); cell data
    ``strain``, ``stress`` (Pa) and ``von_mises`` (Pa) as `verify.compare.hooke` has them at the
    centres, and ``side``, where the solver labels its parts.

    Parameters
    ----------
    run : Path
        Directory of a run.
    out : Path
        Directory to write into.
    solvers : sequence of str
        Whose solutions; default all, the reference with them.
    level : int, optional
        Mesh level; default the finest of each solver.
    with_reference : bool
        Whether point data ``reference`` and ``error`` (m) are added: displacement less error, and
        the error as `verify.compare.errors` takes it.

    Returns
    -------
    list of Path
        The ``.pvd`` files.

    Raises
    ------
    InputError
        If `run` is no run, nothing in it fits, a stored solution cannot be read, or a case has
        no stored reference that was asked for.
    """
    written: list[Path] = []
    for entry in load_run(run).entries:
        if not (chosen := _chosen(entry, solvers, level)):
            continue
        scene = restore_scene(read_json(entry.folder / "scene.json"))
        stored = [(solve, read_stored(run, solve.solution or "")) for solve in chosen]
        judged = [solution for _, solution in stored]
        truth = _truth(run, entry, scene, judged) if with_reference else None
        for solve, solution in stored:
            name = f"{folder_name(solve.solver)}-{solve.level}"
            own = None if solve.solver == REFERENCE else truth
            with asked_place(out):
                place = out / entry.folder.name / name
                written.append(_write_series(scene, solution, own, place, solve.cut))
    if not written:
        asked = f"{', '.join(solvers) or 'any solver'}, level {'any' if level is None else level}"
        raise InputError(f"holds no stored solution of {asked}", str(run))
    return written


def _chosen(entry: CaseEntry, solvers: Sequence[str], level: int | None) -> list[SolveRecord]:
    """Return the solves that are asked for; of each solver its finest, unless a level is."""
    solves = [
        s
        for s in (entry.result.solves if entry.result else entry.unjudged)
        if s.status is Status.SOLVED and s.solution and (not solvers or s.solver in solvers)
    ]
    finest = {s.solver: s.level for s in sorted(solves, key=lambda s: s.level)}
    return [s for s in solves if s.level == (finest[s.solver] if level is None else level)]


def _truth(run: Path, entry: CaseEntry, scene: Scene, judged: Sequence[Solution]) -> Truth:
    exact, references = None, {}
    if scene.judged_by_exact and scene.exact is not None:
        from reference.exact import exact_solution

        exact = exact_solution(scene.exact.solution, scene.exact.parameters, scene.material)
    else:
        finest = _chosen(entry, [REFERENCE], None)
        references = {s.level: read_stored(run, s.solution or "") for s in finest}
    if (truth := truth_of(scene, references, judged, exact)) is None:
        raise InputError("holds no stored solution of the reference", str(entry.folder))
    return truth


def _write_series(
    scene: Scene, solution: Solution, truth: Truth | None, place: Path, cut: CutRecord | None
) -> Path:
    """Write the mesh and fields of each output time, and the collection that names the times."""
    place.mkdir(parents=True, exist_ok=True)
    steps = range(len(solution.times))
    error = None
    if truth is not None:
        error = nodal_differences(solution, truth, body_of(scene), steps, cut)
    collection = ElementTree.Element("VTKFile", type="Collection", version="0.1")
    entries = ElementTree.SubElement(collection, "Collection")
    field = SolutionField(solution)
    for step, time in enumerate(solution.times):
        file = place / f"{step:05d}.vtu"
        nodal = {"displacement": solution.displacement[step]}
        if solution.velocity is not None:
            nodal["velocity"] = solution.velocity[step]
        if error is not None:
            nodal["reference"] = solution.displacement[step] - error[step]
            nodal["error"] = error[step]
        cells = _cell_data(scene, field.with_nodal(solution.displacement[step]))
        _write_mesh(solution, nodal, cells, file)
        name = f"{place.name}/{file.name}"
        ElementTree.SubElement(entries, "DataSet", timestep=repr(float(time)), part="0", file=name)
    ElementTree.indent(collection)
    series = place.with_name(f"{place.name}.pvd")
    write_whole(series, ElementTree.tostring(collection, "unicode", xml_declaration=True))
    return series


def _cell_data(scene: Scene, field: SolutionField) -> dict[str, NDArray[Any]]:
    strain, stress = strain_and_stress(field, scene)
    deviator = stress - np.einsum("nii->n", stress)[:, None, None] / 3.0 * np.eye(3)
    data = {
        "strain": strain[:, *_VOIGT],
        "stress": stress[:, *_VOIGT],
        "von_mises": np.sqrt(1.5 * np.einsum("nij,nij->n", deviator, deviator)),
    }
    sides = field.solution.cell_sides
    return data if sides is None else {**data, "side": sides.astype(np.int32)}


def _write_mesh(
    solution: Solution, nodal: dict[str, Array], cells: dict[str, NDArray[Any]], file: Path
) -> None:
    import meshio

    across = ((0, 0), (0, 3 - solution.dimension))  # VTK's vectors have three components
    mesh = meshio.Mesh(
        np.pad(solution.points, across),
        [(solution.cell_type, solution.cells)],
        point_data={name: np.pad(values, across) for name, values in nodal.items()},
        cell_data={name: [values] for name, values in cells.items()},
    )
    with whole_file(file) as partial:
        mesh.write(partial, file_format="vtu")
