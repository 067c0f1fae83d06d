"""A case file as a stage: what can be played of it, or why it cannot."""

from pathlib import Path

import numpy as np

from verify.errors import InputError, UnsupportedSceneError
from verify.scene import Gravity, Pull, Scene, Skin, ToolPathCut, is_uniform
from verify.simulator.cutting.growing_body import GrowingBody
from verify.simulator.mapping.moving_surface import BodySurface
from verify.simulator.skin_mesh import quartered, skin_mesh, skin_surface
from verify.simulator.stage import Hold, Hook, Stage
from verify.solvers.body_of_scene import background_mesh
from verify.solvers.boundary_of_scene import Boundary
from verify.xfem.arrays import Bools, Floats, Ints
from verify.xfem.body import RayleighDamping
from verify.xfem.cuts import ToolPath
from verify.xfem.elasticity import Material, isotropic
from verify.xfem.errors import XfemError
from verify.xfem.mesh import SimplexMesh


def stage_of(scene: Scene, level: int = 0) -> Stage:
    """Set up what a scene asks for.

    Parameters
    ----------
    scene : Scene
        Dynamic, with a time step, at finite rotation.
    level : int
        Mesh level, 0 is the coarsest.

    Raises
    ------
    UnsupportedSceneError
        If the scene asks for what is not played: statics, tractions, histories, exact values.
    InputError
        If a mesh, a surface or a part of the boundary is bad.
    """
    if reason := _refusal(scene):
        raise UnsupportedSceneError(reason)
    where = str(scene.file or scene.name)
    try:
        mesh, rim = _mesh(scene, level)
        analysis = scene.analysis
        assert analysis.duration is not None
        assert analysis.time_step is not None
        assert scene.material.density is not None
        replay = scene.replay
        thickness = scene.material.thickness or 1.0
        return Stage(
            mesh=mesh,
            material=_material(scene, thickness),
            density=scene.material.density * thickness,
            gravity=sum(
                (np.array(load.acceleration) for load in scene.loads if isinstance(load, Gravity)),
                np.zeros(scene.dimension),
            ),
            time_step=analysis.time_step,
            duration=analysis.duration,
            holds=_holds(scene, mesh, rim),
            hooks=[_hook(scene, pull) for pull in (replay.pulls if replay else [])],
            strokes=[_stroke(cut) for cut in scene.cuts if isinstance(cut, ToolPathCut)],
            damping=RayleighDamping(*analysis.damping),
            visual=_surface(scene, mesh, replay.visual if replay else None),
            collision=_surface(scene, mesh, replay.collision if replay else None),
            tool_radius=replay.tool_radius if replay else 0.0,
            tool_force=replay.tool_force if replay else 0.0,
        )
    except XfemError as error:
        raise InputError(str(error), where) from None


def _refusal(scene: Scene) -> str | None:
    if scene.analysis.kind != "dynamic" or scene.analysis.time_step is None:
        return "a scene is played in time: it needs a dynamic analysis with a time_step"
    if scene.analysis.kinematics != "corotational":
        return "a scene is played at any rotation: kinematics must be 'corotational'"
    if not scene.material.is_uniform:
        return "a scene of one material is played; material.regions differ"
    if scene.initial.kind != "rest":
        return "a scene is played from rest"
    for i, load in enumerate(scene.loads):
        if not isinstance(load, Gravity):
            return f"loads[{i}]: only gravity and pulls are played, not a {load.kind}"
    for i, support in enumerate(scene.supports):
        given = support.displacement
        if given == "exact" or not is_uniform(given) or support.history is not None:
            return f"supports[{i}]: only constant supports are played"
    for i, cut in enumerate(scene.cuts):
        if not isinstance(cut, ToolPathCut):
            return f"cuts[{i}]: only cuts of kind 'tool_path' are played, not a {cut.kind}"
    return None


def _mesh(scene: Scene, level: int) -> tuple[SimplexMesh, Bools | None]:
    if isinstance(scene.geometry, Skin):
        skin = skin_mesh(scene.geometry, _folder(scene))
        return SimplexMesh(skin.points, skin.cells), skin.rim
    return background_mesh(scene, level)[0], None


def _folder(scene: Scene) -> Path:
    return scene.file.parent if scene.file else Path.cwd()


def _material(scene: Scene, thickness: float) -> Material:
    young, poisson = scene.material.young * thickness, scene.material.poisson
    if scene.cell_dimension < scene.dimension or scene.material.plane == "stress":
        return isotropic(young, poisson, "plane stress")
    return isotropic(young, poisson, "plane strain" if scene.dimension == 2 else "solid")


def _holds(scene: Scene, mesh: SimplexMesh, rim: Bools | None) -> list[Hold]:
    boundary = Boundary(mesh.points, mesh.cells, mesh.boundary_facets)
    holds = []
    for i, support in enumerate(scene.supports):
        key = f"supports[{i}].where"
        nodes = np.zeros(len(mesh.points), dtype=bool)
        if support.where == "rim" and rim is not None:
            nodes = rim
            if not rim.any():
                raise InputError(f"{key}: the surface is closed and has no rim", str(scene.file))
        else:
            nodes[boundary.held(scene, support.where, key)[0]] = True
        held = support.held(scene.dimension)
        holds.append(Hold(nodes, held, np.array(support.displacement, dtype=float)))
    return holds


def _hook(scene: Scene, pull: Pull) -> Hook:
    vector = pull.displacement if pull.displacement is not None else pull.force
    stroke = [cut.name for cut in scene.cuts].index(pull.cut)
    return Hook(
        np.array(pull.at, dtype=float),
        pull.radius,
        stroke,
        1 if pull.side == "positive" else -1,
        np.array(vector, dtype=float),
        pull.force is not None,
        pull.begin,
        pull.duration,
    )


def _stroke(cut: ToolPathCut) -> ToolPath:
    depth = None if cut.dimension == 2 else cut.blade
    return ToolPath.of_tip(np.array(cut.points, dtype=float), cut.moments, depth)


def _surface(scene: Scene, mesh: SimplexMesh, triangles: int | None) -> tuple[Floats, Ints] | None:
    if triangles is None:
        return None
    if isinstance(scene.geometry, Skin):
        return skin_surface(scene.geometry, _folder(scene), triangles)
    return _fine_boundary(mesh, triangles)


def _fine_boundary(mesh: SimplexMesh, triangles: int) -> tuple[Floats, Ints]:
    """Boundary of a solid, each of its triangles split in four until there are enough."""
    surface = BodySurface(GrowingBody(mesh)).surface
    points, facets = surface.material.rows.copy(), surface.facets.rows.copy()
    while len(facets) < triangles:
        points, facets = quartered(points, facets)
    return points, facets
