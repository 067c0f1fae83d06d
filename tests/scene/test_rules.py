"""Rules between the parts of a scene: what breaks each of them, and its message."""

import re

import pytest
import scenes
from pydantic import ValidationError

from verify.scene.scene import RULES
from verify.scene.strict import Strict

PATH2 = {"kind": "tool_path", "points": [[0.0, 0.5], [0.5, 0.5]], "speed": 1.0}
PATH3 = {"kind": "tool_path", "points": [[0.2, 0.5, 1.0], [0.8, 0.5, 1.0]], "speed": 1.0,
         "direction": [0.0, 0.0, -1.0], "depth": 0.5}  # fmt: skip
LINE = {"kind": "polyline", "points": [[0.2, 0.5], [0.8, 0.5]]}
ARC = {"kind": "arc", "centre": [0.5, 0.5], "radius": 0.2}
DISC = {"kind": "disc", "centre": [0.5, 0.5, 0.5], "normal": [0.0, 0.0, 1.0], "radius": 0.3}
ELLIPSE = {"kind": "disc", "centre": [0.5, 0.5, 0.5], "normal": [0.0, 0.0, 1.0],
           "radii": [0.3, 0.2], "axis": [1.0, 0.0, 0.0]}  # fmt: skip
SQUARE = {
    "kind": "polygon",
    "points": [[0.2, 0.2, 0.5], [0.8, 0.2, 0.5], [0.8, 0.8, 0.5], [0.2, 0.8, 0.5]],
}
MOVES = {"kind": "dynamic", "duration": 1.0}
TURNS = {"kinematics": "finite_rotation"}
HEAVY = {"young": 1.0, "poisson": 0.3, "plane": "strain", "density": 1.0}
HEAVY3 = {"young": 1.0, "poisson": 0.3, "density": 1.0}
MEMBRANE = {
    "geometry": {"kind": "file", "file": "a.vtu", "dimension": 3, "cells": "surface"},
    "mesh": {"pattern": "given"},
}
THIN = {"young": 1.0, "poisson": 0.3, "thickness": 0.1}
SHEET = {"d": 3, **MEMBRANE, "material": THIN}
SOFT = {"young": 1.0, "poisson": 0.3, "plane": "strain"}
UP = [0.0, 0.0, 1.0]
MOVING = {"analysis": MOVES, "material": HEAVY}
STEPS = {**MOVES, "time_step": 0.1}
STEPPED = {"cuts": [LINE], "material": HEAVY, "analysis": STEPS}
PULL = {"at": [0.5, 0.6], "radius": 0.1, "side": "positive", "force": [0.0, 1.0], "begin": 0.0,
        "duration": 1.0}  # fmt: skip


def held(**more):
    return [{"where": "boundary", "displacement": [0.0, 0.0], **more}]


def held3(**more):
    return [{"where": "boundary", "displacement": [0.0, 0.0, 0.0], **more}]


def factor(**more):
    return [{"kind": "stress_intensity", "name": "K", **more}]


def resultant(kind, **more):
    return [{"kind": kind, "name": "R", "component": "x", **more}]


def stress(**more):
    return [{"kind": "stress", "name": "s", "point": [0.5, 0.5], "radius": 0.1, "component": "xx",
             **more}]  # fmt: skip


def part(**more):
    return [{"kind": "part", "name": "m", "point": [0.5, 0.9], **more}]


# fmt: off
BROKEN = [
    ({"material": {"young": 1.0, "poisson": 0.3}}, "material.plane: a 2D scene needs plane ="),
    ({"d": 3, "material": {**SOFT}}, "material.plane: belongs to 2D scenes"),
    ({"mesh": {"cells": [[4, 4, 4]]}}, "mesh.cells: [4, 4, 4] has 3 numbers; expected 2"),
    ({"mesh": {"pattern": "given"}}, "mesh.pattern: 'given' and a geometry of kind 'file' or"),
    ({"d": 3, "geometry": {"kind": "skin", "shape": "face", "elements": 10}, "material": THIN,
     "mesh": {"pattern": "given", "refine": 1}}, "mesh.refine: belongs to a geometry of kind"),
    ({"geometry": {"kind": "polygon", "corners": [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]}, "mesh":
     {"sizes": [0.1]}}, "mesh.pattern: only rectangles and boxes have structured meshes; use"),
    ({"mesh": {"cells": [[1, 1]], "position": 3}}, "mesh.position: level 0 is one element;"),
    ({"supports": []}, "supports: a static scene needs at least one"),
    ({"supports": held(components=["x", "z"])}, "supports[0].components: z in a 2D scene"),
    ({"supports": [{"where": "boundary", "displacement": [0.0]}]},
     "supports[0].displacement: 1 values; expected 2"),
    ({"supports": held(rotation={"angle": 1.0, "centre": [0.0] * 3})},
     "supports[0].rotation.centre: expected 2 coordinates"),
    ({"d": 3, "supports": held3(rotation={"angle": 1.0, "centre": [0.0] * 3})},
     "supports[0].rotation.axis: 3D needs one"),
    ({"supports": held(rotation={"angle": 1.0, "centre": [0.0, 0.0], "axis": UP})},
     "supports[0].rotation.axis: belongs to 3D scenes"),
    ({"d": 3, "supports": held3(rotation={"angle": 1.0, "centre": [0.0] * 3, "axis": [0.0] * 3})},
     "supports[0].rotation.axis: is zero"),
    ({"cuts": [LINE], "acceptance": [{"check": "error", "metric": "contact_pressure", "at_most":
     0.1}]}, "acceptance[0].metric: contact_pressure belongs to contact.expected = 'closed'"),
    ({"contact": {"expected": "closed"}}, "contact.expected: 'closed' is of the faces of a cut;"),
    ({"contact": {"expected": "closed"}, **SHEET, "cuts": [SQUARE], "analysis": TURNS},
     "contact.expected: the cuts of a membrane have no faces that press on each other;"),
    ({"contact": {"expected": "closed"}, "cuts": [PATH2], **MOVING},
     "contact.expected: faces behind a blade on its way have no contact; expected 'none' or"),
    ({"loads": [{"kind": "cut_faces", "cut": "cat", "pressure": 1.0}], "cuts": [LINE]},
     "loads[0].cut: no cut 'cat'; did you mean 'cut'?"),
    ({**SHEET, "cuts": [SQUARE], "loads": [{"kind": "cut_faces", "pressure": 1.0}]},
     "loads[0]: the cuts of a membrane have no faces that a load acts on"),
    ({"cuts": [PATH2], **MOVING, "loads": [{"kind": "cut_faces", "pressure": 1.0}]},
     "loads[0].cut: 'cut' is opened on the way; its faces bear no load"),
    ({"cuts": [LINE], "loads": [{"kind": "cut_faces", "traction": [1.0]}]},
     "loads[0].traction: 1 values; expected 2"),
    ({"material": HEAVY, "loads": [{"kind": "gravity", "acceleration": [0.0, 0.0, -9.81]}]},
     "loads[0].acceleration: 3 values; expected 2"),
    ({"loads": [{"kind": "gravity", "acceleration": [0.0, -9.81]}]},
     "loads[0]: gravity needs material.density"),
    ({"loads": [{"kind": "body_force", "force": [1.0, 2.0, 3.0]}]},
     "loads[0].force: 3 values; expected 2"),
    ({"loads": [{"kind": "traction", "where": "top", "traction": [1.0]}]},
     "loads[0].traction: 1 values; expected 2"),
    ({"cuts": [DISC]}, "cuts[0]: a disc cut in a 2D scene"),
    ({"d": 3, **MEMBRANE}, "material.thickness: a membrane needs it"),
    ({"d": 3, **MEMBRANE, "material": {**THIN, "model": "neo_hookean"}, "analysis": TURNS},
     "material.model: a membrane is of Hooke's law; expected 'hooke'"),
    ({"material": {**HEAVY, "plane": "stress", "model": "neo_hookean"}, "analysis": TURNS},
     "material.model: plane stress is of Hooke's law; expected 'hooke', or plane = 'strain'"),
    ({"material": {**HEAVY, "model": "stable_neo_hookean"}},
     "material.model: 'stable_neo_hookean' belongs to analysis.kinematics = 'finite_rotation'"),
    ({"material": {**HEAVY, "model": "neo_hookean"}, "analysis": {**MOVES, **TURNS, "damping":
     [0.0, 1e-3]}}, "analysis.damping: damping by the stiffness is of Hooke's law; expected zero"),
    ({"material": {**SOFT, "thickness": 0.1}}, "material.thickness: belongs to membranes (cells"),
    ({**SHEET}, "analysis.kinematics: a membrane has no stiffness across itself but by its"),
    ({"analysis": MOVES}, "material.density: a dynamic analysis needs it"),
    ({"mesh": {"sizes": [1e-7]}}, "mesh.sizes[0]: about 1e+14 nodes in a body of 1 × 1 m;"),
    ({"analysis": {"kind": "dynamic", "duration": 1.0, "time_step": 1e-12}, "material": HEAVY},
     "analysis.time_step: 1e+12 steps to the end at 1 s; expected at most 1e+10"),
    ({"supports": [{"where": "lft", "displacement": [0.0, 0.0]}]},
     "supports[0].where: no part 'lft'; did you mean 'left'?"),
    ({"loads": [{"kind": "traction", "where": "x > ", "traction": [1.0, 0.0]}]},
     "loads[0].where: 'x > ' is not an inequality in x, y, z"),
    ({"material": {**HEAVY, "regions": [{"where": "x >", "young": 2.0}]}},
     "material.regions[0].where: 'x >' is not an inequality in x, y, z"),
    ({"material": {**SOFT, "regions": [{"where": "x > 0.5", "density": 2.0}]}},
     "material.regions[0].density: material.density is missing"),
    ({"material": {**HEAVY, "regions": [{"where": "x > 5", "young": 2.0}]}},
     "material.regions[0].where: no part of the body lies in 'x > 5' alone; of regions that"),
    ({"supports": [{"where": "boundary", "displacement": ["q", 0.0]}]},
     "supports[0].displacement: 'q' in 'q' is not allowed; expected a formula in x, y"),
    ({"loads": [{"kind": "body_force", "force": ["t", 0.0]}]},
     "loads[0].force: 't' in 't' is not allowed; expected a formula in x, y"),
    ({"loads": [{"kind": "traction", "where": "top", "traction": [0.0, "z"]}]},
     "loads[0].traction: 'z' in 'z' is not allowed; expected a formula in x, y"),
    ({"cuts": [LINE], "loads": [{"kind": "cut_faces", "traction": ["x +", 0.0]}]},
     "loads[0].traction: 'x +' is not a formula in x, y"),
    ({"cuts": [LINE], "loads": [{"kind": "cut_faces", "pressure": "z"}]},
     "loads[0].pressure: 'z' in 'z' is not allowed; expected a formula in x, y"),
    ({**MOVING, "initial": {"kind": "field", "displacement": ["t", 0.0]}},
     "initial.displacement: 't' in 't' is not allowed; expected a formula in x, y"),
    ({**MOVING, "initial": {"kind": "field", "velocity": ["z", 0.0]}},
     "initial.velocity: 'z' in 'z' is not allowed; expected a formula in x, y"),
    ({"supports": [{"where": "boundary", "displacement": "exact"}]},
     "supports[0]: 'exact' needs an [exact] solution"),
    ({"loads": [{"kind": "body_force", "force": "exact"}]}, "loads[0]: 'exact' needs an [exact]"),
    ({**MOVING, "initial": {"kind": "field", "displacement": "exact"}},
     "initial.displacement: 'exact' needs an [exact] solution"),
    ({**MOVING, "initial": {"kind": "field", "velocity": "exact"}},
     "initial.velocity: 'exact' needs an [exact] solution"),
    ({"reference": {"kind": "exact"}}, "reference.kind: 'exact' needs an [exact] solution"),
    ({"cuts": [LINE, LINE]}, "cuts: names must differ, got ['cut', 'cut']"),
    ({"quantities": [{"kind": "strain_energy"}, {"kind": "strain_energy"}]},
     "quantities: names must differ, got ['strain_energy', 'strain_energy']"),
    ({"quantities": [{"kind": "displacement", "name": "u", "point": [0.5, 0.5, 0.5], "component":
     "x"}]}, "quantities[0].point: expected 2 coordinates"),
    ({"quantities": [{"kind": "displacement", "name": "u", "point": [0.5, 0.5], "component":
     "z"}]}, "quantities[0].component: z in a 2D scene"),
    ({"quantities": [{"kind": "part", "name": "m", "point": [0.5, 0.5, 0.5], "of":
     "strain_energy"}]}, "quantities[0].point: expected 2 coordinates"),
    ({"quantities": part(of="inertia", component="x"), "material": HEAVY},
     "quantities[0].component: inertia in a 2D scene has z"),
    ({"quantities": part(of="mass")}, "quantities[0]: the mass of a part needs material.density"),
    ({"quantities": part(of="kinetic_energy"), "material": HEAVY},
     "quantities[0]: kinetic_energy belongs to a dynamic analysis"),
    ({"quantities": part(of="kinetic_energy", time=0.55), **MOVING},
     "quantities[0].time: 0.55 s is no output time"),
    ({"quantities": [{"kind": "opening", "name": "o", "cut": "cat", "at": 0.5}], "cuts": [LINE]},
     "quantities[0].cut: no cut 'cat'; did you mean 'cut'?"),
    ({"quantities": [{"kind": "opening", "name": "o", "point": [0.5, 0.5, 0.5]}], "cuts": [LINE]},
     "quantities[0].at: an opening in 2D is at 'at = …'"),
    ({"d": 3, "quantities": [{"kind": "opening", "name": "o", "at": 0.5}], "cuts": [DISC]},
     "quantities[0].point: an opening in 3D is at 'point = …'"),
    ({"quantities": factor(cut="cat", end="end"), "cuts": [LINE]},
     "quantities[0].cut: no cut 'cat'; did you mean 'cut'?"),
    ({"quantities": factor(mode="III", end="end", radius=0.1), "cuts": [LINE]},
     "quantities[0].mode: III belongs to 3D scenes"),
    ({"d": 3, "quantities": factor(end="end"), "cuts": [PATH3], "analysis": MOVES,
      "material": HEAVY3},
     "quantities[0].mode: III alone is measured behind the blade of a tool_path"),
    ({"quantities": resultant("section", point=[0.0] * 3, normal=[1.0] * 3)},
     "quantities[0].point: expected 2 coordinates"),
    ({"quantities": resultant("reaction", where="boundary", of="moment", centre=[0.0] * 3)},
     "quantities[0].centre: expected 2 coordinates"),
    ({"quantities": resultant("reaction", where="boundary", component="z")},
     "quantities[0].component: the force of a 2D scene has no such"),
    ({"quantities": resultant("reaction", where="left")},
     "quantities[0].where: no support holds 'left'; those of the case: boundary"),
    ({**SHEET, "analysis": {"kinematics": "corotational"}, "quantities": resultant("section",
     point=[0.0] * 3, normal=[1.0] * 3)}, "quantities[0]: a membrane has no section across its"),
    ({"analysis": {"kinematics": "corotational"}, "quantities": stress(), "material":
     scenes.soft(plane="stress")}, "quantities[0]: a Cauchy stress in plane stress needs the"),
    ({"quantities": stress(component="xz")}, "quantities[0].component: z in a 2D scene"),
    ({"d": 3, "quantities": factor(kind="energy_release_rate", end="end"), "cuts": [PATH3],
     "analysis": MOVES, "material": scenes.soft(3, density=1.0)},
     "quantities[0].cut: 'cut' is opened on the way; released_to_cut says what its blade takes"),
    ({"quantities": factor(kind="energy_release_rate"), "cuts": [LINE]},
     "quantities[0].end: a factor in 2D is at 'end = …'"),
    ({"quantities": factor(), "cuts": [LINE]}, "quantities[0].end: a factor in 2D is at 'end = …'"),
    ({"d": 3, "quantities": factor(end="end"), "cuts": [DISC]},
     "quantities[0].point: a factor in 3D is at 'point = …'"),
    ({"quantities": factor(end="end"), "cuts": [ARC]}, "quantities[0].cut: 'cut' is closed and"),
    ({"d": 3, "quantities": factor(point=[0.8, 0.5, 0.5]), "cuts": [ELLIPSE]},
     "quantities[0].cut: factors in 3D are known along the fronts of round discs and of"),
    ({"d": 3, "quantities": factor(point=[0.7, 0.5, 0.5]), "cuts": [DISC]},
     "quantities[0].point: is 0.1 m away from the front of 'cut'"),
    ({"d": 3, "quantities": factor(point=[0.9, 0.5, 0.5]), "cuts": [SQUARE]},
     "quantities[0].point: is 0.1 m away from the front of 'cut'"),
    ({"quantities": [{"kind": "maximum_displacement", "name": "energy_norm"}]},
     "quantities[0].name: 'energy_norm' names an error; take another"),
    ({"acceptance": [{"check": "error", "metric": "enrgy_norm", "at_most": 0.1}]},
     "acceptance[0].metric: no 'enrgy_norm'; did you mean 'energy_norm'?"),
    ({"acceptance": [{"check": "error", "metric": "jump_l2", "at_most": 0.1}]},
     "acceptance[0].metric: jump_l2 needs a cut"),
    ({"cuts": [LINE], "acceptance": [{"check": "ratio", "metric": "overlap_depth", "at_most":
     1.0}]}, "acceptance[0].metric: overlap_depth has no ratio; expected a check 'error' (at"),
    ({"acceptance": [{"check": "error", "metric": "energy_drift", "at_most": 0.1}]},
     "acceptance[0].metric: energy_drift belongs to a dynamic analysis"),
    ({"acceptance": [{"check": "rate", "metric": "energy_norm", "at_least": 1.0}]},
     "acceptance[0]: a rate needs at least three mesh levels"),
    ({"known_findings": [{"solver": "xfem", "check": "rate", "metric": "energy_norm", "reason":
     "so"}]}, "known_findings[0]: no check 'rate of energy_norm' is made of 'xfem'; the case"),
    ({"adequacy": {"motion": True}}, "adequacy.motion: belongs to a dynamic analysis"),
    ({"adequacy": {"material": True}}, "adequacy.material: neo-Hookean material is of solids and"),
    ({**SHEET, "analysis": {"kinematics": "corotational"}, "adequacy": {"kinematics": True}},
     "adequacy.kinematics: a membrane has no linear kinematics"),
    ({"adequacy": {"kinematics": True}, "cuts": [PATH2], **MOVING, "analysis": STEPS, "replay":
     {}}, "adequacy: a tool_path with a table [replay] is for `verify play`"),
    ({"supports": [{"where": "x > 5", "displacement": [0.0, 0.0]}]},
     "supports[0].where: no node of the boundary lies in 'x > 5'"),
    ({"quantities": [{"kind": "maximum_displacement", "time": 0.5}]},
     "quantities[0].time: belongs to a dynamic analysis"),
    ({"quantities": [{"kind": "maximum_displacement", "time": 1.5}], **MOVING},
     "quantities[0].time: 1.5 s is after the end, 1 s"),
    # a line between two output times is no motion
    *(({"quantities": [{**asked, "time": 0.55}], "cuts": [LINE], **MOVING},
       "quantities[0].time: 0.55 s is no output time")
      for asked in ({"kind": "maximum_displacement"}, {"kind": "opening", "name": "o", "at": 0.5},
                    {"kind": "displacement", "name": "u", "point": [0.1, 0.2], "component": "x"},
                    {"kind": "stress", "name": "s", "point": [0.2, 0.1], "radius": 0.05,
                     "component": "xx"})),
    ({"cuts": [{**LINE, "opens_at": 0.5}]}, "cuts[0].opens_at: belongs to a dynamic analysis"),
    ({"cuts": [{**LINE, "opens_at": 1.5}], **MOVING}, "cuts[0].opens_at: 1.5 s is after the end,"),
    ({"supports": held(history=[[0.0, 1.0]])}, "supports[0].history: belongs to a dynamic"),
    ({"loads": [{"kind": "body_force", "force": [1.0, 0.0], "history": [[0.0, 1.0]]}]},
     "loads[0].history: belongs to a dynamic analysis"),
    ({"initial": {"kind": "equilibrium"}}, "initial: belongs to a dynamic analysis"),
    ({**MOVING, "initial": {"kind": "field", "displacement": [1.0]}},
     "initial.displacement: 1 values; expected 2"),
    ({**MOVING, "initial": {"kind": "field", "velocity": [1.0]}},
     "initial.velocity: 1 values; expected 2"),
    ({**MOVING, "initial": {"kind": "moving", "spin": 1.0, "centre": [0.0] * 3}},
     "initial.centre: 3 values; expected 2"),
    ({**MOVING, "initial": {"kind": "moving", "spin": UP}}, "initial.spin: expected a number"),
    ({"d": 3, "material": HEAVY3, "analysis": MOVES, "initial": {"kind": "moving", "spin": 1.0}},
     "initial.spin: expected three numbers"),
    ({"cuts": [{**LINE, "points": [[2.0, 0.5], [3.0, 0.5]]}]},
     "cuts[0] ('cut'): lies outside the body or along its boundary; it cuts nothing"),
    ({"quantities": [{"kind": "displacement", "name": "u", "point": [1.5, 0.5], "component":
     "x"}]}, "quantities[0].point: (1.5, 0.5), which is not in the body"),
    ({"cuts": [{**PATH2, "starts_at": 0.0, "points": [[-0.5, 0.5], [0.5, 0.5]]}]},
     "cuts[0]: a tool_path takes time; it needs a dynamic analysis"),
    ({"cuts": [{**PATH2, "speed": 0.1}], **MOVING}, "cuts[0]: the tool arrives at 5 s, after the"),
    ({"replay": {}}, "replay: needs a dynamic analysis with a time_step"),
    ({**STEPPED, "replay":{"pulls": [{**PULL, "at": [0.5] * 3, "force": [0.0] * 3}]}},
     "replay.pulls[0].at: 3 coordinates in a 2D scene"),
    ({**STEPPED, "replay":{"pulls": [{**PULL, "cut": "cat"}]}},
     "replay.pulls[0].cut: no cut 'cat'; did you mean 'cut'?"),
    ({**STEPPED, "replay":{"pulls": [{**PULL, "begin": 1.0}]}},
     "replay.pulls[0].begin: 1 s is after the end of the analysis"),
    ({**MOVING, "analysis": STEPS, "replay": {"visual": 10}}, "replay.visual: a plane body or"),
    ({**MOVING, "analysis": STEPS, "replay": {"collision": 10}},
     "replay.collision: a plane body or membrane is its own surface"),
]
# fmt: on


CYLINDER = {"kind": "cylinder", "base": [0.5, 0.5, 0.2], "axis": UP, "radius": 0.3,
            "height": 0.5}  # fmt: skip
SWEPT = {"kind": "swept", "points": [[0.2, 0.3, 0.2], [0.5, 0.5, 0.2], [0.8, 0.3, 0.2]],
         "along": [0.0, 0.0, 0.5]}  # fmt: skip
TRIANGLE = {"kind": "polygon", "points": [[0.2, 0.2, 0.5], [0.8, 0.2, 0.5], [0.8, 0.8, 0.5]]}


def one_cut(cut, d=2):
    return {"d": d, "cuts": [cut]}


def without(table, *keys):
    return {key: value for key, value in table.items() if key not in keys}


# fmt: off
BROKEN_ALONE = [
    (one_cut({**PATH2, "points": [[0.0, 0.5], [0.5, 0.5, 0.5]]}),
     "points: some have 2 coordinates, others 3"),
    (one_cut({**PATH2, "times": [0.0, 1.0]}), "a tool path has either times or a speed"),
    (one_cut(without(PATH2, "speed")), "a tool path has either times or a speed"),
    (one_cut({**without(PATH2, "speed"), "times": [0.0, 1.0, 2.0]}), "3 times for 2 points"),
    (one_cut({**without(PATH2, "speed"), "times": [1.0, 0.0]}), "times: time runs backwards"),
    (one_cut({**without(PATH2, "speed"), "times": [0.0, 1.0], "starts_at": 1.0}),
     "starts_at belongs to a speed; times say when it starts"),
    (one_cut({**PATH2, "depth": 1.0}), "depth: belongs to a path in space; the points are plane"),
    (one_cut({**PATH2, "direction": UP}), "direction: belongs to a path in space; the points are"),
    (one_cut(without(PATH3, "depth"), 3), "depth: missing; in space the blade has a depth and a"),
    (one_cut(without(PATH3, "direction"), 3), "direction: missing; in space the blade has a"),
    (one_cut({**PATH3, "direction": [UP] * 3}, 3), "direction: 3 for 2 points; expected one, or"),
    (one_cut({**PATH3, "direction": [0.0] * 3}, 3), "direction: has no length"),
    (one_cut({**PATH2, "points": [[0.0, 0.5]] * 2}), "points: the tool does not move"),
    (one_cut({**PATH2, "points": [[0.0, 0.5], [0.5, 0.5], [0.2, 0.5]]}),
     "the path folds back onto itself between segments 0 and 1; begin another tool_path there"),
    (one_cut({**DISC, "normal": [0.0] * 3}, 3), "the normal of the disc is zero"),
    (one_cut(without(DISC, "radius"), 3), "a disc has either a radius or radii with an axis"),
    (one_cut({**DISC, "axis": [1.0, 0.0, 0.0]}, 3), "radii and axis go together"),
    (one_cut({**without(DISC, "radius"), "radii": [0.1, 0.2], "axis": [0.0, 0.0, 2.0]}, 3),
     "axis [0.0, 0.0, 2.0] is zero or parallel to the normal"),
    (one_cut({**CYLINDER, "axis": [0.0] * 3}, 3), "the axis of the cylinder is zero"),
    (one_cut({**CYLINDER, "towards": [0.0] * 3}, 3), "towards [0.0, 0.0, 0.0] is zero or parallel"),
    (one_cut({**CYLINDER, "sweep": 90.0}, 3),
     "a sector needs the direction of its angle 0: towards = [x, y, z]"),
    (one_cut({"kind": "sphere", "centre": [0.5] * 3, "radius": 0.2, "towards": [0.0] * 3}, 3),
     "the direction of the cap's pole is zero"),
    (one_cut({**SWEPT, "along": [0.0] * 3}, 3), "along is zero: the polyline is not swept"),
    (one_cut({**SWEPT, "along": [0.3, 0.2, 0.0]}, 3),
     "segment 0 is parallel to `along`: it sweeps no area"),
    (one_cut({**SWEPT, "points": [[0.2, 0.3, 0.2], [0.8, 0.3, 0.2], [0.4, 0.3, 0.2]]}, 3),
     "the polyline, seen along the sweep, folds back onto itself between segments 0 and 1"),
    (one_cut({**TRIANGLE, "points": [[0.2, 0.2, 0.5], [0.4, 0.4, 0.5], [0.6, 0.6, 0.5]]}, 3),
     "the polygon has no area"),
    (one_cut({**TRIANGLE, "points": [[0.2, 0.2, 0.5], [0.8, 0.2, 0.5], [0.8, 0.8, 0.5], [0.2, 0.8,
     0.6]]}, 3), "the polygon is not plane (off by 0.0497 m)"),
    (one_cut({**TRIANGLE, "points": [[0.2, 0.2, 0.5], [0.8, 0.8, 0.5], [0.8, 0.2, 0.5], [0.2, 0.8,
     0.5]]}, 3), "the polygon intersects itself (segments 0 and 2)"),
    (one_cut({"kind": "polyline", "points": [[0.2, 0.5], [0.2, 0.5]]}),
     "the polyline repeats point 0 (0.2, 0.5)"),
    ({"geometry": {"kind": "rectangle", "lower": [0.0, 0.0], "upper": [1.0, 0.0]}},
     "upper (1.0, 0.0) must exceed lower (0.0, 0.0) in both coordinates"),
    ({"geometry": {"kind": "box", "lower": [0.0] * 3, "upper": [1.0, 0.0, 1.0]}, "d": 3},
     "upper (1.0, 0.0, 1.0) must exceed lower (0.0, 0.0, 0.0) in all coordinates"),
    ({"geometry": {"kind": "polygon", "corners": [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], "names":
     ["a"]}}, "1 names for 3 edges"),
    ({"geometry": {"kind": "polygon", "corners": [[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0,
     1.0]]}}, "the polygon intersects itself (segments 0 and 2)"),
    ({"geometry": {"kind": "file", "file": "a", "cells": "surface"}},
     "cells = 'surface' is a membrane in space: dimension = 3"),
    ({"geometry": {"kind": "skin"}}, "a skin has either a shape or a file"),
    ({"geometry": {"kind": "skin", "shape": "face"}}, "elements belong to a shape, and a shape"),
    ({"geometry": {"kind": "skin", "shape": "face", "elements": 10, "layers": 2}},
     "layers belong to a skin with a thickness"),
    ({"mesh": {"pattern": "given", "sizes": [0.1]}}, "a given mesh has neither sizes nor cells"),
    ({"mesh": {"pattern": "unstructured", "sizes": [0.1], "position": 2}},
     "position: 2; only structured meshes, of rectangles and boxes, have others than 0"),
    ({"mesh": {"sizes": [0.1], "refine": 1}}, "refine belongs to a given mesh"),
    ({"mesh": {}}, "a mesh has either sizes or cells"),
    ({"mesh": {"pattern": "unstructured", "cells": [[4, 4]]}}, "cells belong to a structured"),
    ({"mesh": {"cells": [[4, 4], [4, 4]]}}, "cells must go from coarse to fine, no level twice"),
    ({"mesh": {"sizes": [0.1, 0.2]}}, "sizes must descend from coarse to fine, none of them twice"),
    ({"mesh": {"sizes": [0.1], "cells": [[4, 4]]}}, "a mesh has either sizes or cells"),
    ({"reference": {"levels": 4, "max_levels": 3}}, "max_levels 3 is below levels 4"),
    ({"supports": [{"where": "left", "displacement": "exact", "rotation": {"angle": 1.0, "centre":
     [0.0, 0.0]}}]}, "a rotation goes with a displacement of all components"),
    ({"supports": [{"where": "left", "displacement": [0.0], "components": ["x", "x"]}]},
     "components ['x', 'x'] must name each component once"),
    ({"supports": [{"where": "left", "displacement": [0.0], "components": []}]},
     "components [] must name each component once"),
    ({"supports": [{"where": "left", "displacement": [0.0], "components": ["x", "y"]}]},
     "displacement has 1 values for components ['x', 'y']; expected one per component"),
    ({"loads": [{"kind": "cut_faces"}]}, "a load on the faces of a cut has either a pressure or"),
    ({"loads": [{"kind": "cut_faces", "pressure": 1.0, "traction": [1.0, 0.0]}]},
     "a load on the faces of a cut has either a pressure or a traction"),
    ({"analysis": {"kind": "dynamic"}}, "a dynamic analysis needs a duration"),
    ({"analysis": {"duration": 1.0}}, "duration, time_step and outputs belong to a dynamic"),
    ({"analysis": {"damping": [1.0, 0.0]}}, "damping belongs to a dynamic analysis"),
    ({"analysis": {"opening": "late"}}, "opening: it belongs to a dynamic analysis"),
    ({"initial": {"kind": "moving"}}, "a moving body needs a velocity, a spin, or both"),
    ({"initial": {"kind": "moving", "velocity": [1.0, 0.0], "centre": [0.0, 0.0]}},
     "centre belongs to a spin"),
    ({"initial": {"kind": "field"}}, "an initial field needs a displacement, a velocity, or both"),
    ({"material": {**SOFT, "regions": [{"where": "x > 0.5"}]}}, "expected young, poisson or"),
    ({"quantities": resultant("reaction", where="boundary", of="moment")},
     "centre: it belongs to a moment, which needs one"),
    ({"quantities": resultant("section", point=[0.0, 0.0], normal=[0.0, 0.0])}, "normal: is zero"),
    ({"quantities": resultant("section", point=[0.0, 0.0], normal=[1.0, 0.0, 0.0])},
     "normal: 3 components at a point of 2"),
    ({"quantities": [{"kind": "part", "name": "m", "of": "inertia"}]},
     "component: the inertia of a part needs one"),
    ({"quantities": [{"kind": "part", "name": "m", "of": "mass", "component": "x"}]},
     "component: the mass of a part has none"),
    ({"quantities": [{"kind": "part", "name": "m", "of": "mass", "time": 1.0}]},
     "time: the mass of a part is that of it undeformed"),
    ({"quantities": [{"kind": "stress_intensity", "name": "K", "radius": 0.1}]},
     "a radius belongs to mode III at a blade, which needs one"),
    ({"quantities": [{"kind": "stress_intensity", "name": "K", "mode": "III"}]},
     "a radius belongs to mode III at a blade, which needs one"),
    ({"quantities": [{"kind": "stress_intensity", "name": "K", "mode": "III", "radius": 0.1}]},
     "mode III is asked for at the blade: end = 'end'"),
    ({"acceptance": [{"check": "rate", "metric": "energy_norm"}]},
     "a rate check has either at_least, or equals with within"),
    ({"acceptance": [{"check": "rate", "metric": "energy_norm", "at_least": 1.0, "within": 1.0}]},
     "equals and within go together"),
    ({"acceptance": [{"check": "rate", "metric": "energy_norm", "equals": 1.0}]},
     "equals and within go together"),
    ({"acceptance": [{"check": "ratio", "metric": "energy_norm"}]},
     "a ratio check has either at_most or within"),
    ({"acceptance": [{"check": "ratio", "metric": "energy_norm", "within": 1.0, "to": "uncut",
     "row": 1.0}]}, "a ratio check is either to a solver or to a row"),
    ({"replay": {"pulls": [without(PULL, "force")]}}, "a pull has either a displacement or a"),
    ({"replay": {"pulls": [{**PULL, "displacement": [1.0, 0.0]}]}},
     "a pull has either a displacement or a force"),
    ({"replay": {"pulls": [{**PULL, "force": [1.0, 0.0, 0.0]}]}}, "3 components pull at a point"),
]
# fmt: on
ALL = [*BROKEN, *BROKEN_ALONE]


def said(changes):
    """The message of the only fault of a scene."""
    with pytest.raises(ValidationError) as caught:
        scenes.scene(**changes)
    (fault,) = caught.value.errors()
    return fault["msg"].removeprefix("Value error, ")


@pytest.mark.parametrize("changes, begin", ALL, ids=[begin for _, begin in ALL])
def test_a_broken_rule_is_named_with_its_place(changes, begin):
    assert said(changes).startswith(begin)


def is_broken(place, text, messages):
    where = re.escape(re.sub(r"\[[\w*|]+\]", "[0]", place)) + (": " if place else "")
    whole = re.compile(where + ".*".join(map(re.escape, re.split(r"{.*?}", text))))
    return any(map(whole.match, messages))


def tables(kind=Strict):
    """Every kind of table in a scene."""
    return [kind, *(deeper for own in kind.__subclasses__() for deeper in tables(own))]


def test_every_rule_is_broken_by_one_of_these():
    """A rule that nothing breaks says nothing, or its condition is misspelt."""
    alone = [rule for kind in tables() if kind.__module__.startswith("verify.scene.")
             for rule in kind.__dict__.get("rules", ())]  # fmt: skip
    assert len(alone) > 60
    for rules, rows in ((RULES, BROKEN), (alone, BROKEN_ALONE)):
        messages = [said(changes) for changes, _ in rows]
        assert [rule for rule in rules if not is_broken(rule[0], rule[2], messages)] == []
