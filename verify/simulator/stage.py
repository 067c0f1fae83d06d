"""A simulated scene as arrays: body, strokes, surfaces, supports and hooks, and how these grip.

`stage_of` tells which parts of a case file can be played, or why it cannot.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from verify.errors import InputError, UnsupportedSceneError
from verify.scene import Gravity, Pull, Scene, Skin, ToolPathCut, is_uniform
from verify.simulator.growing_body import GrowingBody
from verify.simulator.moving_surface import BodySurface
from verify.simulator.skin_mesh import quartered, skin_mesh, skin_surface
from verify.solvers.body_of_scene import background_mesh
from verify.solvers.boundary_conditions import Boundary
from verify.xfem.arrays import Bools, Floats, Ints, XfemError
from verify.xfem.body import MovingSupports, RayleighDamping
from verify.xfem.cuts import ToolPath
from verify.xfem.element import Material, isotropic
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import PhantomMesh


@dataclass(frozen=True)
class Hold:
    """Nodes of the uncut mesh that are held.

    Attributes
    ----------
    nodes : (n,) bool array
    components : tuple of int
    values : (c,) float array
        Displacement of each of the components, m.
    """

    nodes: Bools
    components: tuple[int, ...]
    values: Floats


@dataclass(frozen=True)
class Hook:
    """Grips the material on one side of a stroke and moves it, or pulls at it.

    Attributes
    ----------
    at : (s,) float array
        In the uncut body, m.
    radius : float
        m.
    stroke : int
        Number of the stroke beside which it grips.
    side : int
        +1 or -1.
    vector : (s,) float array
        Displacement in m or force in N, reached at the end.
    is_force : bool
    begin, duration : float
        s.
    """

    at: Floats
    radius: float
    stroke: int
    side: int
    vector: Floats
    is_force: bool
    begin: float
    duration: float

    def share(self, time: float) -> float:
        """Tell how much of vector there is at a time: from 0 to 1, without a jump in velocity."""
        s = min(max((time - self.begin) / self.duration, 0.0), 1.0)
        return s * s * (3.0 - 2.0 * s)

    def at_edge(self, path: ToolPath) -> Floats:
        """Place (s,) of the edge of a cut that is nearest to where the hook grips, m."""
        blade = (path.blades[:, -1] - path.blades[:, 0]).mean(axis=0)
        along = blade / (np.linalg.norm(blade) or 1.0)
        away = path.blades[:, 0] - self.at
        away -= np.outer(away @ along, along)  # what lies along the blade is no distance
        fine = np.linspace(0.0, len(away) - 1.0, 50 * len(away))
        line = np.column_stack([np.interp(fine, np.arange(len(away)), x) for x in away.T])
        return self.at + line[np.argmin(np.linalg.norm(line, axis=1))]

    def rate(self, time: float) -> float:
        """Time derivative of `share`, in 1/s."""
        s = min(max((time - self.begin) / self.duration, 0.0), 1.0)
        return 6.0 * s * (1.0 - s) / self.duration


@dataclass(frozen=True)
class Stage:
    """A scene to be played.

    Attributes
    ----------
    mesh : SimplexMesh
        Triangles in the plane, tetrahedra, or triangles in space (a membrane).
    material : Material
        Of a membrane times the thickness.
    density : float
        kg/m³; of a membrane times the thickness.
    gravity : (s,) float array
        m/s².
    time_step, duration : float
        s.
    holds, hooks : lists
    strokes : list of ToolPath
        In the order of their numbers.
    damping : RayleighDamping
    visual, collision : (points, facets), optional
        Surfaces beside the material's own, for solids.
    tool_radius : float
        m.
    tool_force : float
        With which the moving blade drags what it touches, N.
    opening : str
        ``"swept"``: elements open ahead of a blade of `strokes`, held by forces that fade;
        ``"late"``: when it has crossed them through.
    toughness : list of float or None
        Of the tissue along each stroke, J/m²; of a membrane times the thickness.
    tolerance : float
        Residual that iterations may leave of the right-hand side of a step.
    skin : float or None
        Of a skin, how deep the lips are drawn, m: its thickness if it is a membrane, else 0.
    """

    mesh: SimplexMesh
    material: Material
    density: float
    gravity: Floats
    time_step: float
    duration: float
    holds: list[Hold] = field(default_factory=list)
    hooks: list[Hook] = field(default_factory=list)
    strokes: list[ToolPath] = field(default_factory=list)
    damping: RayleighDamping = field(default_factory=RayleighDamping)
    visual: tuple[Floats, Ints] | None = None
    collision: tuple[Floats, Ints] | None = None
    tool_radius: float = 0.0
    tool_force: float = 0.0
    opening: str = "swept"
    toughness: list[float | None] = field(default_factory=list)
    tolerance: float = 1e-10
    skin: float | None = None

    @cached_property
    def smoothing(self) -> float:
        """Advance over which forces on blades are smoothed, m: two mean edges of the mesh."""
        return 2.0 * float(np.linalg.norm(self.mesh.edge_vectors, axis=2).mean())

    @property
    def steps(self) -> int:
        """Number of steps; the last one may end a little later than the duration."""
        return int(np.ceil(self.duration / self.time_step * (1.0 - 1e-12)))


def gripped(phantom: PhantomMesh, hook: Hook) -> Ints:
    """Find dof nodes that a hook grips: those on its side within its radius, at least the nearest.

    The unknowns at nodes across the cut are among them: they carry the material up to the cut.
    """
    on_side = np.flatnonzero(phantom.node_side[:, hook.stroke] == hook.side)
    if len(on_side) == 0:
        return on_side
    away = np.linalg.norm(phantom.node_points[on_side] - hook.at, axis=1)
    return on_side[away <= max(hook.radius, float(away.min()))]


def held_unknowns(phantom: PhantomMesh, nodes: Bools, facets: Bools) -> Bools:
    """Find dof nodes (N,) to be held where some nodes (n,) of the uncut mesh are.

    The unknown of the material at a node is held. Another one there, of material beyond a cut, is
    held only if that material reaches a held facet: else a part that is cut free would hang on a
    node that is no part of it. `facets` is what `held_facets` gives.
    """
    held = np.zeros(phantom.node_count, dtype=bool)
    held[: len(nodes)] = nodes
    sub = phantom.sub_cells
    # of sub-simplices on held facets all corners but one lie on these
    away = sub.barycentric != 0.0
    part, facet = np.nonzero((away.sum(axis=1) == 1) & facets[phantom.parent[sub.piece]])
    on_facet = np.arange(facets.shape[1]) != facet[:, None]
    held[phantom.cells[sub.piece[part]][on_facet]] = True
    return held


def held_facets(mesh: SimplexMesh, nodes: Bools) -> Bools:
    """Tell whether facets (m, d + 1) are on the boundary with all nodes held."""
    cell, local = mesh.boundary_facets.T
    facet = nodes[mesh.cells[cell]]
    facet[np.arange(len(cell)), local] = True
    on_held = np.zeros(mesh.cells.shape, dtype=bool)
    on_held[cell, local] = facet.all(axis=1)
    return on_held


class Grips:
    """Supports and loads of a body as it is now, from the time at which it was last cut.

    Parameters
    ----------
    phantom : PhantomMesh
    holds : sequence of Hold
    hooks : sequence of Hook
    weights : (N,) float array
        Lumped masses: a force is shared in proportion, so that slivers get next to nothing.
    start : dict
        Displacement (N, s) at which each hook (by its number) has gripped.
    facets : sequence of (m, d + 1) bool arrays
        `held_facets` of each hold; they do not change as the body is cut.

    Attributes
    ----------
    tool : (N, s) float array or None
        Nodal forces of the blades, N.
    """

    def __init__(
        self,
        phantom: PhantomMesh,
        holds: Sequence[Hold],
        hooks: Sequence[Hook],
        weights: Floats,
        start: dict[int, Floats],
        facets: Sequence[Bools],
    ) -> None:
        shape = (phantom.node_count, phantom.mesh.space)
        self.tool: Floats | None = None
        self._fixed, self._values = np.zeros(shape, dtype=bool), np.zeros(shape)
        for k, hold in enumerate(holds):
            at = held_unknowns(phantom, hold.nodes, facets[k])
            for axis, value in zip(hold.components, hold.values, strict=True):
                self._fixed[at, axis], self._values[at, axis] = True, value
        self._moved: list[tuple[Hook, Ints, Floats]] = []
        self._pulled: list[tuple[Hook, Ints, Floats]] = []
        for number, begun in start.items():
            hook, nodes = hooks[number], gripped(phantom, hooks[number])
            if len(nodes) == 0:
                continue
            if hook.is_force:
                share = weights[nodes] / weights[nodes].sum()
                self._pulled.append((hook, nodes, share[:, None] * hook.vector))
            else:
                self._fixed[nodes] = True
                self._moved.append((hook, nodes, begun[nodes]))

    @property
    def supports(self) -> MovingSupports:
        """Holds, and hooks that move."""
        return MovingSupports(self._fixed, self._at)

    def force(self, time: float) -> Floats:
        """Compute nodal forces (N, s) of the hooks that pull, and of the tool, N."""
        force = np.zeros(self._values.shape) if self.tool is None else self.tool.copy()
        for hook, nodes, full in self._pulled:
            force[nodes] += hook.share(time) * full
        return force

    def _at(self, time: float) -> tuple[Floats, Floats]:
        displacement, velocity = self._values.copy(), np.zeros(self._values.shape)
        for hook, nodes, begun in self._moved:
            displacement[nodes] = begun + hook.share(time) * hook.vector
            velocity[nodes] = hook.rate(time) * hook.vector
        return displacement, velocity


def stage_of(scene: Scene) -> Stage:
    """Set up what a scene asks for.

    Parameters
    ----------
    scene : Scene
        Dynamic, with a time step, at finite rotation; its coarsest mesh is played.

    Raises
    ------
    UnsupportedSceneError
        If the scene has parts that are not played: statics, tractions, histories, exact values.
    InputError
        If a mesh, a surface or a part of the boundary is bad.
    """
    if reason := _refusal(scene):
        raise UnsupportedSceneError(reason)
    where = str(scene.file or scene.name)
    try:
        mesh, rim = _mesh(scene)
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
            opening=analysis.opening,
            toughness=[c.toughness and c.toughness * thickness for c in scene.cuts],
            skin=scene.material.thickness or 0.0 if isinstance(scene.geometry, Skin) else None,
        )
    except XfemError as error:
        raise InputError(str(error), where) from None


def _refusal(scene: Scene) -> str | None:
    if scene.analysis.kind != "dynamic" or scene.analysis.time_step is None:
        return "a scene is played in time: it needs a dynamic analysis with a time_step"
    if scene.analysis.kinematics != "corotational":
        return "a scene is played at any rotation: kinematics must be 'corotational'"
    if scene.material.model != "hooke":
        return f"a scene of Hooke's law is played; material.model is '{scene.material.model}'"
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


def _mesh(scene: Scene) -> tuple[SimplexMesh, Bools | None]:
    if isinstance(scene.geometry, Skin):
        skin = skin_mesh(scene.geometry, _folder(scene))
        return SimplexMesh(skin.points, skin.cells), skin.rim
    return background_mesh(scene, 0)[0], None


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
    """Compute boundary of a solid, each of its triangles split in four until there are enough."""
    surface = BodySurface(GrowingBody(mesh)).surface
    points, facets = surface.material.rows.copy(), surface.facets.rows.copy()
    while len(facets) < triangles:
        points, facets = quartered(points, facets)
    return points, facets
