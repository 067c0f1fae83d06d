"""Runs of our solvers on the mesh of a scene: repeated, timed, errors in the words of the scene."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from math import inf
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from verify.errors import InputError, UnsupportedSceneError
from verify.scene import Scene
from verify.solution import Regularisation, Solution
from verify.solvers.body_of_scene import background_mesh
from verify.xfem.errors import BasisError, XfemError
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import PhantomMesh
from verify.xfem.subdivision import Subdivision, extrapolation

_Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Answer:
    """Displacements and their rates (t, N, d) of the unknowns of a cut mesh at output times.

    `mass` is that of a motion: a word, or the matrix (N, N) with which it ended.
    """

    phantom: PhantomMesh
    times: _Floats
    displacement: _Floats
    velocity: _Floats | None
    acceleration: _Floats | None
    ledger: dict[str, _Floats]
    timings: dict[str, float]
    iterations: dict[str, int]
    notes: dict[str, str]
    unknowns: int
    further: list[Regularisation]
    mass: str | csr_array | None = field(default=None, kw_only=True)


@dataclass(frozen=True)
class Repeated[A: Answer]:
    """Answer of the last run, element size in m, and wall seconds of every run by phase."""

    answer: A
    size: float
    timings: dict[str, list[float]]


def check_steps(load_steps: int, step_factor: float) -> None:
    """Raise `InputError` unless load steps are counted from 0 and a factor of steps is positive."""
    whole = isinstance(load_steps, int) and load_steps >= 0
    if not whole or not isinstance(step_factor, int | float) or not 0.0 < step_factor < inf:
        text = f"load_steps {load_steps}, step_factor {step_factor}"
        raise InputError(f"{text}; expected at least 0, and a positive number")


@contextmanager
def errors_of_scene(scene: Scene) -> Iterator[None]:
    """Turn errors of the library into those of a scene: `UnsupportedSceneError`, `InputError`."""
    try:
        yield
    except BasisError as error:  # another basis can do the scene
        raise UnsupportedSceneError(str(error)) from None
    except XfemError as error:
        raise InputError(str(error), str(scene.file or scene.name)) from None


def repeated[A: Answer](
    scene: Scene, level: int, repetitions: int, run: Callable[[SimplexMesh, float, bool], A]
) -> Repeated[A]:
    """Run on the mesh of a level as often as asked for, and at least once.

    Parameters
    ----------
    scene : Scene
    level, repetitions : int
    run : callable
        Solves on a mesh, given its element size and whether it is a trial, which compiles what
        compiles and is not timed. Each gets a mesh of its own, with nothing kept from before.

    Raises
    ------
    InputError
        If there is no such level.
    """
    if not 0 <= level < scene.mesh.count:
        raise InputError(f"mesh level {level}; expected 0..{scene.mesh.count - 1}")
    with errors_of_scene(scene):
        start = perf_counter()
        mesh, size = background_mesh(scene, level)
        meshing = perf_counter() - start
        if repetitions:
            run(SimplexMesh(mesh.points, mesh.cells), size, True)
        answers = [
            run(SimplexMesh(mesh.points, mesh.cells), size, False)
            for _ in range(max(1, repetitions))
        ]
    timings = {"meshing": [meshing]}
    if repetitions:
        timings |= {name: [one.timings[name] for one in answers] for name in answers[0].timings}
    return Repeated(answers[-1], size, timings)


def solution_on(
    shown: Subdivision,
    done: Repeated[Any],
    cell_sides: NDArray[np.int64] | None,
    regularisations: list[Regularisation],
    notes: dict[str, str],
) -> Solution:
    """Put the answer of a run on the conforming mesh of its cut body.

    Parameters
    ----------
    shown : Subdivision
    done : Repeated
        Its answer is on the unknowns of the cut body.
    cell_sides : (m,) int array, optional
        Of the cells of `shown`.
    regularisations : list of Regularisation
    notes : dict of str to str
        Choices of the solver, beside those of the answer.
    """
    answer = done.answer

    def at_points(values: _Floats) -> _Floats:
        return np.stack([shown.interpolation @ one for one in values])

    mass = answer.mass
    if not (mass is None or isinstance(mass, str)):
        back = extrapolation(answer.phantom, shown)
        mass = csr_array(back.T @ mass @ back)
    return Solution(
        points=shown.points,
        cells=shown.cells,
        displacement=at_points(answer.displacement),
        times=answer.times,
        velocity=None if answer.velocity is None else at_points(answer.velocity),
        acceleration=None if answer.acceleration is None else at_points(answer.acceleration),
        mass=mass,
        cut_facets=shown.cut_facets,
        cell_sides=cell_sides,
        ledger=answer.ledger,
        unknowns=answer.unknowns,
        size=done.size,
        timings=done.timings,
        iterations=answer.iterations,
        regularisations=regularisations,
        notes={
            **notes,
            "timed": "every phase as listed; first call (compilation) excluded; writing excluded",
            **answer.notes,
        },
    )
