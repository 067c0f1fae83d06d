"""Deviations that a stated and measured change of the cut explains.

A cut that a solver moved, shortened or left closed near an end or a crossing changes the answer.
What it may change is known from the displacement alone, of unit bodies whose parts are held:

* **Place of the cut**: where the displacement jumps. Beside the cut as asked at most `_ASIDE`
  elements, as far as its nearest nodes are; missing or too much at most `_LENGTH` elements: each
  scene has one end or crossing, in one element, and a moved node makes that half an edge longer.
* **Energy**: let e be the field in closed form, and w its interpolant on the solver's own mesh,
  taken from one side where a node belongs to both. Where sides are joined, w strains. A Galerkin
  solution u is at least as near to e as w is, in the energy norm, so ‖u − w‖ ≤ 2 ‖w − e‖.
* **Supports** hold: a motion of a whole part costs no energy.
"""

from dataclasses import replace

import numpy as np

from verify.compare.body import body_of
from verify.compare.cut_deviation import realised_cut, welded
from verify.compare.hooke import hooke
from verify.compare.integration import cut_rules
from verify.compare.locate import SolutionField
from verify.compare.simplices import simplices
from verify.compare.strain_energy import nodal_strain_energy
from verify.conformance.measures import covered
from verify.conformance.scenes import YOUNG, Array, Field
from verify.records import CutRecord
from verify.scene import Scene
from verify.scene.parts import on_part
from verify.solution import Solution

# Of the longest edge of the elements asked for, right-angled triangles
_ASIDE, _LENGTH = 0.5, 1.5
_SAME = 1e-9  # m: places of a unit body
_SOLVED = 1e-6  # of the largest displacement: an iterative solver leaves less


def parting_record(scene: Scene, solution: Solution) -> CutRecord:
    """Measure where the displacement of a unit body jumps, beside its cuts as asked."""
    own = replace(solution, cut_facets=_parting_facets(solution))
    body, size = body_of(scene), _element(scene)
    (rule,) = cut_rules(body, size, 1)
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
        held = on_part(scene.geometry, support.where, solution.points, 1.0)
        axes = ["xyz".index(axis) for axis in support.components or "xyz"[:d]]
        if np.abs(off[held][:, axes]).max(initial=0.0) > _SOLVED * scale:
            return f"the support on '{support.where}' does not hold"
    law, k = hooke(scene.material), solution.cells.shape[1]
    apart = Solution(
        corners.reshape(-1, d), np.arange(len(corners) * k).reshape(-1, k),
        (interpolant[solution.cells] - wanted).reshape(1, -1, d), order=solution.order,
    )  # fmt: skip
    allowed = 4.0 * nodal_strain_energy(SolutionField(apart), law)
    found = nodal_strain_energy(SolutionField(solution).with_nodal(off), law)
    if not found <= allowed + YOUNG * (_SOLVED * scale) ** 2 * len(corners):
        return f"the energy of what is off is {found:.2g} J, by the place of the cut {allowed:.2g}"
    return ""


def _parting_facets(solution: Solution) -> Array:
    """Facets (f, d, d) inside a unit body at which the displacement jumps, or that one cell has."""
    d, moved = solution.dimension, solution.displacement[-1]
    cells = solution.cells[:, : d + 1]
    facets = np.concatenate([np.delete(cells, k, axis=1) for k in range(d + 1)])
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
