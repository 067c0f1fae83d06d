"""Stress-intensity factors and G of any solution, by the domain integrals of the reference."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.compare.motion import step_at
from verify.errors import InputError, UnsupportedSceneError
from verify.scene import (
    ArcCut,
    BodyForce,
    Box,
    CutFaces,
    Gravity,
    Material,
    MeshFile,
    PolylineCut,
    Scene,
    ToolPathCut,
    is_uniform,
)  # fmt: skip
from verify.scene.acceptance import FractureQuantity
from verify.scene.physics import factor_at, jumps
from verify.scene.tool_path import Cut
from verify.solution import Solution

Array = NDArray[np.float64]
Found = dict[Any, Any]  # modes by tip and time, stress by law and output
_SAME_TIME = 1e-9  # of the duration
_AROUND = 65  # directions, and distances, in which the material around a tip is looked at


def intensity_defect(scene: Scene, asked: FractureQuantity) -> str | None:
    """Why a factor cannot be had from any solution of a scene, or None."""
    if asked.at_blade:
        return None
    if scene.cell_dimension < scene.dimension or scene.analysis.kinematics != "linear":
        return "stress-intensity factors are measured in linear kinematics, and not in membranes"
    cut = next(cut for cut in scene.cuts if cut.name == asked.cut)
    if isinstance(cut, ToolPathCut) and asked.end == "end" and _time(scene, asked) <= cut.ends_at:
        return "a tip that advances has another field than one at rest: measured of mode III only"
    if any(isinstance(load, BodyForce) and load.force == "exact" for load in scene.loads):
        return "stress-intensity factors are not measured under the body force of an exact solution"
    if reason := _defect_in_time(scene, asked) or _defect_on_faces(scene, asked):
        return reason
    from reference.fracture import front_reach, no_tip

    if scene.dimension == 3:
        if not scene.material.is_uniform:
            return "factors along a front are measured in one material"
        if not isinstance(scene.geometry, Box):
            return "factors along a front are measured in boxes"
        if not front_reach(scene, asked) > 0.0:
            return f"the front of cut '{asked.cut}' leaves the body or meets another cut"
        return None
    if isinstance(scene.geometry, MeshFile):
        return "factors at a tip are measured in rectangles and polygons"
    assert asked.end is not None  # the scene is plane
    return no_tip(scene, asked.cut, asked.end)


def _defect_on_faces(scene: Scene, asked: FractureQuantity) -> str | None:
    """Why a factor cannot be had from a cut whose faces are loaded, or None."""
    for load in _face_loads(scene, asked):
        if not is_uniform(load.components):
            return f"the load on the faces of cut '{asked.cut}' is not uniform"
        if load.traction is not None and _asked_cut(scene, asked).plane_normal is None:
            return f"tractions are borne by the faces of cut '{asked.cut}', which is not plane"
    return None


def _face_loads(scene: Scene, asked: FractureQuantity) -> list[CutFaces]:
    return [load for load in scene.loads if isinstance(load, CutFaces) and load.cut == asked.cut]


def _defect_in_time(scene: Scene, asked: FractureQuantity) -> str | None:
    """Why a factor cannot be had at the time at which it is asked for, or None."""
    duration = scene.analysis.duration
    if duration is None:
        return None
    slack, time = _SAME_TIME * duration, _time(scene, asked)
    opens = _asked_cut(scene, asked).opens_at
    still_closed = "closed" if opens > 0.0 or time == 0.0 else ""
    if scene.analysis.damping[1]:
        return (
            "stress-intensity factors are not measured under damping by the stiffness: its stress "
            "is not in the displacement"
        )
    if still_closed and time <= opens + slack:
        return f"at {time:.6g} s cut '{asked.cut}' has not opened yet (opens_at = {opens:.6g} s)"
    forces: list[BodyForce | CutFaces] = [x for x in scene.loads if isinstance(x, BodyForce)]
    for load in [*forces, *_face_loads(scene, asked)]:
        if any(abs(time - t) <= slack for t in jumps(load.history)):
            what = load.kind.replace("_", " ")
            return f"a load ({what}) jumps at {time:.6g} s, and with it accelerations at the tip"
    return None


def solution_intensity(
    scene: Scene, solution: Solution, asked: FractureQuantity, found: Found | None = None
) -> float:
    """K_I, K_II, K_III (Pa √m) or G (J/m²) at the end of a cut or a point of a front, by the field.

    The mean over domains around the end as asked: a tip that a solver has put elsewhere shows.

    Parameters
    ----------
    scene : Scene
    solution : Solution
    asked : FractureQuantity
    found : dict, optional
        What other factors of the same solution share, and this one adds to: the modes of a tip, and
        the stress of the field.

    Raises
    ------
    UnsupportedSceneError
        If `intensity_defect` gives a reason, the mesh is too coarse for a domain around the end,
        or the solution is in motion and carries no accelerations or no field at that time.
    """
    found = {} if found is None else found
    time, column = _time(scene, asked), asked.column
    place = asked.cut, asked.end, None if asked.point is None else tuple(asked.point), time
    if place in found:
        return found[place][column]
    if reason := intensity_defect(scene, asked):
        raise UnsupportedSceneError(reason)
    moving = scene.analysis.kind == "dynamic"
    step = step_at(solution, time if moving else None)
    if moving and solution.acceleration is None:
        raise UnsupportedSceneError("the solution carries no accelerations: its inertia is unknown")
    drag = scene.analysis.damping[0]
    if drag and solution.velocity is None:
        raise UnsupportedSceneError("the solution carries no velocities: its damping is unknown")
    modes = _front_modes if scene.dimension == 3 else _tip_modes
    given = {"body_force": _body_force(scene, time), "drag": drag, "step": step}
    free = _with_free_faces(scene, solution, asked, time)
    try:
        found[place] = modes(scene, free, asked, given, found if free is solution else {})
    except InputError as problem:
        raise UnsupportedSceneError(str(problem)) from None
    return found[place][column]


def _shared_stresses(solution: Solution, material: Material, step: int, found: Found) -> Any:
    """Give the stress of a field: a pressure, if it has one, is found once for all of its tips."""
    from reference.exact.solution import hooke
    from reference.fracture import stress_of

    law = hooke(material)
    if (law, step) not in found:
        found[law, step] = stress_of(solution, law, step)
    return found[law, step]


def _tip_modes(
    scene: Scene, solution: Solution, asked: FractureQuantity, given: dict[str, Any],
    found: Found,
) -> tuple[float, ...]:  # fmt: skip
    from reference.fracture import DomainError, stress_intensity, tip_at

    assert asked.end is not None  # the scene is plane
    tip = tip_at(scene, asked.cut, asked.end)
    material = _material_around(scene, tip.point, max(tip.radii()))
    stresses = _shared_stresses(solution, material, given["step"], found)
    try:
        modes = stress_intensity(
            solution, material, tip.point, tip.direction, tip.radii(), arc=tip.arc,
            stresses=stresses, **given,
        )  # fmt: skip
    except DomainError as problem:
        raise InputError(f"{problem}: {tip.nearest}, {tip.reach:.4g} m away") from None
    return modes.mode_1, modes.mode_2, modes.release


def _front_modes(
    scene: Scene, solution: Solution, asked: FractureQuantity, given: dict[str, Any],
    shared: Found,
) -> tuple[float, ...]:  # fmt: skip
    """K_I, K_II, K_III (Pa √m) and G (J/m²) at the point of a front, from the field alone.

    Each station of the integrals gives a mean with a hat along the front; the second difference of
    three stations, over 12, makes it the value at the middle but for the fourth order of the hat's
    width. At a straight front the hats reach to its nearer end.

    Raises
    ------
    InputError
        If the mesh is too coarse for the domains.
    """
    from reference.fracture import front_at, front_intensity, station_count

    front, radii = front_at(scene, asked)
    stations, middle = station_count(front), 0 if front.closed else 1
    material = scene.material.each[0]
    stresses = _shared_stresses(solution, material, given["step"], shared)
    found = front_intensity(
        solution, material, front, radii, stations=stations, fitted=False, stresses=stresses,
        **given,
    )  # fmt: skip
    rows = np.column_stack([found.modes, found.release])
    around = rows[middle - 1] - 2.0 * rows[middle] + rows[middle + 1]
    return tuple((rows[middle] - around / 12.0).tolist())


def _with_free_faces(
    scene: Scene, solution: Solution, asked: FractureQuantity, time: float
) -> Solution:
    """Add the uniform stress that frees the loaded faces of a cut: K is that of both fields."""
    loads = _face_loads(scene, asked)
    if not loads:
        return solution
    d = scene.dimension
    stress = np.zeros((d, d))
    for load in loads:
        factor = factor_at(load.history, time)
        values = factor * load.values(np.zeros((1, d)), time)[0]
        if load.traction is None:
            stress += values[0] * np.eye(d)
        else:
            normal = _asked_cut(scene, asked).plane_normal
            assert normal is not None  # else it is a defect
            stress += np.outer(values, normal) + np.outer(normal, values)
            stress -= (values @ normal) * np.outer(normal, normal)
    from reference.exact.solution import hooke

    law = hooke(scene.material.each[0])
    trace = np.trace(stress) / (d * law.lame + 2 * law.shear)
    strain = (stress - law.lame * trace * np.eye(d)) / (2 * law.shear)
    return replace(solution, displacement=solution.displacement + solution.points @ strain)


def _asked_cut(scene: Scene, asked: FractureQuantity) -> Cut:
    """Return the cut at whose end a factor is asked for, as it is in the end."""
    return next(cut for cut in scene.final_cuts if cut.name == asked.cut)


def _material_around(scene: Scene, tip: Array, radius: float) -> Material:
    """Return the one material around a tip; the integral's fields know no interface.

    Raises
    ------
    UnsupportedSceneError
        If there are several within the radius, m.
    """
    turn = np.linspace(0.0, 2.0 * np.pi, _AROUND)
    spokes = np.column_stack([np.cos(turn), np.sin(turn)])
    rings = radius * np.linspace(0.0, 1.0, _AROUND)
    found = np.unique(
        scene.material.number_at((tip + rings[:, None, None] * spokes).reshape(-1, 2))
    )
    if len(found) > 1:
        raise UnsupportedSceneError(
            f"materials differ within {radius:.3g} m of the tip; the integral expects one"
        )
    return scene.material.each[found[0]]


def exact_intensity(scene: Scene, exact: Any, asked: FractureQuantity) -> float | None:
    """Factor (Pa √m) or G (J/m²) that an exact solution states; None if it states none.

    Of a tip at rest G = (K_I² + K_II²)/E' + K_III²/2μ (Irwin 1957).
    """
    if hasattr(exact, "intensity_at"):  # its tips differ
        cut, point = _asked_cut(scene, asked), asked.point
        if isinstance(cut, PolylineCut | ArcCut):
            point = cut.vertices()[0 if asked.end == "start" else -1]
        stated = exact.intensity_at(point)
    else:
        stated = getattr(exact, "stress_intensity", None)
    if stated is None or len(stated) <= asked.column:
        return None
    if asked.column >= 0:
        return float(stated[asked.column])
    from reference.exact.solution import hooke

    law = hooke(scene.material.each[0])
    k_1, k_2, k_3 = [*stated, 0.0][:3]
    return float((k_1**2 + k_2**2) / law.plane_modulus + k_3**2 / (2.0 * law.shear))


def _time(scene: Scene, asked: FractureQuantity) -> float:
    """Time at which a factor is asked for, s; 0 in statics."""
    return float(scene.analysis.output_times[-1] if asked.time is None else asked.time)


def _body_force(scene: Scene, time: float) -> Callable[[Array], Array] | None:
    """Force per volume (n, 2) at points (n, 2) in N/m³, if there is any."""
    weights = [load for load in scene.loads if isinstance(load, Gravity)]
    forces = [load for load in scene.loads if isinstance(load, BodyForce)]
    if not weights and not forces:
        return None

    def force(points: Array) -> Array:
        total = np.zeros_like(points)
        for weight in weights:
            density = np.nan_to_num(scene.material.at(points).density)
            total += np.multiply.outer(density, np.asarray(weight.acceleration))
        for given in forces:
            total += factor_at(given.history, time) * given.values(points, time)
        return total

    return force
