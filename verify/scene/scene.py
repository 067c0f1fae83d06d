"""The scene, and the rules that take more than one of its tables.

Each rule is a row of a table: place, what breaks the rule, message. A place with brackets is a key
of the entries of a list: of all (``supports[*].where``), or of some kinds
(``loads[gravity].acceleration``, ``loads[gravity|traction]``). What breaks a rule is asked of the
scene, or of the scene and the entry. It answers with nothing where the rule holds, else with what
the braces of the message stand for.
"""

import re
from collections.abc import Iterator
from itertools import groupby
from typing import Any

import numpy as np
from pydantic import model_validator

from verify.geometry.simplices import feet
from verify.scene.acceptance import (
    METRICS,
    OF_CONTACT,
    OF_CUTS,
    OF_MOTION,
    OF_MOVING_PARTS,
    OVERLAP,
)
from verify.scene.cuts import DiscCut, PolygonCut
from verify.scene.geometry import GROUP, Box, MeshFile, Polygon, Rectangle, Skin
from verify.scene.placement import (
    empty_region,
    misplaced_cut,
    misplaced_point,
    part_without_facets,
    points_of_body,
)
from verify.scene.regions import parse_expression, parse_region
from verify.scene.strict import Rule, Rules, first_broken, nearest
from verify.scene.tables import SceneTables

_MOST = 1e10  # nodes of a mesh (25 TB in the plane), and time steps
_ON_FRONT = 1e-3  # of the radius or the edge: a point given in a few digits is on the front
_VALUES = "{} values; expected {}"
_IN_TIME = "belongs to a dynamic analysis"
_AFTER_END = "{:g} s is after the end, {:g} s"
_EXACT = "'exact' needs an [exact] solution"
_FACTOR = "quantities[stress_intensity|energy_release_rate]"
_NO_CUT = "no cut '{}'{}"


def first_fault_of_parts(scene: SceneTables) -> str | None:
    """Say in one line which parts of a scene do not fit together; None if all do."""
    for path, rows in _BY_LIST:
        for place, parts in _entries(scene, path):
            own = {"*", getattr(parts[-1], "kind", "*")}
            rules = tuple(rule for kinds, rule in rows if own.intersection(kinds.split("|")))
            if found := first_broken(rules, *parts, place=place):
                return found
    return None


def _entries(scene: SceneTables, path: str) -> Iterator[tuple[str, tuple[Any, ...]]]:
    """Give what the rules on a list are asked of, and its place; without a path the scene alone."""
    if not path:
        yield "", (scene,)
        return
    found: Any = scene
    for key in path.split("."):
        found = getattr(found, key, None)  # a table that is not given has no entries
    yield from ((f"{path}[{i}]", (scene, entry)) for i, entry in enumerate(found or []))


# ------------------------------------------------------------------- what breaks more than one rule
def _is_static(scene: SceneTables) -> bool:
    return scene.analysis.kind == "static"


def _is_membrane(scene: SceneTables) -> bool:
    return scene.cell_dimension < scene.dimension


def _unequal(given: Any, count: int) -> tuple[int, int] | None:
    """Break a rule on the number of values, unless they are of the exact solution."""
    return None if given in (None, "exact") or len(given) == count else (len(given), count)


def _unequal_cells(scene: SceneTables) -> tuple[Any, ...] | None:
    wrong = (one for one in scene.mesh.cells or [] if len(one) != scene.dimension)
    return next(((list(one), len(one), scene.dimension) for one in wrong), None)


def _no_cut(scene: SceneTables, name: str) -> tuple[str, str] | None:
    names = [cut.name for cut in scene.cuts]
    return None if name in names else (name, nearest(name, names))


def _cut(scene: SceneTables, name: str) -> Any:
    return next(cut for cut in scene.cuts if cut.name == name)


def _unknown_part(scene: SceneTables, where: str, of_boundary: bool = True) -> str | None:
    """Why a text is neither the name of a part, or of a group, nor an inequality."""
    names = (*scene.geometry.parts(), "boundary") if of_boundary else ()
    if where in names or (isinstance(scene.geometry, MeshFile) and scene.geometry.is_part(where)):
        return None
    if where.startswith(GROUP):
        return f"'{where}' is of a mesh file; the body is a {scene.geometry.kind}"
    if of_boundary and where.replace("_", "").isalnum():
        return f"no part '{where}'{nearest(where, names)}"
    return _fault_of(parse_region, where, scene.dimension)


def _unreadable(scene: SceneTables, given: Any, timed: bool = True) -> str | None:
    """Why the first formula that cannot be read is none.

    Where formulas are no finite number is found on meshes.
    """
    texts = given if isinstance(given, list) else [given]
    faults = [
        _fault_of(parse_expression, text, scene.dimension, timed and not _is_static(scene))
        for text in texts
        if isinstance(text, str) and text != "exact"
    ]
    return next(filter(None, faults), None)


def _fault_of(parse: Any, *asked: Any) -> str | None:
    try:
        parse(*asked)
    except ValueError as error:
        return str(error)
    return None


def _twice(entries: list[Any]) -> tuple[list[str]] | None:
    names = [entry.name for entry in entries]
    return (names,) if len(set(names)) < len(names) else None


# ------------------------------------------------------------------------ what breaks a single rule
def _too_many_nodes(scene: SceneTables) -> tuple[Any, ...] | None:
    """Break the rule where a mesh would have more nodes than any machine holds."""
    ends, mesh = scene.geometry.extremes(), scene.mesh
    if not len(ends):
        return None
    sides = np.ptp(ends, axis=0)
    levels = [sides / size for size in mesh.sizes or []]
    levels += [np.array(cells, dtype=float) for cells in mesh.cells or []]
    for i, counts in enumerate(levels):
        if (nodes := np.prod(counts + 1.0)) > _MOST:
            extent = " × ".join(f"{side:.3g}" for side in sides)
            return "sizes" if mesh.sizes else "cells", i, nodes, extent, _MOST
    return None


def _too_few_to_move(scene: SceneTables) -> bool:
    """Break the rule where the coarsest mesh is one element: no other mesh is nearly as fine."""
    body, mesh = scene.geometry, scene.mesh
    if not mesh.position or not isinstance(body, Rectangle | Box):
        return False
    asked = mesh.model_copy(update={"position": 0})
    return bool(asked.divisions(body, 0).max() == 1)


def _too_many_steps(scene: SceneTables) -> tuple[float, float, float] | None:
    asked = scene.analysis
    given = [step for step in (asked.time_step, scene.reference.time_step) if step]
    steps = asked.duration / min(given) if asked.duration and given else 0.0
    return (steps, asked.duration or 0.0, _MOST) if steps > _MOST else None


def _point_elsewhere(scene: SceneTables, asked: Any) -> int | None:
    given = scene.dimension if asked.point is None else len(asked.point)
    return None if given == scene.dimension else scene.dimension


def _axis_in_plane(part: Any) -> tuple[str, str] | None:
    """Break the rule for a component of a part that a plane body has not."""
    axes = ("x", "y") if part.of == "linear_momentum" else ("z",)
    return None if part.component in (None, *axes) else (part.of, " or ".join(axes))


def _not_held(scene: SceneTables, asked: Any) -> tuple[str, str] | None:
    known = dict.fromkeys(support.where for support in scene.supports)
    return None if asked.where in known else (asked.where, ", ".join(known) or "none")


def _no_output(scene: SceneTables, time: float | None) -> tuple[float] | None:
    if time is None or scene.analysis.duration is None:
        return None
    times = np.array(scene.analysis.output_times)
    return (time,) if np.abs(times - time).min() > 1e-9 * times[-1] else None


def _at_an_end(scene: SceneTables, asked: Any) -> bool:
    """Whether a factor is at an end of its cut: in the plane, or behind a blade."""
    cut = _cut(scene, asked.cut)
    return cut.dimension == 2 or cut.on_the_way


def _no_front(scene: SceneTables, asked: Any) -> bool:
    cut = _cut(scene, asked.cut)
    round_disc = isinstance(cut, DiscCut) and cut.radius is not None
    return not (_at_an_end(scene, asked) or round_disc or isinstance(cut, PolygonCut))


def _off_front(scene: SceneTables, asked: Any) -> tuple[float, str] | None:
    """Break the rule where a point is on no rim of a round disc, and on no edge of a polygon."""
    if _at_an_end(scene, asked):
        return None
    cut, point = _cut(scene, asked.cut), np.asarray(asked.point)
    if isinstance(cut, DiscCut):
        spoke, size, normal = point - np.asarray(cut.centre), cut.radius or 0.0, cut.axes()[2]
        height = float(spoke @ normal)
        off = float(np.hypot(np.linalg.norm(spoke - height * normal) - size, height))
    else:
        start, end = cut.edge_of(point)
        size = float(np.linalg.norm(end - start))
        off = float(np.linalg.norm(point - feet(point, start, end)))
    return (off, cut.name) if off > _ON_FRONT * size else None


def _unknown_metric(scene: SceneTables, name: str) -> tuple[str, str] | None:
    known = dict.fromkeys((*METRICS, *(quantity.name for quantity in scene.quantities)))
    if name in known:
        return None
    # quantities that need no name of their own
    by_kind = name in ("strain_energy", "maximum_displacement")
    return name, f"; ask for it: [[quantities]] kind = '{name}'" if by_kind else nearest(
        name, known
    )


def _not_made(scene: SceneTables, finding: Any) -> tuple[str, ...] | None:
    """Break the rule where no check of the case is the one that is known to fail."""
    if any(map(finding.concerns, scene.checks)):
        return None
    made = dict.fromkeys(f"{check.check} of {check.metric}" for check in scene.checks)
    return finding.check, finding.metric, finding.solver, ", ".join(made) or "none"


def _after_end(scene: SceneTables, time: float | None) -> tuple[float, float] | None:
    end = scene.analysis.duration
    return (time, end) if time is not None and end is not None and time > end else None


# fmt: off
RULES: Rules = (
    ("material.plane", lambda s: s.dimension == 2 and s.material.plane is None,
     "a 2D scene needs plane = 'strain' or 'stress'"),
    ("material.plane", lambda s: s.dimension == 3 and s.material.plane is not None,
     "belongs to 2D scenes"),
    ("mesh.cells", _unequal_cells, "{} has {} numbers; expected {}"),
    ("mesh.pattern",
     lambda s: isinstance(s.geometry, MeshFile | Skin) != (s.mesh.pattern == "given"),
     "'given' and a geometry of kind 'file' or 'skin' belong together"),
    ("mesh.refine", lambda s: s.mesh.refine and isinstance(s.geometry, Skin),
     "belongs to a geometry of kind 'file'; a skin brings its own mesh"),
    ("mesh.pattern", lambda s: s.mesh.pattern == "structured" and isinstance(s.geometry, Polygon),
     "only rectangles and boxes have structured meshes; use 'unstructured'"),
    ("mesh.position", _too_few_to_move,
     "level 0 is one element; positions other than 0 need two along an axis at least"),
    ("supports", lambda s: not s.supports and _is_static(s), "a static scene needs at least one"),
    ("supports[*].components", lambda s, p: any(c >= s.dimension for c in p.held(s.dimension)),
     "z in a 2D scene"),
    ("supports[*].displacement",
     lambda s, p: _unequal(p.displacement, len(p.held(s.dimension))), _VALUES),
    ("supports[*].rotation.centre", lambda s, p: p.rotation
     and len(p.rotation.centre) != s.dimension and s.dimension, "expected {} coordinates"),
    ("supports[*].rotation.axis",
     lambda s, p: p.rotation and p.rotation.axis is None and s.dimension == 3, "3D needs one"),
    ("supports[*].rotation.axis",
     lambda s, p: p.rotation and p.rotation.axis and s.dimension == 2, "belongs to 3D scenes"),
    ("supports[*].rotation.axis",
     lambda s, p: p.rotation and p.rotation.axis and not any(p.rotation.axis), "is zero"),
    ("loads[cut_faces].cut", lambda s, p: _no_cut(s, p.cut), _NO_CUT),
    ("loads[cut_faces]", lambda s, p: _is_membrane(s),
     "the cuts of a membrane have no faces that a load acts on"),
    ("loads[cut_faces].cut", lambda s, p: _cut(s, p.cut).on_the_way and p.cut,
     "'{}' is opened on the way; its faces bear no load"),
    ("loads[cut_faces].traction", lambda s, p: _unequal(p.traction, s.dimension), _VALUES),
    ("loads[gravity].acceleration", lambda s, p: _unequal(p.acceleration, s.dimension), _VALUES),
    ("loads[gravity]", lambda s, p: s.material.density is None, "gravity needs material.density"),
    ("loads[body_force].force", lambda s, p: _unequal(p.force, s.dimension), _VALUES),
    ("loads[traction].traction", lambda s, p: _unequal(p.traction, s.dimension), _VALUES),
    ("cuts[*]", lambda s, p: p.dimension != s.dimension and (p.kind, s.dimension),
     "a {} cut in a {}D scene"),
    ("contact.expected", lambda s: s.contact.closed and not s.cuts,
     "'closed' is of the faces of a cut; there is none"),
    ("contact.expected", lambda s: s.contact.closed and _is_membrane(s),
     "the cuts of a membrane have no faces that press on each other; expected 'none' or 'overlap'"),
    ("contact.expected", lambda s: s.contact.closed and any(c.on_the_way for c in s.cuts),
     "faces behind a blade on its way have no contact; expected 'none' or 'overlap'"),
    ("material.thickness", lambda s: _is_membrane(s) and s.material.thickness is None,
     "a membrane needs it"),
    ("material.thickness", lambda s: not _is_membrane(s) and s.material.thickness is not None,
     "belongs to membranes (cells = 'surface')"),
    ("material.model", lambda s: _is_membrane(s) and s.material.model != "hooke",
     "a membrane is of Hooke's law; expected 'hooke'"),
    ("material.model", lambda s: s.material.plane == "stress" and s.material.model != "hooke",
     "plane stress is of Hooke's law; expected 'hooke', or plane = 'strain'"),
    ("material.model",
     lambda s: s.analysis.kinematics == "linear" and s.material.model != "hooke"
     and s.material.model,
     "'{}' belongs to analysis.kinematics = 'finite_rotation'"),
    ("analysis.damping", lambda s: s.analysis.damping[1] > 0.0 and s.material.model != "hooke",
     "damping by the stiffness is of Hooke's law; expected zero"),
    ("analysis.kinematics", lambda s: _is_membrane(s) and s.analysis.kinematics == "linear",
     "a membrane has no stiffness across itself but by its rotation; expected 'corotational'"),
    ("material.density", lambda s: not _is_static(s) and s.material.density is None,
     "a dynamic analysis needs it"),
    ("", _too_many_nodes,
     "mesh.{}[{}]: about {:.0e} nodes in a body of {} m; expected at most {:.0e}"),
    ("analysis.time_step", _too_many_steps,
     "{:.0e} steps to the end at {:g} s; expected at most {:.0e}"),
    ("supports[*].where", lambda s, p: _unknown_part(s, p.where), "{}"),
    ("loads[traction].where", lambda s, p: _unknown_part(s, p.where), "{}"),
    ("material.regions[*].where", lambda s, p: _unknown_part(s, p.where, of_boundary=False), "{}"),
    ("material.regions[*].density",
     lambda s, p: p.density is not None and s.material.density is None,
     "material.density is missing"),
    ("", lambda s: s.material.regions and empty_region(s, points_of_body(s)), "{}"),
    ("supports[*].displacement", lambda s, p: _unreadable(s, p.displacement), "{}"),
    ("loads[body_force].force", lambda s, p: _unreadable(s, p.force), "{}"),
    ("loads[traction].traction", lambda s, p: _unreadable(s, p.traction), "{}"),
    ("loads[cut_faces].traction", lambda s, p: _unreadable(s, p.traction), "{}"),
    ("loads[cut_faces].pressure", lambda s, p: _unreadable(s, p.pressure), "{}"),
    ("initial.displacement",
     lambda s: _unreadable(s, getattr(s.initial, "displacement", None), timed=False), "{}"),
    ("initial.velocity",
     lambda s: _unreadable(s, getattr(s.initial, "velocity", None), timed=False), "{}"),
    ("supports[*]", lambda s, p: p.displacement == "exact" and s.exact is None, _EXACT),
    ("loads[*]", lambda s, p: p.exact and s.exact is None, _EXACT),
    ("initial.displacement",
     lambda s: getattr(s.initial, "displacement", None) == "exact" and s.exact is None, _EXACT),
    ("initial.velocity",
     lambda s: getattr(s.initial, "velocity", None) == "exact" and s.exact is None, _EXACT),
    ("reference.kind", lambda s: s.reference.kind == "exact" and s.exact is None, _EXACT),
    ("cuts", lambda s: _twice(s.cuts), "names must differ, got {}"),
    ("quantities", lambda s: _twice(s.quantities), "names must differ, got {}"),
    ("quantities[displacement|part|section|stress].point", _point_elsewhere,
     "expected {} coordinates"),
    ("quantities[reaction].centre", lambda s, p: p.centre and len(p.centre) != s.dimension
     and s.dimension, "expected {} coordinates"),
    ("quantities[reaction|section].component", lambda s, p: s.dimension == 2
     and (p.component == "z") != (p.of == "moment") and p.of, "the {} of a 2D scene has no such"),
    ("quantities[reaction].where", _not_held, "no support holds '{}'; those of the case: {}"),
    ("quantities[section|stress]", lambda s, p: _is_membrane(s) and p.kind,
     "a membrane has no {} across its thickness"),
    ("quantities[stress]",
     lambda s, p: s.analysis.kinematics != "linear" and s.material.plane == "stress",
     "a Cauchy stress in plane stress needs the stretch across; expected linear kinematics"),
    ("quantities[stress].component",
     lambda s, p: s.dimension == 2 and "z" in p.component, "z in a 2D scene"),
    ("quantities[displacement].component",
     lambda s, p: "xyz".index(p.component) >= s.dimension, "z in a 2D scene"),
    ("quantities[part].component", lambda s, p: s.dimension == 2 and _axis_in_plane(p),
     "{} in a 2D scene has {}"),
    ("quantities[part]",
     lambda s, p: p.of != "strain_energy" and s.material.density is None and p.of,
     "the {} of a part needs material.density"),
    ("quantities[part]", lambda s, p: p.of in OF_MOVING_PARTS and _is_static(s) and p.of,
     "{} belongs to a dynamic analysis"),
    ("quantities[opening].cut", lambda s, p: _no_cut(s, p.cut), _NO_CUT),
    ("quantities[opening].at",
     lambda s, p: s.dimension == 2 and (p.at is None or p.point is not None),
     "an opening in 2D is at 'at = …'"),
    ("quantities[opening].point",
     lambda s, p: s.dimension == 3 and (p.point is None or p.at is not None),
     "an opening in 3D is at 'point = …'"),
    (f"{_FACTOR}.cut", lambda s, p: _no_cut(s, p.cut), _NO_CUT),
    ("quantities[stress_intensity].mode",
     lambda s, p: p.mode == "III" and s.dimension == 2, "III belongs to 3D scenes"),
    ("quantities[stress_intensity].mode",
     lambda s, p: p.mode != "III" and s.dimension == 3 and _at_an_end(s, p),
     "III alone is measured behind the blade of a tool_path"),
    ("quantities[energy_release_rate].cut",
     lambda s, p: s.dimension == 3 and _at_an_end(s, p) and p.cut,
     "'{}' is opened on the way; released_to_cut says what its blade takes"),
    (f"{_FACTOR}.end", lambda s, p: _at_an_end(s, p)
     and (p.end is None or p.point is not None) and s.dimension, "a factor in {}D is at 'end = …'"),
    (f"{_FACTOR}.point", lambda s, p: not _at_an_end(s, p)
     and (p.point is None or p.end is not None), "a factor in 3D is at 'point = …'"),
    (f"{_FACTOR}.cut",
     lambda s, p: _cut(s, p.cut).kind == "arc" and _cut(s, p.cut).closed and p.cut,
     "'{}' is closed and has no end"),
    (f"{_FACTOR}.cut", _no_front,
     "factors in 3D are known along the fronts of round discs and of polygons"),
    (f"{_FACTOR}.point", _off_front, "is {:.3g} m away from the front of '{}'"),
    ("quantities[*].name", lambda s, p: p.name in METRICS and p.name,
     "'{}' names an error; take another"),
    ("acceptance[*].metric", lambda s, p: _unknown_metric(s, p.metric), "no '{}'{}"),
    ("acceptance[*].metric", lambda s, p: p.metric in OF_CUTS and not s.cuts and p.metric,
     "{} needs a cut"),
    ("acceptance[*].metric", lambda s, p: p.metric in OF_CONTACT and not s.contact.closed
     and p.metric, "{} belongs to contact.expected = 'closed'"),
    ("acceptance[*].metric", lambda s, p: p.metric == OVERLAP and p.check in ("rate", "ratio")
     and (OVERLAP, p.check), "{} has no {}; expected a check 'error' (at most, m) or 'value'"),
    ("acceptance[*].metric", lambda s, p: p.metric in OF_MOTION and _is_static(s) and p.metric,
     "{} belongs to a dynamic analysis"),
    ("acceptance[*]", lambda s, p: p.check == "rate" and s.mesh.count < 3,
     "a rate needs at least three mesh levels"),
    ("known_findings[*]", _not_made,
     "no check '{} of {}' is made of '{}'; the case makes {}"),
    ("adequacy.motion", lambda s: s.adequacy.motion and _is_static(s), _IN_TIME),
    ("adequacy.kinematics", lambda s: s.adequacy.kinematics and _is_membrane(s),
     "a membrane has no linear kinematics"),
    ("adequacy.material", lambda s: s.adequacy.material and (
        s.analysis.kinematics == "linear" or s.material.plane == "stress" or _is_membrane(s)),
     "neo-Hookean material is of solids and plane strain at finite rotation"),
    ("adequacy", lambda s: s.adequacy.models and s.played_only, "{}"),
    ("", part_without_facets, "{}"),
    ("quantities[*].time",
     lambda s, p: _is_static(s) and getattr(p, "time", None) is not None, _IN_TIME),
    ("quantities[*].time", lambda s, p: _after_end(s, getattr(p, "time", None)), _AFTER_END),
    ("quantities[*].time", lambda s, p: _no_output(s, getattr(p, "time", None)),
     "{:g} s is no output time"),
    ("cuts[*].opens_at", lambda s, p: _is_static(s) and p.opens_at, _IN_TIME),
    ("cuts[*].opens_at", lambda s, p: _after_end(s, p.opens_at), _AFTER_END),
    ("supports[*].history", lambda s, p: _is_static(s) and p.history is not None, _IN_TIME),
    ("loads[*].history",
     lambda s, p: _is_static(s) and getattr(p, "history", None) is not None, _IN_TIME),
    ("initial", lambda s: _is_static(s) and s.initial.kind != "rest", _IN_TIME),
    ("initial.displacement",
     lambda s: _unequal(getattr(s.initial, "displacement", None), s.dimension), _VALUES),
    ("initial.velocity",
     lambda s: _unequal(getattr(s.initial, "velocity", None), s.dimension), _VALUES),
    ("initial.centre",
     lambda s: _unequal(getattr(s.initial, "centre", None), s.dimension), _VALUES),
    ("initial.spin", lambda s: s.dimension == 2
     and isinstance(getattr(s.initial, "spin", None), tuple), "expected a number"),
    ("initial.spin", lambda s: s.dimension == 3
     and isinstance(getattr(s.initial, "spin", None), float), "expected three numbers"),
    ("", misplaced_cut, "{}"),
    ("", misplaced_point, "{}"),
    ("cuts[tool_path]", lambda s, p: _is_static(s),
     "a tool_path takes time; it needs a dynamic analysis"),
    ("cuts[tool_path]", lambda s, p: p.ends_at > s.analysis.duration * (1.0 + 1e-12)
     and (p.ends_at, s.analysis.duration),
     "the tool arrives at {:g} s, after the end of the analysis at {:g} s"),
    ("replay", lambda s: s.replay and (s.analysis.duration is None or s.analysis.time_step is None),
     "needs a dynamic analysis with a time_step"),
    ("replay.pulls[*].at", lambda s, p: len(p.at) != s.dimension and (len(p.at), s.dimension),
     "{} coordinates in a {}D scene"),
    ("replay.pulls[*].cut", lambda s, p: _no_cut(s, p.cut), _NO_CUT),
    ("replay.pulls[*].begin", lambda s, p: p.begin >= s.analysis.duration and (p.begin,),
     "{:g} s is after the end of the analysis"),
    ("replay.visual", lambda s: s.replay and s.replay.visual is not None and s.cell_dimension < 3,
     "a plane body or membrane is its own surface"),
    ("replay.collision",
     lambda s: s.replay and s.replay.collision is not None and s.cell_dimension < 3,
     "a plane body or membrane is its own surface"),
)
# fmt: on


def _by_list() -> list[tuple[str, list[tuple[str, Rule]]]]:
    """Join rules on the same list that follow each other: an entry is asked all of them at once."""
    rows = []
    for place, broken, text in RULES:  # later rules rest on earlier ones
        path, kind, key = re.split(r"\[|\]\.?", place) if "[" in place else ("", "*", place)
        rows.append((path, kind, (key, broken, text)))
    return [
        (path, [(kind, rule) for _, kind, rule in own])
        for path, own in groupby(rows, key=lambda row: row[0])
    ]


_BY_LIST = _by_list()


class Scene(SceneTables):
    """One case. Solver-neutral: it states the problem, never how a solver shall solve it."""

    @model_validator(mode="after")
    def _is_consistent(self) -> "Scene":
        if fault := first_fault_of_parts(self):
            raise ValueError(fault)
        if isinstance(self.geometry, MeshFile):
            for region in self.material.regions:
                region._geometry = self.geometry
        return self
