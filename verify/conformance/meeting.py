"""Scenes and checks of cuts that cross, branch, end, or cross an interface; of forces in space.

Unit bodies of a few cells whose lines no cut follows, with answers in closed form. A stated and
measured change of the cut explains a deviation. A cut that a solver moved, shortened or left closed
near an end or a crossing changes the answer. What it may change is known from the displacement
alone, of unit bodies whose parts are held:

* **Place of the cut**: where the displacement jumps. Beside the cut as asked at most `_ASIDE`
  elements, as far as its nearest nodes are; missing or too much at most `_LENGTH` elements: each
  scene has one end or crossing, in one element, and a moved node makes that half an edge longer.
* **Energy**: let e be the field in closed form, and w its interpolant on the solver's own mesh,
  taken from one side where a node belongs to both. Where sides are joined, w strains. A Galerkin
  solution u is at least as near to e as w is, in the energy norm, so ‖u − w‖ ≤ 2 ‖w − e‖.
* **Supports** hold: a motion of a whole part costs no energy.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from verify.compare.body import body_of
from verify.compare.cut_deviation import realised_cut, welded
from verify.compare.cut_rule import cut_rule_of
from verify.compare.hooke import cell_strain_energies, hooke
from verify.compare.locate import SolutionField
from verify.compare.simplices import simplices
from verify.conformance.check import EXACT, Check, Finding, Solutions, covered, is_field
from verify.conformance.scenes import (
    POISSON,
    ROLLERS,
    UPRIGHT,
    UPRIGHT_AT,
    YOUNG,
    Array,
    Field,
    held,
    in_space,
    line,
    pull,
    unit_scene,
)
from verify.conformance.trials import Trial
from verify.geometry.simplices import cell_facets
from verify.result import CutRecord
from verify.scene import Scene
from verify.scene.parts import on_part
from verify.solution import Solution

END = (0.6, 0.5)  #: where the cut of `ending_cut` ends: a node of its mesh of 5 × 4 cells
SLOPE = 0.24  #: of that cut
# two translations (m) and an infinitesimal rotation of each part
_MOTIONS = np.array([
    [0.02, -0.03, 0.1], [-0.04, 0.05, -0.06], [0.05, 0.08, 0.03], [-0.03, 0.06, 0.08],
])  # fmt: skip


def two_cuts() -> tuple[Scene, Field]:
    """Move each of three parts between two cuts, held off the cuts."""
    lower, upper = [[-0.1, 0.14], [1.1, 0.23]], [[-0.1, 0.85], [1.1, 0.77]]
    places = ["bottom", "x < 1e-9 and y > 0.3 and y < 0.7", "top"]

    def part(near: Array) -> Array:
        return np.sum([_left_of(near, *ends) for ends in (lower, upper)], axis=0)

    return _parted("two-cuts", [lower, upper], places, part, cells=[5, 8])


def crossing_cuts() -> tuple[Scene, Field]:
    """Move each quarter between two cuts that cross, held off the cuts."""
    one, two = [[-0.1, 0.326], [1.1, 0.614]], [[0.43, -0.1], [0.58, 1.1]]
    places = [
        f"y {end} and x {side}" for end in ("< 1e-9", "> 0.999999") for side in ("> 0.8", "< 0.2")
    ]

    def part(near: Array) -> Array:
        return 2 * _left_of(near, *one) + _left_of(near, *two)

    return _parted("crossing-cuts", [one, two], places, part)


def branched_cut() -> tuple[Scene, Field]:
    """Move each of three parts between a cut and a branch of it, held off the cuts."""
    stem, branch = [[-0.1, 0.326], [1.1, 0.614]], [[0.45, 0.458], [0.62, 1.1]]
    places = ["bottom", "y > 0.999999 and x > 0.8", "y > 0.999999 and x < 0.2"]

    def part(near: Array) -> Array:
        return _left_of(near, *stem) * (1 + _left_of(near, *branch))

    return _parted("branched-cut", [stem, branch], places, part)


def _left_of(points: Array, start: Sequence[float], end: Sequence[float]) -> Array:
    """1 for points (n, 2) on the left of a line, else 0."""
    (u, v), (x, y) = np.subtract(end, start), (points - np.asarray(start)).T
    return (u * y - v * x > 0.0).astype(np.int64)


def _parted(
    name: str,
    cuts: Sequence[Sequence[Sequence[float]]],
    places: Sequence[str],
    part: Callable[[Array], Array],
    cells: Sequence[int] = (5, 4),
) -> tuple[Scene, Field]:
    """Hold the parts of a cut square, each somewhere, so that each moves as a rigid body."""
    scene = unit_scene(
        name,
        mesh={"cells": [list(cells), [2 * n for n in cells]]},
        supports=[
            held(where, [f"{a} - {turn} * y", f"{b} + {turn} * x"])
            for where, (a, b, turn) in zip(places, _MOTIONS.tolist(), strict=False)
        ],
        cuts=[line(*ends, name=f"cut {k}") for k, ends in enumerate(cuts)],
    )

    def field(points: Array, near: Array) -> Array:
        a, b, turn = _MOTIONS[part(near)].T
        return np.column_stack([a - turn * points[:, 1], b + turn * points[:, 0]])

    return scene, field


def crossed_interface() -> tuple[Scene, Field]:
    """Pull two halves, cut apart lengthwise, across an interface that the cut crosses.

    Mesh lines follow the interface. ν/E is the same on both sides, so that both contract alike.
    """
    traction, interface, times = 0.05, 0.5, 4.0
    above = {"where": f"y > {interface}", "young": times * YOUNG, "poisson": times * 0.1}
    material = {"young": YOUNG, "poisson": 0.1, "plane": "stress", "regions": [above]}
    scene = unit_scene(
        "crossed-interface",
        material=material,
        cuts=[UPRIGHT],
        supports=ROLLERS,
        loads=[pull("top", 0.0, traction)],
    )

    def field(points: Array, near: Array) -> Array:
        strain = traction / YOUNG
        fixed = np.where(near[:, 0] < UPRIGHT_AT, 0.0, 1.0)
        soft = np.minimum(points[:, 1], interface)
        along = strain * (soft + (points[:, 1] - soft) / times)
        return np.column_stack([-0.1 * strain * (points[:, 0] - fixed), along])

    return scene, field


def pulled_halves_in_space() -> tuple[Scene, Field]:
    """Pull two halves of a cube along an inclined cut by a traction: each contracts for itself."""
    traction = 0.2
    corners = [[0.31, -0.1], [0.31, -0.1], [0.55, 1.1], [0.55, 1.1]]
    heights = [-0.1, 1.1, 1.1, -0.1]
    points = [[*corner, height] for corner, height in zip(corners, heights, strict=True)]
    scene = unit_scene(
        "pulled-halves-3d",
        supports=[
            *(held(f"{axis} < 1e-9", [0.0], axis) for axis in "xyz"),
            held("x > 0.999999", [0.0], "x"),
        ],
        loads=[pull("z > 0.999999", 0.0, 0.0, traction)],
        **in_space([{"kind": "polygon", "points": points}]),
    )

    def field(points: Array, near: Array) -> Array:
        strain = traction / YOUNG
        fixed = np.where(_left_of(near[:, :2], corners[0], corners[2]) == 1, 0.0, 1.0)
        contraction = -POISSON * strain
        return np.column_stack([
            contraction * (points[:, 0] - fixed), contraction * points[:, 1], strain * points[:, 2],
        ])  # fmt: skip

    return scene, field


def ending_cut() -> Scene:
    """Pull a square apart across a cut that ends at a node of its mesh."""
    mouth = [-0.1, END[1] - SLOPE * (END[0] + 0.1)]
    return unit_scene(
        "ending-cut",
        cuts=[line(mouth, END)],
        supports=[held("bottom", [0.0, 0.0]), held("top", [0.0, 0.1])],
    )


# Of the longest edge of the elements asked for, right-angled triangles
_ASIDE, _LENGTH = 0.5, 1.5
_SAME = 1e-9  # m: places of a unit body
_SOLVED = 1e-6  # of the largest displacement: an iterative solver leaves less


def parting_record(scene: Scene, solution: Solution) -> CutRecord:
    """Measure where the displacement of a unit body jumps, beside its cuts as asked."""
    own = replace(solution, cut_facets=_parting_facets(solution))
    body, size = body_of(scene), _element(scene)
    rule = cut_rule_of(body, size)
    return realised_cut(own, body, rule).record


def unexplained(scene: Scene, solution: Solution, cut: CutRecord, field: Field | None) -> str:
    """Say what the place of the cut does not explain of a deviation from a field, or "".

    Without a field the end of the cut is what deviates.
    """
    element = _element(scene)
    if (gap := covered(solution)) > _SAME:
        return f"{gap:.3g} of the body is not covered once"
    moved = {"beside it": (cut.lateral, _ASIDE), "missing": (cut.missing, _LENGTH),
             "too much": (cut.surplus, _LENGTH)}  # fmt: skip
    if max(amount for amount, _ in moved.values()) <= _SAME:
        return "the cut is where it was asked"
    for what, (amount, most) in moved.items():
        if amount > most * element:
            return f"{amount:.3g} m of the cut {what}, more than {most} elements"
    if field is not None:
        return _unexplained_field(scene, solution, field)
    return "" if max(cut.missing, cut.surplus) > _SAME else "the cut ends where it was asked"


def _unexplained_field(scene: Scene, solution: Solution, field: Field) -> str:
    """Hold a solution to its supports, and to the energy of the interpolant on its mesh."""
    corners, d = solution.points[solution.cells], solution.dimension
    near = np.repeat(corners[:, : d + 1].mean(axis=1), corners.shape[1], axis=0)
    wanted = field(corners.reshape(-1, d), near).reshape(corners.shape)
    interpolant = solution.displacement[-1].copy()
    for cell in np.argsort(simplices(solution.points, solution.cells).volume):
        interpolant[solution.cells[cell]] = wanted[cell]  # the largest cell of a node comes last
    off = solution.displacement[-1] - interpolant
    scale = float(np.abs(interpolant).max())
    for support in scene.supports:
        there = on_part(scene.geometry, support.where, solution.points, 1.0)
        axes = ["xyz".index(axis) for axis in support.components or "xyz"[:d]]
        if np.abs(off[there][:, axes]).max(initial=0.0) > _SOLVED * scale:
            return f"the support on '{support.where}' does not hold"
    law, k = hooke(scene.material), solution.cells.shape[1]
    apart = Solution(
        corners.reshape(-1, d), np.arange(len(corners) * k).reshape(-1, k),
        (interpolant[solution.cells] - wanted).reshape(1, -1, d), order=solution.order,
    )  # fmt: skip
    allowed = 4.0 * cell_strain_energies(SolutionField(apart), law).sum()
    found = cell_strain_energies(SolutionField(solution).with_nodal(off), law).sum()
    if not found <= allowed + YOUNG * (_SOLVED * scale) ** 2 * len(corners):
        return f"the energy of what is off is {found:.2g} J, by the place of the cut {allowed:.2g}"
    return ""


def _parting_facets(solution: Solution) -> Array:
    """Facets (f, d, d) inside a unit body at which the displacement jumps, or that one cell has."""
    d, moved = solution.dimension, solution.displacement[-1]
    cells = solution.cells[:, : d + 1]
    facets = cell_facets(cells)
    _, place = welded(solution.points[facets], _SAME)
    order = np.argsort(place, axis=1)
    facets, place = (np.take_along_axis(rows, order, axis=1) for rows in (facets, place))
    _, first, group, count = np.unique(
        place, axis=0, return_index=True, return_inverse=True, return_counts=True
    )
    jump = np.zeros(len(first))
    apart = np.abs(moved[facets] - moved[facets[first[group]]]).max(axis=(1, 2))
    np.maximum.at(jump, group, apart)
    places = solution.points[facets[first]]
    middle = places.mean(axis=1)
    inside = ((middle > _SAME) & (middle < 1.0 - _SAME)).all(axis=1)
    parted = (jump > _SOLVED * np.abs(moved).max()) | (count == 1)
    return np.asarray(places[inside & parted])


def _element(scene: Scene) -> float:
    """Longest edge of the coarsest mesh that a unit body asks for, m."""
    assert scene.mesh.cells is not None
    return float(np.linalg.norm(1.0 / np.array(scene.mesh.cells[0])))


_PARTED = {
    "two-cuts": (two_cuts, "the three parts between two cuts move without strain"),
    "crossing-cuts": (crossing_cuts, "the quarters between crossing cuts move without strain"),
    "branched-cut": (branched_cut, "the parts beside a branch of a cut move without strain"),
}
# Of the opening at the mouth, a quarter of an element before the end. With linear elements it is
# a quarter of that where the cut enters the last element, 0.2 m before the end; of an infinite
# plate it is (0.2/0.6)^½ of the mouth's, so 0.14. A cut half an element short is closed there.
_OPEN = 0.02
# Of the same, a quarter of an element beyond: the places on both sides are 2e-6 m apart, over which
# strains of a few times 0.1/1 m give 1e-5.
_CLOSED = 1e-4
_AWAY, _OFF = 0.05, 1e-6  # m: a quarter of an element; from the line of the cut


def parted_checks() -> list[Check]:
    """Make the checks of bodies whose parts move, each for itself."""
    made = []
    for name, (make, claim) in _PARTED.items():
        scene, field = make()
        check = is_field(name, claim, scene, field, 0.0)
        made.append(check if name == "two-cuts" else unless_stated(check, scene, field))
    return made


def interface_check() -> Check:
    """Make the check of a cut that crosses an interface of materials."""
    scene, field = crossed_interface()
    claim = "both sides of a cut across an interface are pulled"
    return unless_stated(is_field("crossed-interface", claim, scene, field), scene, field)


def end_check() -> Check:
    """Make the check of a cut that ends where the mesh has a node."""
    scene = ending_cut()
    along = np.array([1.0, SLOPE]) / np.hypot(1.0, SLOPE)
    mouth = np.array([_OFF, END[1] - SLOPE * (END[0] - _OFF)])
    places = np.array([mouth, END - _AWAY * along, END + _AWAY * along])

    def judge(solutions: Solutions) -> Finding:
        (solution,) = solutions.values()
        opened, before, beyond = _jumps(solution, places, np.array([-along[1], along[0]]))
        if not before > _OPEN * opened:
            return Finding(1.0, _CLOSED, "it is closed a quarter of an element before its end")
        note = "it is open a quarter of an element beyond its end"
        return Finding(beyond / opened, _CLOSED, note if beyond > _CLOSED * opened else "")

    claim = "a cut that ends at a node of the mesh ends there"
    return unless_stated(Check("ending-cut", claim, [Trial(scene.name, scene)], judge), scene)


def _jumps(solution: Solution, places: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Lengths (n,) of the differences across a line at places (n, 2) on it, m."""
    field = SolutionField(solution)
    above, below = (field.displacement(places + sign * _OFF * normal) for sign in (1.0, -1.0))
    return np.asarray(np.linalg.norm(above - below, axis=1))


def unless_stated(check: Check, scene: Scene, field: Field | None = None) -> Check:
    """Hold nothing against a solver that its stated regularisation and its measured cut explain.

    `field` is the one in closed form, if there is one.
    """
    judge = check.judge
    assert judge is not None

    def lenient(solutions: Solutions) -> Finding:
        found = judge(solutions)
        (solution,) = solutions.values()
        stated = ", ".join(sorted({entry.kind for entry in solution.regularisations}))
        if found.limit is None or found.observed <= found.limit or not stated:
            return found
        cut = parting_record(scene, solution)
        lacking = unexplained(scene, solution, cut, field)
        said = f"{found.note}; it states: {stated}"
        if lacking:
            return replace(found, note=f"{said}, which does not explain it: {lacking}")
        shift = {"beside": cut.lateral, "missing": cut.missing, "more": cut.surplus}
        how = ", ".join(f"{size:.2g} m {what}" for what, size in shift.items() if size > EXACT)
        return replace(found, note=f"{said}; its cut is {how}", stated=True)

    return replace(check, judge=lenient)
