"""Checks that take more than one part of a scene: dimensions, names, times."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.geometry.nearest import feet
from verify.scene.acceptance import (
    METRICS,
    OF_CUTS,
    OF_MOTION,
    OVERLAP,
    PartQuantity,
    StressIntensityQuantity,
)  # fmt: skip
from verify.scene.cut_placement import check_cuts, check_points
from verify.scene.cuts import ArcCut
from verify.scene.empty_parts import check_parts_act
from verify.scene.geometry import Box, MeshFile, Polygon, Rectangle
from verify.scene.initial import InitialField, Moving
from verify.scene.material_regions import check_material_regions
from verify.scene.nearest import nearest
from verify.scene.physics import BodyForce, CutFaces, Gravity, Rotation, Traction
from verify.scene.regions import parse_expression, parse_region
from verify.scene.skin import Skin
from verify.scene.spatial_cuts import DiscCut, PolygonCut
from verify.scene.tables import SceneTables
from verify.scene.tool_path import ToolPathCut

_MOST = 1e10  # nodes of a mesh (25 TB in the plane), and time steps
_ON_FRONT = 1e-3  # of the radius or the edge: what is given in a few digits is on the front
# quantities that need no name of their own
_QUANTITIES = ("strain_energy", "maximum_displacement")


def check_placement(scene: SceneTables) -> None:
    """Raise ValueError with one clear line if the parts of `scene` do not fit together."""
    _check_dimensions(scene)
    _check_counts(scene)
    _check_regions(scene)
    check_material_regions(scene)
    _check_formulas(scene)
    _check_exact(scene)
    _check_names(scene)
    _check_acceptance(scene)
    _check_known_findings(scene)
    _check_adequacy(scene)
    check_parts_act(scene)
    _check_times(scene)
    check_cuts(scene)
    check_points(scene)


def boundary_condition_names(scene: SceneTables) -> tuple[str, ...]:
    """Names that `where` may use: the boundary parts, and ``boundary`` for all of it."""
    return (*scene.geometry.parts(), "boundary")


def _check_dimensions(scene: SceneTables) -> None:
    d = scene.dimension
    if d == 2 and scene.material.plane is None:
        raise ValueError("material.plane: a 2D scene needs plane = 'strain' or 'stress'")
    if d == 3 and scene.material.plane is not None:
        raise ValueError("material.plane: belongs to 2D scenes")
    for cells in scene.mesh.cells or []:
        if len(cells) != d:
            raise ValueError(f"mesh.cells: {list(cells)} has {len(cells)} numbers; expected {d}")
    if isinstance(scene.geometry, MeshFile | Skin) != (scene.mesh.pattern == "given"):
        raise ValueError(
            "mesh.pattern: 'given' and a geometry of kind 'file' or 'skin' belong together"
        )
    if scene.mesh.pattern == "structured" and isinstance(scene.geometry, Polygon):
        raise ValueError(
            "mesh.pattern: only rectangles and boxes have structured meshes; use 'unstructured'"
        )
    if not scene.supports and scene.analysis.kind == "static":
        raise ValueError("supports: a static scene needs at least one")
    for i, support in enumerate(scene.supports):
        if any(c >= d for c in support.held(d)):
            raise ValueError(f"supports[{i}].components: z in a 2D scene")
        if support.displacement != "exact" and len(support.displacement) != len(support.held(d)):
            raise ValueError(
                f"supports[{i}].displacement: {len(support.displacement)} values; "
                f"expected {len(support.held(d))}"
            )
        if support.rotation is not None:
            _check_rotation(support.rotation, d, f"supports[{i}].rotation")
    for i, load in enumerate(scene.loads):
        if isinstance(load, CutFaces):
            _check_faces(scene, load, f"loads[{i}]")
            continue
        vector = {"gravity": "acceleration", "body_force": "force", "traction": "traction"}
        value = getattr(load, vector[load.kind])
        if value != "exact" and len(value) != d:
            raise ValueError(f"loads[{i}].{vector[load.kind]}: {len(value)} values; expected {d}")
        if isinstance(load, Gravity) and scene.material.density is None:
            raise ValueError(f"loads[{i}]: gravity needs material.density")
    for i, cut in enumerate(scene.cuts):
        if cut.dimension != d:
            raise ValueError(f"cuts[{i}]: a {cut.kind} cut in a {d}D scene")
    membrane = scene.cell_dimension < d
    if membrane != (scene.material.thickness is not None):
        need = "a membrane needs it" if membrane else "belongs to membranes (cells = 'surface')"
        raise ValueError(f"material.thickness: {need}")
    if membrane and scene.analysis.kinematics == "linear":
        raise ValueError(
            "analysis.kinematics: a membrane has no stiffness across itself but by its rotation; "
            "expected 'corotational'"
        )
    if scene.analysis.kind == "dynamic" and scene.material.density is None:
        raise ValueError("material.density: a dynamic analysis needs it")


def _check_counts(scene: SceneTables) -> None:
    """Refuse meshes and steps of which there would be more than any machine holds."""
    body, analysis = scene.geometry, scene.analysis
    if isinstance(body, Rectangle | Polygon | Box):
        ends = [body.lower, body.upper] if isinstance(body, Box) else body.outline()
        sides = np.ptp(ends, axis=0)
        levels = [sides / size for size in scene.mesh.sizes or []]
        levels += [np.array(cells, dtype=float) for cells in scene.mesh.cells or []]
        for i, counts in enumerate(levels):
            if (nodes := np.prod(counts + 1.0)) > _MOST:
                key = "sizes" if scene.mesh.sizes else "cells"
                extent = " × ".join(f"{side:.3g}" for side in sides)
                raise ValueError(
                    f"mesh.{key}[{i}]: about {nodes:.0e} nodes in a body of {extent} m; expected "
                    f"at most {_MOST:.0e}"
                )
    if analysis.duration and analysis.time_step:
        steps = analysis.duration / analysis.time_step
        if steps > _MOST:
            raise ValueError(
                f"analysis.time_step: {steps:.0e} steps to the end at {analysis.duration:g} s; "
                f"expected at most {_MOST:.0e}"
            )


def _check_faces(scene: SceneTables, load: CutFaces, place: str) -> None:
    names = [cut.name for cut in scene.cuts]
    if load.cut not in names:
        raise ValueError(f"{place}.cut: no cut '{load.cut}'{nearest(load.cut, names)}")
    if scene.cell_dimension < scene.dimension:
        raise ValueError(f"{place}: the cuts of a membrane have no faces that a load acts on")
    if next(cut for cut in scene.cuts if cut.name == load.cut).kind == "tool_path":
        raise ValueError(f"{place}.cut: '{load.cut}' is opened on the way; its faces bear no load")
    if load.traction is not None and len(load.traction) != scene.dimension:
        given = len(load.traction)
        raise ValueError(f"{place}.traction: {given} values; expected {scene.dimension}")


def _check_rotation(rotation: Rotation, dimension: int, place: str) -> None:
    if len(rotation.centre) != dimension:
        raise ValueError(f"{place}.centre: expected {dimension} coordinates")
    if (rotation.axis is not None) != (dimension == 3):
        need = "3D needs one" if dimension == 3 else "belongs to 3D scenes"
        raise ValueError(f"{place}.axis: {need}")
    if rotation.axis is not None and not any(rotation.axis):
        raise ValueError(f"{place}.axis: is zero")


def _check_regions(scene: SceneTables) -> None:
    names = boundary_condition_names(scene)
    places = [(f"supports[{i}].where", s.where) for i, s in enumerate(scene.supports)]
    places += [
        (f"loads[{i}].where", load.where)
        for i, load in enumerate(scene.loads)
        if isinstance(load, Traction)
    ]
    for place, where in places:
        if where in names:
            continue
        if where.replace("_", "").isalnum():
            raise ValueError(f"{place}: no part '{where}'{nearest(where, names)}")
        try:
            parse_region(where, scene.dimension)
        except ValueError as error:
            raise ValueError(f"{place}: {error}") from None


def _check_formulas(scene: SceneTables) -> None:
    """Refuse formulas that cannot be read; where they are no finite number is found on meshes."""
    given = {f"supports[{i}].displacement": s.displacement for i, s in enumerate(scene.supports)}
    for i, load in enumerate(scene.loads):
        if isinstance(load, BodyForce):
            given[f"loads[{i}].force"] = load.force
        elif isinstance(load, Traction):
            given[f"loads[{i}].traction"] = load.traction
        elif isinstance(load, CutFaces):
            key = "pressure" if load.traction is None else "traction"
            given[f"loads[{i}].{key}"] = list(load.components)
    dynamic = scene.analysis.kind == "dynamic"
    for place, components in given.items():
        _check_components(components, scene.dimension, dynamic, place)
    if isinstance(scene.initial, InitialField):
        for key in ("displacement", "velocity"):
            components = getattr(scene.initial, key)
            _check_components(components or [], scene.dimension, False, f"initial.{key}")


def _check_components(components: Any, dimension: int, timed: bool, place: str) -> None:
    for text in [] if components == "exact" else components:
        if isinstance(text, str):
            try:
                parse_expression(text, dimension, timed)
            except ValueError as error:
                raise ValueError(f"{place}: {error}") from None


def _check_exact(scene: SceneTables) -> None:
    wants = [f"supports[{i}]" for i, s in enumerate(scene.supports) if s.displacement == "exact"]
    wants += [
        f"loads[{i}]"
        for i, load in enumerate(scene.loads)
        if (isinstance(load, BodyForce) and load.force == "exact")
        or (isinstance(load, Traction) and load.traction == "exact")
    ]
    if isinstance(scene.initial, InitialField):
        own = ("displacement", "velocity")
        wants += [f"initial.{key}" for key in own if getattr(scene.initial, key) == "exact"]
    if scene.reference.kind == "exact":
        wants.append("reference.kind")
    if wants and scene.exact is None:
        raise ValueError(f"{wants[0]}: 'exact' needs an [exact] solution")


def _check_tip(scene: SceneTables, asked: StressIntensityQuantity, place: str) -> None:
    cut = next(cut for cut in scene.cuts if cut.name == asked.cut)
    blade = isinstance(cut, ToolPathCut) and cut.dimension == 3
    if asked.mode == "III" and cut.dimension == 2:
        raise ValueError(f"{place}.mode: III belongs to 3D scenes")
    if blade and asked.mode != "III":
        raise ValueError(f"{place}.mode: III alone is measured behind the blade of a tool_path")
    key, other = ("end", "point") if cut.dimension == 2 or blade else ("point", "end")
    if getattr(asked, key) is None or getattr(asked, other) is not None:
        raise ValueError(f"{place}.{key}: a factor in {cut.dimension}D is at '{key} = …'")
    if isinstance(cut, ArcCut) and cut.sweep == 360.0:
        raise ValueError(f"{place}.cut: '{asked.cut}' is closed and has no end")
    if cut.dimension == 3 and not blade:
        _check_front(cut, np.asarray(asked.point), place)


def _check_front(cut: Any, point: NDArray[np.float64], place: str) -> None:
    """Refuse a point that is neither on the rim of a round disc nor on an edge of a polygon."""
    if isinstance(cut, DiscCut) and cut.radius is not None:
        spoke, size = point - np.asarray(cut.centre), cut.radius
        height = float(spoke @ cut.axes()[2])
        off = float(np.hypot(np.linalg.norm(spoke - height * cut.axes()[2]) - size, height))
    elif isinstance(cut, PolygonCut):
        start, end = cut.edge_of(point)
        size = float(np.linalg.norm(end - start))
        off = float(np.linalg.norm(point - feet(point, start, end)))
    else:
        raise ValueError(
            f"{place}.cut: factors in 3D are known along the fronts of round discs and of polygons"
        )
    if off > _ON_FRONT * size:
        raise ValueError(f"{place}.point: is {off:.3g} m away from the front of '{cut.name}'")


def _check_times(scene: SceneTables) -> None:
    """Refuse times in a static scene, and times after the end."""
    duration = scene.analysis.duration
    times: dict[str, float | None] = {
        f"quantities[{i}].time": getattr(quantity, "time", None)
        for i, quantity in enumerate(scene.quantities)
    }
    times |= {
        f"cuts[{i}].opens_at": getattr(cut, "opens_at", None) or None
        for i, cut in enumerate(scene.cuts)
    }
    for place, time in times.items():
        if time is not None and duration is None:
            raise ValueError(f"{place}: belongs to a dynamic analysis")
        if time is not None and duration is not None and time > duration:
            raise ValueError(f"{place}: {time:g} s is after the end, {duration:g} s")
    if duration is None:
        entries = {f"supports[{i}]": entry.history for i, entry in enumerate(scene.supports)}
        entries |= {
            f"loads[{i}]": getattr(load, "history", None) for i, load in enumerate(scene.loads)
        }
        for place, history in entries.items():
            if history is not None:
                raise ValueError(f"{place}.history: belongs to a dynamic analysis")
        if scene.initial.kind != "rest":
            raise ValueError("initial: belongs to a dynamic analysis")
    if isinstance(scene.initial, Moving):
        _check_motion(scene, scene.initial)
    if isinstance(scene.initial, InitialField):
        for key in ("displacement", "velocity"):
            given = getattr(scene.initial, key)
            if given not in (None, "exact") and len(given) != scene.dimension:
                raise ValueError(f"initial.{key}: {len(given)} values; expected {scene.dimension}")


def _check_motion(scene: SceneTables, motion: Moving) -> None:
    d = scene.dimension
    for key in ("velocity", "centre"):
        vector = getattr(motion, key)
        if vector is not None and len(vector) != d:
            raise ValueError(f"initial.{key}: {len(vector)} values; expected {d}")
    if motion.spin is not None and isinstance(motion.spin, tuple) != (d == 3):
        raise ValueError(f"initial.spin: expected {'a number' if d == 2 else 'three numbers'}")


def _check_names(scene: SceneTables) -> None:
    cuts = [cut.name for cut in scene.cuts]
    if len(set(cuts)) != len(cuts):
        raise ValueError(f"cuts: names must differ, got {cuts}")
    quantities = [quantity.name for quantity in scene.quantities]
    if len(set(quantities)) != len(quantities):
        raise ValueError(f"quantities: names must differ, got {quantities}")
    for i, quantity in enumerate(scene.quantities):
        if quantity.kind in ("opening", "stress_intensity") and quantity.cut not in cuts:
            raise ValueError(
                f"quantities[{i}].cut: no cut '{quantity.cut}'{nearest(quantity.cut, cuts)}"
            )
        if quantity.kind == "displacement" and len(quantity.point) != scene.dimension:
            raise ValueError(f"quantities[{i}].point: expected {scene.dimension} coordinates")
        if quantity.kind == "displacement" and "xyz".index(quantity.component) >= scene.dimension:
            raise ValueError(f"quantities[{i}].component: z in a 2D scene")
        if quantity.kind == "part":
            _check_part(scene, quantity, f"quantities[{i}]")
        if quantity.kind == "opening":
            key, other = ("at", "point") if scene.dimension == 2 else ("point", "at")
            if getattr(quantity, key) is None or getattr(quantity, other) is not None:
                raise ValueError(
                    f"quantities[{i}].{key}: an opening in {scene.dimension}D is at '{key} = …'"
                )
        if quantity.kind == "stress_intensity":
            _check_tip(scene, quantity, f"quantities[{i}]")
    for i, name in enumerate(quantities):
        if name in METRICS:
            raise ValueError(f"quantities[{i}].name: '{name}' names an error; take another")


def _check_part(scene: SceneTables, asked: PartQuantity, place: str) -> None:
    d = scene.dimension
    if asked.point is not None and len(asked.point) != d:
        raise ValueError(f"{place}.point: expected {d} coordinates")
    if d == 2 and asked.component is not None:
        axes = ("x", "y") if asked.of == "linear_momentum" else ("z",)
        if asked.component not in axes:
            expected = " or ".join(axes)
            raise ValueError(f"{place}.component: {asked.of} in a 2D scene has {expected}")
    if asked.of != "strain_energy" and scene.material.density is None:
        raise ValueError(f"{place}: the {asked.of} of a part needs material.density")
    moves = asked.of in ("linear_momentum", "angular_momentum", "kinetic_energy")
    if moves and scene.analysis.duration is None:
        raise ValueError(f"{place}: {asked.of} belongs to a dynamic analysis")
    if asked.time is not None and scene.analysis.duration is not None:
        times = np.array(scene.analysis.output_times)
        if np.abs(times - asked.time).min() > 1e-9 * times[-1]:
            raise ValueError(f"{place}.time: {asked.time:g} s is no output time")


def _check_acceptance(scene: SceneTables) -> None:
    """Refuse checks of what is not measured in this scene."""
    known = dict.fromkeys((*METRICS, *(quantity.name for quantity in scene.quantities)))
    for i, check in enumerate(scene.acceptance):
        place = f"acceptance[{i}].metric"
        if check.metric not in known:
            asked = nearest(check.metric, known)
            if check.metric in _QUANTITIES:
                asked = f"; ask for it: [[quantities]] kind = '{check.metric}'"
            raise ValueError(f"{place}: no '{check.metric}'{asked}")
        if check.metric in OF_CUTS and not scene.cuts:
            raise ValueError(f"{place}: {check.metric} needs a cut")
        if check.metric == OVERLAP and check.check in ("rate", "ratio"):
            expected = "expected a check 'error' (at most, m) or 'value'"
            raise ValueError(f"{place}: {OVERLAP} has no {check.check}; {expected}")
        if check.metric in OF_MOTION and scene.analysis.duration is None:
            raise ValueError(f"{place}: {check.metric} belongs to a dynamic analysis")
        if check.check == "rate" and scene.mesh.count < 3:
            raise ValueError(f"acceptance[{i}]: a rate needs at least three mesh levels")


def _check_adequacy(scene: SceneTables) -> None:
    """Refuse models that the scene has no other one of."""
    if scene.adequacy.motion and scene.analysis.kind == "static":
        raise ValueError("adequacy.motion: belongs to a dynamic analysis")
    if scene.adequacy.kinematics and scene.cell_dimension < scene.dimension:
        raise ValueError("adequacy.kinematics: a membrane has no linear kinematics")
    if scene.adequacy.models and scene.played_only:
        raise ValueError(f"adequacy: {scene.played_only}")


def _check_known_findings(scene: SceneTables) -> None:
    made = [f"{check.check} of {check.metric}" for check in scene.acceptance]
    for i, finding in enumerate(scene.known_findings):
        if not any(map(finding.concerns, scene.acceptance)):
            own = ", ".join(dict.fromkeys(made)) or "none"
            raise ValueError(
                f"known_findings[{i}]: no check '{finding.check} of {finding.metric}' is made of "
                f"'{finding.solver}'; the case makes {own}"
            )
