"""Adapters of the FEniCSx side: conforming elements at equal h, and the reference itself."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from typing import Any

from reference.boundary_conditions import constrained_values, load_forces, support_ends
from reference.elasticity import linear_system, solve_linear, wants_pressure
from reference.exact import exact_of
from reference.fracture.cells import MIXED
from reference.inside_out import naming_weak_places, place_text
from reference.installation import all_ranks, import_dolfinx
from reference.large_strain import LargeStrainSolve, solve_large_strain
from reference.law import energy_of
from reference.meshing import ConformingMesh
from reference.space import ConformingSpace, conforming_space
from verify.errors import InputError, UnsupportedSceneError
from verify.scene import Box, MeshFile, Polygon, Rectangle, Scene
from verify.scene.acceptance import FractureQuantity
from verify.solution import Regularisation, Solution
from verify.solvers.conforming_meshes import not_imprinted, peer_mesh, reference_mesh, structure
from verify.solvers.conforming_motion import SCHEMES, Marching, TiedMotion, natural_step
from verify.solvers.interface import check_choices, refused_contact
from verify.solvers.runs import OPENINGS, Record, across_interfaces, at_rest, repeated
from verify.system import System

# Spectral radii of the reference in linear motion: what jumps excites waves that no mesh resolves.
# The trapezoidal rule keeps them, turned about with every step. ½ leaves a thousandth in ten steps.
_RADIUS = 0.5
# Behind a blade every facet jumps, and waves of the mesh are damped at once. Factors weigh short
# waves most: ½ leaves 5, 0.7 and 0.02 % of K at 4, 8 and 16 steps from a jump, no power of the
# step; 0 leaves 1.8, 0.34 and 0.07 %, the second order.
_RADIUS_OF_JUMPS = 0.0

import_dolfinx()  # fail here, by name, and not in the middle of a solve


def _refusal(scene: Scene) -> str | None:
    try:
        _ = scene.final_cuts
    except InputError as error:
        return str(error)
    geometry = scene.geometry
    if isinstance(geometry, MeshFile):
        if geometry.cells == "surface" and scene.exact is not None:
            return "exact fields on membranes are not offered by the reference"
        if reason := not_imprinted(scene):
            return reason
    elif not isinstance(geometry, Rectangle | Polygon | Box):
        return f"conforming meshes of a '{geometry.kind}' geometry are not offered yet"
    return None


class _OnConformingMeshes:
    """What both adapters do not do, and the contact that they know."""

    contact = ("static", "dynamic", "finite_rotation")

    def refuses(self, scene: Scene) -> str | None:
        """Refuse what `reference` does not do yet."""
        return _refusal(scene) or refused_contact(self, scene)


class ConformingSolver(_OnConformingMeshes):
    """P1 (or P2) elements on a mesh that conforms to the cut, at the mesh size of the scene.

    Parameters of `solve`
    ---------------------
    degree : {1, 2}
        Polynomial order.
    mesh : {"imprinted", "remeshed"}
        Imprinted: the scene's own background mesh, of which only the cells that the cut
        touches are split; it differs from what an unfitted method works on by the cut cells
        alone. Remeshed: gmsh meshes the cut body anew, with the same mean cell area. Neither is
        graded.
    scheme : {"newmark", "energy_momentum", "implicit_euler", "generalised_alpha"}
        Dynamics: time integration. The step is the scene's, or else the time in which a pressure
        wave crosses an element; outputs that are closer cut it short, on every level alike.
    spectral_radius : float
        Of generalised-α at infinite frequency, 0 to 1.
    delay : float
        By which facets behind a blade on its way open late, s.
    opening : {"late", "swept"}
        Dynamics: when a blade opens a facet, when it has passed all of it, or ahead of it against
        forces that fade (docs/theory/dynamics.md); by default as the scene says.
    """

    name = "conforming"
    choices: Mapping[str, Collection[Any]] = {
        "mesh": ("imprinted", "remeshed"), "degree": (1, 2), "scheme": SCHEMES,
        "opening": OPENINGS,
    }  # fmt: skip

    def levels(self, scene: Scene) -> int:
        """Return the number of mesh levels of the scene."""
        return scene.mesh.count

    def solve(
        self,
        scene: Scene,
        level: int,
        repetitions: int = 1,
        degree: int = 1,
        mesh: str = "imprinted",
        scheme: str = "newmark",
        spectral_radius: float = 0.8,
        delay: float = 0.0,
        opening: str | None = None,
    ) -> Solution:
        """Solve `scene` on mesh `level`; see `verify.solvers.interface.Solver`."""
        opening = opening or scene.analysis.opening
        given = {"mesh": mesh, "degree": degree, "scheme": scheme, "opening": opening}
        check_choices(self.name, self.choices, given)

        def marching(_level: int, size: float) -> Marching:
            largest = scene.analysis.time_step or natural_step(scene, size)
            return Marching(scheme, largest, spectral_radius, delay, opening=opening)

        size = structure(scene, level)[1]
        return _solve(
            self, scene, lambda level: (peer_mesh(scene, level, mesh), size), level, degree,
            repetitions, marching,
        )  # fmt: skip

    def system(
        self,
        scene: Scene,
        level: int,
        degree: int = 1,
        mesh: str = "imprinted",
        **_of_the_solve: Any,
    ) -> System:
        """Return stiffness, consistent mass and supports of `scene`; all cuts are open."""
        if reason := self.refuses(scene):
            raise UnsupportedSceneError(reason)
        space = conforming_space(peer_mesh(scene, level, mesh), degree, None)
        return System(*linear_system(scene, space, exact_of(scene)))


class ReferenceSolver(_OnConformingMeshes):
    """Elements of the degree that the scene asks for, graded to every singular point.

    Quadratic elements have a pressure of their own from Poisson's ratio 0.45 on, so that they do
    not lock. This holds in linear kinematics, and in the plane for statics at finite rotation.

    A motion is integrated by generalised-α, at finite rotation by the energy–momentum scheme. Level
    0 has the time step of the scene's reference or analysis; outputs, openings and jumps may divide
    it. Every level halves each step with the elements, so that the difference of levels shows both
    errors.

    A reference is timed once, whatever `repetitions` says: it judges and does not compete.
    """

    name = "reference"

    def levels(self, scene: Scene) -> int:
        """Return the number of levels of the reference."""
        return scene.reference.levels

    def solve(
        self,
        scene: Scene,
        level: int,
        repetitions: int = 1,
        delay: float = 0.0,
        opening: str | None = None,
    ) -> Solution:
        """Solve `scene` on reference level `level`; each halves all element sizes."""
        behind = any(cut.on_the_way for cut in scene.cuts)
        linear, model = scene.analysis.kinematics == "linear", scene.material.model
        damped = behind or linear or model != "hooke"
        scheme = "generalised_alpha" if damped else "energy_momentum"
        factors = any(isinstance(one, FractureQuantity) for one in scene.quantities)
        radius = _RADIUS_OF_JUMPS if behind or factors else _RADIUS

        def marching(level: int, size: float) -> Marching:
            asked = scene.reference.time_step or scene.analysis.time_step
            step = asked or natural_step(scene, size * 2**level)
            return Marching(scheme, step, radius, delay, level, opening or scene.analysis.opening)

        degree = scene.reference.degree
        return _solve(
            self, scene, lambda level: reference_mesh(scene, level), level, degree,
            min(repetitions, 1), marching, wants_pressure(scene, degree),
        )  # fmt: skip


def _solve(
    solver: ConformingSolver | ReferenceSolver,
    scene: Scene,
    make_mesh: Callable[[int], tuple[ConformingMesh, float]],
    level: int,
    degree: int,
    repetitions: int,
    marching: Callable[[int, float], Marching],
    pressure: bool = False,
) -> Solution:
    if reason := solver.refuses(scene):
        raise UnsupportedSceneError(reason)
    exact, (ranks, _) = exact_of(scene), all_ranks()
    comm = ranks if ranks.size > 1 else None  # over which a scene is distributed

    def run(made: tuple[ConformingMesh, float, int], trial: bool) -> Solution:
        mesh, size, level = made
        space, record = conforming_space(mesh, degree, comm), Record()
        if scene.analysis.kind == "static":
            fields = _equilibrium(scene, space, exact, pressure, record)
        else:
            how = replace(marching(level, size), element=size)
            motion = TiedMotion(scene, space, exact, how, record, comm, pressure)
            fields = motion.run(trial)
        return _solution(scene, space, record, fields, size)

    def made(level: int) -> tuple[ConformingMesh, float, int]:
        if comm is None:
            return *make_mesh(level), level
        # on the first rank, for all
        return *comm.bcast(make_mesh(level) if comm.rank == 0 else None), level

    # a trial on the coarsest mesh compiles the forms
    return repeated(repetitions, lambda: made(level), run, lambda: made(0))


def _equilibrium(
    scene: Scene, space: ConformingSpace, exact: Any, pressure: bool, record: Record
) -> dict[str, Any]:
    """Solve a scene by its kinematics; with a pressure if that is wanted."""
    if scene.analysis.kinematics == "linear":
        linear = solve_linear(scene, space, exact, pressure=pressure)
        record.notes = {
            "unknowns": MIXED if pressure else "displacement",
            "linear solver": linear.answer.method,
            "round-off": f"{linear.answer.round_off:.1e}",
            "residual": f"{linear.answer.residual:.1e}",
        }
        if linear.answer.iterations:
            record.iterations["cg"] = linear.answer.iterations
        record.timings |= linear.timings
        if linear.contact is not None:
            record.iterations["contact"] = linear.changes
        return at_rest(linear.displacement, linear.strain_energy) | {"contact": linear.contact}
    unknowns, _ = constrained_values(scene, space, exact)
    # in space large saddle points of a tangent have no solver but a factorisation
    pressure = pressure and scene.dimension == 2
    with naming_weak_places(scene, space):
        finite = solve_large_strain(
            scene.material,
            space,
            unknowns,
            lambda factor: constrained_values(scene, space, exact, factor)[1],
            load_forces(scene, space, exact),
            energy_of(scene.material),
            pressure=pressure,
            closed=scene.contact.closed,
        )
    state = finite.orientation
    record.notes = {
        "unknowns": MIXED if pressure else "displacement",
        "linear solver": finite.method,
        "smallest det F": f"{state.least:.3g}",
        "smallest det F at": place_text(state.place),
        "steps taken again": "; ".join(finite.refused_steps) or "none",
        "load steps by": "linear elements on the same mesh" if finite.nested else "these elements",
        "stability": _stability(finite),
    }
    record.iterations |= {"newton": finite.iterations, "load steps": finite.steps}
    record.timings |= finite.timings
    return at_rest(finite.displacement, finite.strain_energy) | {"contact": finite.contact}


def _stability(finite: LargeStrainSolve) -> str:
    """Say what the equilibrium was checked by beyond the energy of each step."""
    if (modes := finite.negative_modes) is None:
        return "not shown: a membrane, or a tangent too large to be factorised"
    said = f"{modes} negative modes of the tangent" if modes else "tangent positive definite"
    if finite.paths == 1:
        return said
    if finite.dismissed is None:
        return f"{said}; two paths end at one energy"
    return f"{said}; an unstable state of {finite.dismissed:.6g} J on another path was left"


def _solution(
    scene: Scene, space: ConformingSpace, record: Record, fields: dict[str, Any], size: float
) -> Solution:
    mesh = space.mesh
    kind = "loose part of round-off size joined to its neighbour"
    largest = float(mesh.tiny_parts.max(initial=0.0))
    record.regularisations += [
        Regularisation(kind, len(mesh.tiny_parts), largest, "volume fraction of the body"),
        *support_ends(scene, space, size),
        *across_interfaces(scene, mesh.points, mesh.cells),
    ]
    record.notes |= {"element": f"P{space.degree}", "cells": str(len(mesh.cells))}
    return record.solution(
        points=space.node_points,
        cells=space.cell_nodes,
        order=space.degree,
        cut_facets=mesh.realised_cut,
        cell_sides=mesh.pieces,
        size=size,
        **fields,
    )
