"""First use of the compiled kernels, on bodies of a few elements, and what compiling it takes.

numba compiles a kernel when it is first called and keeps it in `NUMBA_CACHE_DIR` (by default beside
the source). `STAGES` call the kernels of one kind of scene after another; `compile_all` runs them
in two processes that share the cache.

``python -m verify.first_use [STAGE …]`` runs stages in this process and prints JSON.
"""

import gc
import json
import os
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from time import perf_counter

import numpy as np

from verify.accelerated import FAST
from verify.accelerated.conjugate_gradients import ConjugateGradients
from verify.accelerated.two_level import TwoLevel
from verify.compare.body import Body
from verify.compare.body_rule import area_rule
from verify.compare.cell_tree import build_cell_tree, find_cells
from verify.compare.hooke import Corotated
from verify.compare.locate import (
    SolutionField,
    bends_of,
    difference_squares,
    evaluate_linear,
    evaluate_quadratic,
    value_squares,
)
from verify.compare.mass import kinetic
from verify.compare.overlap import OverlapSearch
from verify.compare.sides import distance_to_segments
from verify.compare.simplices import simplices
from verify.processes import ONE_THREAD
from verify.provenance import compile_times
from verify.solution import Solution
from verify.xfem.block_pattern import body_pattern, constrain
from verify.xfem.body import DynamicBody
from verify.xfem.cuts import Plane, ToolPath
from verify.xfem.element import State, isotropic
from verify.xfem.energy_momentum import EnergyMomentum
from verify.xfem.equilibrium import static_equilibrium
from verify.xfem.explicit import CentralDifferences
from verify.xfem.implicit import Trapezoidal
from verify.xfem.internal_force import InternalForce
from verify.xfem.loads_and_supports import Supports, body_force
from verify.xfem.mass import side_wise_mass
from verify.xfem.mesh import SimplexMesh, box_mesh, rectangle_mesh
from verify.xfem.phantom import PhantomMesh, cut_mesh
from verify.xfem.real_time import RealTimeEuler
from verify.xfem.slivers import treat_slivers
from verify.xfem.statics import solve_static

_SECONDS = 1200.0  # ten times what a slow core takes


class FirstUseError(RuntimeError):
    """A kernel could not be compiled or run."""


def _plane() -> tuple[PhantomMesh, State]:
    return cut_mesh(rectangle_mesh((3, 3)), [Plane([0.5, 0.45], [0.1, 1.0])]), "plane strain"


def _flat_membrane() -> SimplexMesh:
    flat = rectangle_mesh((3, 3))
    return SimplexMesh(np.column_stack([flat.points, np.zeros(len(flat.points))]), flat.cells)


def _membrane() -> tuple[PhantomMesh, State]:
    cut = Plane([0.5, 0.45, 0.0], [0.1, 1.0, 0.2])
    return cut_mesh(_flat_membrane(), [cut]), "plane stress"


def _solid() -> tuple[PhantomMesh, State]:
    return cut_mesh(box_mesh((2, 2, 2)), [Plane([0.5, 0.45, 0.5], [0.1, 1.0, 0.2])]), "solid"


def _held(phantom: PhantomMesh) -> Supports:
    held = Supports.none(phantom).prescribe(phantom, phantom.mesh.points[:, 1] % 1.0 == 0.0)
    if phantom.mesh.dim < phantom.mesh.space:
        whole = np.ones(len(phantom.mesh.points), dtype=bool)
        held = held.prescribe(phantom, whole, components=(2,))
    return held


def _linear(phantom: PhantomMesh, kind: State) -> None:
    material, load = isotropic(1.0, 0.3, kind), body_force(phantom, -np.ones(phantom.mesh.space))
    held = _held(phantom)
    solve_static(phantom, material, held, load, kernels=FAST)
    if kind == "solid":  # taken for large ones alone
        pattern = body_pattern(phantom)
        blocks = InternalForce(phantom, material, "linear", FAST).stiffness(pattern)
        constrain(pattern, held.fixed, blocks)
        solver = TwoLevel(pattern, phantom.node_points, held.fixed, 1e-6, 100)
        solver.factorize(blocks)
        solver.solve(np.where(held.fixed, 0.0, load))


def _turning(phantom: PhantomMesh, kind: State) -> None:
    """Finite rotation in statics, and every scheme in motion: all linear solvers."""
    force = InternalForce(phantom, isotropic(1.0, 0.3, kind), kernels=FAST)
    held = _held(phantom)
    load = body_force(phantom, -0.01 * np.ones(phantom.mesh.space))
    static_equilibrium(force, held.fixed, load=load)
    body = DynamicBody(force, side_wise_mass(phantom, 1.0), supports=held)
    for scheme in (
        RealTimeEuler(body, 1e-3),
        RealTimeEuler(body, 1e-3, solver=ConjugateGradients(body.pattern, body.shape[1])),
        Trapezoidal(body, 1e-3),
        EnergyMomentum(body, 1e-3),
        CentralDifferences(body, 1e-3),
    ):
        state = body.rest()
        state.velocity[:] = 0.01 * phantom.node_points
        scheme.step(state)


def _without_slivers(
    body: Callable[[], tuple[PhantomMesh, State]], use: Callable[[PhantomMesh, State], None]
) -> None:
    # aggregated cells assemble at corners by the same loops: the untreated body has them all
    phantom, kind = body()
    treat_slivers(phantom)
    use(phantom, kind)


def _scalpel(mesh: SimplexMesh, kind: State) -> None:
    """Move a blade through a body in motion, with its skin, an inner surface and collision."""
    # who loads the kernels of solves does not wait for the simulator
    from verify.simulator.session import Session
    from verify.simulator.stage import Stage

    path = ToolPath.of_tip([[-0.5, 0.4, -0.2], [1.5, 0.5, -0.2]], [0.0, 1.0], [0, 0, 1.5])
    session = Session(
        Stage(
            mesh, isotropic(1.0, 0.3, kind), 1.0, np.array([0.0, 0.0, -0.01]), 0.25, 1.0,
            strokes=[path], tool_radius=0.05, tool_force=1e-3,
            visual=(mesh.points, mesh.cells[:1, :3].copy()) if kind == "solid" else None,
        )
    )  # fmt: skip
    session.run()


def _comparison() -> None:
    """Ask fields in the plane, in space and of a membrane; cuts for distances and overlaps."""
    for mesh in (rectangle_mesh((3, 3)), box_mesh((2, 2, 2))):
        points, corners = mesh.points[:3] + 0.1, mesh.points[mesh.cells]
        tree = build_cell_tree(corners.min(axis=1), corners.max(axis=1))
        shape = simplices(mesh.points, mesh.cells)
        for near in (np.empty((0, mesh.space)), points):
            no_sides = [np.zeros((n, 0), dtype=np.int8) for n in (len(points), len(corners))]
            cells = find_cells(
                points, near, no_sides[0], tree.over(shape.corners, shape.normals), no_sides[1],
                1e-12,
            )  # fmt: skip
        origin = np.ascontiguousarray(corners[:, 0])
        evaluate_linear(points, cells, origin, origin, np.ascontiguousarray(shape.gradients[:, 1:]))
        bends = np.empty((len(corners), mesh.space, mesh.space, 1 + mesh.space))
        evaluate_quadratic(points, cells, origin, origin, bends, shape.gradients[:, 1:])
        value_squares(points, points)
        still, gradients = np.zeros((1, *mesh.points.shape)), np.zeros((1, mesh.space, mesh.space))
        difference_squares(gradients, gradients)
        solution = Solution(mesh.points, mesh.cells, still, velocity=still)
        kinetic(solution, 1.0)
        SolutionField(solution)
        bends_of(mesh.points, np.zeros((1, 4 * mesh.space - 2), dtype=np.int64))
        Corotated(1.0, 1.0).error_density(gradients, gradients)
        distance_to_segments(points, np.stack([points, points], axis=1), 1.0)
    nowhere = np.zeros((0, 2))
    area_rule(Body((np.eye(3, 2),), {}, [], nowhere, nowhere), 1.0)
    across = np.zeros((1, 3, 2))
    Corotated(1.0, 1.0).error_density(across, across)
    sheet = _flat_membrane()
    still = np.zeros((1, *sheet.points.shape))
    SolutionField(Solution(sheet.points, sheet.cells, still)).cells_at(sheet.points)
    below, above = rectangle_mesh((2, 2)), rectangle_mesh((2, 2))
    above.points[:, 1] += 1.0
    pressed = np.concatenate([np.zeros_like(below.points), np.full_like(above.points, -0.1)])
    OverlapSearch(
        Solution(
            np.concatenate([below.points, above.points]),
            np.concatenate([below.cells, above.cells + len(below.points)]),
            pressed[None],
        )
    ).at()


_STAGES: list[tuple[str, Callable[[], None]]] = [
    ("comparison", _comparison),
    ("plane: statics", partial(_without_slivers, _plane, _linear)),
    ("plane: rotation and motion", partial(_without_slivers, _plane, _turning)),
    ("membrane: rotation and motion", partial(_without_slivers, _membrane, _turning)),
    ("space: scalpel", partial(_scalpel, box_mesh((3, 3, 3)), "solid")),
    ("membrane: scalpel", partial(_scalpel, _flat_membrane(), "plane stress")),
    ("space: statics", partial(_without_slivers, _solid, _linear)),
    ("space: rotation and motion", partial(_without_slivers, _solid, _turning)),
]
STAGES = dict(_STAGES)
# Of two processes. The first begins with what the other does not need, and finds in the cache how
# a body is split and joined, with which the other begins.
_SHARES = (list(STAGES)[:4], list(STAGES)[4:])


@dataclass(frozen=True)
class FirstUse:
    """What compiling took.

    Attributes
    ----------
    kernels : int
        Compilations; 0 if all were found in the cache.
    seconds : dict
        Processor seconds of compilation by ``module:kernel``.
    wall : float
        Seconds until all was done.
    """

    kernels: int
    seconds: dict[str, float]
    wall: float


def compile_here(stages: list[str]) -> FirstUse:
    """Run stages in this process.

    Parameters
    ----------
    stages : list of str
        Of `STAGES`.
    """
    begun = perf_counter()
    collecting = gc.isenabled()
    gc.disable()  # the compiler makes millions of objects that live on: 8 % of its time
    try:
        with compile_times() as times:
            for stage in stages:
                STAGES[stage]()
    finally:
        if collecting:
            gc.enable()
    return FirstUse(times.kernels, dict(times.seconds), perf_counter() - begun)


def compile_all() -> FirstUse:
    """Run all stages, in two processes with one cache.

    Both may meet the same kernel at once and compile it twice; numba replaces a cache entry as a
    whole, so that neither reads half of one.

    Raises
    ------
    FirstUseError
        If a process fails, with its last line.
    """
    begun = perf_counter()
    environment = {**os.environ, **ONE_THREAD}
    root = str(Path(__file__).resolve().parent.parent)
    paths = filter(None, [root, os.environ.get("PYTHONPATH")])
    environment["PYTHONPATH"] = os.pathsep.join(paths)
    running = [
        subprocess.Popen(
            [sys.executable, "-m", "verify.first_use", *share],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment,
        )
        for share in _SHARES
    ]  # fmt: skip
    kernels = 0
    seconds: dict[str, float] = defaultdict(float)
    try:
        for process in running:
            said, complaint = process.communicate(timeout=_SECONDS)
            if process.returncode != 0:
                last = complaint.strip().splitlines()[-1:] or [f"exit code {process.returncode}"]
                raise FirstUseError(f"a kernel does not compile: {last[0]}")
            found = json.loads(said)
            kernels += found["kernels"]
            for kernel, spent in found["seconds"].items():
                seconds[kernel] += spent
    except subprocess.TimeoutExpired:
        raise FirstUseError(f"compiling takes more than {_SECONDS:g} s") from None
    finally:
        for process in running:
            process.kill()
            process.wait()
    return FirstUse(kernels, dict(seconds), perf_counter() - begun)


if __name__ == "__main__":
    print(json.dumps(asdict(compile_here(sys.argv[1:] or list(STAGES)))))
