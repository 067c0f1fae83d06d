"""Faults that a mesh of the body shows before a run: of formulas, cuts, places and loose pieces."""

from collections.abc import Callable, Iterator
from functools import partial
from itertools import pairwise
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.geometry.planar import overlap_length
from verify.geometry.simplices import measures, rim_edges
from verify.runner import exact_fit as samples
from verify.runner.cost import mesh_of_level
from verify.runner.exact_fit import holds
from verify.runner.mesh_faults import mesh_warning
from verify.scene import (
    BodyForce,
    CutFaces,
    Equilibrium,
    InitialField,
    PolylineCut,
    Scene,
    Traction,
)
from verify.scene.parts import on_part
from verify.scene.physics import CLOSE, PrescribedMotion, field_values
from verify.scene.placement import misplaced_point
from verify.solvers.body_of_scene import background_mesh, cuts_of
from verify.solvers.boundary_conditions import supports_of
from verify.xfem.arrays import XfemError
from verify.xfem.loads_and_supports import UnsupportedBodyError, check_bodies
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import cut_mesh
from verify.xfem.slivers import join_fragments

Array = NDArray[np.float64]
_Values = Callable[[Array, float], Any]

_NODES = 3000  # of the mesh on which loose pieces are looked for: cut in 0.1 s
_SHORTEST = 1e-4  # of the body: the reference puts one facet on a shorter cut, and cannot open it
_ALONG = 40  # samples of a line inside the bounding box of the body
_NEAR = 1e-6  # of the body: on its boundary, not inside it
_JUMP = 1e-6  # of the largest displacement of a support: an initial field in seven digits is none
# of a formula in time: steps that are looked at, how many of them closely, and how closely
_LOOKS, _FASTEST, _HALVINGS = 257, 4, 40
_METRES = 100.0  # times the body: a cut as large is not in metres, or the body is not


def check_formulas_are_finite(scene: Scene, mesh: SimplexMesh) -> None:
    """Raise `InputError` where a formula has no finite value at a node, or inside a facet or cell.

    Parameters
    ----------
    scene : Scene
    mesh : SimplexMesh
        Any mesh of the body.
    """
    times = scene.analysis.output_times
    for key, values, points in _used(scene, mesh):
        for time in sorted({times[0], times[len(times) // 2], times[-1]}):
            try:
                values(points, time)
            except InputError as error:
                at = f" at {time:.6g} s" if scene.analysis.duration is not None else ""
                where = str(scene.file or scene.name)
                raise InputError(f"{key}: {error.what}{at}", where) from None


def _used(scene: Scene, mesh: SimplexMesh) -> Iterator[tuple[str, _Values, Array]]:
    """Key, values, and the points (n, d) at which they are needed, of every formula."""
    rng = np.random.default_rng(5)
    nodes, facets = samples.boundary_nodes(mesh)[0], samples.on_boundary(mesh, rng).points
    inside = samples.in_body(mesh, rng)[:, 0]
    for i, support in enumerate(scene.supports):
        if support.displacement != "exact":
            at = mesh.points if scene.geometry.holds_inside(support.where) else nodes
            on = on_part(scene.geometry, support.where, at, mesh.extent)
            given = cast(list[Any], support.displacement)
            yield f"supports[{i}].displacement", partial(field_values, given), at[on]
    for i, load in enumerate(scene.loads):
        if isinstance(load, Traction) and not load.exact:
            on = on_part(scene.geometry, load.where, facets, mesh.extent)
            yield f"loads[{i}].traction", load.values, facets[on]
        elif isinstance(load, BodyForce) and not load.exact:
            yield f"loads[{i}].force", load.values, inside
        elif isinstance(load, CutFaces):
            cut = next(cut for cut in scene.final_cuts if cut.name == load.cut)
            on_cut = samples.on_cut(cut, np.zeros(0), rng).points
            if scene.cell_dimension == scene.dimension:
                yield f"loads[{i}]", load.values, on_cut[samples.holds(mesh, on_cut)]
    if isinstance(scene.initial, InitialField):
        for key in ("displacement", "velocity"):
            given = getattr(scene.initial, key)
            if given not in (None, "exact"):
                yield f"initial.{key}", partial(field_values, given), inside


def check_supports_do_not_jump(scene: Scene, mesh: SimplexMesh, exact: Any) -> None:
    """Raise `InputError` if a support of a motion jumps: on its way, or from the initial state.

    Material beside it would be thrown at any speed: the energy of the motion has no limit as
    elements and steps become smaller.
    """
    if scene.analysis.duration is None:
        return
    end, outline = scene.analysis.duration, samples.boundary_nodes(mesh)[0]
    for i, support in enumerate(scene.supports):
        at = mesh.points if scene.geometry.holds_inside(support.where) else outline
        points = at[on_part(scene.geometry, support.where, at, mesh.extent)]
        prescribed = exact if support.displacement == "exact" else None
        motion = PrescribedMotion(support, points, None, prescribed)
        start, held = _initial(scene, points, exact), list(support.held(scene.dimension))
        before = {
            time: motion.at(last, before=True)
            for (last, _), (time, _) in pairwise(support.history or ())
            if time - last <= CLOSE * end  # for every solver these are one time
        }
        if support.timed:
            before |= _leaps(motion, end)
        before[0.0] = motion.at(0.0, before=True) if start is None else start[:, held]
        times = [*scene.analysis.output_times, *before]
        largest = max(np.abs(motion.at(time)).max(initial=0.0) for time in times)
        for time, place in before.items():
            off = np.linalg.norm(motion.at(time) - place, axis=1).max(initial=0.0)
            if time <= end and off > _JUMP * max(largest, np.abs(place).max(initial=0.0)):
                raise InputError(
                    f"supports[{i}]: jumps by {off:.3g} m at {time:g} s, and no motion follows "
                    "that: its energy has no limit as steps get smaller; expected a history that "
                    "leads there in some time, from the initial state on",
                    str(scene.file or scene.name),
                )


def _leaps(motion: PrescribedMotion, end: float) -> dict[float, Array]:
    """Places before and times after the fastest changes of a formula, each looked at closely.

    Between times that are halved so often a jump is all left, a steep slope next to nothing.
    """
    times = np.linspace(0.0, end, _LOOKS)

    def change(one: tuple[float, float]) -> float:
        return float(np.abs(motion.at(one[1]) - motion.at(one[0])).max(initial=0.0))

    found = {}
    for pair in sorted(pairwise(times.tolist()), key=change)[-_FASTEST:]:
        for _ in range(_HALVINGS):
            middle = 0.5 * (pair[0] + pair[1])
            pair = max((pair[0], middle), (middle, pair[1]), key=change)
        found[pair[1]] = motion.at(pair[0])
    return found


def _initial(scene: Scene, points: Array, exact: Any) -> Array | None:
    """Return the initial displacement (n, d) of points, m; None: the one that supports have."""
    match scene.initial:
        case Equilibrium():
            return None
        case InitialField():
            still = scene.initial.model_copy(update={"velocity": None})  # unbounded at tips
            return still.state(points, points, exact)[0]
    return np.zeros_like(points)


def check_pieces_are_held(scene: Scene, exact: object) -> None:
    """Raise `InputError` if a piece of a body that is to be in equilibrium can move rigidly.

    The body is cut as `verify.xfem` cuts it, on the finest of the scene's meshes that is cheap.
    """
    static = scene.analysis.kind == "static"
    if not static and not isinstance(scene.initial, Equilibrium):
        return
    mesh, size = background_mesh(scene, _level(scene))
    opened = static or (isinstance(scene.initial, Equilibrium) and scene.initial.cuts == "open")
    cuts = [
        cut
        for cut, asked in zip(cuts_of(scene, size), scene.cuts, strict=True)
        if static or (opened and asked.kind != "tool_path" and asked.opens_at == 0.0)
    ]
    try:
        phantom = cut_mesh(mesh, cuts)
        phantom, _ = join_fragments(phantom, supports_of(scene, phantom, exact))
        check_bodies(phantom, supports_of(scene, phantom, exact))
    except UnsupportedBodyError as error:
        apart = mesh_warning(scene)
        text = f"supports: {error}{f' ({apart})' if apart else ''}"
        raise InputError(text, str(scene.file or scene.name)) from None
    except XfemError:
        return  # no fault of the scene: another method may cut this mesh


def _level(scene: Scene) -> int:
    """Finest level of a structured mesh with few nodes; else the first."""
    if scene.mesh.pattern != "structured":
        return 0
    cheap = [0]
    for level in range(1, scene.mesh.count):
        found = mesh_of_level(scene, level)
        if found is not None and found[0] <= _NODES:
            cheap.append(level)
    return cheap[-1]


def check_cuts_can_be_meshed(scene: Scene) -> None:
    """Raise `InputError` where a cut is too short, or runs along the boundary on part of its way.

    Cuts that are close to each other or to the boundary are for methods that need no mesh between
    them, and are not refused here.
    """
    body, where = scene.geometry, str(scene.file or scene.name)
    corners = body.extremes()
    if not len(corners):
        return
    size = float(np.ptp(corners, axis=0).max())
    for i, cut in enumerate(scene.final_cuts):
        place, extent = f"cuts[{i}] ('{cut.name}')", _extent(cut)
        if extent < _SHORTEST * size:
            raise InputError(
                f"{place}: is {extent:.3g} m long in a body of {size:.3g} m; expected at least "
                f"{_SHORTEST * size:.3g} m",
                where,
            )
        if isinstance(cut, PolylineCut):
            along = overlap_length(cut.vertices(), np.vstack([corners, corners[:1]]))
            if along:
                raise InputError(
                    f"{place}: runs along the boundary over {along:.3g} m, where it cuts nothing; "
                    "let it begin and end where it leaves the boundary",
                    where,
                )


def _extent(cut: Any) -> float:
    """Length of a cut in the plane, or root of its area in space, m."""
    points, facets = cut.facets()
    return float(measures(points[facets]).sum() ** (1.0 / (cut.dimension - 1)))


def check_places_in_mesh(scene: Scene, mesh: SimplexMesh) -> None:
    """Raise `InputError` if cuts or quantities do not lie in the mesh of a body as they should.

    As `verify.scene.placement` holds them against bodies that the case itself describes; of
    a membrane only whether a cut reaches it at all is known.
    """
    where = str(scene.file or scene.name)
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    size = float((high - low).max())
    for i, cut in enumerate(scene.final_cuts):
        place = f"cuts[{i}] ('{cut.name}')"
        lines, corners, closed = _rim(cut)
        if (corners.min(axis=0) > high).any() or (corners.max(axis=0) < low).any():
            raise InputError(f"{place}: lies outside the body{_unit(corners, size)}", where)
        if scene.cell_dimension < scene.dimension:
            continue
        inner, outer = _sides(mesh, lines, low, high, size)
        kind = "through" if not inner else "edge" if outer else "inner"
        misses = kind == "through" and not holds(mesh, corners).any()
        if misses and not _parts(mesh, scene, i):
            raise InputError(
                f"{place}: lies outside the body or along its boundary; it cuts nothing"
                f"{_unit(corners, size)}",
                where,
            )
        if cut.expected and cut.expected != kind and not closed:
            raise InputError(f"{place}: expected '{cut.expected}' but it is '{kind}'", where)
    if scene.cell_dimension == scene.dimension:
        steps = _NEAR * size * np.vstack([np.eye(mesh.space), -np.eye(mesh.space)])
        if fault := misplaced_point(scene, size, lambda at: bool(holds(mesh, at + steps).any())):
            raise InputError(fault, where)


def _parts(mesh: SimplexMesh, scene: Scene, i: int) -> bool:
    """Whether a cut whose rim is outside the body goes through a cell of it."""
    try:
        return len(cut_mesh(mesh, [cuts_of(scene, mesh.extent)[i]]).cells) > len(mesh.cells)
    except XfemError:  # it meets the mesh
        return True


def _unit(corners: Array, size: float) -> str:
    extent = float(np.abs(corners).max())
    if extent < _METRES * size:
        return ""
    return f"; its coordinates reach {extent:.3g}, the body {size:.3g} m: expected both in metres"


def _rim(cut: Any) -> tuple[Array, Array, bool]:
    """Lines (r, 2, d) or ends (k, 1, d) at which a cut ends, its points, and whether it has none.

    The ends of a cut in the plane are points, its rim in space is made of lines.
    """
    if cut.dimension == 3:
        surface = cut.facets()
        rim = rim_edges(surface)
        return rim, surface[0], len(rim) == 0
    line = cut.vertices()
    closed = bool(np.array_equal(line[0], line[-1]))
    return line[[0, -1]][:, None], line, closed


def _sides(mesh: SimplexMesh, lines: Array, low: Array, high: Array, size: float) -> Any:
    """Whether some points of the rim are inside the body, and whether some are not."""
    if lines.shape[1] == 1:
        inside = [_strictly(mesh, lines[:, 0], size)]
        return bool(np.any(inside)), not bool(np.all(inside))
    points, outer = [np.zeros((0, mesh.space))], False
    for a, b in lines:
        begin, end = _clipped(a, b, low, high)
        outer |= begin > 0.0 or end < 1.0
        if end > begin:
            share = np.linspace(begin, end, max(3, _ALONG // (1 + len(lines) // 8)))[:, None]
            points.append(a + share * (b - a))
    found = _strictly(mesh, np.concatenate(points), size)
    return bool(found.any()), outer or not bool(found.all())


def _strictly(mesh: SimplexMesh, points: Array, size: float) -> NDArray[np.bool_]:
    inside = np.ones(len(points), dtype=bool)
    for step in _NEAR * size * np.vstack([np.eye(mesh.space), -np.eye(mesh.space)]):
        inside &= holds(mesh, points + step)
    return inside


def _clipped(a: Array, b: Array, low: Array, high: Array) -> tuple[float, float]:
    """Shares of a line between which it runs inside a box; the second is less if nowhere."""
    way = np.where(b == a, 1e-300, b - a)
    with np.errstate(over="ignore"):
        one, other = (low - a) / way, (high - a) / way
    return (
        max(0.0, float(np.minimum(one, other).max())),
        min(1.0, float(np.maximum(one, other).min())),
    )
