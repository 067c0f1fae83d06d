"""Size and mass of a body; cost of a case, from its mesh sizes before anything is solved; rough.

Unknowns follow from the numbers of nodes; those of a reference, whose mesh is graded, lie in a
range. Seconds and bytes per unknown were measured on one core of the machine of the published
results, over the quick cases: half of the solves took between a third and three times of what is
said here. Nothing is meshed.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, prod, sqrt

import numpy as np

from reference.deformation import wave_speed
from verify.scene import Box, MeshFile, Polygon, Rectangle, Scene, read_mesh
from verify.scene.placement import points_of_body
from verify.solvers.interface import is_built_in, solver_in

REFERENCE = "reference"
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
# more where cuts are near each other, fewer (0.55) where a mesh is fine everywhere
_RANGE = (0.5, 5.0)
_PER_AREA, _PER_VOLUME = 2 / sqrt(3), sqrt(2)  # nodes per h^d of equilateral triangles, tetrahedra


def volume_of(scene: Scene) -> float:
    """Area or volume of a rectangle, a box or a polygon."""
    body = scene.geometry
    if isinstance(body, Box):
        return float(np.prod(np.subtract(body.upper, body.lower)))
    assert isinstance(body, Rectangle | Polygon)
    x, y = body.outline().T
    return float(0.5 * abs(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)))


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
    elif len(ends := body.extremes()):
        sides, places = np.ptp(ends, axis=0), points_of_body(scene)
        volumes = np.full(len(places), volume_of(scene) / len(places))
    else:
        return ""
    extent = " × ".join(f"{side:.3g}" for side in sides)
    power = "²" if scene.cell_dimension == 2 else "³"
    mass = ""
    if scene.material.density is not None:
        weights = volumes * scene.material.at(places).density * (scene.material.thickness or 1.0)
        mass = f", {weights.sum():.3g} kg{' per m of thickness' if d == 2 else ''}"
    return f"{extent} m{mesh}, {volumes.sum():.3g} m{power}{mass}"


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
    reference = solver == REFERENCE
    count = scene.reference.levels if reference else scene.mesh.count
    rows = []
    for level in range(count):
        found = _reference_mesh(scene, level) if reference else mesh_of_level(scene, level)
        if found is None:
            return []
        nodes, size = found
        unknowns = round(nodes * scene.dimension)
        heavy = solver_in(solver) in _FENICSX or not is_built_in(solver)
        work = unknowns * _SECONDS[heavy] * (_IN_SPACE if scene.cell_dimension == 3 else 1.0)
        work *= scene.reference.degree if reference else 1  # more entries to a row
        if scene.analysis.kind == "dynamic":
            work = max(_STEP * work, _LEAST[heavy]) * _steps(
                scene, size, level if reference else 0, reference
            )
        else:
            work *= _ITERATIONS[scene.analysis.kinematics]
        times = 1 if reference else 1 + repetitions
        memory = _MEMORY[heavy] + unknowns * _BYTES * (_IN_SPACE if scene.dimension == 3 else 1.0)
        least, most = (round(share * unknowns) for share in (_RANGE if reference else (1, 1)))
        rows.append(LevelCost(solver, level, least, most, _BESIDE[heavy] + times * work, memory))
    return rows


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
    if scene.mesh.cells is not None or isinstance(body, Rectangle | Box):
        assert not isinstance(body, Polygon)
        sides = np.subtract(body.upper, body.lower)
        if scene.mesh.cells is not None:
            counts = list(scene.mesh.cells[level])
        else:
            assert scene.mesh.sizes is not None
            counts = [ceil(side / scene.mesh.sizes[level] * (1 - 1e-9)) for side in sides]
        return float(prod(n + 1 for n in counts)), float(max(sides / counts))
    assert scene.mesh.sizes is not None
    size = scene.mesh.sizes[level]
    return _nodes(scene, size), size


def _reference_mesh(scene: Scene, level: int) -> tuple[float, float] | None:
    """Return nodes and element size, far from what is singular, of a level of the reference."""
    body, degree = scene.geometry, scene.reference.degree
    if isinstance(body, MeshFile):
        coarse = mesh_of_level(scene, 0)
        assert coarse is not None
        level += scene.first_refinement
        nodes, size = coarse[0] * 2.0 ** (scene.cell_dimension * level), coarse[1] / 2**level
    elif isinstance(body, Rectangle | Box | Polygon):
        extent = volume_of(scene) ** (1 / scene.dimension)
        size = scene.reference.size or extent / _FINENESS[scene.dimension]
        size /= 2**level
        nodes = _GRADED[scene.dimension] * _nodes(scene, size)
    else:
        return None
    return nodes * degree**scene.cell_dimension, size


def _nodes(scene: Scene, size: float) -> float:
    """Nodes of an unstructured mesh: of equilateral cells, and half of those on its boundary."""
    d, volume = scene.dimension, volume_of(scene)
    inside = (_PER_AREA if d == 2 else _PER_VOLUME) * volume / size**d
    return float(inside + d * volume ** ((d - 1) / d) / size ** (d - 1))


def _steps(scene: Scene, size: float, halved: int, reference: bool) -> float:
    """Time steps of a motion: those that are asked, or of a pressure wave across an element."""
    analysis = scene.analysis
    asked = scene.reference.time_step if reference else None
    largest = asked or analysis.time_step or size * 2**halved / wave_speed(scene.material)
    return analysis.steps(largest) * 2.0**halved
