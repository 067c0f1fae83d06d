"""Size and mass of a body; cost of a case, from its mesh sizes before anything is solved; rough.

Unknowns follow from the numbers of nodes; a reference, whose mesh is graded, has a range. Seconds
and bytes per unknown were measured on one core of the machine of the published results, over the
quick cases. Nothing is meshed. Once a level of a reference is solved, the finer ones are forecast
from its unknowns and seconds; docs/theory/reference.md states the accuracy.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt
from typing import NamedTuple

import numpy as np

from reference.deformation import wave_speed
from verify.printable import duration_text, memory_text
from verify.result import REFERENCE, SolveRecord
from verify.scene import Box, MeshFile, Polygon, Rectangle, Scene, read_mesh
from verify.scene.placement import points_of_body
from verify.solvers.interface import is_built_in, solver_in

_FENICSX = ("conforming", REFERENCE)
_BESIDE = {True: 0.8, False: 0.25}  # s of a process that is no solve, with FEniCSx and without
_MEMORY = {True: 2.3e8, False: 1.6e8}  # bytes of a process before it solves
_SECONDS = {True: 1.5e-5, False: 5e-6}  # per unknown of a static, linear solve in the plane
_BYTES = 2.5e3  # per unknown in the plane
_IN_SPACE = 2.5  # times as much per unknown: fill-in of the factors
_ITERATIONS = {"linear": 1.0, "corotational": 8.0}
_STEP = 0.2  # of a static solve
_LEAST = {True: 1e-3, False: 3e-4}  # s of a step, however few the unknowns
_FINENESS = {2: 12, 3: 4}  # elements over a body's extent on the first level of its reference
_GRADED = {2: 3.0, 3: 1.5}  # times as many elements, where a reference is graded
# of 81 levels of references of published runs, 72 had between 0.6 and 5 times as many unknowns;
# more where cuts are near each other, fewer (0.44) where a mesh is fine everywhere
_RANGE = (0.4, 5.0)
_TYPICAL = 1.6  # times as many: the middle of that range
_DOUBT = 0.5  # s that a level may take more or less than by its unknowns, whatever it is
_FACTOR = 3.0  # within which forecasts are expected
_COARSEST = 8  # times the size of elements that a case asks for
_PER_AREA, _PER_VOLUME = 2 / sqrt(3), sqrt(2)  # nodes per h^d of equilateral triangles, tetrahedra


def body_text(scene: Scene) -> str:
    """Say extent, volume and mass of a body, of a mesh file its nodes and cells too.

    Empty for a body that is meshed elsewhere (a skin).

    Raises
    ------
    InputError, ValueError
        If the mesh file is bad.
    """
    body, d = scene.geometry, scene.dimension
    mesh = ""
    if isinstance(body, MeshFile):
        # commands that only read cases shall not load numba, nor scipy below
        from verify.xfem.mesh import SimplexMesh

        grid = SimplexMesh(*read_mesh(scene))
        sides, places, volumes = np.ptp(grid.points, axis=0), grid.points[grid.cells], grid.measures
        places = places.mean(axis=1)
        mesh = f", {len(grid.points)} nodes, {len(grid.cells)} cells"
    elif isinstance(body, Rectangle | Box | Polygon):
        sides, places = np.ptp(body.extremes(), axis=0), points_of_body(scene)
        volumes = np.full(len(places), body.measure() / len(places))
    else:
        return ""
    extent = " × ".join(f"{side:.3g}" for side in sides)
    power = "²" if scene.cell_dimension == 2 else "³"
    mass = ""
    if scene.material.density is not None:
        weights = volumes * scene.material.at(places).density * (scene.material.thickness or 1.0)
        mass = f", {weights.sum():.3g} kg{' per m of thickness' if d == 2 else ''}"
    return f"{extent} m{mesh}, {volumes.sum():.3g} m{power}{mass}"


class _Rates(NamedTuple):
    """Seconds of a reference: setup U^power + steps (step + each U), of U unknowns."""

    setup: float
    power: float
    step: float = 0.0
    each: float = 0.0


_LINEAR = {2: _Rates(1.8e-5, 1.0), 3: _Rates(1.0e-5, 1.2)}
_ROTATION = {2: _Rates(6e-5, 1.0), 3: _Rates(2e-4, 1.1)}
_ROTATION_OF_SKIN = _Rates(7.5e-4, 1.0)
_LINEAR_MOTION = {2: _Rates(1.8e-5, 1.0, 4e-4, 2.0e-6), 3: _Rates(1.0e-5, 1.2, 4e-4, 5.0e-6)}
_MOTION = {2: _Rates(2e-5, 1.0, 1.2e-3, 6e-6), 3: _Rates(2e-5, 1.2, 1.5e-3, 4e-5)}


@dataclass(frozen=True)
class LevelCost:
    """What a solve is expected to take.

    Attributes
    ----------
    solver : str
    level : int
    unknowns, at_most : int
        Least and largest number that is expected; equal but for references.
    seconds : float
        On one core, with all repetitions.
    memory : float
        Bytes.
    """

    solver: str
    level: int
    unknowns: int
    at_most: int
    seconds: float
    memory: float


def solver_costs(scene: Scene, solver: str, repetitions: int = 3) -> list[LevelCost]:
    """Estimate the solves of a solver on the levels that `scene` names, coarse to fine.

    Empty for a body whose mesh is made elsewhere (a skin). A solver of others counts as one of
    FEniCSx does.
    """
    if solver == REFERENCE:
        return _reference_costs(scene)
    rows = []
    for level in range(scene.mesh.count):
        if (found := mesh_of_level(scene, level)) is None:
            return []
        nodes, size = found
        unknowns = round(nodes * scene.dimension)
        heavy = solver_in(solver) in _FENICSX or not is_built_in(solver)
        work = unknowns * _SECONDS[heavy] * (_IN_SPACE if scene.cell_dimension == 3 else 1.0)
        if scene.analysis.kind == "dynamic":
            work = max(_STEP * work, _LEAST[heavy]) * _steps(scene, size)
        else:
            work *= _ITERATIONS[scene.analysis.kinematics]
        seconds = _BESIDE[heavy] + (1 + repetitions) * work
        memory = _memory(scene, unknowns, heavy)
        rows.append(LevelCost(solver, level, unknowns, unknowns, seconds, memory))
    return rows


def _reference_costs(scene: Scene) -> list[LevelCost]:
    """Estimate all levels of a reference before any is solved."""
    rows = []
    for level in range(scene.reference.levels):
        if (found := _reference_mesh(scene, level)) is None:
            return []
        unknowns = found[0] * scene.dimension
        least, most = (round(share * unknowns) for share in _RANGE)
        seconds = _BESIDE[True] + _work(scene, level, _TYPICAL * unknowns)
        memory = _memory(scene, round(unknowns))
        rows.append(LevelCost(REFERENCE, level, least, most, seconds, memory))
    return rows


def finer_costs(scene: Scene, solved: SolveRecord, levels: int) -> list[LevelCost]:
    """Forecast the finer ones of some levels of a reference from one that is solved.

    Empty for a body whose mesh is made elsewhere (a skin).
    """
    known = _reference_mesh(scene, solved.level)
    if known is None or not solved.unknowns or solved.wall is None:
        return []
    expected = _work(scene, solved.level, solved.unknowns)
    slower = (max(solved.wall - _BESIDE[True], 0.0) + _DOUBT) / (expected + _DOUBT)
    rows = []
    for level in range(solved.level + 1, levels):
        mesh = _reference_mesh(scene, level)
        assert mesh is not None
        unknowns = round(solved.unknowns * mesh[0] / known[0])
        seconds = _BESIDE[True] + slower * _work(scene, level, unknowns)
        memory = _memory(scene, unknowns)
        rows.append(LevelCost(REFERENCE, level, unknowns, unknowns, seconds, memory))
    return rows


def forecast_text(scene: Scene, finer: Sequence[LevelCost], timeout: float, memory: float) -> str:
    """Say what finer levels of a reference will take, and what to change where that is too much.

    Parameters
    ----------
    scene : Scene
    finer : sequence of LevelCost
        Of `finer_costs`.
    timeout, memory : float
        Limits of a solve, s and bytes.
    """
    said = [f"level {row.level} in about {duration_text(row.seconds)}" for row in finer]
    if not (beyond := [row for row in finer if row.seconds > timeout or row.memory > memory]):
        return ", ".join(said)
    first = beyond[0]
    limit = f"{duration_text(timeout)} (--timeout)"
    if first.memory > memory:
        limit = f"{memory_text(memory)} (--memory), with about {memory_text(first.memory)}"
    sure = "will" if first.seconds > _FACTOR * timeout else "may"
    change = "a mesh of fewer cells"
    if (mesh := _reference_mesh(scene, 0)) is not None and not isinstance(scene.geometry, MeshFile):
        change = f"'size = {2 ** len(beyond) * mesh[1]:.3g}' in [reference] of the case"
    return (
        f"{', '.join(said)}; level {first.level} {sure} not end within {limit}; "
        f"expected {change}, a larger limit, or --within"
    )


def coarser_reference(scene: Scene, seconds: float) -> tuple[Scene, int]:
    """Ask for elements of a reference so large that its levels are expected within some seconds.

    At most eight times as large as the case asks; elements of a given mesh stay.

    Returns
    -------
    scene : Scene
    times : int
        How much larger they are: 1, 2, 4, 8.
    """
    mesh = _reference_mesh(scene, 0)
    if scene.judged_by_exact or mesh is None or isinstance(scene.geometry, MeshFile):
        return scene, 1
    times, found = 1, scene
    while times < _COARSEST and sum(row.seconds for row in _reference_costs(found)) > seconds:
        times *= 2
        larger = scene.reference.model_copy(update={"size": times * mesh[1]})
        found = scene.model_copy(update={"reference": larger})
    return found, times


def _work(scene: Scene, level: int, unknowns: float) -> float:
    """Seconds of a level of a reference with so many unknowns, without its process."""
    d, linear = scene.cell_dimension, scene.analysis.kinematics == "linear"
    if scene.analysis.kind == "dynamic":
        rates, mesh = (_LINEAR_MOTION if linear else _MOTION)[d], _reference_mesh(scene, level)
        assert mesh is not None
        steps = _steps(scene, mesh[1], level, True)
    else:
        rates, steps = (_LINEAR if linear else _ROTATION)[d], 1.0
        if not linear and d < scene.dimension:
            rates = _ROTATION_OF_SKIN
    return rates.setup * unknowns**rates.power + steps * (rates.step + rates.each * unknowns)


def _memory(scene: Scene, unknowns: int, heavy: bool = True) -> float:
    """Bytes of a process that solves for so many unknowns."""
    return _MEMORY[heavy] + unknowns * _BYTES * (_IN_SPACE if scene.dimension == 3 else 1.0)


def case_cost(scene: Scene, solvers: Sequence[str], repetitions: int = 3) -> list[LevelCost]:
    """Estimate all solves of a case; see `solver_costs`."""
    return [row for name in solvers for row in solver_costs(scene, name, repetitions)]


def mesh_of_level(scene: Scene, level: int) -> tuple[float, float] | None:
    """Return nodes and element size of a level of the scene's own mesh."""
    body = scene.geometry
    if isinstance(body, MeshFile):
        points, cells = read_mesh(scene)
        size = float(np.ptp(points, axis=0).max()) / len(cells) ** (1 / scene.cell_dimension)
        return len(points) * 2.0 ** (scene.cell_dimension * level), size / 2**level
    if not isinstance(body, Rectangle | Box | Polygon):
        return None
    if not isinstance(body, Polygon):
        counts = scene.mesh.divisions(body, level)
        sides = np.subtract(body.upper, body.lower)
        return float(np.prod(counts + 1.0)), float(max(sides / counts))
    assert scene.mesh.sizes is not None
    size = scene.mesh.sizes[level]
    return _nodes(body, size), size


def _reference_mesh(scene: Scene, level: int) -> tuple[float, float] | None:
    """Return nodes and element size, far from singularities, of a level of the reference."""
    body, degree = scene.geometry, scene.reference.degree
    if isinstance(body, MeshFile):
        coarse = mesh_of_level(scene, 0)
        assert coarse is not None
        level += scene.first_refinement
        nodes, size = coarse[0] * 2.0 ** (scene.cell_dimension * level), coarse[1] / 2**level
    elif isinstance(body, Rectangle | Box | Polygon):
        extent = body.measure() ** (1 / scene.dimension)
        size = scene.reference.size or extent / _FINENESS[scene.dimension]
        size /= 2**level
        nodes = _GRADED[scene.dimension] * _nodes(body, size)
    else:
        return None
    return nodes * degree**scene.cell_dimension, size


def _nodes(body: Rectangle | Box | Polygon, size: float) -> float:
    """Nodes of an unstructured mesh: of equilateral cells, and half of those on its boundary."""
    d, volume = body.dimension, body.measure()
    inside = (_PER_AREA if d == 2 else _PER_VOLUME) * volume / size**d
    return float(inside + d * volume ** ((d - 1) / d) / size ** (d - 1))


def _steps(scene: Scene, size: float, halved: int = 0, reference: bool = False) -> float:
    """Time steps of a motion: those that are asked, or of a pressure wave across an element."""
    analysis = scene.analysis
    asked = scene.reference.time_step if reference else None
    largest = asked or analysis.time_step or size * 2**halved / wave_speed(scene.material)
    return analysis.steps(largest) * 2.0**halved
